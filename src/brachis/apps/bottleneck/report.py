"""The bottleneck report: the cost of the limits, when they are active, and the reference."""

from __future__ import annotations

import math
import os
import time
from collections.abc import Sequence
from dataclasses import dataclass
from html import escape
from typing import TYPE_CHECKING, Any

from brachis.apps.bottleneck.check import SensitivityCheck, check_sensitivities
from brachis.apps.bottleneck.optimum import plan_again
from brachis.apps.bottleneck.reference import MEANING, Reference, find_reference
from brachis.apps.bottleneck.saturation import (
    RIPPLE,
    SHORTEST_SHARE,
    THRESHOLD,
    PhaseLimits,
    Saturation,
    limit_ratios,
    limits_by_component,
    limits_by_phase,
    limits_in,
    saturations,
)
from brachis.common.progress import Listener, ignore
from brachis.common.summary import LINES
from brachis.errors import InputError
from brachis.explain import TIMINGS, Sensitivities, Sensitivity, explain_motion
from brachis.ik import Family
from brachis.limits import Limit, limits_of
from brachis.robot.custom_limits import LimitModel
from brachis.robot.joints import shown_unit
from brachis.search.given_motion import narrow_motion
from brachis.timing import TimingGap, find_timing_gap
from brachis.trajectory import (
    MotionPart,
    MotionPhase,
    Trajectory,
    motion_of,
    part_rows,
    phase_rows,
)
from brachis.trajectory.sensitivities import STATIONARY

if TYPE_CHECKING:
    from brachis.search.planned import PlannedMotion


@dataclass(frozen=True, repr=False)
class BottleneckReport:
    """Report on what slows a motion down.

    Attributes
    ----------
    t_end : float
        End time of the motion, s.
    sensitivities : Sensitivities or None
        Cost of every limit; None if unknown.
    saturations : tuple of Saturation
        When every limit is active. Limits that are active longest come first.
    phases : tuple of PhaseLimits
        For each phase, or each part of a program, the limits that are active in it.
    timing : TimingGap or None
        Comparison with the fastest timing of the motion's joint path; None if unknown.
    check : SensitivityCheck or None
        Comparison of the predictions with the results of solving again, if requested.
    reference : Reference or None
        Motion with the best end time known, if requested and found.
    reference_sought : bool
        Whether the reference was requested.

    Examples
    --------
    >>> import brachis
    >>> result = brachis.plan(brachis.examples.scara_line, redundant_joints=["j1"], effort="single", intervals=8)
    >>> print(next(line for line in str(result.bottleneck()).splitlines() if "torque" in line))
    10 % more torque at j1 (1 Nm) saves 3.4 % (87 ms)
    """

    t_end: float
    sensitivities: Sensitivities | None
    saturations: tuple[Saturation, ...]
    phases: tuple[PhaseLimits, ...]
    timing: TimingGap | None = None
    check: SensitivityCheck | None = None
    reference: Reference | None = None
    reference_sought: bool = False

    @property
    def is_of_program(self) -> bool:
        """Whether `phases` are the parts of a program."""
        return any(isinstance(limits.phase, MotionPart) for limits in self.phases)

    def __str__(self) -> str:
        """Return the report as text."""
        return self.text()

    def text(self, *, degrees: bool = False) -> str:
        """Return the report as text, with angles in degrees if requested."""
        lines = [
            "the cost of the limits is unknown: the motion was not planned, or was saved without its sensitivities"
        ]
        if self.sensitivities is not None:
            lines = _costs(self.sensitivities, self.t_end, degrees=degrees)
        if self.timing is not None:
            lines += _timing(self.timing, self.t_end)
        if self.check is not None:
            lines += _check_lines(self.check)
            costs = self.sensitivities
            if costs is not None and len(costs.limits) > len(self.check.entries):
                lines.append("process speeds are not checked")
        lines += write_active(self.saturations)
        if len(self.phases) > 1:
            descriptions = _describe([limits.phase for limits in self.phases])
            lines += [
                f"{text}; active limits: {limits}"
                for text, limits in zip(descriptions, self.phases, strict=True)
            ]
        best = self.reference
        if best is not None:
            longer = f"{100.0 * best.distance:.2f} % ({1e3 * (self.t_end - best.t_end):.1f} ms)"
            lines.append(
                f"reference {best.t_end:.4f} s ({MEANING}; {best.intervals} intervals): "
                f"the motion takes {longer} longer"
            )
        elif self.reference_sought:
            lines.append("reference: no faster motion was found")
        return "\n".join(lines)

    def __repr__(self) -> str:
        """Return as many lines of the report as fit on a screen."""
        lines = str(self).split("\n")
        return "\n".join([*lines[:LINES], "..."] if len(lines) > LINES else lines)

    def _repr_html_(self) -> str:
        """Show the report as text in a notebook."""
        return f"<pre>{escape(str(self))}</pre>"

    def to_dict(self) -> dict[str, Any]:
        """Return the figures as plain data for JSON."""
        return {
            "t_end_s": self.t_end,
            "sensitivities": self.sensitivities and self.sensitivities.to_dict(),
            "active_from_ratio": THRESHOLD,
            "saturations": [entry.to_dict() for entry in self.saturations],
            "parts" if self.is_of_program else "phases": [
                phase.to_dict() for phase in self.phases
            ],
            "timing_gap": self.timing and self.timing.to_dict(),
            "check": self.check and self.check.to_dict(),
            "reference": self.reference and self.reference.to_dict(),
        }


def report(
    motion: PlannedMotion | Trajectory | str | os.PathLike[str],
    *,
    check: bool = False,
    reference: bool = False,
    solve: bool = True,
    families: Sequence[Family] = (),
    own_limits: Sequence[LimitModel] = (),
    listener: Listener = ignore,
) -> BottleneckReport:
    """Find out what slows a planned motion down.

    Parameters
    ----------
    motion : Result, Trajectory or path
        A result of `brachis.plan`, a trajectory, or the file of either. A trajectory is planned again (`plan_again`) if
        it has no saved sensitivities, or if `check` or `reference` is set.
    check : bool, optional
        Whether to solve again with every limit raised by 1 %, and compare with the multipliers' predictions.
    reference : bool, optional
        Whether to plan again with discontinuous torque allowed. The reference is the best end time known, not a proven
        bound.
    solve : bool, optional
        Whether to plan a motion without saved sensitivities again.
    families, own_limits : sequence, optional
        The ones with which the motion was planned, as passed to `brachis.plan`. Families and limits are not saved with
        the motion.
    listener : callable, optional
        Function that is called with one line of text about each step.

    Returns
    -------
    BottleneckReport

    Raises
    ------
    InputError
        The closed form of a trajectory is unknown, or families or limits are invalid.
    PlanningError
        A trajectory is not an optimum of its problem; or, with `check`, no solver could solve the problem again.

    Examples
    --------
    >>> import brachis
    >>> result = brachis.plan(brachis.examples.scara_line, redundant_joints=["j1"], effort="single", intervals=8)
    >>> report = brachis.bottleneck.report(result.trajectory)  # the same for a loaded one
    >>> [sensitivity.label.subject for sensitivity in report.sensitivities.limits][0]
    'j1'
    """
    if isinstance(motion, str | os.PathLike):
        motion = Trajectory.load(motion)
    trajectory = motion_of(motion, "motion")
    recovered = trajectory.recovered
    if recovered is None:
        trajectory = narrow_motion(trajectory)
    elif check or reference:
        raise InputError(
            "this motion was not planned, so the cost of its limits cannot be computed",
            where=recovered.source,
            hint="brachis compare plans the same path; ask for the bottlenecks of that plan",
        )
    else:
        solve = False
    is_program = bool(trajectory.components)
    if is_program and (reference or (check and isinstance(motion, Trajectory))):
        raise InputError(
            "the motion of a program cannot be planned again from itself",
            where="reference" if reference else "check",
            allowed="a single path or move" if reference else "the result of a plan",
        )
    costs = motion.sensitivities
    checked = None
    best = None
    listener("finding the limits that are active, and when")
    candidate = None
    limits: Sequence[Limit] = limits_of(trajectory.robot, trajectory.task, own_limits)
    if not isinstance(motion, Trajectory):
        candidate = motion.candidate
        limits = limits_in(candidate.refined.program)
    by_component = limits_by_component(motion, own_limits)
    began = time.perf_counter()
    ratios = limit_ratios(trajectory, limits, by_component=by_component)
    active = saturations(ratios)
    seconds = _LOOKS * (time.perf_counter() - began)
    solve = solve and costs is None and not is_program
    if candidate is None and (solve or check or reference):
        longest = trajectory.task.search.time_limit
        words = f"about {math.ceil(seconds)} s, no more than {longest:g} s"
        listener(
            f"re-planning the motion, with itself as the first guess: {words} (search.time_limit)"
        )
        candidate = plan_again(
            trajectory, listener, families=families, own_limits=own_limits
        )
        costs = explain_motion(candidate.problem, candidate.refined, candidate.optimum)
    if check and candidate and costs:
        listener("solving again with every limit raised")
        checked = check_sensitivities(candidate.optimum, costs)
    if reference and candidate:
        listener("planning again with discontinuous torque")
        best = find_reference(candidate, families=families, listener=listener)
    timing = None
    if not (recovered or is_program):
        timing = find_timing_gap(trajectory, limits)
    return BottleneckReport(
        t_end=trajectory.t_end,
        sensitivities=costs,
        saturations=active,
        phases=limits_by_phase(trajectory, active),
        timing=timing,
        check=checked,
        reference=best,
        reference_sought=reference,
    )


_LOOKS = 40
"""Time to re-plan a motion with itself as the first guess, as a multiple of the time to find its active limits: the
median of 30 motions, for which this multiple was 14 to 100.
"""
_FRACTION = 0.1
"""Fraction by which limits are raised in the sentences on their cost."""
_FRACTION_OF_RANGE = 0.01
"""Fraction of a range by which its end is moved in such sentences.

With 10 %, a weld gained only a seventh of the predicted saving.
"""
_VERBS = {
    "exact": "saves",
    "estimate": "saves about",
    "least": "saves at least about",
    "bound": "saves, along the same joint path, no more than",
}
"""Words that introduce the saving of a change of the task, by the accuracy of the saving."""
_NOTHING = 1e-5
"""Fraction of the end time t_E below which savings are not mentioned."""


def _figures(value: float) -> str:
    """Write a positive number with two significant figures, or with all digits before the point."""
    return f"{value:.{max(0, 1 - math.floor(math.log10(value)))}f}"


def _part(saved: float, t_end: float) -> str:
    """Write a time, s, as a percentage of the end time t_E and in ms."""
    return f"{_figures(100.0 * saved / t_end)} % ({_figures(1e3 * saved)} ms)"


def _costs(sensitivities: Sensitivities, t_end: float, *, degrees: bool) -> list[str]:
    """Say how much time every limit costs, beginning with the costliest."""
    lines = []
    if not sensitivities.reliable:
        lines.append(
            f"warning: the multipliers leave {100.0 * sensitivities.residual:.2g} % of the gradient of t_E unbalanced, "
            "so the motion is not an optimum, and the savings below are rough"
        )
    savings = [
        (_predict_saving(entry), f"{_more_room(entry, degrees=degrees)} saves")
        for entry in sensitivities.limits
    ]
    savings += [
        (entry.saved, f"{entry.change} {_VERBS[entry.accuracy]}")
        for entry in sensitivities.task
    ]
    savings.sort(key=lambda saving: -saving[0])
    costly = [saving for saving in savings if saving[0] > _NOTHING * t_end]
    lines += [f"{change} {_part(saved, t_end)}" for saved, change in costly]
    if not sensitivities.reliable:
        lines.append("the cost of other limits is unknown")
    elif len(costly) < len(savings):
        lines.append("no other limit costs time" if costly else "no limit costs time")
    if sensitivities.source == TIMINGS:
        how = "timings of the same joint path with limits raised"
    else:
        residual = f"{100.0 * sensitivities.residual:.2g} % of the gradient"
        how = f"multipliers ({sensitivities.source}), residual {residual}: reliable up to {100.0 * STATIONARY:g} %"
    lines.append(f"(to first order, from {how})")
    if not sensitivities.unique:
        lines.append(
            "(each saving is for raising one limit alone; lowering it by as much may cost more time)"
        )
    for boundary in sensitivities.boundaries:
        saved = boundary.derivative * boundary.margin
        if saved > _NOTHING * t_end:
            lines.append(
                f"the branch boundary of {boundary.label} costs {_figures(1e3 * saved)} ms (margin "
                f"{boundary.margin:.3g}, to first order): not a limit of the robot; other redundant joints may be "
                "faster"
            )
    return lines


def _predict_saving(entry: Sensitivity) -> float:
    """Predict the time, s, that more room at one limit saves. The time at a given speed is inverse to the speed."""
    saved = -entry.change(_fraction_of(entry))
    is_speed = bool(entry.label.cause) and entry.label.unit == "m/s"
    return saved / (1.0 + _FRACTION) if is_speed else saved


def _fraction_of(entry: Sensitivity) -> float:
    """Return the fraction by which a limit is raised in its sentence; it is smaller for the end of a range."""
    return _FRACTION if entry.side is None else _FRACTION_OF_RANGE


def _more_room(entry: Sensitivity, *, degrees: bool) -> str:
    """Say in words by how much one limit is raised."""
    label = entry.label
    end = entry.side
    unit, factor = shown_unit(label.unit, degrees=degrees)
    amount = f"{factor * _fraction_of(entry) * entry.full_scale:.3g} {unit}"
    if label.cause:
        faster = (1.0 + _FRACTION) * entry.figure
        return f"a {label.cause} of {faster:.4g} {unit} in place of {entry.figure:.4g} {unit}"
    if label.slack_text:
        return f"{amount} more {label.slack_text}"
    if end is None:
        return (
            f"{100.0 * _FRACTION:.0f} % more {label.kind} at {label.subject} ({amount})"
        )
    return f"{amount} more room at the {end} end of {label}"


def _timing(gap: TimingGap, t_end: float) -> list[str]:
    """Say what the timing costs if this is at least 1 % of the end time; ``intervals: auto`` leaves about 0.1 %."""
    saved = t_end - gap.least_time
    if saved < 0.01 * t_end or gap.left_out:
        return []
    line = (
        f"the timing costs about {_part(saved, t_end)}: the same joint path takes {gap.least_time:.4g} s "
        f"with torques that may jump; for a faster motion, {gap.advice}"
    )
    return [line]


def _check_lines(check: SensitivityCheck) -> list[str]:
    """Compare the predictions with the results of solving again, in words."""
    lines = []
    for entry in check.entries:
        if not entry.predicted:
            continue
        side = entry.sensitivity.side or ""
        what = f"{entry.sensitivity.label} {side}".rstrip()
        line = (
            f"checked, {what} +{100.0 * check.step:g} %: predicted {1e3 * entry.predicted:+.4f} ms, solved again "
            f"{1e3 * entry.re_solved:+.4f} ms, off by {100.0 * entry.deviation:.2g} %"
        )
        if entry.other_optimum:
            which = "faster" if entry.other_optimum < 0.0 else "slower"
            line += f"; from another local optimum, {1e3 * abs(entry.other_optimum):.2g} ms {which}"
        if not entry.optimal:
            line += " (solved again without reaching an optimum)"
        lines.append(line)
    larger = check.larger()
    lost = sum(not entry.optimal for entry in larger)
    if not larger:
        lines.append("checked: no change is larger than 0.1 ms")
    elif lost == len(larger):
        lines.append(
            "checked: for changes larger than 0.1 ms no solver reached an optimum"
        )
    else:
        but = f", except {lost} for which no solver reached an optimum" if lost else ""
        worst = f"{100.0 * check.worst_deviation():.2g} %"
        lines.append(
            f"checked: changes larger than 0.1 ms are predicted to within {worst}{but}"
        )
    return lines


def _describe(phases: Sequence[MotionPhase | MotionPart]) -> list[str]:
    """Describe each phase of a motion, or each part of a program, in words."""
    parts = [phase for phase in phases if isinstance(phase, MotionPart)]
    if parts:
        return [
            f"part {name} ({kind}), {time}, {share} of the time"
            for name, kind, time, share in part_rows(parts)
        ]
    rows = phase_rows([phase for phase in phases if isinstance(phase, MotionPhase)])
    return [f"phase {name}, s = {s}, {time}, {speed}" for name, s, time, speed in rows]


def write_active(entries: tuple[Saturation, ...]) -> list[str]:
    """Say which limits are active, and for how long."""
    lines = []
    for entry in entries:
        if entry.share < SHORTEST_SHARE:
            continue
        label = entry.label
        count = len(entry.active)
        times = "once" if count == 1 else f"in {count} intervals"
        reached = label.active_text or f"{label.subject} is at its {label.kind} limit"
        lines.append(f"{reached} for {100.0 * entry.share:.1f} % of the time, {times}")
    return [
        *(lines or ["nothing stays at a limit"]),
        f"(at its limit: at {100.0 * THRESHOLD:g} % of it or more, including ripple down to {100.0 * RIPPLE:g} %)",
    ]
