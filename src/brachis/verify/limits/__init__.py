"""Ratios to limits, computed with the verification's own formulas, which share no code with `brachis.limits`.

Only a user's own limit that has no method `check` is verified with its own values, and the result of its check says so.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from brachis.robot.custom_limits import (
    LimitModel,
    bind_model,
    check_ratios,
    has_check,
    list_models,
)
from brachis.verify.limits.clearance import worst_clearance
from brachis.verify.limits.joint import DRIVE_CHECKS, JOINT_CHECKS
from brachis.verify.limits.margins import MARGIN_CHECKS
from brachis.verify.limits.protocol import LimitCheck, Worst, worst_between
from brachis.verify.limits.tool import TOOL_CHECKS
from brachis.verify.motion import CheckedMotion, MotionStates
from brachis.verify.report import Check

LIMIT_CHECKS: dict[str, LimitCheck] = {
    **JOINT_CHECKS,
    **DRIVE_CHECKS,
    **TOOL_CHECKS,
    **MARGIN_CHECKS,
    "clearance": worst_clearance,
}
"""The check of each kind of limit, in the order in which the verification runs them."""


def check_limits(
    motion: CheckedMotion, own_limits: Sequence[LimitModel]
) -> list[Check]:
    """Check all kinds of limits, then the limits of the task's ``custom_limits`` and the user's own limits."""
    results = [
        (kind.replace("_", " "), find(motion)) for kind, find in LIMIT_CHECKS.items()
    ]
    models = list_models(motion.task, own_limits)
    results += [_check_model(where, model, motion) for where, model in models.items()]
    allowed = 1.0 + motion.options.ratio_tolerance
    return [
        Check(
            f"{name} ratio",
            worst.ratio,
            allowed,
            "-",
            worst.subject,
            worst.time,
            worst.remark,
            name,
            worst.is_kept,
        )
        for name, worst in results
        if worst is not None
    ]


def _check_model(
    where: str, model: LimitModel, motion: CheckedMotion
) -> tuple[str, Worst]:
    """Find the largest ratio of a value to its bound in one of the user's own limits; return it with the limit's name.

    A model may have a method ``check(robot, q, qdot, qddot, tau)`` that returns ratios, (K, c), computed by a different
    formula. Without this method, the limit's own values are checked densely.
    """
    limit = bind_model(where, model, motion.robot)
    subjects = [label.subject for label in limit.labels]

    def ratios(states: MotionStates) -> np.ndarray:
        """Return the magnitudes of the ratios, (K, c)."""
        if not has_check(model):
            return np.abs(limit.ratios(states, states.t))
        arguments = (states.q, states.qdot, states.qddot, states.tau)
        return check_ratios(where, model, motion.robot, arguments, len(subjects))

    worst = worst_between(motion, ratios, subjects)
    if has_check(model):
        return limit.name, worst
    if limit.guarantee.is_mean:
        worst = worst._replace(time=motion.states.t[-1])
    return limit.name, worst._replace(remark="checked by its own formula")
