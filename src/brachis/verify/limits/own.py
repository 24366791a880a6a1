"""Limits of the user's own: checked by a formula that they bring along, or by their own values, densely."""

from __future__ import annotations

import numpy as np

from brachis.custom_limits import LimitModel
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
            return np.abs(limit.ratio(limit.values(states)))
        return np.abs(independent(given.robot, states.q, states.qdot, states.qddot, states.tau))

    worst = worst_between(given, ratios, [label.subject for label in limit.labels])
    return limit.name, worst if independent else worst._replace(remark=_OWN_FORMULA)
