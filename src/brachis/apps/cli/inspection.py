"""``brachis inspect``.

The joints of a robot with what is in use: limits, masses, friction.

The points that a task's path follows, for ``brachis inspect``.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from math import degrees
from pathlib import Path
from typing import Any

import numpy as np
import pinocchio as pin
from rich.console import Console

from brachis import ik
from brachis.apps.cli.output import Column, print_json, print_table, result_console
from brachis.apps.cli.settings import changed_task, task_space_of, urdf_of
from brachis.common.files import TASK_SUFFIXES, Kind, kind_of
from brachis.errors import InputError, write_count
from brachis.problem.plausibility import of_robot
from brachis.robot import Robot, TaskMap, bind
from brachis.robot.from_task import in_use, robot_from_settings
from brachis.robot.joints import UNITS, shown_unit
from brachis.robot.limits import MAGNITUDES
from brachis.robot.urdf import first_limb, read_file
from brachis.task import FitReport, LimitSpec, Task

NONE = "none"
WORDS = ("joint", "type")
"""Columns that are no figures with units."""
_FRICTION = ("viscous", "coulomb", "armature")


def joint_rows(robot: Robot, *, degrees: bool = False) -> list[dict[str, str]]:
    """Name, type, axis, limits, mass and friction of every joint, with units; `NONE` where there is none.

    The mass is that of the links that the joint carries up to the next one, with the payload at the last one.
    """
    geometry, limits = ik.ChainGeometry.of(robot), robot.limits
    rows = []
    for i, (name, unit) in enumerate(
        zip(robot.joint_names, robot.position_units, strict=True)
    ):
        friction = {key: getattr(robot.friction, key)[i] for key in _FRICTION}
        rows.append(
            {
                "joint": name,
                "type": "revolute" if geometry.revolute[i] else "prismatic",
                "axis at zero": " ".join(
                    f"{round(component, 6) + 0.0:.4g}" for component in geometry.axes[i]
                ),
                "range": _range(
                    limits.position_lower[i],
                    limits.position_upper[i],
                    unit,
                    degrees=degrees,
                ),
                **{
                    kind.replace("_", " "): _limit(
                        limits.both_ways(kind)[:, i], UNITS[kind][unit], degrees=degrees
                    )
                    for kind in MAGNITUDES
                },
                "mass": f"{robot.model.inertias[i + 1].mass:.4g} kg",
                **{
                    key: f"{value:.4g} {UNITS[key][unit]}" if value else NONE
                    for key, value in friction.items()
                },
            }
        )
    return rows


def _range(lower: float, upper: float, unit: str, *, degrees: bool) -> str:
    if np.isinf([lower, upper]).all():
        return NONE
    shown, factor = shown_unit(unit, degrees=degrees)
    return f"{factor * lower:.4g} to {factor * upper:.4g} {shown}"


def _limit(pair: np.ndarray, unit: str, *, degrees: bool) -> str:
    """Write a limit, or two where they differ in both directions."""
    unit, factor = shown_unit(unit, degrees=degrees)
    lower, upper = factor * pair
    if np.isinf(upper):
        return NONE
    return (
        f"{upper:.4g} {unit}"
        if -lower == upper
        else f"{lower:.4g} to {upper:.4g} {unit}"
    )


def print_points(console: Console, task: Task) -> None:
    """Print what was read from a task's files, and how near the fitted path is to it."""
    if not task.fits:
        console.print("no part of the path comes from points")
    for fit in task.fits:
        print_table(console, fit.source, ("", ""), _rows(fit), header=False)
        if fit.corners:
            _print_corners(console, fit)


def _rows(fit: FitReport) -> list[tuple[str, str]]:
    passes = [] if fit.profile else [("path", "passes all points")]
    position = f"(allowed {1e3 * fit.position_tolerance:.4g} mm), rms {1e3 * fit.position_rms:.3g} mm"
    orientation = f"(allowed {degrees(fit.orientation_tolerance):.4g} deg)"
    return [
        ("points", f"{fit.points} along {1e3 * fit.length:.6g} mm"),
        ("knot intervals", str(fit.intervals)),
        *passes,
        ("position error", f"at most {1e3 * fit.position_error:.4g} mm {position}"),
        (
            "orientation error",
            f"at most {degrees(fit.orientation_error):.3g} deg {orientation}",
        ),
        *(("found", told) for told in (*fit.told, *([fit.doubt] if fit.doubt else []))),
    ]


def _print_corners(console: Console, fit: FitReport) -> None:
    columns = [
        Column(name, number=True)
        for name in ("row", "angle [deg]", "at [mm]", "blend [mm]")
    ]
    rows = [
        (
            corner.row,
            f"{degrees(corner.angle):.4g}",
            f"{1e3 * corner.distance:.6g}",
            f"{1e3 * corner.blend:.4g}",
        )
        for corner in fit.corners
    ]
    print_table(console, "corners, blended within the tolerance", columns, rows)


_LISTED = 12
_OTHER_TASKS = (
    "a whole pose is prescribed",
    "no whole pose is prescribed",
    "only for poses",
    "only for the position: x, y and z",
)
"""Reasons of families for other task spaces, which need not be told where there are others."""


def inspect_command(
    source: Path,
    changes: Sequence[str],
    *,
    task_space: str | None,
    tool_frame: str | None,
    base_frame: str | None,
    lock: list[str],
    posture: str | None = None,
    degrees: bool = False,
    as_json: bool,
) -> None:
    """Print a robot's joints and its decompositions."""
    remarks: list[str] = []
    if source.suffix in TASK_SUFFIXES or kind_of(source) is Kind.TASK:
        given = {"--tool-frame": tool_frame, "--base-frame": base_frame, "--lock": lock}
        task = _task_of(
            source, changes, [option for option, value in given.items() if value]
        )
        robot = robot_from_settings(task.robot)
    else:
        task, source = None, urdf_of(source)
        base_frame, tool_frame = _frames(source, base_frame, tool_frame, remarks)
        robot = _of_urdf(source, tool_frame, base_frame, lock)
    asked: str | Sequence[str] | None = None if task is None else task.task_space
    robot, rows = bind(
        robot,
        task_space_of(task_space) if task_space else asked or _natural(robot, remarks),
    )
    remarks += [f"warning: {remark}" for remark in of_robot(robot)]
    candidates = ik.find_all(robot, rows)
    remarks += _remarks_on_closed_forms(candidates)
    decompositions = _decompositions(candidates)
    if posture is not None:
        remarks.append(_tool_pose(robot, posture))
    inspected = _Inspected(source, robot, rows, tuple(remarks), task, decompositions)
    if as_json:
        print_json(inspected.to_dict())
    else:
        inspected.show(result_console(), degrees=degrees)


@dataclass(frozen=True)
class _Inspected:
    """What there is to say of a robot."""

    source: Path
    robot: Robot
    rows: TaskMap
    remarks: tuple[str, ...]
    task: Task | None
    decompositions: list[dict[str, Any]]

    def to_dict(self) -> dict[str, Any]:
        """Return all as plain data for JSON."""
        robot = self.robot
        return {
            "robot": str(self.source),
            "tool_frame": robot.tool_frame,
            "base_frame": robot.base_frame,
            "task_space": list(self.rows.rows),
            "degree_of_redundancy": robot.n - self.rows.m,
            "remarks": list(self.remarks),
            "in_use": in_use(robot),
            "joints": joint_rows(robot),
            "decompositions": self.decompositions,
            "fits": [fit.to_dict() for fit in self.task.fits] if self.task else [],
        }

    def show(self, console: Console, *, degrees: bool) -> None:
        """Print all for a person."""
        robot, joints = self.robot, joint_rows(self.robot, degrees=degrees)
        console.print(
            f"{self.source}: {robot.base_frame} -> {robot.tool_frame}, {write_count(robot.n, 'joint')}"
        )
        for remark in self.remarks:
            console.print(remark)
        shown = [key for key in joints[0] if any(row[key] != NONE for row in joints)]
        columns = [Column(key, number=key not in WORDS) for key in shown]
        print_table(
            console, "joints", columns, [[row[key] for key in shown] for row in joints]
        )
        for name, text in in_use(robot).items():
            console.print(f"{name}: {text}")
        if self.task:
            print_points(console, self.task)
        r = robot.n - self.rows.m
        console.print(
            f"task space [{', '.join(self.rows.rows)}]: degree of redundancy {r}"
        )
        if r < 0:
            console.print(
                "The robot has fewer joints than the task space has rows; prescribe fewer rows."
            )
            return
        _print_decompositions(console, self.decompositions)


def _task_of(path: Path, changes: Sequence[str], options: Sequence[str]) -> Task:
    """Read a task file, beside which no options are given."""
    if options:
        hint = "Leave the option away, or inspect the URDF"
        raise InputError(
            "is for URDFs; a task says it itself", where=options[0], hint=hint
        )
    return changed_task(path, changes)


def _of_urdf(
    path: Path, tool_frame: str, base_frame: str | None, lock: list[str]
) -> Robot:
    """Make the robot of a URDF with the limits that the file states, which need not be usable ones."""
    # Which limits are missing is for the plan to say; here any robot is shown.
    unlimited = LimitSpec(torque=None, velocity=None, acceleration=1.0)
    robot = Robot.from_urdf(
        path,
        tool_frame=tool_frame,
        base_frame=base_frame,
        locked_joints=_locks(lock),
        limits=unlimited,
    )
    stated = {
        kind: np.array([np.inf if value is None else value for value in values])
        for kind, values in (
            ("velocity", [limit.velocity for limit in robot.stated_limits]),
            ("torque", [limit.effort for limit in robot.stated_limits]),
        )
    }
    return replace(
        robot,
        limits=robot.limits.with_magnitudes(
            acceleration=np.full(robot.n, np.inf), **stated
        ),
    )


def _frames(
    urdf: Path, base: str | None, tool: str | None, remarks: list[str]
) -> tuple[str | None, str]:
    """Take the first limb of the URDF where base and tool frame are not given, and say so where there is a choice."""
    if tool is not None:
        return base, tool
    limb = first_limb(read_file(urdf), str(urdf))
    if limb.base and base is None:
        remarks.append(
            f"base frame: {limb.base}, from which several limbs part; --base-frame names another one"
        )
    if len(limb.leaves) > 1:
        remarks.append(
            f"tool frame: {limb.tool}, the last link before the chains to {', '.join(limb.leaves)} part; "
            "--tool-frame names another one"
        )
    return base or limb.base, limb.tool


def _natural(robot: Robot, remarks: list[str]) -> str | list[str]:
    """Choose what the robot can prescribe at most, and say so."""
    space = ik.natural_space(robot)
    remarks.append(
        f"task space: {space if isinstance(space, str) else ','.join(space)}; --task-space names another one"
    )
    return space


def _locks(lock: list[str]) -> dict[str, float]:
    """Read ``name=value`` options."""
    locked = {}
    for text in lock:
        name, _, value = text.partition("=")
        try:
            locked[name] = float(value)
        except ValueError as error:
            raise InputError(
                "is not understood",
                where="--lock",
                found=text,
                allowed="name=value, rad or m",
            ) from error
    return locked


def _remarks_on_closed_forms(candidates: Sequence[ik.Candidate]) -> list[str]:
    """Say where there is none at all, and what EAIK might add."""
    none = bool(candidates) and not any(candidate.solver for candidate in candidates)
    missing = ik.missing_eaik(candidates)
    return [*([ik.NO_CLOSED_FORM] if none else []), *([missing] if missing else [])]


def _decompositions(candidates: Sequence[ik.Candidate]) -> list[dict[str, Any]]:
    """Every choice of redundant joints, its solver or the reasons why there is none."""
    rows = []
    for candidate in candidates:
        solver = candidate.solver
        told = {
            family: reason
            for family, reason in candidate.reasons.items()
            if reason not in _OTHER_TASKS
        }
        why = "; ".join(
            f"{family}: {reason}"
            for family, reason in (told or candidate.reasons).items()
        )
        rows.append(
            {
                "redundant joints": ", ".join(candidate.redundant_joints) or "none",
                "solver": candidate.family or "-",
                "branches": len(solver.branches) if solver else 0,
                "labels": _labels(solver) if solver else "",
                "why not": "" if solver else why,
                "remark": candidate.remark,
            }
        )
    return rows


def _labels(solver: ik.IKSolver) -> str:
    """List the branches, with the number of their alternatives where there are several."""
    several = f" (up to {solver.alternatives})" if solver.alternatives > 1 else ""
    return ", ".join(f"{label}{several}" for label in solver.branches)


def _print_decompositions(console: Console, rows: list[dict[str, Any]]) -> None:
    """Print the choices that have a solver as a table, their branches, and the reasons against the others."""
    solved = [row for row in rows if row["solver"] != "-"]
    columns = [
        "redundant joints",
        "solver",
        "branches",
        *(["remark"] if any(r["remark"] for r in solved) else []),
    ]
    if solved:
        print_table(
            console,
            "choices of redundant joints",
            columns,
            [[row[name] for name in columns] for row in solved],
        )
    for labels in dict.fromkeys(row["labels"] for row in solved):
        choices = "; ".join(
            row["redundant joints"] for row in solved if row["labels"] == labels
        )
        console.print(f"branches with {choices} redundant: {labels}")
    refused = [row for row in rows if row["solver"] == "-"]
    if refused:
        console.print(
            f"no closed form with these redundant ({len(refused)} of {write_count(len(rows), 'choice')}):"
        )
    for row in refused[:_LISTED]:
        console.print(f"  {row['redundant joints']}: {row['why not']}")
    if len(refused) > _LISTED:
        console.print(f"  ... and {len(refused) - _LISTED} more, which --json lists")


def _tool_pose(robot: Robot, text: str) -> str:
    """Say where the tool is at a posture given as numbers, as ``path_start`` of a task of poses takes it."""
    try:
        values = [float(word) for word in text.replace(",", " ").split()]
    except ValueError as error:
        raise InputError(
            "is not understood",
            where="--posture",
            found=text,
            allowed="numbers, rad or m",
        ) from error
    placement = robot.tool_placement(robot.posture(values, "--posture"))
    x, y, z, qx, qy, qz, qw = pin.SE3ToXYZQUAT(placement)
    position = ", ".join(f"{value:.9g}" for value in (x, y, z))
    turn = ", ".join(f"{value:.9g}" for value in (qw, qx, qy, qz))
    return f"the tool is at {{position: [{position}], quaternion_wxyz: [{turn}]}}, m"
