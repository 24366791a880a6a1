"""Limits on the motion: one kind per file, listed in `TABLE`.

A limit is a function of q, qdot, qddot and s, some of qdddot too. A new kind is its model in `task` (of joints, its
field in `robot.limits` as well), its file here with a line in `TABLE`, and a file in `verify.limits` with a line in the
table there. Nothing else asks which kind a limit is. Joint ranges are known elsewhere too: postures and turns are
chosen within them.

Examples
--------
>>> import brachis
>>> "torque" in brachis.limits.TABLE
True
"""

from __future__ import annotations

from collections.abc import Callable, Sequence

from brachis.limits.checks import bound_limits
from brachis.limits.joint import (
    build_acceleration,
    build_jerk,
    build_position,
    build_velocity,
)
from brachis.limits.power import build_power, build_total_power
from brachis.limits.process_speed import build_least_process_speed, build_process_speed
from brachis.limits.protocol import (
    Approach,
    Bound,
    Guarantee,
    JointMotion,
    Label,
    Limit,
    Moments,
    Partials,
    PhaseLines,
    Role,
)
from brachis.limits.tool import (
    build_tool_acceleration,
    build_tool_angular_speed,
    build_tool_speed,
)
from brachis.limits.torque import (
    build_rms_torque,
    build_torque,
    build_torque_rate,
    build_torque_speed,
)
from brachis.robot import Robot
from brachis.robot.custom_limits import LimitModel, custom_limits
from brachis.task import Task

Build = Callable[[Robot, Task], Limit | None]
"""Makes the limit of a kind for a task on a robot; None where nothing is limited."""

TABLE: dict[str, Build] = {
    "torque": build_torque,
    "velocity": build_velocity,
    "acceleration": build_acceleration,
    "position": build_position,
    "tool_speed": build_tool_speed,
    "tool_acceleration": build_tool_acceleration,
    "tool_angular_speed": build_tool_angular_speed,
    "process_speed": build_process_speed,
    "least_process_speed": build_least_process_speed,
    "power": build_power,
    "total_power": build_total_power,
    "torque_speed": build_torque_speed,
    "rms_torque": build_rms_torque,
    "jerk": build_jerk,
    "torque_rate": build_torque_rate,
}


def limits_of(
    robot: Robot,
    task: Task,
    further: Sequence[LimitModel] = (),
    approach: Approach | None = None,
) -> tuple[Limit, ...]:
    """List the limits of a task on a robot.

    Parameters
    ----------
    robot : Robot
    task : Task
    further : sequence of LimitModel, optional
        A user's own, beside those of the table and of the task's ``custom_limits``.
    approach : Approach, optional
        How speeds are reached along the path; bounds of parts of the path set in at once where it is left out.

    Returns
    -------
    tuple of Limit
        In the order of the table, then the user's.

    Raises
    ------
    InputError
        A limit of the user's own does not fit the robot, or is none (see `bound_limits`).
    """
    built = tuple(
        limit for build in TABLE.values() if (limit := build(robot, task)) is not None
    )
    named = bound_limits(custom_limits(task), robot, built, "custom_limits")
    limits = (
        *built,
        *named,
        *bound_limits(further, robot, (*built, *named), "own_limits"),
    )
    return (
        limits if approach is None else tuple(limit.along(approach) for limit in limits)
    )


__all__ = [
    "TABLE",
    "Approach",
    "Bound",
    "Guarantee",
    "JointMotion",
    "Label",
    "Limit",
    "LimitModel",
    "Moments",
    "Partials",
    "PhaseLines",
    "Role",
    "limits_of",
]
