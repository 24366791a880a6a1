"""``brachis inspect``: the joints of a robot, its closed forms, and the points that a task's path follows."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from math import degrees as in_degrees
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from brachis.apps.cli.app import Changes, Degrees
from brachis.apps.cli.output import (
    Column,
    Json,
    print_json,
    print_table,
    result_console,
)
from brachis.common import interrupts
from brachis.errors import InputError, write_count

if TYPE_CHECKING:
    import numpy as np

    from brachis import ik
    from brachis.robot import Robot
    from brachis.task import FitReport, Task

_NONE = "none"
"""What a table shows where there is no limit and no friction."""
_OTHER_TASKS = (
    "a whole pose is prescribed",
    "no whole pose is prescribed",
    "only for poses",
    "only for the position: x, y and z",
)
"""Reasons of families for other task spaces; they are left out where there are others."""


def inspect(
    source: Annotated[
        Path,
        typer.Argument(
            help="URDF file or name of a robot; or a task file: its robot with the limits and masses in use, and the "
            "points that its path follows.",
            metavar="URDF|TASK",
        ),
    ],
    task_space: Annotated[
        str | None,
        typer.Option(
            help="What the path prescribes: rows such as x,y or x,z,yaw, or position, pose or pose_free_roll. "
            "Default: the task's, or all that the robot can."
        ),
    ] = None,
    tool_frame: Annotated[
        str | None, typer.Option(help="Link at the chain's end.")
    ] = None,
    base_frame: Annotated[
        str | None, typer.Option(help="Link at the chain's beginning.")
    ] = None,
    posture: Annotated[
        str | None,
        typer.Option(
            help="Say where the tool is at these joint positions, for example '0, 0.3, 1.2'."
        ),
    ] = None,
    lock: Annotated[
        list[str] | None,
        typer.Option(help="Joint held at a position: name=value, repeatable."),
    ] = None,
    degrees: Degrees = False,
    changes: Changes = None,
    json: Json = False,
) -> None:
    """Show a robot's joints and its closed forms.

    Limits, masses and friction of every joint, and which choices of redundant joints have a closed form.
    """
    with interrupts.defer():
        from brachis import ik
        from brachis.apps.cli.settings import task_space_of, urdf_of
        from brachis.common.files import TASK_SUFFIXES, Kind, kind_of
        from brachis.limits import describe_guarantees, joint_limits_of, limits_of
        from brachis.problem.plausibility import of_robot
        from brachis.robot import bind
        from brachis.robot.from_task import in_use, robot_from_settings
    remarks: list[str] = []
    task = None
    space: str | Sequence[str] | None = task_space and task_space_of(task_space)
    if source.suffix in TASK_SUFFIXES or kind_of(source) is Kind.TASK:
        given = {"--tool-frame": tool_frame, "--base-frame": base_frame, "--lock": lock}
        task = _read_task(source, changes, given)
        robot = robot_from_settings(task.robot)
        space = space or task.task_space
    else:
        source = urdf_of(source)
        base_frame, tool_frame = _frames(source, base_frame, tool_frame, remarks)
        robot = _robot_of_urdf(source, tool_frame, base_frame, lock or [])
    if space is None:
        space = ik.default_task_space(robot)
        words = space if isinstance(space, str) else ",".join(space)
        remarks.append(f"task space: {words}; --task-space names another one")
    robot, task_map = bind(robot, space)
    remarks += [f"warning: {remark}" for remark in of_robot(robot)]
    candidates = ik.find_all(robot, task_map)
    if candidates and not any(candidate.solver for candidate in candidates):
        remarks.append(ik.NO_CLOSED_FORM)
    if missing := ik.missing_eaik(candidates):
        remarks.append(missing)
    if posture is not None:
        remarks.append(_tool_pose(robot, posture))
    limits = joint_limits_of(robot) if task is None else limits_of(robot, task)
    data = {
        "robot": str(source),
        "tool_frame": robot.tool_frame,
        "base_frame": robot.base_frame,
        "task_space": list(task_map.rows),
        "degree_of_redundancy": robot.n - task_map.m,
        "remarks": remarks,
        "in_use": in_use(robot),
        "joints": _joint_rows(robot),
        "guarantees": describe_guarantees(limits),
        "decompositions": [_decomposition(candidate) for candidate in candidates],
        "fits": [fit.to_dict() for fit in task.fits] if task else [],
    }
    if json:
        print_json(data)
    else:
        _print_robot(robot, task, data, degrees=degrees)


def _read_task(path: Path, changes: list[str] | None, options: dict[str, Any]) -> Task:
    """Load a task file; options that change the robot are refused."""
    from brachis.apps.cli.settings import changed_task

    for option, value in options.items():
        if value:
            raise InputError(
                "not allowed with a task file",
                where=option,
                hint="Leave the option away, or inspect the URDF",
            )
    return changed_task(path, changes)


def _print_robot(
    robot: Robot, task: Task | None, data: dict[str, Any], *, degrees: bool
) -> None:
    """Print all for a person."""
    console = result_console()
    chain = f"{robot.base_frame} -> {robot.tool_frame}"
    console.print(f"{data['robot']}: {chain}, {write_count(robot.n, 'joint')}")
    for remark in data["remarks"]:
        console.print(remark)
    rows = _joint_rows(robot, degrees=degrees)
    shown = [key for key in rows[0] if any(row[key] != _NONE for row in rows)]
    columns = [Column(key, number=key not in {"joint", "type"}) for key in shown]
    print_table(
        console, "joints", columns, [[row[key] for key in shown] for row in rows]
    )
    for name, text in data["in_use"].items():
        console.print(f"{name}: {text}")
    for name, text in data["guarantees"].items():
        console.print(f"{name} limit: {text}")
    if task is not None:
        _print_points(task)
    redundancy = data["degree_of_redundancy"]
    space = ", ".join(data["task_space"])
    console.print(f"task space [{space}]: degree of redundancy {redundancy}")
    if redundancy < 0:
        console.print(
            "The robot has fewer joints than the task space has rows; prescribe fewer rows."
        )
    else:
        _print_decompositions(data["decompositions"])


def _joint_rows(robot: Robot, *, degrees: bool = False) -> list[dict[str, str]]:
    """Name, type, axis, limits, mass and friction of every joint, with units.

    The mass is that of the links that the joint carries up to the next one, with the payload at the last one.
    """
    from brachis import ik
    from brachis.robot.joints import UNITS
    from brachis.robot.limits import MAGNITUDES

    geometry = ik.ChainGeometry.of(robot)
    limits = robot.limits
    rows = []
    for i, (name, unit) in enumerate(
        zip(robot.joint_names, robot.position_units, strict=True)
    ):
        axis = [f"{round(component, 6) + 0.0:.4g}" for component in geometry.axes[i]]
        row = {
            "joint": name,
            "type": "revolute" if geometry.revolute[i] else "prismatic",
            "axis at zero": " ".join(axis),
            "range": _range(
                (limits.position_lower[i], limits.position_upper[i]),
                unit,
                degrees=degrees,
            ),
        }
        for kind in MAGNITUDES:
            pair = limits.both_ways(kind)[:, i]
            row[kind.replace("_", " ")] = _limit(
                pair, UNITS[kind][unit], degrees=degrees
            )
        row["mass"] = f"{robot.model.inertias[i + 1].mass:.4g} kg"
        for key in ("viscous", "coulomb", "armature"):
            value = getattr(robot.friction, key)[i]
            row[key] = f"{value:.4g} {UNITS[key][unit]}" if value else _NONE
        rows.append(row)
    return rows


def _range(pair: Sequence[float] | np.ndarray, unit: str, *, degrees: bool) -> str:
    """Write two ends."""
    import numpy as np

    from brachis.robot.joints import shown_unit

    if np.isinf(pair).all():
        return _NONE
    shown, factor = shown_unit(unit, degrees=degrees)
    lower, upper = factor * np.asarray(pair)
    return f"{lower:.4g} to {upper:.4g} {shown}"


def _limit(pair: np.ndarray, unit: str, *, degrees: bool) -> str:
    """Write a limit, or two if they differ in both directions."""
    from brachis.robot.joints import shown_unit

    shown, factor = shown_unit(unit, degrees=degrees)
    lower, upper = factor * pair
    if upper == float("inf"):
        return _NONE
    if -lower == upper:
        return f"{upper:.4g} {shown}"
    return f"{lower:.4g} to {upper:.4g} {shown}"


def _print_points(task: Task) -> None:
    """Print what was read from a task's files, and how near the fitted path is to it."""
    console = result_console()
    if not task.fits:
        console.print("no part of the path comes from points")
    for fit in task.fits:
        print_table(console, fit.source, ("", ""), _fit_rows(fit), header=False)
        if fit.corners:
            _print_corners(fit)


def _fit_rows(fit: FitReport) -> list[tuple[str, str]]:
    passes = [] if fit.profile else [("path", "passes all points")]
    position = f"(allowed {1e3 * fit.position_tolerance:.4g} mm), rms {1e3 * fit.position_rms:.3g} mm"
    orientation = f"(allowed {in_degrees(fit.orientation_tolerance):.4g} deg)"
    return [
        ("points", f"{fit.points} along {1e3 * fit.length:.6g} mm"),
        ("knot intervals", str(fit.intervals)),
        *passes,
        ("position error", f"at most {1e3 * fit.position_error:.4g} mm {position}"),
        (
            "orientation error",
            f"at most {in_degrees(fit.orientation_error):.3g} deg {orientation}",
        ),
        *(("found", note) for note in (*fit.told, fit.doubt) if note),
    ]


def _print_corners(fit: FitReport) -> None:
    columns = [
        Column(name, number=True)
        for name in ("row", "angle [deg]", "at [mm]", "blend [mm]")
    ]
    rows = [
        (
            corner.row,
            f"{in_degrees(corner.angle):.4g}",
            f"{1e3 * corner.distance:.6g}",
            f"{1e3 * corner.blend:.4g}",
        )
        for corner in fit.corners
    ]
    print_table(
        result_console(), "corners, blended within the tolerance", columns, rows
    )


def _robot_of_urdf(
    path: Path, tool_frame: str, base_frame: str | None, lock: list[str]
) -> Robot:
    """Make the robot of a URDF with the limits that the file states, which need not be usable ones."""
    import numpy as np

    from brachis.robot import Robot
    from brachis.task import LimitSpec

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
    from brachis.robot.urdf import first_limb, read_file

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


def _decomposition(candidate: ik.Candidate) -> dict[str, Any]:
    """Describe one choice of redundant joints: its solver, or the reasons why there is none."""
    solver = candidate.solver
    row: dict[str, Any] = {
        "redundant joints": ", ".join(candidate.redundant_joints) or "none",
        "solver": "-",
        "branches": 0,
        "labels": "",
        "why not": "",
        "remark": candidate.remark,
    }
    if solver is None:
        reasons = {
            family: reason
            for family, reason in candidate.reasons.items()
            if reason not in _OTHER_TASKS
        }
        row["why not"] = "; ".join(
            f"{family}: {reason}"
            for family, reason in (reasons or candidate.reasons).items()
        )
        return row
    several = f" (up to {solver.alternatives})" if solver.alternatives > 1 else ""
    row["solver"] = candidate.family
    row["branches"] = len(solver.branches)
    row["labels"] = ", ".join(f"{label}{several}" for label in solver.branches)
    return row


def _print_decompositions(rows: list[dict[str, Any]]) -> None:
    """Print the choices that have a solver as a table, their branches, and the reasons against the others."""
    console = result_console()
    solved = [row for row in rows if row["solver"] != "-"]
    columns = ["redundant joints", "solver", "branches"]
    if any(row["remark"] for row in solved):
        columns.append("remark")
    if solved:
        cells = [[row[name] for name in columns] for row in solved]
        print_table(console, "choices of redundant joints", columns, cells)
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
    for row in refused[:12]:
        console.print(f"  {row['redundant joints']}: {row['why not']}")
    if len(refused) > 12:
        console.print(f"  ... and {len(refused) - 12} more, which --json lists")


def _tool_pose(robot: Robot, text: str) -> str:
    """Say where the tool is at a posture given as numbers, as ``path_start`` of a task of poses takes it."""
    import pinocchio as pin

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
