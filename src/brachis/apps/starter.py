"""Making a first task: what to prescribe, where to begin and lead, and a plan that shows that it works.

Where a first motion may begin and lead: a posture far from limits and singularities, and a straight line from it.

Limits that a URDF leaves open and a plan needs: placeholders that the task file marks as such.

What a robot's path can prescribe.

The text of a first task, with comments that say what else there is.
"""

from __future__ import annotations

import os
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, fields
from itertools import combinations
from pathlib import Path

import numpy as np
import yaml

from brachis import planner
from brachis.common.deadline import Deadline
from brachis.errors import PlanningError, write_count
from brachis.ik.registry import default_task_space
from brachis.result import Result
from brachis.robot import Robot, TaskMap, bind
from brachis.robot.dynamics import rigid_torque
from brachis.robot.joints import UNITS
from brachis.robot.limits import UrdfLimit
from brachis.robot.task_map.protocol import AXES
from brachis.robot.urdf import default_chain, read_chain, read_file
from brachis.task import LimitSpec, load_task
from brachis.task.yaml_reader import read_yaml

_POSTURES = 400
"""That are drawn at random."""
_BEST = 4
"""Of them that are looked at."""
_INNER = 0.15
"""Part of a range, at each end, in which no motion begins."""
_FARTHEST = 2.0
"""From zero, rad or m, of a joint that may be nearer."""
_DIGITS = 2
"""Of a position in the task file."""
_STEPS = 10
"""Of a line that is followed."""
_NEWTON = 6
"""Corrections per step."""
_ON_PATH = 1e-8
_SHARE = 0.25
"""Longest line, in lengths of the arm."""
_LENGTHS = (1.0, 0.5, 0.3, 0.2, 0.1, 0.05, 0.02, 0.01)
"""Of lines, m."""
_LEAST_DEXTERITY = 1e-3
_KEPT = 0.4
"""Of the dexterity of the first posture, everywhere on the line."""
_CLEARANCE = 0.1
"""Of the tool above the robot's base, in lengths of the arm, where the arm can."""
_STRONGEST = 0.7
"""Of a torque limit, that holding the arm may need."""


@dataclass(frozen=True)
class Choice:
    """A first motion.

    Attributes
    ----------
    posture : (n,) ndarray
        Where it begins, rad or m.
    displacement : (len(axes),) ndarray
        Where it leads, m, in the position rows of the task space.
    """

    posture: np.ndarray
    displacement: np.ndarray


def choices(task_map: TaskMap) -> Iterator[Choice]:
    """Find first motions one by one, the most promising first.

    Postures whose tool stays above the robot's base come first. There are no motions where the robot cannot move its
    tool in all directions of the task space. The same robot gets the same answer: what is drawn at random has a fixed
    seed.
    """
    robot = task_map.robot
    postures = _drawn(robot)
    reach = _reach(robot, postures)
    for lowest in (_CLEARANCE * reach, -np.inf):
        quality = _quality(task_map, postures, reach, lowest)
        best = [
            k for k in np.argsort(-quality)[:_BEST] if quality[k] > _LEAST_DEXTERITY
        ]
        for k in best:
            line = _line(task_map, postures[k], float(quality[k]), reach, lowest)
            if line is not None:
                yield Choice(postures[k], line)


def _drawn(robot: Robot) -> np.ndarray:
    """Draw postures in the inner part of all ranges, near zero where that is in it, with few digits."""
    lower, upper = robot.limits.position_lower, robot.limits.position_upper
    inner = _INNER * np.where(np.isfinite(upper - lower), upper - lower, 0.0)
    near = np.clip([[-_FARTHEST], [_FARTHEST]], lower + inner, upper - inner)
    low, high = np.where(near[1] > near[0], near, [lower + inner, upper - inner])
    drawn = np.random.default_rng(0).uniform(low, high, (_POSTURES, robot.n))
    rounded = np.round(drawn, _DIGITS) + 0.0
    return np.where((rounded > lower) & (rounded < upper), rounded, drawn)


def _reach(robot: Robot, postures: np.ndarray) -> float:
    """Return how far the tool gets about, m."""
    positions, _ = robot.tool_placements(postures)
    return float(np.linalg.norm(np.ptp(positions, axis=0))) / 2.0


def _quality(
    task_map: TaskMap, postures: np.ndarray, reach: float, lowest: float
) -> np.ndarray:
    """Rate postures (K, n): least singular value of the task Jacobian without units, with and without the rail.

    Positions are divided by the arm's length, and so are prismatic joints. Postures count nothing where holding takes
    much, or where the tool is lower than `lowest` above the base, m.
    """
    robot = task_map.robot
    rows = np.where([unit == "m" for unit in task_map.units], 1.0 / reach, 1.0)
    columns = np.where(robot.revolute, 1.0, reach)
    jacobian = rows[:, None] * task_map.jacobian(task_map.twists(postures)) * columns
    dexterity = np.linalg.svd(jacobian, compute_uv=False)[:, -1]
    rail = int(np.argmax(robot.revolute))  # slides before the first joint that turns
    if 0 < rail <= robot.n - task_map.m:
        dexterity = np.minimum(
            dexterity, np.linalg.svd(jacobian[:, :, rail:], compute_uv=False)[:, -1]
        )
    return (
        dexterity
        * (_holding(robot, postures) < _STRONGEST)
        * (robot.heights(postures) >= lowest)
    )


def _holding(robot: Robot, postures: np.ndarray) -> np.ndarray:
    """Return how much of its torque limits a robot needs to hold postures (K, n), at the joint that needs most."""
    still = np.zeros_like(postures)
    torque = rigid_torque(robot, postures, still, still)
    return np.asarray(
        np.max(
            np.maximum(
                torque / robot.limits.torque_upper, torque / robot.limits.torque_lower
            ),
            axis=1,
        )
    )


def _line(
    task_map: TaskMap, posture: np.ndarray, quality: float, reach: float, lowest: float
) -> np.ndarray | None:
    """Find the longest line along an axis on which the arm stays about as dexterous; None where there is none."""
    for length in (each for each in _LENGTHS if each <= _SHARE * reach):
        rated = {}
        for row in range(len(task_map.axes)):
            for sign in (1.0, -1.0):
                displacement = np.zeros(len(task_map.axes))
                displacement[row] = sign * length
                followed = _followed(task_map, posture, displacement)
                if followed is not None:
                    rated[row, sign] = (
                        float(_quality(task_map, followed, reach, lowest).min()),
                        displacement,
                    )
        worst, displacement = max(
            rated.values(), key=lambda each: each[0], default=(0.0, np.zeros(0))
        )
        if worst > _KEPT * quality:
            return displacement
    return None


def _followed(
    task_map: TaskMap, posture: np.ndarray, displacement: np.ndarray
) -> np.ndarray | None:
    """Follow a line by small steps of least joint motion; None where a joint leaves its range or the line is lost."""
    robot = task_map.robot
    lower, upper = robot.limits.position_lower, robot.limits.position_upper
    position, rotation = robot.tool_placements(posture[None])
    step = np.zeros(3)
    step[list(task_map.axes)] = displacement / _STEPS
    postures = [posture]
    for k in range(1, _STEPS + 1):
        target, q = (
            task_map.of_placements(position + k * step, rotation)[0],
            postures[-1],
        )
        for _ in range(_NEWTON):
            error = task_map.difference(target, task_map.value(q))
            if np.abs(error).max() < _ON_PATH:
                break
            q = (
                q
                + np.linalg.pinv(task_map.jacobian(task_map.twists(q[None]))[0]) @ error
            )
        else:
            return None
        if np.any(q <= lower) or np.any(q >= upper):
            return None
        postures.append(q)
    return np.array(postures)


_ACCELERATION = 1.0
"""Placeholder, rad/s^2 or m/s^2: of a careful machine."""
_RANGE = (-1.5, 1.5)
"""Placeholder, rad or m."""


def placeholders(names: Sequence[str], stated: Sequence[UrdfLimit]) -> LimitSpec:
    """Return limits for the joints of which a URDF states no usable ones; what it states stays.

    Limits of zero, and a range from zero to zero, are what exporters write where there is none. Without a torque a
    joint gets a limit of acceleration, since its time would go to zero otherwise.
    """
    by_name = dict(zip(names, stated, strict=True))
    weak = [name for name, limit in by_name.items() if not limit.effort]
    slow = [name for name, limit in by_name.items() if not limit.velocity]
    open_ended = [
        name for name, limit in by_name.items() if limit.needs_range or _is_empty(limit)
    ]
    given: dict[str, dict[str, object]] = {
        "torque": dict.fromkeys(weak),
        "acceleration": dict.fromkeys(weak, _ACCELERATION),
        "velocity": dict.fromkeys(slow),
        "position": dict.fromkeys(open_ended, _RANGE),
    }
    return LimitSpec(**{kind: values for kind, values in given.items() if values})  # type: ignore[arg-type]


def _is_empty(limit: UrdfLimit) -> bool:
    return limit.lower is not None and limit.lower == limit.upper


def spaces(robot: Robot) -> Iterator[str | list[str]]:
    """Give what a robot might prescribe, the most natural first, then ever fewer rows of its tool's position."""
    yield default_task_space(robot)
    for count in range(min(robot.n, len(AXES)), 0, -1):
        yield from (list(rows) for rows in combinations(AXES, count))


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


def task_text(
    robot: Robot,
    space: str | list[str],
    choice: Choice,
    limits: LimitSpec,
    folder: Path,
) -> str:
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
        name=Path(robot.source).parent.name
        if Path(robot.source).name == "robot.urdf"
        else Path(robot.source).name,
        urdf=_inline(_near(Path(robot.source), folder)),
        tool=_inline(robot.tool_frame),
        base=f"\n  base_frame: {_inline(robot.base_frame)}"
        if robot.settings.base_frame
        else "",
        limits=_limits(robot, limits),
        joints="\n".join(_joint(robot, i, choice.posture[i]) for i in range(robot.n)),
        space=_inline(space),
        degree=f"{write_count(robot.n, 'joint')}: {degree or 'none is'} redundant",
        by=_inline([float(each) for each in choice.displacement]),
    )


def _inline(value: object) -> str:
    """Write a value as YAML on one line, with quotes where it needs them."""
    return (
        yaml.safe_dump(value, default_flow_style=True, width=10_000)
        .removesuffix("...\n")
        .strip()
    )


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
    needed = {
        kind: values for kind, values in given.items() if isinstance(values, dict)
    }
    if not needed:
        return _OWN_LIMITS.format(
            joint=_inline(robot.joint_names[0]),
            torque=_inline(float(f"{robot.limits.torque_upper[0]:.4g}")),
            unit=UNITS["torque"][robot.position_units[0]],
        )
    return "\n".join(
        (
            _PLACEHOLDERS,
            *(
                f"    {kind}: {_inline(_lists(values))}"
                for kind, values in needed.items()
            ),
        )
    )


def _lists(values: dict[str, object]) -> dict[str, object]:
    return {
        name: list(value) if isinstance(value, tuple) else value
        for name, value in values.items()
    }


_SOON = {
    "search.effort": "single",
    "search.time_limit": 20.0,
    "spline.intervals": 10,
    "search.least_motion": False,
}
"""Keys of the plan by which a task is tried."""
_LONGEST = 90.0
"""Time after which no further space is tried, s."""


@dataclass(frozen=True)
class Starter:
    """A first task.

    Attributes
    ----------
    text : str
        The task file.
    robot : Robot
    result : Result
        A quick plan of it, verified.
    """

    text: str
    robot: Robot
    result: Result


def starter_task(
    urdf: str | os.PathLike[str],
    *,
    folder: str | os.PathLike[str] = ".",
    tool_frame: str | None = None,
    base_frame: str | None = None,
    listener: Callable[[str], None] | None = None,
) -> Starter:
    """Write a commented task for a robot: a short line from a good posture, everything else left open.

    Parameters
    ----------
    urdf : path
    folder : path, optional
        Where the task file will be; the URDF's path in it is relative to it where that is near.
    tool_frame, base_frame : str, optional
        As in a task. By default the ends of the chain of most joints; see `default_chain`.
    listener : callable, optional
        Is told what is done.

    Raises
    ------
    UrdfError, UnknownNameError
        See `Robot.from_urdf`.
    PlanningError
        No posture and line were found from which a plan was verified.

    Examples
    --------
    >>> import brachis
    >>> starter = starter_task(brachis.robots.path_of("gantry2"))
    >>> starter.result.verified
    True
    >>> starter.text.splitlines()[2]
    'brachis: 1'
    """
    tell = listener or (lambda _text: None)
    path = Path(urdf)
    text = read_file(path)
    base, tool = base_frame, tool_frame
    if tool is None:
        limb = default_chain(text, str(path))
        base, tool = base or limb.base, limb.tool
    chain = read_chain(
        text, str(path), tool_frame=tool, base_frame=base, locked_joints={}
    )
    limits = placeholders(chain.joint_names, chain.limits)
    robot = Robot.from_urdf(path, tool_frame=tool, base_frame=base, limits=limits)
    deadline = Deadline.after(_LONGEST)
    for space in spaces(robot):
        tell(
            f"looking for a first motion that prescribes {space if isinstance(space, str) else ', '.join(space)}"
        )
        bound, task_map = bind(robot, space)
        for choice in () if deadline.passed else choices(task_map):
            written = task_text(bound, space, choice, limits, Path(folder))
            result = _tried(written, path, tell)
            if result is not None and result.verified:
                return Starter(written, bound, result)
    raise PlanningError(
        "no first motion was found",
        where=str(path),
        found=f"chain {robot.base_frame} -> {robot.tool_frame} with {', '.join(robot.joint_names)}",
        hint="Name another tool frame; brachis inspect shows limits and closed forms",
    )


def _tried(text: str, urdf: Path, listener: Callable[[str], None]) -> Result | None:
    """Plan a task quickly; None where there is no plan."""
    content = read_yaml(text, "starter task")
    assert isinstance(content, dict)
    task = load_task(content, changes={**_SOON, "robot.urdf": str(urdf.absolute())})
    try:
        return planner.plan(task, listener=listener, check_advice=False)
    except PlanningError:
        return None
