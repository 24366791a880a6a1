"""Plan the path of a motion that runs today.

Both motions over time: progress, and how much of their limits they use.
"""

from __future__ import annotations

import os
from collections.abc import Iterator, Mapping, Sequence
from typing import TYPE_CHECKING

import numpy as np

from brachis.apps.bottleneck import limit_ratios
from brachis.apps.bottleneck.saturation import dense_samples
from brachis.apps.comparison.comparison import Comparison, bound_ratios
from brachis.apps.plots import style
from brachis.apps.recording import import_motion
from brachis.common.arguments import check_callable, check_keywords, file_name
from brachis.common.progress import Listener
from brachis.errors import PathError, PlanningError
from brachis.planner import plan
from brachis.result import Result
from brachis.robot import Robot
from brachis.robot.task_map import JOINTS
from brachis.task import SplineSettings, Task
from brachis.trajectory import Trajectory
from brachis.verify import verify_trajectory

if TYPE_CHECKING:
    from matplotlib.figure import Figure

_FINER, _MOST = 3, 10_000
"""Times as many knot intervals, where a plan is slower than the motion given."""


@check_keywords
def compare(
    today: str | os.PathLike[str] | Trajectory,
    robot: str | os.PathLike[str] | Robot | Task | None = None,
    *,
    task: str | os.PathLike[str] | Mapping[str, object] | Task | None = None,
    task_space: str | Sequence[str] | None = None,
    units: Mapping[str, str] | None = None,
    tolerance: float | None = None,
    noise: float | Sequence[float] | None = None,
    keep_end: bool = False,
    listener: Listener | None = None,
) -> Comparison:
    """Plan the path of today's motion within the same limits, from the same start posture, and compare.

    Where the first plan is slower, a finer one is made; then today's own joint path is timed anew. The fastest verified
    motion counts.

    Parameters
    ----------
    today : path or Trajectory
        CSV file, or what `brachis.import_motion` made of it.
    robot, task, task_space, units, tolerance, noise : optional
        See `brachis.import_motion`; for files alone.
    keep_end : bool, optional
        Whether the plan ends in today's end posture, too, and not in any whose tool is there.
    listener : callable, optional
        Told what happens.

    Returns
    -------
    Comparison

    Raises
    ------
    InputError
        See `brachis.import_motion` and `brachis.plan`.
    PlanningError
        No plan could be made.

    Examples
    --------
    >>> import tempfile
    >>> import brachis
    >>> result = brachis.plan(brachis.examples.scara_line, redundant_joints=["j1"], effort="single", intervals=8)
    >>> with tempfile.TemporaryDirectory() as folder:
    ...     brachis.export.write(result.trajectory, f"{folder}/today.csv", dt=0.004)
    ...     found = brachis.compare(f"{folder}/today.csv", task=result.task)
    >>> found.result.verified, found.saved > -1e-3
    (True, True)
    """
    check_callable(listener, "listener")
    if not isinstance(today, Trajectory):
        today = import_motion(
            file_name(today, "today"),
            robot,
            task=task,
            task_space=task_space,
            units=units,
            tolerance=tolerance,
            noise=noise,
        )
    verification = verify_trajectory(today)
    best: Result | None = None
    failure: PlanningError | None = None
    for wanted in _tasks(today, keep_end=keep_end):
        try:
            result = plan(today.robot, wanted, listener=listener, check_advice=False)
        except PlanningError as error:
            failure = failure or error
            continue
        if best is None or (result.verified, -result.t_end) > (
            best.verified,
            -best.t_end,
        ):
            best = result
        if best.verified and best.t_end <= today.t_end:
            break
    if best is None:
        assert failure is not None
        raise failure
    return Comparison(today, verification, bound_ratios(today), best)


def _tasks(today: Trajectory, *, keep_end: bool) -> Iterator[Task]:
    """Yield tasks of today's path, each for the case that those before it gave no faster motion."""
    task = today.task
    if not keep_end:
        task = task.model_copy(update={"end": "free"})
    yield task
    spline = task.spline
    if spline.intervals != "auto":
        finer = min(_MOST, _FINER * spline.intervals)
        spline = SplineSettings.model_validate(
            {**spline.model_dump(), "intervals": finer}
        )
        task = task.model_copy(update={"spline": spline})
        yield task
    if task.task_space != JOINTS:
        try:
            along = _along_joints(today, task)
        except PathError:  # the plans before it count
            return
        yield along


def _along_joints(today: Trajectory, task: Task) -> Task:
    """Return the task of today's own joint path."""
    from brachis.apps.recording.importing import joint_path_of

    return task.model_copy(update={"task_space": JOINTS, "path": joint_path_of(today)})


def plot_today(comparison: Comparison) -> Figure:
    """Plot path coordinate, tool speed, and the largest ratio to any limit over time, of both motions.

    Of today's motion the line is what its rows prove; the band above it is what the motion that was made of them does
    between the rows.

    Parameters
    ----------
    comparison : Comparison

    Returns
    -------
    Figure
        One column wide.
    """
    figure = style.new_figure(style.COLUMN_WIDTH, 130.0)
    panels = figure.subplots(3, 1, sharex=True)
    motions = {"today": comparison.today, "planned": comparison.result.trajectory}
    for (name, motion), colour, line in zip(
        motions.items(), style.COLOURS[1::-1], ("--", "-"), strict=True
    ):
        look = {"color": colour, "linestyle": line, "linewidth": style.LINE_WIDTH}
        samples, ratios = dense_samples(motion), limit_ratios(motion)
        label = f"{name}: {motion.t_end:.4f} s"
        panels[0].plot(samples.t, samples.s, label=label, **look)
        panels[1].plot(samples.t, samples.tool_speed, **look)
        t, largest = ratios.t, np.abs(ratios.values).max(axis=1, initial=0.0)
        if motion is comparison.today and comparison.proven:
            proven = np.max(
                [each.ratios.max(axis=1) for each in comparison.proven], axis=0
            )
            least = np.interp(t, comparison.proven[0].t, proven)
            label = "today, between its rows: up to"
            panels[2].fill_between(
                t,
                least,
                np.maximum(least, largest),
                color=colour,
                alpha=0.25,
                linewidth=0.0,
                label=label,
            )
            t, largest = comparison.proven[0].t, proven
        panels[2].plot(t, largest, **look)
    panels[2].axhline(1.0, color=style.GREY, linewidth=0.8)
    for ax, ylabel in zip(
        panels, ("$s$", "tool speed (m/s)", "largest ratio to a limit"), strict=True
    ):
        style.dress(ax, r"$t$ (s)" if ax is panels[-1] else "", ylabel)
        ax.set_ylim(bottom=0.0)
    panels[0].set_xlim(0.0, max(motion.t_end for motion in motions.values()))
    style.legend_above(panels[2], style.COLUMN_WIDTH - 15.0)
    style.legend_above(panels[0], style.COLUMN_WIDTH - 15.0)
    panels[0].set_title(comparison.verdict, fontsize=style.LABEL_SIZE, pad=16.0)
    return figure
