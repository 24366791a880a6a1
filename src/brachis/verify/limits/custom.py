"""Limits of the user's own: checked by a formula that they bring along, or by their own values, densely."""

from __future__ import annotations

from types import SimpleNamespace

import numpy as np

from brachis.errors import InputError
from brachis.robot.custom_limits import LimitModel
from brachis.verify.limits.protocol import Given, Worst, worst_between
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
            s = given.s_at(states.t)
            motion = SimpleNamespace(
                q=states.q,
                qdot=states.qdot,
                qddot=states.qddot,
                qdddot=states.qdddot,
                s=s,
            )
            return np.abs(limit.ratios(motion, states.t))
        found = np.abs(
            independent(given.robot, states.q, states.qdot, states.qddot, states.tau)
        )
        if found.shape != (len(states.t), len(limit.labels)):
            allowed = f"{(len(states.t), len(limit.labels))}, a ratio for every moment and label"
            where = f"{type(model).__name__}.check"
            raise InputError(
                "has the wrong shape", where=where, found=found.shape, allowed=allowed
            )
        return found

    subjects = [label.subject for label in limit.labels]
    if independent is None and limit.guarantee.is_mean:
        whole = ratios(given.states)[0]
        worst = Worst(
            float(whole.max()),
            subjects[int(np.argmax(whole))],
            float(given.states.t[-1]),
        )
    else:
        worst = worst_between(given, ratios, subjects)
    return limit.name, worst if independent else worst._replace(remark=_OWN_FORMULA)
