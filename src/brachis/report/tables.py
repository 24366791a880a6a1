"""The tables of a report, in words and figures with their units."""

from __future__ import annotations

import importlib.metadata
import platform
from dataclasses import dataclass

import numpy as np

import brachis
from brachis.attempt import coordinates
from brachis.bottleneck import THRESHOLD
from brachis.plots.quantities import KINDS, quantities
from brachis.report.motion import ReportedMotion
from brachis.verify import Check

_LIBRARIES = ("pin", "numpy", "scipy", "plotly")
NEAR = 0.9
"""Values that use more of a limit are marked as near it; 1 is the limit itself."""
_SMALL = 1e-9


@dataclass(frozen=True)
class Row:
    """A joint's extreme value of one quantity.

    Attributes
    ----------
    value, limit : str
        With units; the limit is empty where there is none.
    share : str
        Of the limit, per cent; empty where there is none.
    level : str
        ``beyond``, ``at``, ``near`` or empty: how near to the limit.
    """

    value: str
    limit: str
    share: str
    level: str


@dataclass(frozen=True)
class JointRow:
    """What a joint does.

    Attributes
    ----------
    name : str
    redundant : bool
    start, end, range : str
        Positions with their unit.
    travel : str
        Lowest and highest position.
    peaks : tuple of Row
        Of velocity, acceleration, and torque or force.
    """

    name: str
    redundant: bool
    start: str
    end: str
    travel: str
    range: str
    peaks: tuple[Row, ...]


def figures_of_merit(motion: ReportedMotion) -> dict[str, str]:
    """Say what a person asks first."""
    trajectory, samples, verification = motion.trajectory, motion.samples, motion.verification
    boundary = trajectory.task.boundary
    named = trajectory.branch not in {"", coordinates(trajectory.redundant_joints, trajectory.branch)}
    fastest = int(np.argmax(samples.tool_speed))
    ends = "goes round for ever" if boundary.periodic else "from rest to rest"
    if boundary.start_speed or boundary.end_speed:
        first, last = samples.tool_speed[[0, -1]]
        ends = f"begins with the tool at {first:.3f} m/s and ends with it at {last:.3f} m/s"
    return {
        "end time t_E": f"{trajectory.t_end:.4f} s",
        "moves": ends,
        "largest tool speed": f"{samples.tool_speed[fastest]:.3f} m/s at {samples.t[fastest]:.3f} s",
        "worst ratio to a limit": f"{verification.worst_ratio:.5f} (1 is the limit)",
        "largest distance from the path": f"{verification.path_error:.1e} m or rad",
        "robot": trajectory.robot.model.name,
        "redundant joints": coordinates(trajectory.redundant_joints, trajectory.branch),
        **({"branch": trajectory.branch} if named else {}),
        **motion.planned,
    }


def what_limits(motion: ReportedMotion) -> str:
    """Name the limits that are active longest, in one sentence."""
    active = [entry for entry in motion.saturations if entry.active][:3]
    if not active:
        return "No limit is active."
    shares = (f"{entry.label} ({100.0 * entry.share:.0f} % of the time)" for entry in active)
    return f"At its limits longest: {', '.join(shares)}."


def joint_rows(motion: ReportedMotion) -> list[JointRow]:
    """List what every joint does, in chain order."""
    trajectory, samples = motion.trajectory, motion.samples
    robot, tolerance = trajectory.robot, trajectory.task.refinement.tolerance
    peaks: dict[int, list[Row]] = {joint: [] for joint in range(robot.n)}
    for kind in list(KINDS)[1:]:  # the position has columns of its own
        for part in quantities(trajectory, samples, kind):
            for column, joint in enumerate(part.joints.tolist()):
                levels = part.lower[column], part.upper[column]
                peaks[joint].append(_peak(part.values[:, column], *levels, part.unit, tolerance))
    rows = []
    for joint, (name, unit) in enumerate(zip(robot.joint_names, robot.position_units, strict=True)):
        q = samples.q[:, joint]
        ends = robot.limits.position_lower[joint], robot.limits.position_upper[joint]
        rows.append(
            JointRow(
                name=name,
                redundant=name in trajectory.redundant_joints,
                start=f"{q[0]:.4f} {unit}",
                end=f"{q[-1]:.4f} {unit}",
                travel=f"{q.min():.4f} to {q.max():.4f} {unit}",
                range=" to ".join("open" if np.isinf(end) else f"{end:.4g}" for end in ends) + f" {unit}",
                peaks=tuple(peaks[joint]),
            )
        )
    return rows


def _peak(values: np.ndarray, lower: float, upper: float, unit: str, tolerance: float) -> Row:
    """Find the value that is nearest to its limit, or the largest one where there is no limit."""
    ratios = values / np.where(values > 0.0, upper, -lower)
    limited = bool(np.isfinite([lower, upper]).all())
    at = int(np.argmax(np.abs(ratios if limited else values)))
    value = values[at] if abs(values[at]) > _SMALL else 0.0
    share = abs(float(ratios[at]))
    limit = f"{upper:.4g} {unit}" if upper == -lower else f"{lower:.4g} to {upper:.4g} {unit}"
    return Row(
        value=f"{value:.4g} {unit}",
        limit=limit if limited else "",
        share=f"{100.0 * share:.1f} %" if limited else "",
        level=_level(share, tolerance) if limited else "",
    )


def _level(share: float, tolerance: float) -> str:
    """Grade how near a value is to its limit."""
    edges = (("beyond", 1.0 + tolerance), ("at", THRESHOLD), ("near", NEAR))
    return next((level for level, edge in edges if share >= edge), "")


@dataclass(frozen=True)
class CheckRow:
    """One check of the verification in words."""

    name: str
    found: str
    allowed: str
    where: str
    passed: bool
    remark: str


def check_rows(motion: ReportedMotion) -> list[CheckRow]:
    """List the checks of the verification, those that failed first."""
    return [_check_row(check) for check in sorted(motion.verification.checks, key=lambda check: check.passed)]


def _check_row(check: Check) -> CheckRow:
    unit = "" if check.unit == "-" else f" {check.unit}"
    parts = [check.subject or "", "" if check.time is None else f"{check.time:.4f} s"]
    return CheckRow(
        name=check.name,
        found=check.figures[0] + unit,
        allowed=check.figures[1] + unit,
        where=" at ".join(part for part in parts if part),
        passed=check.passed,
        remark=check.remark,
    )


def versions() -> dict[str, str]:
    """Name the versions of what made the report."""
    found = {name: importlib.metadata.version(name) for name in _LIBRARIES}
    return {"brachis": brachis.__version__, "Python": platform.python_version(), **found}
