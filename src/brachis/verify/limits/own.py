"""Limits of the user's own: checked by a formula that they bring along, or by their own values, densely."""

from __future__ import annotations

import numpy as np

from brachis.custom_limits import LimitModel
from brachis.errors import InputError
from brachis.verify.limits.peaks import worst_between
from brachis.verify.limits.protocol import Given, Worst
from brachis.verify.motion import States

_OWN_FORMULA = "checked by its own formula"


def check_own(model: LimitModel, given: Given) -> tuple[str, Worst]:
    """Find the worst ratio to a limit of the user's, and its name.

    A model may have a method ``check(robot, q, qdot, qddot, tau)`` that returns ratios, (K, c), by a formula other
    than the limit's; without one, the limit's own values are looked at wherever the motion is.
    """
    limit = model.bind(given.robot)
    independent = getattr(model, "check", None)

    def ratios(states: States) -> np.ndarray:
        if independent is None:
            values = limit.values(states)
            return 1.0 + np.maximum(values - limit.upper, limit.lower - values) * limit.violation_scale
        found = np.abs(independent(given.robot, states.q, states.qdot, states.qddot, states.tau))
        if found.shape != (len(states.t), len(limit.labels)):
            allowed = f"{(len(states.t), len(limit.labels))}, a ratio for every moment and label"
            where = f"{type(model).__name__}.check"
            raise InputError("has the wrong shape", where=where, found=found.shape, allowed=allowed)
        return found

    worst = worst_between(given, ratios, [label.subject for label in limit.labels])
    return limit.name, worst if independent else worst._replace(remark=_OWN_FORMULA)
