"""The tables of a report, as text and as numbers with units."""

from __future__ import annotations

import hashlib
import importlib.metadata
import platform
from datetime import datetime
from pathlib import PurePosixPath, PureWindowsPath
from typing import Any

import numpy as np
import yaml

import brachis
from brachis.apps.bottleneck import THRESHOLD, limits_by_phase
from brachis.apps.bottleneck.saturation import write_share
from brachis.apps.plots.panels import Panel, PanelCurve, curves_of
from brachis.apps.report.motion import ReportedMotion
from brachis.kinematics import CHART
from brachis.task import Task
from brachis.trajectory import phase_table, settings_in_use

NEAR = 0.9
"""Ratio to a limit above which a value is marked as close to this limit; 1 is the limit itself."""
_LISTED = 6
"""Maximum number of segments of a path, and of numbers in a segment, that are written out."""


def figures_of_merit(motion: ReportedMotion) -> dict[str, str]:
    """List the main figures of a motion, by name."""
    trajectory = motion.trajectory
    samples = motion.samples
    verification = motion.verification
    boundary = trajectory.task.boundary
    branch = trajectory.branch
    named = {} if branch in {"", CHART} else {"branch": branch}
    if trajectory.events:
        named["events"] = ", ".join(map(str, trajectory.events))
    fastest = np.argmax(samples.tool_speed)
    ends = "repeats without end" if boundary.periodic else "from rest to rest"
    if boundary.start_speed or boundary.end_speed:
        first, last = samples.tool_speed[[0, -1]]
        ends = f"begins with the tool at {first:.3f} m/s and ends with it at {last:.3f} m/s"
    return {
        "end time t_E": f"{trajectory.t_end:.4f} s",
        "moves": ends,
        "largest tool speed": f"{samples.tool_speed[fastest]:.3f} m/s at {samples.t[fastest]:.3f} s",
        "worst ratio to a limit": f"{verification.worst_ratio:.5f} (1 is the limit)",
        "largest distance from the path": f"{verification.path_error:.1e} m or rad",
        "redundant joints": trajectory.redundancy,
        **named,
        **motion.planned,
    }


def identity(motion: ReportedMotion) -> dict[str, str]:
    """Describe robot, path, payload and mounting, and say when the report was made."""
    trajectory = motion.trajectory
    task = trajectory.task
    name = trajectory.robot.name
    if task.robot.urdf is not None:
        name = f"{name} ({_file_name(task.robot.urdf)})".strip()
    source = {}
    if trajectory.recovered is not None:
        source["recovered from"] = _file_name(trajectory.recovered.source)
    steps = np.diff(motion.samples.tool_position, axis=0)
    length = np.linalg.norm(steps, axis=1).sum()
    components = [part.task for _, part in trajectory.components]
    tasks = [part for part in components if part.path] or [task]
    spaces = (part.task_space for part in tasks)
    rows = (space if isinstance(space, str) else ", ".join(space) for space in spaces)
    described = f"{'; then '.join(map(describe_path, tasks))}; the tool moves {length:.3f} m in all"
    texts = {"URDF": trajectory.urdf, "task as it stands below": task_text(task)}
    return {
        "robot": name,
        "path": f"{described}; prescribed: {'; '.join(dict.fromkeys(rows))}",
        **source,
        "payload": "none",
        "tool offset": "none",
        "mounting": "at the world's origin, upright",
        **settings_in_use(trajectory),
        "report of": datetime.now().astimezone().strftime("%Y-%m-%d %H:%M %Z"),
        **{
            f"SHA-256 of the {what}": hashlib.sha256(text.encode()).hexdigest()
            for what, text in texts.items()
        },
    }


def describe_path(task: Task) -> str:
    """Describe each segment of a path by its shape and its entries in the task."""
    shapes = []
    for segment in task.path:
        for shape, values in segment.model_dump(exclude_defaults=True).items():
            if isinstance(values, dict):
                entries = [
                    f"{key.replace('_', ' ')} {_write_entry(value)}"
                    for key, value in values.items()
                ]
                shapes.append(f"{shape.replace('_', ' ')} ({', '.join(entries)})")
    text = ", then ".join(shapes[:_LISTED])
    omitted = len(shapes) - _LISTED
    return f"{text}, and {omitted} more" if omitted > 0 else text


def _write_entry(value: object) -> str:
    """Write an entry of a segment. A long list or mapping is replaced by its length."""
    nested = (list, tuple, dict)
    if isinstance(value, float):
        return f"{value:.4g}"
    if not isinstance(value, nested):
        return _file_name(str(value))
    if len(value) > _LISTED or any(isinstance(item, nested) for item in value):
        return f"{len(value)} entries"
    return f"[{', '.join(map(_write_entry, value))}]"


def task_text(task: Task) -> str:
    """Write a task as YAML, with file names but without folders, which mean nothing to other readers."""
    return yaml.safe_dump(_without_folders(task.to_dict()), sort_keys=False)


def _without_folders(value: Any) -> Any:
    """Replace every absolute path in nested data by the name of the file."""
    if isinstance(value, dict):
        return {key: _without_folders(item) for key, item in value.items()}
    if isinstance(value, list | tuple):
        return [_without_folders(item) for item in value]
    return _file_name(value) if isinstance(value, str) else value


def _file_name(text: str) -> str:
    """Return the file name of an absolute path, and any other text unchanged."""
    for kind in (PurePosixPath, PureWindowsPath):
        if kind(text).is_absolute():
            return kind(text).name
    return text


def what_limits(motion: ReportedMotion) -> str:
    """Name the limits that are active longest in one sentence."""
    shares = [
        f"{entry.label} ({write_share(entry.share)} of the time)"
        for entry in motion.saturations
        if entry.active
    ]
    if not shares:
        return "No limit is active."
    return f"Limits that are active longest: {', '.join(shares[:3])}."


def phases_with_limits(motion: ReportedMotion) -> list[tuple[str, ...]]:
    """List the phases or parts, each with its active limits. For a motion with only one phase, the list is empty."""
    phases = limits_by_phase(motion.trajectory, motion.saturations)
    _, _, rows = phase_table(motion.trajectory)
    if len(rows) == 1:
        return []
    return [(*row, str(limits)) for row, limits in zip(rows, phases, strict=True)]


def joint_rows(motion: ReportedMotion) -> list[dict[str, Any]]:
    """Describe the motion of every joint, in chain order.

    Returns
    -------
    list of dict
        ``name``; ``redundant``; the positions ``start`` and ``end``, and the range ``travel`` from the lowest to the
        highest position, with their unit. ``peaks`` has an entry for every kind of quantity: the extreme ``value`` with
        its unit; the ``limit`` and the used ``share`` of this limit, both empty if there is no limit; and the
        ``level``, which is ``beyond``, ``at``, ``near`` or empty.
    """
    trajectory = motion.trajectory
    tolerance = trajectory.task.refinement.tolerance
    joints = []
    for name in trajectory.joint_names:
        curves = curves_of(motion.panels, name)
        panel, position = curves[0]
        q = position.values
        unit = panel.unit
        row = {
            "name": name,
            "redundant": name in trajectory.redundant_joints,
            "start": f"{q[0]:z.4f} {unit}",
            "end": f"{q[-1]:z.4f} {unit}",
            "travel": f"{q.min():z.4f} to {q.max():z.4f} {unit}",
            "peaks": [_find_peak(*curve, tolerance) for curve in curves],
        }
        joints.append(row)
    return joints


def _find_peak(panel: Panel, curve: PanelCurve, tolerance: float) -> dict[str, str]:
    """Find the value of a joint that is closest to its limit or, without a limit, the largest value."""
    ratios = np.abs(curve.ratios if curve.is_limited else curve.values)
    worst = np.argmax(ratios)
    value = f"{_write_number(curve.values[worst])} {panel.unit}"
    if not curve.is_limited:
        return {"value": value, "limit": "", "share": "", "level": ""}
    share = ratios[worst]
    # Parts of a program may have limits of their own.
    pair = (np.broadcast_to(end, ratios.shape) for end in (curve.lower, curve.upper))
    lower, upper = (float(end[worst]) for end in pair)
    limit = f"{_write_number(upper)} {panel.unit}"
    if upper != -lower:
        limit = f"{_write_number(lower)} to {limit}"
    edges = (("beyond", 1.0 + tolerance), ("at", THRESHOLD), ("near", NEAR))
    return {
        "value": value,
        "limit": limit,
        "share": f"{100.0 * share:.1f} %",
        "level": next((level for level, edge in edges if share >= edge), ""),
    }


def _write_number(value: float) -> str:
    """Write a number with four significant figures; large numbers have no exponent, and rounding noise is zero."""
    if abs(value) <= 1e-9:
        return "0"
    return f"{value:.0f}" if 1e4 <= abs(value) < np.inf else f"{value:.4g}"


def check_rows(motion: ReportedMotion) -> list[dict[str, Any]]:
    """List the checks of the verification as text. Failed checks come first."""
    rows = []
    for check in sorted(motion.verification.checks, key=lambda check: check.passed):
        figure, allowed, unit = check.figures(degrees=motion.degrees)
        after = "" if unit == "-" else f" {unit}"
        time = "" if check.time is None else f"{check.time:.4f} s"
        row = {
            "name": check.name,
            "found": figure + after,
            "allowed": allowed + after,
            "where": " at ".join(filter(None, (check.subject, time))),
            "passed": check.passed,
            "remark": check.remark,
        }
        rows.append(row)
    passed_check = {"allowed": "", "passed": True, "remark": ""}
    for margin in motion.verification.margins:
        figure, where = margin.in_words().split(", ", 1)
        rows.append(
            {"name": margin.name, "found": figure, "where": where, **passed_check}
        )
    return rows


def versions() -> dict[str, str]:
    """Return the versions of brachis, Python and the libraries used, by name."""
    libraries = ("pin", "numpy", "scipy", "plotly")
    return {
        "brachis": brachis.__version__,
        "Python": platform.python_version(),
        **{name: importlib.metadata.version(name) for name in libraries},
    }
