"""Adding the limits of a controller to those of a robot."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from brachis.apps.controller.axes import ControllerAxes
from brachis.apps.controller.profile import Profile
from brachis.errors import InputError
from brachis.robot import Robot
from brachis.robot.from_task import replace_limits
from brachis.robot.limits import MAGNITUDES
from brachis.task import LIMIT_KINDS, LimitSpec
from brachis.task.limit_models import FROM_URDF, map_by_joint


def robot_with_profile(robot: Robot, profile: Profile, axes: ControllerAxes) -> Robot:
    """Return a robot in which each limit is the stricter of its own and that of the profile.

    Raises
    ------
    InputError
        A list in the profile does not have one value per axis of the arm, or the limits do not fit the robot.
    """
    arm = [
        joint
        for joint, is_external in zip(axes.joints, axes.external, strict=True)
        if not is_external
    ]
    changes: dict[str, Any] = {}
    unscaled = without_scale(robot)
    for kind in MAGNITUDES:
        stated = getattr(profile.limits, kind)
        usual = LIMIT_KINDS[kind].usual
        needs_masses = LIMIT_KINDS[kind].needs_masses and not robot.has_masses
        if stated in (None, FROM_URDF) or needs_masses:
            continue
        if isinstance(stated, tuple) and len(stated) != len(arm):
            raise InputError(
                "wrong number of values",
                where=f"profile.limits.{kind}",
                found=len(stated),
                allowed=f"{len(arm)}, for the arm; limits of external axes need a mapping by joint",
            )
        names = axes.joints if isinstance(stated, Mapping) else arm
        lower, upper = unscaled.limits.both_ways(kind)
        value: Any
        for joint, value in map_by_joint(
            f"profile.limits.{kind}", stated, names, None
        ).items():
            number = robot.joint_names.index(joint)
            low, high = value if isinstance(value, tuple) else (-value, value)
            pair = (max(lower[number], low), min(upper[number], high))
            if usual and usual.overridden:
                override = robot.settings.speed_override
                pair = (pair[0] / override, pair[1] / override)
            is_pair = LIMIT_KINDS[kind].form == "pair"
            changes.setdefault(kind, {})[joint] = pair if is_pair else pair[1]
    if not changes:
        return robot
    return replace_limits(robot, LimitSpec(**changes))


def without_scale(robot: Robot) -> Robot:
    """Return a robot without the factors in ``robot.limits.scale``."""
    scale = robot.settings.limits.scale
    inverse = {kind: 1.0 / factor for kind, factor in scale if factor != 1.0}
    return robot.with_limits(scale=inverse) if inverse else robot
