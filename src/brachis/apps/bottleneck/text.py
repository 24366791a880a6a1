"""The bottleneck report in plain words."""

from __future__ import annotations

import math

from brachis.apps.bottleneck.check import CheckedSensitivity, SensitivityCheck
from brachis.apps.bottleneck.reference import MEANING, KnotCost, Reference
from brachis.apps.bottleneck.saturation import RIPPLE, THRESHOLD, Saturation
from brachis.apps.bottleneck.sensitivities import (
    BranchBoundary,
    Sensitivities,
    Sensitivity,
)
from brachis.errors import write_count
from brachis.robot.joints import shown_unit

_FRACTION = 0.1
_NOTHING = 1e-5
"""Of t_E; what saves less for `_FRACTION`, and a boundary that costs less, is not worth a line."""
_KNOTS = 0.01
"""Of t_E; what the knots cost is known to 0.2 % or so, and `intervals: auto` leaves 0.1 %."""


def in_words(
    *,
    t_end: float,
    sensitivities: Sensitivities | None,
    saturations: tuple[Saturation, ...],
    knots: KnotCost | None,
    check: SensitivityCheck | None,
    reference: Reference | None,
    reference_sought: bool,
    degrees: bool,
) -> list[str]:
    """Say what a report found, a line each; see `BottleneckReport` for its parts."""
    if sensitivities is None:
        lines = ["the motion was not planned, so the cost of its limits is unknown"]
    else:
        lines = _costs(sensitivities, t_end, degrees=degrees)
    if knots is not None:
        lines += _knots(knots, t_end)
    if check is not None:
        lines += _check_lines(check)
    lines += active_in_words(saturations)
    if reference is not None:
        lines.append(_reference(reference, t_end))
    elif reference_sought:
        lines.append("reference: no faster motion was found")
    return lines


def _figures(value: float) -> str:
    """Write a positive number with two significant figures, or all before the point."""
    return f"{value:.{max(0, 1 - math.floor(math.log10(value)))}f}"


def _costs(found: Sensitivities, t_end: float, *, degrees: bool) -> list[str]:
    """Sentences on every limit that costs time, the costliest first."""
    lines = []
    if not found.reliable:
        lines.append(
            f"warning: the multipliers leave {100.0 * found.residual:.2g} % of the gradient of t_E unbalanced, so the "
            "motion is not an optimum, and the savings below are rough"
        )
    costly = [
        entry for entry in found.limits if -entry.change(_FRACTION) > _NOTHING * t_end
    ]
    lines += [_saving(entry, t_end, degrees=degrees) for entry in costly]
    if len(costly) < len(found.limits):
        lines.append("no other limit costs time" if costly else "no limit costs time")
    lines.append(
        f"(to first order, from multipliers by the {found.source}, residual {found.residual:.0e})"
    )
    lines += [
        _boundary(entry)
        for entry in found.boundaries
        if entry.derivative * entry.margin > _NOTHING * t_end
    ]
    return lines


def _saving(entry: Sensitivity, t_end: float, *, degrees: bool) -> str:
    """Say what more room at one limit saves."""
    saved = -entry.change(_FRACTION)
    label = entry.label
    end = entry.bound.side
    unit, factor = shown_unit(label.unit, degrees=degrees)
    amount = f"{factor * _FRACTION * entry.bound.full_scale:.3g} {unit}"
    if label.slack_text:
        more = f"{amount} more {label.slack_text}"
    elif end is None:
        more = (
            f"{100.0 * _FRACTION:.0f} % more {label.kind} at {label.subject} ({amount})"
        )
    else:
        more = f"{amount} more room at the {end} end of {label}"
    return (
        f"{more} saves {_figures(100.0 * saved / t_end)} % ({_figures(1e3 * saved)} ms)"
    )


def _knots(found: KnotCost, t_end: float) -> list[str]:
    """Say what the knots cost, if it is worth a line."""
    if found.saved < _KNOTS:
        return []
    saved = (
        f"{_figures(100.0 * found.saved)} % ({_figures(1e3 * found.saved * t_end)} ms)"
    )
    hint = (
        "; to come closer, set spline.intervals: auto or a larger number"
        if found.given
        else ""
    )
    again = f"with torques that may jump, the same joint path takes {found.t_end:.4g} s"
    return [
        f"the knots cost about {saved} with {write_count(found.intervals, 'interval')}: {again}{hint}"
    ]


def _boundary(entry: BranchBoundary) -> str:
    saved = _figures(1e3 * entry.derivative * entry.margin)
    return (
        f"the branch boundary of {entry.label} costs {saved} ms (margin {entry.margin:.3g}, to first order): no "
        "limit of the robot; other redundant joints may be faster"
    )


def _check_lines(check: SensitivityCheck) -> list[str]:
    """Sentences on the predictions beside solving again."""
    percent = f"{100.0 * check.step:g} %"
    lines = []
    for entry in check.entries:
        if not entry.predicted:
            continue
        what = " ".join(
            filter(None, (str(entry.sensitivity.label), entry.sensitivity.bound.side))
        )
        line = (
            f"checked, {what} +{percent}: predicted {1e3 * entry.predicted:+.4f} ms, solved again "
            f"{1e3 * entry.re_solved:+.4f} ms, off by {100.0 * entry.deviation:.2g} %"
            f"{_taken_back(entry)}"
        )
        if entry.other_optimum:
            line += f"; from another local optimum, {1e3 * abs(entry.other_optimum):.2g} ms "
            line += "faster" if entry.other_optimum < 0.0 else "slower"
        lines.append(
            line
            if entry.optimal
            else f"{line} (solved again without reaching an optimum)"
        )
    if not check.larger():
        return [*lines, "checked: no change is larger than 0.1 ms"]
    if all(not entry.optimal for entry in check.larger()):
        return [
            *lines,
            "checked: no solver brought the changes that are larger than 0.1 ms to an optimum",
        ]
    worst = f"{100.0 * check.worst_deviation():.2g} %"
    lost = sum(not entry.optimal for entry in check.larger())
    but = f", but for {lost} that no solver brought to an optimum" if lost else ""
    return [
        *lines,
        f"checked: changes larger than 0.1 ms are predicted to within {worst}{but}",
    ]


def _taken_back(entry: CheckedSensitivity) -> str:
    """Say how much of a promise other limits take back within the step, where it is worth saying."""
    if abs(entry.linearised - entry.predicted) <= 0.02 * abs(entry.predicted):
        return ""
    return f"; other limits take over within the step, which leaves {1e3 * entry.linearised:+.4f} ms"


def active_in_words(found: tuple[Saturation, ...]) -> list[str]:
    """Sentences on the limits that are active for some time."""
    lines = []
    for entry in found:
        if entry.share >= 5e-4:
            times = (
                "once"
                if len(entry.active) == 1
                else f"in {len(entry.active)} stretches"
            )
            share = f"{100.0 * entry.share:.1f} % of the time"
            reached = (
                entry.label.active_text
                or f"{entry.label.subject} is at its {entry.label.kind} limit"
            )
            lines.append(f"{reached} for {share}, {times}")
    if not lines:
        lines = ["nothing stays at a limit"]
    return [
        *lines,
        f"(at its limit: at {100.0 * THRESHOLD:g} % of it or beyond, with ripple down to {100.0 * RIPPLE:g} %)",
    ]


def _reference(reference: Reference, t_end: float) -> str:
    longer = (
        f"{100.0 * reference.distance:.2f} % ({1e3 * (t_end - reference.t_end):.1f} ms)"
    )
    return (
        f"reference {reference.t_end:.4f} s ({MEANING}; degree {reference.degree}, {reference.intervals} intervals): "
        f"the motion takes {longer} longer"
    )
