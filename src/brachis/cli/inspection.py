"""``brachis inspect``."""

from __future__ import annotations

from pathlib import Path
from typing import Any

from rich.table import Table

from brachis import ik
from brachis.cli.output import print_json, result_console
from brachis.errors import InputError
from brachis.robot import LimitSpec, Robot, TaskSpace
from brachis.robot.limits import UrdfLimit


def inspect_command(
    urdf: Path, *, task_space: str, tool_frame: str | None, base_frame: str | None, lock: list[str], as_json: bool
) -> None:
    """Print a robot's joints and its decompositions."""
    # Which limits are missing is for the plan to say; here any robot is shown.
    unlimited = LimitSpec(torque=None, velocity=None, acceleration=1.0)
    robot = Robot.from_urdf(
        urdf, tool_frame=tool_frame, base_frame=base_frame, locked_joints=_locks(lock), limits=unlimited
    )
    rows = TaskSpace.of(robot, [row.strip() for row in task_space.split(",") if row.strip()])
    joints = _joints(robot)
    decompositions = _decompositions(robot, rows)
    if as_json:
        print_json(
            {
                "robot": str(urdf),
                "tool_frame": robot.tool_frame,
                "base_frame": robot.base_frame,
                "task_space": list(rows.rows),
                "degree_of_redundancy": robot.n - rows.m,
                "joints": joints,
                "decompositions": decompositions,
            }
        )
        return
    console = result_console()
    console.print(f"{urdf}: {robot.base_frame} -> {robot.tool_frame}, {robot.n} joints")
    console.print(_table("joints", joints))
    r = robot.n - rows.m
    console.print(f"task space [{', '.join(rows.rows)}]: degree of redundancy {r}")
    if r < 0:
        console.print("The robot has fewer joints than the task space has rows; prescribe fewer rows.")
        return
    console.print(_table("choices of redundant joints", decompositions))


def _locks(lock: list[str]) -> dict[str, float]:
    """Read ``name=value`` options."""
    locked = {}
    for text in lock:
        name, _, value = text.partition("=")
        try:
            locked[name] = float(value)
        except ValueError as error:
            raise InputError("is not understood", where="--lock", found=text, allowed="name=value, rad or m") from error
    return locked


def _joints(robot: Robot) -> list[dict[str, Any]]:
    """Name, type, axis and the URDF's limits of every joint."""
    geometry = ik.ChainGeometry.of(robot)
    rows = []
    for i, name in enumerate(robot.joint_names):
        stated, unit = robot.stated_limits[i], robot.position_units[i]
        rows.append(
            {
                "joint": name,
                "type": "revolute" if geometry.revolute[i] else "prismatic",
                "axis at zero": " ".join(f"{component + 0.0:.4g}" for component in geometry.axes[i]),
                "range": _range(stated, unit),
                "velocity": _figure(stated.velocity, f"{unit}/s"),
                "effort": _figure(stated.effort, "Nm" if unit == "rad" else "N"),
            }
        )
    return rows


def _range(limit: UrdfLimit, unit: str) -> str:
    return "unlimited" if limit.lower is None else f"{limit.lower:.4g} to {limit.upper:.4g} {unit}"


def _figure(value: float | None, unit: str) -> str:
    return "not stated" if value is None else f"{value:.4g} {unit}"


def _decompositions(robot: Robot, task_space: TaskSpace) -> list[dict[str, Any]]:
    """Every choice of redundant joints, its solver or the reasons why there is none."""
    rows = []
    for candidate in ik.find_all(robot, task_space):
        solver = candidate.solver
        why = "; ".join(f"{family}: {reason}" for family, reason in candidate.reasons.items())
        rows.append(
            {
                "redundant joints": ", ".join(candidate.redundant_joints) or "none",
                "solver": candidate.family or "-",
                "kind": solver.kind if solver else "-",
                "branches": len(solver.branches) if solver else 0,
                "labels": ", ".join(solver.branches) if solver else "",
                "why not": "" if solver else why,
            }
        )
    return rows


def _table(title: str, rows: list[dict[str, Any]]) -> Table:
    table = Table(title=title, title_justify="left")
    for column in rows[0] if rows else ():
        table.add_column(column)
    for row in rows:
        table.add_row(*(str(value) for value in row.values()))
    return table
