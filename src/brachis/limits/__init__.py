"""Limits on the motion, listed in `LIMIT_BUILDERS`.

A limit is a function of q, qdot, qddot and s; a few also depend on qdddot. To add a new kind of limit, change these
places:

- A joint limit: a row of `brachis.task.LIMIT_KINDS` and its keyword in `LimitKeywords`, both in `task/limit_kinds.py`;
  a class in `JOINT_LIMITS` of `joint.py`; a formula in `JOINT_CHECKS` of `verify/limits/joint.py`.
- A limit on one figure of the whole robot: a row of `brachis.task.ROBOT_LIMITS` and its keyword; a class in
  `drives.py`; a line in `LIMIT_BUILDERS`; a formula in `DRIVE_CHECKS` of `verify/limits/joint.py`.
- Any other limit of drives, such as ``torque_speed``: a field of `brachis.LimitSpec` with its keyword, and its unit in
  `task/units.py`; a field of `Limits` in `robot/limits.py`, which `resolve_limits`, `with_tool_joints` and `to_spec`
  handle; a line in `robot/masses.py` if it needs masses; a class, a line in `LIMIT_BUILDERS` and a formula.
- A limit on the tool or the scene: a field of its model in `task`; a class here with a line in `LIMIT_BUILDERS`; a
  formula in `verify/limits`, in a table that `LIMIT_CHECKS` contains.

No other code depends on the kind of a limit, except that postures and turns are chosen within the joint ranges.

Examples
--------
>>> import brachis
>>> "torque" in brachis.limits.LIMIT_BUILDERS
True
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from functools import partial
from operator import attrgetter

from brachis.common.labels import Label
from brachis.limits.checks import build_own_limits
from brachis.limits.clearance import build_clearance
from brachis.limits.drives import TotalPowerLimit, build_torque_speed
from brachis.limits.joint import JOINT_LIMITS
from brachis.limits.margins import JointEndLimit, SingularityLimit
from brachis.limits.protocol import (
    Bound,
    Description,
    Guarantee,
    HasLatticeWeights,
    JointStates,
    Limit,
    Moments,
    Partials,
    Role,
)
from brachis.limits.tool import (
    DistanceLimit,
    TiltLimit,
    build_tool_range,
    build_tool_speed,
    constant_limit,
)
from brachis.robot import Robot
from brachis.robot.custom_limits import LimitModel, list_models
from brachis.task import Task

Build = Callable[[Robot, Task], Limit | None]
"""Function that builds the limit of one kind for a task on a robot; it returns None if nothing is limited."""


def _build_from(limit: Callable[[Robot, Task, float], Limit], key: str) -> Build:
    """Return a function that builds a limit from one figure, which the task gives under a dotted key."""

    def build(robot: Robot, task: Task) -> Limit | None:
        """Build the limit; None if the figure is missing, or if it limits nothing on this robot."""
        figure = attrgetter(key)(task)
        built = None if figure is None else limit(robot, task, figure)
        return built if built and built.labels else None

    return build


LIMIT_BUILDERS: dict[str, Build] = {
    **{kind: limit.build for kind, limit in JOINT_LIMITS.items()},
    "total_power": TotalPowerLimit.build,
    "torque_speed": build_torque_speed,
    "tool_speed": build_tool_speed,
    "tool_acceleration": _build_from(
        partial(constant_limit, "acceleration", "m/s^2"), "tool_limits.acceleration"
    ),
    "tool_angular_speed": _build_from(
        partial(constant_limit, "angular speed", "rad/s"), "tool_limits.angular_speed"
    ),
    "singularity": _build_from(SingularityLimit, "margins.singularity"),
    "joint_ends": _build_from(JointEndLimit, "margins.joint_ends"),
    "tool_tilt": _build_from(TiltLimit, "tolerances.orientation.tilt"),
    "tool_distance": _build_from(DistanceLimit, "tolerances.position.sphere"),
    "tool_range": build_tool_range,
    "clearance": build_clearance,
}
"""Builders by kind of limit, in the order of the rows of the program."""


def limits_of(
    robot: Robot,
    task: Task,
    own_limits: Sequence[LimitModel] = (),
) -> tuple[Limit, ...]:
    """List the limits of a task on a robot.

    Parameters
    ----------
    robot : Robot
    task : Task
    own_limits : sequence of LimitModel, optional
        Limits in addition to the built-in ones and those under the task's ``custom_limits``.

    Returns
    -------
    tuple of Limit
        The built-in limits in the order of `LIMIT_BUILDERS`, then the user's.

    Raises
    ------
    InputError
        A user's limit does not fit the robot, or is not valid (see `build_own_limits`).
    """
    limits = build_limits(robot, task, LIMIT_BUILDERS)
    models = list_models(task, own_limits)
    return (*limits, *build_own_limits(models, robot, limits, LIMIT_BUILDERS))


def build_limits(robot: Robot, task: Task, kinds: Iterable[str]) -> Sequence[Limit]:
    """Build the built-in limits of some kinds that a task on a robot has."""
    built = [LIMIT_BUILDERS[kind](robot, task) for kind in kinds]
    return [limit for limit in built if limit is not None]


def joint_limits_of(robot: Robot) -> tuple[Limit, ...]:
    """List the limits of a robot without a task, which are the limits of its joints."""
    built = [kind.build(robot) for kind in JOINT_LIMITS.values()]
    return tuple(limit for limit in built if limit is not None)


def describe_guarantees(limits: Iterable[Limit]) -> dict[str, str]:
    """Describe where each limit is guaranteed to be met; the keys are the names of the limits."""
    return {limit.name: limit.guarantee.value for limit in limits}


__all__ = [
    "LIMIT_BUILDERS",
    "Bound",
    "Description",
    "Guarantee",
    "HasLatticeWeights",
    "JointStates",
    "Label",
    "Limit",
    "LimitModel",
    "Moments",
    "Partials",
    "Role",
    "build_limits",
    "describe_guarantees",
    "joint_limits_of",
    "limits_of",
]
__dir__ = __all__.copy  # what completion shows
