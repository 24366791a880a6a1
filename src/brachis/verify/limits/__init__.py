"""Ratios to limits by formulas of the verification's own, which share nothing with `brachis.limits`: a kind a file.

Only limits of a user's own that bring no check along are looked at by their own values (`own`), and marked so.
"""

from __future__ import annotations

from collections.abc import Sequence

from brachis.robot.custom_limits import LimitModel, custom_limits
from brachis.verify.limits.custom import check_own
from brachis.verify.limits.joint import (
    worst_acceleration,
    worst_jerk,
    worst_position,
    worst_velocity,
)
from brachis.verify.limits.protocol import Given, LimitCheck, Worst
from brachis.verify.limits.tool import (
    worst_least_process_speed,
    worst_process_speed,
    worst_tool_acceleration,
    worst_tool_angular_speed,
    worst_tool_speed,
)
from brachis.verify.limits.torque import (
    worst_power,
    worst_rms_torque,
    worst_torque,
    worst_torque_at_speed,
    worst_torque_rate,
    worst_total_power,
)
from brachis.verify.report import Check, VerifyOptions

TABLE: dict[str, LimitCheck] = {
    "torque": worst_torque,
    "velocity": worst_velocity,
    "acceleration": worst_acceleration,
    "position": worst_position,
    "tool_speed": worst_tool_speed,
    "tool_acceleration": worst_tool_acceleration,
    "tool_angular_speed": worst_tool_angular_speed,
    "process_speed": worst_process_speed,
    "least_process_speed": worst_least_process_speed,
    "power": worst_power,
    "total_power": worst_total_power,
    "torque_speed": worst_torque_at_speed,
    "rms_torque": worst_rms_torque,
    "jerk": worst_jerk,
    "torque_rate": worst_torque_rate,
}


def limit_checks(
    given: Given, further: Sequence[LimitModel], options: VerifyOptions
) -> list[Check]:
    """Check every kind of limit that there is, then those of the task's ``custom_limits`` and the `further` ones."""
    found = [
        (kind.replace("_", " "), worst)
        for kind, find in TABLE.items()
        if (worst := find(given)) is not None
    ]
    found += [
        check_own(model, given)
        for model in (*custom_limits(given.trajectory.task), *further)
    ]
    allowed = 1.0 + options.ratio_tolerance
    return [
        Check(
            f"{name} ratio",
            ratio,
            allowed,
            "-",
            ratio <= allowed,
            subject,
            time,
            remark,
            of_limit=True,
        )
        for name, (ratio, subject, time, remark) in found
    ]


__all__ = ["TABLE", "Given", "LimitCheck", "Worst", "limit_checks"]
