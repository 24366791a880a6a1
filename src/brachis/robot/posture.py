"""A posture as a user gives it: joint positions in chain order, or by joint name."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from numbers import Real
from typing import Any

import numpy as np

from brachis.errors import InputError
from brachis.robot.limits import FARTHEST
from brachis.task.limit_models import per_joint_values

_ALLOWED = "a list of numbers, one for each joint, or a mapping of joint names to numbers; rad or m"


def read_posture(
    joints: Any, names: Sequence[str], defaults: Mapping[str, float], where: str
) -> np.ndarray:
    """Check joint positions and return them in chain order.

    Parameters
    ----------
    joints : (n,) array, sequence or mapping of str to float
        rad or m.
    names : sequence of str
        The joints of the chain.
    defaults : mapping of str to float
        Default positions of the last joints, which may be left out of `joints`.
    where : str
        Where the posture is given, for messages.

    Returns
    -------
    (n,) ndarray

    Raises
    ------
    InputError, UnknownNameError
        The position of a joint is missing, not a number or not finite; a joint is unknown; or the list has the wrong
        length.
    """
    if isinstance(joints, Mapping):
        joints = {**defaults, **joints}
    else:
        is_list = isinstance(joints, Sequence) and not isinstance(joints, str | bytes)
        if not is_list and np.ndim(joints) != 1:
            raise InputError(
                "wrong type", where=where, found=repr(joints), allowed=_ALLOWED
            )
        joints = list(joints)
        is_short = len(joints) == len(names) - len(defaults)
        joints = [*joints, *defaults.values()] if is_short else joints
    values = per_joint_values(where, joints, names, None)
    pairs = zip(names, values, strict=True)
    missing = [name for name, value in pairs if value is None]
    if missing:
        raise InputError(
            f"no position for {', '.join(missing)}",
            where=where,
            allowed="a position for each joint",
        )
    if not all(isinstance(q_i, Real) and not isinstance(q_i, bool) for q_i in values):
        raise InputError(
            "a joint position is not a number",
            where=where,
            found=values,
            allowed=_ALLOWED,
        )
    q = np.array(values, dtype=float)
    if not np.all(np.abs(q) <= FARTHEST):
        raise InputError(
            "a joint position is out of range",
            where=where,
            found=q.tolist(),
            allowed=f"finite numbers, within {FARTHEST:g} rad or m of zero",
        )
    return q
