"""What a constraint on the joint motion is."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Protocol

import numpy as np

from brachis.kinematics import Decomposition, JointState


@dataclass(frozen=True)
class Partials:
    """Partial derivatives of a constraint's c values at K times, each (K, c, n), or None where they vanish."""

    q: np.ndarray | None = None
    qdot: np.ndarray | None = None
    qddot: np.ndarray | None = None


class Constraint(Protocol):
    """c values of the joint motion at every collocation point, held between bounds.

    Attributes
    ----------
    kind : str
        Key in the table of constraints.
    labels : tuple of str
        What each of the c values belongs to, for example a joint name.
    timed : bool
        True where a longer end time relieves it: velocity, acceleration, torque.
    physical : bool
        True for a limit of the robot; False for one that only guards the computation.
    lower, upper : (c,) ndarray
        Bounds, dimensionless: values are divided by their limits.
    excess_scale : (c,) ndarray
        Excess over a limit, as refinement and verification measure it, for a value that is beyond its bound by 1.
    """

    kind: str
    labels: tuple[str, ...]
    timed: bool
    physical: bool
    lower: np.ndarray
    upper: np.ndarray
    excess_scale: np.ndarray

    def values(self, state: JointState) -> np.ndarray:
        """Values (K, c)."""
        ...

    def partials(self, state: JointState) -> Partials:
        """Differentiate `values` with respect to q, qdot, qddot, each taken as independent."""
        ...


class Build(Protocol):
    """Makes a constraint for a decomposition, or None where nothing is limited."""

    def __call__(self, decomposition: Decomposition, margin: float, /) -> Constraint | None:
        """Build the constraint; `margin` is the least branch margin, which most do not need."""
        ...
