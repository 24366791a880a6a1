"""Plan a motion along the path of a recorded motion, and compare the two."""

from __future__ import annotations

import os
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

from brachis.apps.bottleneck.saturation import dense_samples, limit_ratios
from brachis.apps.comparison.rows import RatioBounds, bound_ratios
from brachis.apps.plots import style
from brachis.apps.recording import import_motion, joint_path_of
from brachis.common.arguments import check_keywords, check_listener
from brachis.common.files import file_name
from brachis.common.progress import Listener
from brachis.common.summary import Summary
from brachis.errors import InputError, PathError, PlanningError
from brachis.planner import RobotOrTask, plan
from brachis.result import Result
from brachis.robot.task_map import JOINTS
from brachis.task import Source, Task
from brachis.trajectory import Recovered, Trajectory
from brachis.verify import Verification, verify_trajectory

if TYPE_CHECKING:
    from matplotlib.figure import Figure


_IMPLAUSIBLE_SPEED = 10.0
"""Ratio of planned to recorded end time above which the recorded motion is implausibly fast."""


@dataclass(frozen=True)
class Use:
    """Fraction of a limit that the recorded motion and the plan use.

    Attributes
    ----------
    limit : str
        Name of the limit.
    recorded : float
        Largest ratio to the limit that the rows of the recorded motion prove; at 1 the limit is reached. See
        `RatioBounds`.
    recorded_at : str
        Joint that has this ratio, or the tool.
    recorded_time : float
        Time of this ratio, s.
    recorded_up_to : float
        Largest ratio of the motion interpolated from the rows. The true motion between the rows is unknown.
    planned : float
        Largest ratio of the planned motion.
    planned_at : str
        Joint that has this ratio, or the tool.
    """

    limit: str
    recorded: float
    recorded_at: str
    recorded_time: float
    recorded_up_to: float
    planned: float
    planned_at: str

    @property
    def recorded_text(self) -> str:
        """Fraction of the limit that the recorded motion certainly uses, and fraction that it may use, as text."""
        proven = f"{100.0 * self.recorded:.1f} %"
        possible = f"{100.0 * self.recorded_up_to:.1f} %"
        if proven == possible:
            return proven
        return f"{proven}, between the rows up to {possible}"

    def __str__(self) -> str:
        """Return the fraction of the limit that each motion uses, and where, as text."""
        return (
            f"{self.limit}: {self.recorded_text} used by the recorded motion ({self.recorded_at}), "
            f"{100.0 * self.planned:.1f} % in the plan ({self.planned_at})"
        )


@dataclass(frozen=True, repr=False)
class Comparison(Summary):
    """A recorded motion and the motion planned to replace it.

    Attributes
    ----------
    recorded : Trajectory
        The recorded motion and the path recovered from it.
    verification : Verification
        Verification of the recorded motion, as interpolated from its rows.
    proven : tuple of RatioBounds
        For each limit, the ratios that the recorded rows alone prove.
    result : Result
        Result of the plan along the same path, within the same limits.

    Examples
    --------
    >>> import tempfile
    >>> import brachis
    >>> result = brachis.plan(brachis.examples.scara_line, redundant_joints=["j1"], effort="single", intervals=8)
    >>> with tempfile.TemporaryDirectory() as folder:
    ...     brachis.export.write(result.trajectory, f"{folder}/recorded.csv", dt=0.004)
    ...     comparison = brachis.compare(f"{folder}/recorded.csv", task=result.task)
    >>> [use.limit for use in comparison.uses], isinstance(comparison, brachis.Comparison)
    (['torque'], True)
    """

    recorded: Trajectory
    verification: Verification
    proven: tuple[RatioBounds, ...]
    result: Result

    @property
    def recovered(self) -> Recovered:
        """How the path was recovered, and what is known about the recorded motion."""
        assert self.recorded.recovered is not None
        return self.recorded.recovered

    @property
    def saved(self) -> float:
        """Fraction of the recorded time that the plan saves; negative if the plan takes longer."""
        return 1.0 - self.result.t_end / self.recorded.t_end

    @property
    def uses(self) -> tuple[Use, ...]:
        """Fraction of each limit that the two motions use."""
        proven = {bounds.limit: bounds.worst for bounds in self.proven}
        interpolated = {check.limit: check.value for check in self.verification.checks}
        uses = []
        for check in self.result.verification.checks:
            limit = check.limit
            if limit in proven and limit in interpolated:
                up_to = max(proven[limit][0], interpolated[limit])
                planned = (check.value, check.subject or "")
                uses.append(Use(limit, *proven[limit], up_to, *planned))
        return tuple(uses)

    @property
    def exceeded(self) -> tuple[Use, ...]:
        """Limits that the recorded motion certainly exceeds by more than the task's tolerance."""
        tolerance = self.recorded.task.refinement.tolerance
        return tuple(use for use in self.uses if use.recorded > 1.0 + tolerance)

    @property
    def verdict(self) -> str:
        """One line about the time that the plan saves."""
        times = f"{self.result.t_end:.4f} s instead of {self.recorded.t_end:.4f} s"
        if not self.result.verified:
            return f"no verified motion was found along the recorded path ({times})"
        word = "faster" if self.saved >= 0.0 else "slower"
        return f"{100.0 * abs(self.saved):.1f} % {word}: {times}"

    @property
    def remarks(self) -> tuple[str, ...]:
        """Remarks on the recorded motion, in addition to the times."""
        remarks = [
            f"the recorded motion exceeds the {use.limit} limit of {use.recorded_at} by "
            f"{100.0 * (use.recorded - 1.0):.2g} % at {use.recorded_time:.4f} s, as its rows prove, and "
            f"may exceed it by up to {100.0 * (use.recorded_up_to - 1.0):.2g} % between the rows"
            for use in self.exceeded
        ]
        speed = self.result.t_end / self.recorded.t_end
        if speed > _IMPLAUSIBLE_SPEED:
            remarks.append(
                f"the recorded motion is {speed:.0f} times as fast as the plan: the unit of its times may not "
                "be the stated one (--time, units)"
            )
        if self.recorded.task.spline.rest != "full":
            remarks.append(
                "the recorded motion begins or ends with an acceleration, so the plan may do so too (rest: velocity)"
            )
        return tuple(remarks)

    def summary(self) -> dict[str, object]:
        """Return the entries shown to the user."""
        return {
            "verdict": self.verdict,
            "limits used": "; ".join(map(str, self.uses)),
            "remarks": "; ".join(self.remarks) or "none",
        }

    def __str__(self) -> str:
        """Return the comparison as text."""
        uses = map(str, self.uses)
        return "\n".join([self.verdict, *self.remarks, *uses, *self.recovered.told])

    def to_dict(self) -> dict[str, Any]:
        """Return the figures as plain data for JSON, in which the recorded motion is called ``today``."""
        uses = [
            {
                key.replace("recorded", "today"): value
                for key, value in vars(use).items()
            }
            for use in self.uses
        ]
        return {
            "t_end": self.result.t_end,
            "t_end_today": self.recorded.t_end,
            "saved": self.saved,
            "verdict": self.verdict,
            "verified": self.result.verified,
            "today_within_limits": not self.exceeded,
            "remarks": list(self.remarks),
            "limits": uses,
            "recovered": self.recovered.to_dict(),
            "verification_today": self.verification.to_dict(),
            "plan": self.result.to_dict(),
        }


@check_keywords
def compare(
    recorded: str | os.PathLike[str] | Trajectory,
    robot: RobotOrTask = None,
    *,
    task: Source | None = None,
    task_space: str | Sequence[str] | None = None,
    units: Mapping[str, str | None] | None = None,
    tolerance: float | None = None,
    noise: float | Sequence[float] | None = None,
    keep_end: bool = False,
    listener: Listener | None = None,
) -> Comparison:
    """Plan along the path of a recorded motion, within the same limits and from the same posture, and compare.

    If the first plan is slower than the recorded motion, a plan with more intervals follows. If this plan is slower
    too, a new timing of the recorded joint path is computed. The fastest verified motion is used.

    Parameters
    ----------
    recorded : path or Trajectory
        CSV file, or the trajectory that `brachis.import_motion` made from it.
    robot, task, task_space, units, tolerance, noise : optional
        As in `brachis.import_motion`; only allowed for files.
    keep_end : bool, optional
        Whether the plan must end in the recorded end posture. Otherwise it may end in any posture with the tool at the
        end of the path.
    listener : callable, optional
        Function that is called with a text about each step.

    Returns
    -------
    Comparison

    Raises
    ------
    InputError
        As for `brachis.import_motion` and `brachis.plan`.
    PlanningError
        No plan was found.

    Examples
    --------
    >>> import tempfile
    >>> import brachis
    >>> result = brachis.plan(brachis.examples.scara_line, redundant_joints=["j1"], effort="single", intervals=8)
    >>> with tempfile.TemporaryDirectory() as folder:
    ...     brachis.export.write(result.trajectory, f"{folder}/recorded.csv", dt=0.004)
    ...     comparison = brachis.compare(f"{folder}/recorded.csv", task=result.task)
    >>> comparison.result.verified, comparison.saved > -1e-3
    (True, True)
    """
    check_listener(listener)
    if not isinstance(recorded, Trajectory):
        recorded = import_motion(
            file_name(recorded, "recorded"),
            robot,
            task=task,
            task_space=task_space,
            units=units,
            tolerance=tolerance,
            noise=noise,
        )
    if recorded.recovered is None:
        raise InputError(
            "this motion is not a recording",
            where="recorded",
            found="a planned motion",
            allowed="a CSV file, or a motion that brachis.import_motion returned",
        )
    results = []
    failures = []
    for path_task in tasks_of(recorded, keep_end=keep_end):
        try:
            result = plan(
                recorded.robot, path_task, listener=listener, check_advice=False
            )
        except PlanningError as error:
            failures.append(error)
            continue
        results.append(result)
        if result.verified and result.t_end <= recorded.t_end:
            break
    if not results:
        raise failures[0]
    best = max(results, key=lambda result: (result.verified, -result.t_end))
    verification = verify_trajectory(recorded)
    return Comparison(recorded, verification, bound_ratios(recorded), best)


def tasks_of(recorded: Trajectory, *, keep_end: bool) -> Iterator[Task]:
    """Yield tasks for a recorded path; each one is for the case that the previous ones gave no faster motion."""
    task = recorded.task
    if not keep_end:
        task = task.model_copy(update={"end": "free"})
    yield task
    if task.spline.intervals != "auto":
        finer = min(10_000, 3 * task.spline.intervals)
        spline = task.spline.model_copy(update={"intervals": finer})
        task = task.model_copy(update={"spline": spline})
        yield task
    if task.task_space != JOINTS:
        try:
            path = joint_path_of(recorded)
        except PathError:  # the fastest of the previous plans is used
            return
        yield task.model_copy(update={"task_space": JOINTS, "path": path})


def plot_both_motions(comparison: Comparison) -> Figure:
    """Plot path coordinate, tool speed and the largest ratio to any limit over time, for both motions.

    For the recorded motion, the line is the ratio that its rows prove. The band above it reaches up to the ratio of the
    motion interpolated from the rows.

    Parameters
    ----------
    comparison : Comparison

    Returns
    -------
    Figure
        One column wide.
    """
    figure = style.new_figure(style.COLUMN_WIDTH, 130.0)
    progress, speed, ratio = figure.subplots(3, 1, sharex=True)
    motions = (
        ("recorded", comparison.recorded, style.COLOURS[1], "--"),
        ("planned", comparison.result.trajectory, style.COLOURS[0], "-"),
    )
    for name, motion, colour, line in motions:
        look = {"color": colour, "linestyle": line, "linewidth": style.LINE_WIDTH}
        samples = dense_samples(motion)
        progress.plot(
            samples.t, samples.s, label=f"{name}: {motion.t_end:.4f} s", **look
        )
        speed.plot(samples.t, samples.tool_speed, **look)
        ratios = limit_ratios(motion)
        t = ratios.t
        largest = np.abs(ratios.values).max(axis=1, initial=0.0)
        if name == "recorded" and comparison.proven:
            t = comparison.proven[0].t
            proven = np.hstack([bounds.ratios for bounds in comparison.proven])
            known = proven.max(axis=1)
            least = np.interp(ratios.t, t, known)
            ratio.fill_between(
                ratios.t,
                least,
                np.maximum(least, largest),
                color=colour,
                alpha=0.25,
                linewidth=0.0,
                label="recorded, between rows: up to",
            )
            largest = known
        ratio.plot(t, largest, **look)
    ratio.axhline(1.0, color=style.GREY, linewidth=0.8)
    style.dress(progress, "", "$s$")
    style.dress(speed, "", "tool speed (m/s)")
    style.dress(ratio, r"$t$ (s)", "largest ratio to a limit")
    for ax in (progress, speed, ratio):
        ax.set_ylim(bottom=0.0)
    progress.set_xlim(0.0, max(comparison.recorded.t_end, comparison.result.t_end))
    style.legend_above(ratio, style.COLUMN_WIDTH - 15.0)
    style.legend_above(progress, style.COLUMN_WIDTH - 15.0)
    progress.set_title(comparison.verdict, fontsize=style.LABEL_SIZE, pad=16.0)
    return figure
