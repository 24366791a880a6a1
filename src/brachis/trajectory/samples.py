"""A trajectory at given times."""

from __future__ import annotations

from dataclasses import dataclass, fields

import numpy as np

from brachis.arrays import freeze


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
