"""A first task for a robot: a posture far from limits and singularities, and a straight line from there.

If the URDF lacks limits that a plan needs, the task file contains placeholders and marks them as such.
"""

from __future__ import annotations

import os
import warnings
from collections import defaultdict
from collections.abc import Callable, Iterator, Sequence
from contextlib import suppress
from dataclasses import dataclass
from itertools import combinations, product
from pathlib import Path
from typing import Any

import numpy as np
import pinocchio as pin
import yaml

from brachis import planner
from brachis.common.deadline import Deadline
from brachis.common.files import locate_urdf
from brachis.common.progress import ignore
from brachis.common.words import write_count
from brachis.errors import InputError, PlanningError
from brachis.ik.newton import Newton
from brachis.ik.registry import default_task_space
from brachis.problem.plausibility import of_robot
from brachis.result import Result
from brachis.robot import Robot, TaskMap, bind, dynamics
from brachis.robot.joints import UNITS
from brachis.robot.limits import UrdfLimit
from brachis.robot.plausibility import report_issues
from brachis.robot.task_map.protocol import AXES
from brachis.robot.urdf import default_chain, read_chain, read_file
from brachis.robot.urdf_bodies import placement_matrix
from brachis.task import LimitSpec, load_task
from brachis.task.fields import plain
from brachis.task.yaml_reader import read_yaml
from brachis.timing import SlowTimingWarning

_LENGTHS = (1.0, 0.5, 0.3, 0.2, 0.1, 0.05, 0.02, 0.01)
"""Lengths of the lines that are tried, from long to short, m."""
_QUICK = {
    "search.effort": "single",
    "search.time_limit": 20.0,
    "spline.intervals": 10,
    "search.least_motion": False,
}
"""Keys that are set for the quick plan with which a task is tested."""
_LEAST_REACH = 1e-6
"""Reach below which a tool counts as not moving, m.

For a frame on a joint's axis, rounding gives a far smaller reach.
"""


@dataclass(frozen=True)
class Choice:
    """A first motion along a straight line.

    Attributes
    ----------
    posture : (n,) ndarray
        Start posture, rad or m.
    displacement : (len(axes),) ndarray
        Displacement of the tool in the position rows of the task space, m.
    """

    posture: np.ndarray
    displacement: np.ndarray


def choices(task_map: TaskMap) -> Iterator[Choice]:
    """Yield possible first motions, beginning with the most promising.

    Postures with the tool above the robot's base come first. No motion is found if the robot cannot move its tool in
    all directions of the task space. The random draws have a fixed seed, so the same robot always gives the same
    result.
    """
    robot = task_map.robot
    postures = _draw_postures(robot)
    reach = _measure_reach(robot, postures)
    for lowest in (0.1 * reach, -np.inf):
        quality = _quality(task_map, postures, reach, lowest)
        for k in np.argsort(-quality)[:4]:
            if quality[k] > 1e-3:  # otherwise the posture is too close to a singularity
                line = _line(task_map, postures[k], float(quality[k]), reach, lowest)
                if line is not None:
                    yield Choice(postures[k], line)


def _measure_reach(robot: Robot, postures: np.ndarray) -> float:
    """Measure how far the tool's positions in postures (K, n) are from their middle, m."""
    positions, _ = robot.tool_placements(postures)
    return float(np.linalg.norm(np.ptp(positions, axis=0))) / 2.0


def _draw_postures(robot: Robot) -> np.ndarray:
    """Draw 400 random postures inside all ranges, with two decimals, within 2 rad or m of zero if possible."""
    lower, upper = robot.limits.both_ways("position")
    # No motion begins in the outer 15 % at each end of a range.
    inner = 0.15 * np.where(np.isfinite(upper - lower), upper - lower, 0.0)
    ends = np.array([lower + inner, upper - inner])
    near = np.clip([[-2.0], [2.0]], *ends)
    low, high = np.where(near[1] > near[0], near, ends)
    drawn = np.random.default_rng(0).uniform(low, high, (400, robot.n))
    rounded = np.round(drawn, 2) + 0.0
    return np.where((rounded > lower) & (rounded < upper), rounded, drawn)


def heights(robot: Robot, q: np.ndarray) -> np.ndarray:
    """Return the heights of the tool frame above the plane on which the robot stands, (K,) m, for postures (K, n).

    The plane contains the origin of the base frame. Its normal is the z axis of the URDF's root link.
    """
    base = robot.model.getFrameId(robot.base_frame, pin.FrameType.BODY)
    floor = robot.model.frames[base].placement.translation
    up = placement_matrix(robot.settings.mounting)[:3, 2]
    return (robot.tool_placements(q)[0] - floor) @ up


def _quality(
    task_map: TaskMap, postures: np.ndarray, reach: float, lowest: float
) -> np.ndarray:
    """Rate postures (K, n) by the smallest singular value of the scaled task Jacobian, with and without the rail.

    Positions and prismatic joints are divided by the arm's length. The rating is 0 if a joint needs much of its torque
    to hold the posture, or if the tool is lower than `lowest` above the base, m.
    """
    robot = task_map.robot
    rows = np.where([unit == "m" for unit in task_map.units], 1.0 / reach, 1.0)
    columns = np.where(robot.revolute, 1.0, reach)
    jacobian = rows[:, None] * task_map.jacobian(task_map.twists(postures)) * columns
    quality = np.linalg.svd(jacobian, compute_uv=False)[:, -1]
    rail = int(
        np.argmax(robot.revolute)
    )  # prismatic joints before the first revolute one
    if 0 < rail <= robot.n - task_map.m:
        alone = np.linalg.svd(jacobian[:, :, rail:], compute_uv=False)[:, -1]
        quality = np.minimum(quality, alone)
    still = np.zeros_like(postures)
    if robot.has_masses:
        torque = dynamics.torque(robot, postures, still, still)
        limits = robot.limits
        shares = np.maximum(torque / limits.torque_upper, torque / limits.torque_lower)
        quality[shares.max(axis=1) >= 0.7] = 0.0
    quality[heights(robot, postures) < lowest] = 0.0
    return quality


def _line(
    task_map: TaskMap, posture: np.ndarray, quality: float, reach: float, lowest: float
) -> np.ndarray | None:
    """Find the longest line along an axis on which the arm keeps 40 % of its rating; None if there is none."""
    count = len(task_map.axes)
    for length in _LENGTHS:
        if length > 0.25 * reach:
            continue
        best = 0.4 * quality
        line = None
        for axis, sign in product(range(count), (1.0, -1.0)):
            displacement = np.zeros(count)
            displacement[axis] = sign * length
            postures = _follow(task_map, posture, displacement)
            if postures is not None:
                worst = float(_quality(task_map, postures, reach, lowest).min())
                if worst > best:
                    best = worst
                    line = displacement
        if line is not None:
            return line
    return None


def _follow(
    task_map: TaskMap, posture: np.ndarray, displacement: np.ndarray
) -> np.ndarray | None:
    """Follow a line in 10 steps of least joint motion; None if a joint leaves its range or a step fails."""
    lower, upper = task_map.robot.limits.both_ways("position")
    position, rotation = task_map.robot.tool_placements(posture[None])
    step = np.zeros(3)
    step[list(task_map.axes)] = displacement / 10
    newton = Newton(task_map)
    postures = posture[None]
    for k in range(1, 11):
        target = task_map.of_placements(position + k * step, rotation)
        reached = newton.nearest(target, postures[-1:])
        if not ((reached > lower) & (reached < upper)).all():  # NaN counts as outside
            return None
        postures = np.concatenate([postures, reached])
    return postures


def placeholders(
    names: Sequence[str], stated: Sequence[UrdfLimit], *, has_masses: bool
) -> LimitSpec:
    """Return limits for the joints for which a URDF states no usable limits. Stated limits are kept.

    If there are no masses, torque limits are not usable. Exporters write a limit of zero, or a range from zero to zero,
    if a limit is missing. A joint without a torque limit gets an acceleration limit; otherwise its time would go to
    zero.
    """
    limits: defaultdict[str, dict[str, Any]] = defaultdict(dict)
    for name, limit in zip(names, stated, strict=True):
        if not (limit.effort and has_masses):
            limits["torque"][name] = None
            limits["acceleration"][name] = 1.0  # rad/s^2 or m/s^2: a cautious value
        if not limit.velocity:
            limits["velocity"][name] = None
        is_empty = limit.lower is not None and limit.lower == limit.upper
        if limit.needs_range or is_empty:
            limits["position"][name] = (-1.5, 1.5)  # rad or m
    return LimitSpec(**limits)  # type: ignore[arg-type]


def spaces(robot: Robot) -> Iterator[str | list[str]]:
    """Yield task spaces that may suit a robot: the most natural one first, then fewer and fewer position rows."""
    yield default_task_space(robot)
    for count in range(min(robot.n, len(AXES)), 0, -1):
        yield from map(list, combinations(AXES, count))


_TEXT = """\
# A first task for {name}, written by brachis new. It can be planned as it is. Change it step by step.
# SI units: m, rad, s, kg, N, Nm. All keys: docs/task_files.md. For completion in an editor: brachis schema.
brachis: 1

robot:
  urdf: {urdf}    # a file, relative to this one, or an included robot
  tool_frame: {tool}    # the link that follows the path{base}
{limits}
  # payload: {{mass: 0.5, com: [0, 0, 0.05]}}    # kg, m in the tool frame; needs the masses of the URDF
  # mounting: ceiling    # or floor, wall, {{xyz: [0, 0, 1], rpy_deg: [0, 90, 0]}}

start:    # or start: free, with path_start, the point where the path begins
  joints:
{joints}
end: free    # or {{joints: ...}}, a posture with the tool at the end of the path

task_space: {space}    # what the path prescribes; {degree}

path:    # segments in the world frame, beginning where the tool is in the start posture
  - line: {{by: {by}}}    # m{units}
  # Before a second segment, write "blend: 0.01" (m, to round the corner) or "stop: true" below the first line.
  # Other segments, such as arc, circle, spline and csv: docs/task_files.md

redundant_joints: auto    # or a list of joints; brachis inspect shows which choices have a closed form
search: {{effort: fast}}    # single, fast, thorough or exhaustive
# spline: {{intervals: 20}}    # shorter planning; the default, auto, gives faster motions
# boundary: {{start_speed: 0.1}}    # m/s along the path; by default the motion begins and ends at rest
# tool_limits: {{speed: 0.5}}    # m/s
"""
_OWN_LIMITS = """\
  # Torque, velocity and position limits come from the URDF; brachis inspect shows them. To change some:
  # limits: {{torque: {{{joint}: {torque}}}, scale: {{velocity: 0.5}}}}    # {unit}, as the URDF; halves all speeds"""
_PLACEHOLDERS = """\
  limits:    # the URDF has no usable ones for these joints: ENTER THE MANUFACTURER'S DATA HERE (null: none)"""


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
        Task space: what the path prescribes.
    choice : Choice
    limits : LimitSpec
        Placeholders for limits that the URDF does not state.
    folder : Path
        Folder for the task file.
    """
    source = Path(robot.source)
    redundant = robot.n - (6 if space == "pose" else len(space))
    turning = 0 if space == "pose" else len(space) - len(choice.displacement)
    base = f"\n  base_frame: {_inline(robot.base_frame)}"
    name = source.parent.name if source.name == "robot.urdf" else source.name
    # The name is relative if the URDF is in a folder close to the task file.
    urdf = os.path.relpath(source.absolute(), folder.absolute())
    if locate_urdf(name, folder) == str(source.absolute()):
        urdf = name  # an included robot
    elif urdf.startswith("../../.."):
        urdf = str(source.absolute())
    return _TEXT.format(
        name=name,
        urdf=_inline(urdf),
        tool=_inline(robot.tool_frame),
        base=base if robot.settings.base_frame else "",
        limits=_limits(robot, limits),
        joints="\n".join(_joint(robot, i, choice.posture[i]) for i in range(robot.n)),
        space=_inline(space),
        degree=f"{write_count(robot.n, 'joint')}: {redundant or 'none is'} redundant",
        by=_inline(np.pad(choice.displacement, (0, turning)).tolist()),
        units=", rad" * turning,
    )


def _inline(value: object) -> str:
    """Write a value as YAML on one line, with quotes where they are needed."""
    text = yaml.safe_dump(value, default_flow_style=True, width=10_000)
    return text.removesuffix("...\n").strip()


def _joint(robot: Robot, i: int, position: float) -> str:
    """Write the position of a joint, with its unit and range as a comment."""
    low, high = robot.limits.both_ways("position")[:, i]
    unit = robot.position_units[i]
    allowed = f", {low:.4g} to {high:.4g}" if np.isfinite([low, high]).any() else ""
    return f"    {_inline(robot.joint_names[i])}: {_inline(float(position))}    # {unit}{allowed}"


def _limits(robot: Robot, limits: LimitSpec) -> str:
    """Write the placeholders, or a comment on changing limits if no placeholders are needed."""
    lines = []
    for kind, values in vars(limits).items():
        if isinstance(values, dict):
            lines.append(f"    {kind}: {_inline(plain(values))}")
    if lines:
        return "\n".join([_PLACEHOLDERS, *lines])
    return _OWN_LIMITS.format(
        joint=_inline(robot.joint_names[0]),
        torque=_inline(float(f"{robot.limits.torque_upper[0]:.4g}")),
        unit=UNITS["torque"][robot.position_units[0]],
    )


@dataclass(frozen=True)
class Starter:
    """A first task for a robot, with its verified plan.

    Attributes
    ----------
    text : str
        Text of the task file.
    robot : Robot
    result : Result
        Verified result of a quick plan of the task.
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
    """Write a commented task for a robot: a short line from a good posture, with all other settings left open.

    Parameters
    ----------
    urdf : path
    folder : path, optional
        Folder for the task file. The path of the URDF in the task is relative to this folder if the URDF is close to
        it.
    tool_frame, base_frame : str, optional
        As in a task. Default: the ends of the chain with the most joints, as `default_chain` finds them.
    listener : callable, optional
        Function that is called with a text about each step.

    Raises
    ------
    UrdfError, UnknownNameError
        As `Robot.from_urdf`.
    InputError
        The tool frame does not move, or only rotates on the spot.
    PlanningError
        No posture and line were found for which a plan was verified.

    Examples
    --------
    >>> import brachis
    >>> starter = starter_task(brachis.robots.path_of("gantry2"))
    >>> starter.result.verified
    True
    >>> starter.text.splitlines()[2]
    'brachis: 1'
    """
    tell = listener or ignore
    path = Path(urdf)
    text = read_file(path)
    if tool_frame is None:
        limb = default_chain(text, str(path))
        base_frame = base_frame or limb.base
        tool_frame = limb.tool
    chain = read_chain(text, str(path), tool_frame, base_frame)
    massless = chain.dynamics.without_mass
    limits = placeholders(chain.joint_names, chain.limits, has_masses=not massless)
    robot = Robot.from_urdf(
        path, tool_frame=tool_frame, base_frame=base_frame, limits=limits
    )
    if _measure_reach(robot, _draw_postures(robot)) < _LEAST_REACH:
        raise InputError(
            "this tool frame does not move, or only rotates on the spot",
            where=str(path),
            found=f"{robot.base_frame} -> {robot.tool_frame} with {', '.join(robot.joint_names)}",
            hint="Choose another tool frame, farther along the chain",
        )
    # After these seconds, no further task space is tried.
    deadline = Deadline.after(90.0)
    changes = {**_QUICK, "robot.urdf": str(path.absolute())}
    for space in spaces(robot):
        words = space if isinstance(space, str) else ", ".join(space)
        tell(f"looking for a first motion with {words} prescribed")
        bound, task_map = bind(robot, space)
        for choice in () if deadline.passed else choices(task_map):
            written = task_text(bound, space, choice, limits, Path(folder))
            content: Any = read_yaml(written, "starter task")
            task = load_task(content, changes=changes)
            with suppress(PlanningError), warnings.catch_warnings():
                # This plan has few intervals; the task itself will get as many as it needs.
                warnings.simplefilter("ignore", SlowTimingWarning)
                result = planner.plan(task, listener=tell, check_advice=False)
                if result.verified:
                    return Starter(written, bound, result)
    report_issues(of_robot(robot), strict=False)
    raise PlanningError(
        "no first motion was found",
        where=str(path),
        found=f"chain {robot.base_frame} -> {robot.tool_frame} with {', '.join(robot.joint_names)}",
        hint="Choose another tool frame; brachis inspect shows limits and closed forms",
    )
