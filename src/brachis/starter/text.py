"""The text of a first task, with comments that say what else there is."""

from __future__ import annotations

import os
from dataclasses import fields
from pathlib import Path

import numpy as np
import yaml

from brachis.errors import write_count
from brachis.robot import Robot
from brachis.robot.units import UNITS
from brachis.starter.choice import Choice
from brachis.task import LimitSpec

_TEXT = """\
# A first task for {name}, written by brachis new: it plans and verifies as it is. Change it step by step.
# SI units: m, rad, s, kg, N, Nm. All keys: docs/task_files.md; for completion in an editor: brachis schema.
brachis: 1

robot:
  urdf: {urdf}    # relative to this file
  tool_frame: {tool}    # the link that follows the path{base}
{limits}
  # payload: {{mass: 0.5, com: [0, 0, 0.05]}}    # kg, m in the tool frame
  # mounting: ceiling    # or floor, wall, {{xyz: [0, 0, 1], rpy_deg: [0, 90, 0]}}

start:    # or start: free, with path_start, the place where the path begins
  joints:
{joints}
end: free    # or {{joints: ...}}, in which the tool is at the path's end

task_space: {space}    # what the path prescribes; {degree}

path:    # segments from the start posture's tool on, in the world frame
  - line: {{by: {by}}}    # m
  # A second segment needs a rounded corner: put "blend: 0.01" (m) below the line before it.
  # Others: arc, circle, spline, csv, ...: docs/task_files.md

redundant_joints: auto    # or a list of joints; brachis inspect shows which have a closed form
search: {{effort: fast}}    # single, fast, thorough or exhaustive
# spline: {{intervals: 20}}    # plans sooner; the default, auto, gives faster motions
# boundary: {{start_speed: 0.1}}    # m/s along the path; without it the motion begins and ends at rest
# tool_limits: {{speed: 0.5}}    # m/s
"""
_OWN_LIMITS = """\
  # Limits of torque, velocity and position are the URDF's; brachis inspect shows them. To change some:
  # limits: {{torque: {{{joint}: {torque}}}, scale: {{velocity: 0.5}}}}    # {unit}, as the URDF; half of all speeds"""
_PLACEHOLDERS = """\
  limits:    # the URDF states no usable ones for these joints: PUT THE MAKER'S FIGURES HERE (null: none)"""


def task_text(robot: Robot, space: str | list[str], choice: Choice, limits: LimitSpec, folder: Path) -> str:
    """Write the task file.

    Parameters
    ----------
    robot : Robot
    space : str or list of str
        What the path prescribes.
    choice : Choice
    limits : LimitSpec
        Placeholders for limits that the URDF leaves open.
    folder : Path
        Where the file will be.
    """
    degree = robot.n - (6 if space == "pose" else len(space))
    return _TEXT.format(
        name=Path(robot.source).parent.name if Path(robot.source).name == "robot.urdf" else Path(robot.source).name,
        urdf=_inline(_near(Path(robot.source), folder)),
        tool=_inline(robot.tool_frame),
        base=f"\n  base_frame: {_inline(robot.base_frame)}" if robot.settings.base_frame else "",
        limits=_limits(robot, limits),
        joints="\n".join(_joint(robot, i, choice.posture[i]) for i in range(robot.n)),
        space=_inline(space),
        degree=f"{write_count(robot.n, 'joint')}: {degree or 'none is'} redundant",
        by=_inline([float(each) for each in choice.displacement]),
    )


def _inline(value: object) -> str:
    """Write a value as YAML on one line, with quotes where it needs them."""
    return yaml.safe_dump(value, default_flow_style=True, width=10_000).removesuffix("...\n").strip()


def _near(urdf: Path, folder: Path) -> str:
    """Return the URDF's path as the task file names it: relative where it is in a folder beside, absolute else."""
    relative = os.path.relpath(urdf.absolute(), folder.absolute())
    return str(urdf.absolute()) if relative.startswith("../../..") else relative


def _joint(robot: Robot, i: int, position: float) -> str:
    low, high = robot.limits.position_lower[i], robot.limits.position_upper[i]
    unit = robot.position_units[i]
    allowed = f", {low:.4g} to {high:.4g}" if np.isfinite([low, high]).any() else ""
    return f"    {_inline(robot.joint_names[i])}: {_inline(float(position))}    # {unit}{allowed}"


def _limits(robot: Robot, limits: LimitSpec) -> str:
    """Write the placeholders, or how to change limits where none are needed."""
    given = {each.name: getattr(limits, each.name) for each in fields(limits)}
    needed = {kind: values for kind, values in given.items() if isinstance(values, dict)}
    if not needed:
        return _OWN_LIMITS.format(
            joint=_inline(robot.joint_names[0]),
            torque=_inline(float(f"{robot.limits.torque_upper[0]:.4g}")),
            unit=UNITS["torque"][robot.position_units[0]],
        )
    return "\n".join((_PLACEHOLDERS, *(f"    {kind}: {_inline(_lists(values))}" for kind, values in needed.items())))


def _lists(values: dict[str, object]) -> dict[str, object]:
    return {name: list(value) if isinstance(value, tuple) else value for name, value in values.items()}
