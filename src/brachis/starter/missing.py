"""Limits that a URDF leaves open and a plan needs: placeholders that the task file marks as such."""

from __future__ import annotations

from collections.abc import Sequence

from brachis.robot.limits import UrdfLimit
from brachis.task import LimitSpec

_ACCELERATION = 1.0
"""Placeholder, rad/s^2 or m/s^2: of a careful machine."""
_RANGE = (-1.5, 1.5)
"""Placeholder, rad or m."""


def placeholders(names: Sequence[str], stated: Sequence[UrdfLimit]) -> LimitSpec:
    """Return limits for the joints of which a URDF states no usable ones; what it states stays.

    Limits of zero, and a range from zero to zero, are what exporters write where there is none. Without a torque a
    joint gets a limit of acceleration, since its time would go to zero otherwise.
    """
    by_name = dict(zip(names, stated, strict=True))
    weak = [name for name, limit in by_name.items() if not limit.effort]
    slow = [name for name, limit in by_name.items() if not limit.velocity]
    open_ended = [name for name, limit in by_name.items() if limit.needs_range or _is_empty(limit)]
    given: dict[str, dict[str, object]] = {
        "torque": dict.fromkeys(weak),
        "acceleration": dict.fromkeys(weak, _ACCELERATION),
        "velocity": dict.fromkeys(slow),
        "position": dict.fromkeys(open_ended, _RANGE),
    }
    return LimitSpec(**{kind: values for kind, values in given.items() if values})  # type: ignore[arg-type]


def _is_empty(limit: UrdfLimit) -> bool:
    return limit.lower is not None and limit.lower == limit.upper
