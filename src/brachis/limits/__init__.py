"""Limits on the motion, listed in `TABLE`.

A limit is a function of q, qdot, qddot and s, some of qdddot too. A new kind of joint limit is a row of
`brachis.task.LIMIT_KINDS`, a class in `joint.py`, and a formula in `verify/limits/joint.py`. Any other kind is its
model in `task`, its file here with a line in `TABLE`, and a formula in `verify.limits` with a line in the table there.
Nothing else asks which kind a limit is. Only joint ranges are known elsewhere too: postures and turns are chosen within
them.

Examples
--------
>>> import brachis
>>> "torque" in brachis.limits.TABLE
True
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from functools import partial

from brachis.common.labels import Label
from brachis.limits.checks import build_user_limits
from brachis.limits.clearance import build_clearance
from brachis.limits.drives import build_torque_speed, build_total_power
from brachis.limits.joint import JOINT_LIMITS
from brachis.limits.margins import build_joint_ends, build_singularity
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
    build_constant,
    build_tool_distance,
    build_tool_range,
    build_tool_speed,
    build_tool_tilt,
)
from brachis.robot import Robot
from brachis.robot.custom_limits import LimitModel, list_models
from brachis.task import LIMIT_KINDS, Task

Build = Callable[[Robot, Task], Limit | None]
"""Makes the limit of a kind for a task on a robot; None where nothing is limited."""

_AFTER: dict[str, dict[str, Build]] = {
    "position": {
        "tool_speed": build_tool_speed,
        "tool_acceleration": partial(build_constant, "acceleration", "m/s^2"),
        "tool_angular_speed": partial(build_constant, "angular speed", "rad/s"),
    },
    "power": {
        "total_power": build_total_power,
        "torque_speed": build_torque_speed,
    },
}
TABLE: dict[str, Build] = {}
"""By kind, in the order of the rows of the program: a joint limit, then those that `_AFTER` lists for it."""
for _kind in LIMIT_KINDS:
    TABLE[_kind] = JOINT_LIMITS[_kind].build
    TABLE |= _AFTER.get(_kind, {})
TABLE |= {
    "singularity": build_singularity,
    "joint_ends": build_joint_ends,
    "tool_tilt": build_tool_tilt,
    "tool_distance": build_tool_distance,
    "tool_range": build_tool_range,
    "clearance": build_clearance,
}


def limits_of(
    robot: Robot,
    task: Task,
    user_limits: Sequence[LimitModel] = (),
) -> tuple[Limit, ...]:
    """List the limits of a task on a robot.

    Parameters
    ----------
    robot : Robot
    task : Task
    user_limits : sequence of LimitModel, optional
        Further limits, besides those of the table and of the task's ``custom_limits``.

    Returns
    -------
    tuple of Limit
        In the order of the table, then the user's.

    Raises
    ------
    InputError
        A limit of the user's own does not fit the robot, or is not valid (see `build_user_limits`).
    """
    built = [build(robot, task) for build in TABLE.values()]
    limits = [limit for limit in built if limit is not None]
    models = list_models(task, user_limits)
    return (*limits, *build_user_limits(models, robot, limits, TABLE))


def joint_limits_of(robot: Robot) -> tuple[Limit, ...]:
    """List the limits of a robot without a task: those of its joints."""
    built = [kind.build(robot) for kind in JOINT_LIMITS.values()]
    return tuple(limit for limit in built if limit is not None)


def describe_guarantees(limits: Iterable[Limit]) -> dict[str, str]:
    """Say of each limit, by its name, where it holds."""
    return {limit.name: limit.guarantee.value for limit in limits}


__all__ = [
    "TABLE",
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
    "describe_guarantees",
    "joint_limits_of",
    "limits_of",
]
__dir__ = __all__.copy  # what completion shows
