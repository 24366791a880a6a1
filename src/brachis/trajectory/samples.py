"""A trajectory at given times, and arrays that cannot be written to."""

from __future__ import annotations

from dataclasses import dataclass, fields
from typing import Any

import numpy as np


@dataclass(frozen=True, eq=False)
class Samples:
    """A trajectory at K times; joints in chain order. The arrays are read-only.

    Attributes
    ----------
    t : (K,) ndarray
        s.
    s : (K,) ndarray
        Path coordinate, dimensionless.
    q, qdot, qddot, tau : (K, n) ndarray
        Position (rad or m), velocity, acceleration, torque (Nm or N).
    """

    t: np.ndarray
    s: np.ndarray
    q: np.ndarray
    qdot: np.ndarray
    qddot: np.ndarray
    tau: np.ndarray

    def __post_init__(self) -> None:
        """Take copies that nobody can write to."""
        freeze(self, *(field.name for field in fields(self)))


def freeze(owner: Any, *names: str) -> None:  # noqa: ANN401  (any frozen dataclass)
    """Replace arrays of a frozen dataclass by read-only copies of its own."""
    for name in names:
        own = np.array(getattr(owner, name), dtype=float)
        own.setflags(write=False)
        object.__setattr__(owner, name, own)
