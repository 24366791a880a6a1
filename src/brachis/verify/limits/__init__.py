"""Ratios to limits by formulas of the verification's own, which share nothing with `brachis.limits`: a kind a file.

Only limits of a user's own that bring no check along are looked at by their own values (`own`), and marked so.
"""

from __future__ import annotations

from collections.abc import Sequence

from brachis.custom_limits import LimitModel, custom_limits
from brachis.verify.limits import (
    drives,
    joint_rate,
    position,
    process_speed,
    tool_motion,
    tool_speed,
    torque,
    torque_rate,
)
from brachis.verify.limits.own import check_own
from brachis.verify.limits.protocol import Given, LimitCheck, Worst
from brachis.verify.options import VerifyOptions
from brachis.verify.report import Check

TABLE: dict[str, LimitCheck] = {
    "torque": torque.worst,
    "velocity": joint_rate.worst_velocity,
    "acceleration": joint_rate.worst_acceleration,
    "position": position.worst,
    "tool_speed": tool_speed.worst,
    "tool_acceleration": tool_motion.worst_acceleration,
    "tool_angular_speed": tool_motion.worst_angular_speed,
    "process_speed": process_speed.worst_above,
    "least_process_speed": process_speed.worst_below,
    "power": drives.worst_power,
    "total_power": drives.worst_total_power,
    "torque_speed": drives.worst_torque_at_speed,
    "rms_torque": drives.worst_rms_torque,
    "jerk": joint_rate.worst_jerk,
    "torque_rate": torque_rate.worst,
}


def limit_checks(given: Given, further: Sequence[LimitModel], options: VerifyOptions) -> list[Check]:
    """Check every kind of limit that there is, then those of the task's ``custom_limits`` and the `further` ones."""
    found = [(kind.replace("_", " "), worst) for kind, find in TABLE.items() if (worst := find(given)) is not None]
    found += [check_own(model, given) for model in (*custom_limits(given.trajectory.task), *further)]
    allowed = 1.0 + options.ratio_tolerance
    return [
        Check(f"{name} ratio", ratio, allowed, "-", ratio <= allowed, subject, time, remark, of_limit=True)
        for name, (ratio, subject, time, remark) in found
    ]


__all__ = ["TABLE", "Given", "LimitCheck", "Worst", "limit_checks"]
