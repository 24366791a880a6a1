"""Ratios to limits by formulas of the verification's own, which share nothing with `brachis.limits`.

Only a user's own limit without a check is verified by its own values, and marked so.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np

from brachis.robot.custom_limits import (
    LimitModel,
    bind_model,
    check_ratios,
    has_check,
    list_models,
)
from brachis.task import LIMIT_KINDS
from brachis.verify.limits.clearance import worst_clearance
from brachis.verify.limits.joint import (
    JOINT_CHECKS,
    worst_torque_at_speed,
    worst_total_power,
)
from brachis.verify.limits.margins import MARGIN_CHECKS
from brachis.verify.limits.protocol import LimitCheck, Worst, worst_between
from brachis.verify.limits.tolerance import TOLERANCE_CHECKS
from brachis.verify.limits.tool import TOOL_CHECKS
from brachis.verify.motion import Given, MotionStates
from brachis.verify.report import Check

_AFTER: dict[str, dict[str, LimitCheck]] = {
    "position": TOOL_CHECKS,
    "power": {
        "total_power": worst_total_power,
        "torque_speed": worst_torque_at_speed,
    },
}
TABLE: dict[str, LimitCheck] = {}
"""By kind, in the order of the checks: a joint limit, then those that `_AFTER` lists for it."""
for _kind in LIMIT_KINDS:
    TABLE[_kind] = JOINT_CHECKS[_kind]
    TABLE |= _AFTER.get(_kind, {})
TABLE |= MARGIN_CHECKS
TABLE |= TOLERANCE_CHECKS
TABLE["clearance"] = worst_clearance


def check_limits(given: Given, user_limits: Sequence[LimitModel]) -> list[Check]:
    """Check every kind of limit that there is, then those of the task's ``custom_limits`` and the user's."""
    found = [(kind.replace("_", " "), find(given)) for kind, find in TABLE.items()]
    models = list_models(given.task, user_limits)
    found += [_check_model(where, model, given) for where, model in models.items()]
    allowed = 1.0 + given.options.ratio_tolerance
    return [
        Check(
            f"{name} ratio",
            worst.ratio,
            allowed,
            "-",
            worst.subject,
            worst.time,
            worst.remark,
            of_limit=True,
            is_kept=worst.is_kept,
        )
        for name, worst in found
        if worst is not None
    ]


def _check_model(where: str, model: LimitModel, given: Given) -> tuple[str, Worst]:
    """Find the worst ratio to a limit of the user's, and its name.

    A model may have a method ``check(robot, q, qdot, qddot, tau)`` that returns ratios, (K, c), by a formula other
    than the limit's. Without one, the limit's own values are checked densely.
    """
    limit = bind_model(where, model, given.robot)
    subjects = [label.subject for label in limit.labels]
    if not has_check(model):
        return limit.name, _check_values(limit, given, subjects)

    def ratios(states: MotionStates) -> np.ndarray:
        """Return the ratios by the model's own check, (K, c)."""
        motion = (states.q, states.qdot, states.qddot, states.tau)
        return check_ratios(where, model, given.robot, motion, len(subjects))

    return limit.name, worst_between(given, ratios, subjects)


def _check_values(limit: Any, given: Given, subjects: Sequence[str]) -> Worst:
    """Find the worst ratio by the values of a `brachis.limits.Limit` itself."""

    def ratios(states: MotionStates) -> np.ndarray:
        """Return the sizes of the limit's ratios, (K, c)."""
        return np.abs(limit.ratios(states, states.t))

    if limit.guarantee.is_mean:
        means = ratios(given.states)[0]
        column = int(np.argmax(means))
        time = given.states.t[-1]
        worst = Worst(means[column], subjects[column], time)
    else:
        worst = worst_between(given, ratios, subjects)
    return worst._replace(remark="checked by its own formula")
