"""Small nonlinear programs with known optima that implement `brachis.optimise.backends.NonlinearProgram`."""

from __future__ import annotations

import time
from collections.abc import Callable
from dataclasses import dataclass, field

import numpy as np

from brachis.errors import UnreachableError

Rows = Callable[[np.ndarray], np.ndarray]


@dataclass
class Program:
    """Minimise ``costs @ x`` under rows of which every entry may differ from zero.

    Where a place `near` is given, half the squared distance from it is added.
    """

    costs: np.ndarray
    row_values: Rows
    row_slopes: Callable[[np.ndarray], np.ndarray]
    lower: np.ndarray
    upper: np.ndarray
    x_lower: np.ndarray
    x_upper: np.ndarray
    reachable: Callable[[np.ndarray], bool] = lambda _x: True
    pause: float = 0.0
    interrupt_at: int | None = None
    near: np.ndarray | None = None
    evaluations: list[np.ndarray] = field(default_factory=list)
    refusals: int = 0

    def __post_init__(self) -> None:
        rows, columns = np.indices((len(self.lower), len(self.costs)))
        self.jacobian_rows, self.jacobian_columns = rows.ravel(), columns.ravel()

    def objective(self, x):
        return float(self.costs @ x) + (
            0.0 if self.near is None else 0.5 * float((x - self.near) @ (x - self.near))
        )

    def gradient(self, x):
        return self.costs + (0.0 if self.near is None else x - self.near)

    def rows(self, x):
        self._visit(x)
        return self.row_values(x)

    def jacobian(self, x):
        self._visit(x)
        return self.row_slopes(x).ravel()

    def curvature(self, _x):
        return None

    def _visit(self, x) -> None:
        self.evaluations.append(x.copy())
        time.sleep(self.pause)
        if len(self.evaluations) == self.interrupt_at:
            raise KeyboardInterrupt
        if not self.reachable(x):
            self.refusals += 1
            raise UnreachableError("beyond the edge")


def disc(**more) -> Program:
    """Leftmost point of the disc about (3, 1) of radius 2: x = (1, 1), and its row's multiplier is -1/4.

    L = x0 - mu ((x0 - 3)^2 + (x1 - 1)^2) is stationary at (1, 1) for 1 + 4 mu = 0.
    """
    centre = np.array([3.0, 1.0])
    return Program(
        costs=np.array([1.0, 0.0]),
        row_values=lambda x: np.array([(x - centre) @ (x - centre)]),
        row_slopes=lambda x: 2.0 * (x - centre)[None],
        lower=np.array([-np.inf]),
        upper=np.array([4.0]),
        x_lower=np.array([-50.0, -np.inf]),
        x_upper=np.array([50.0, np.inf]),
        **more,
    )


def nearest_in_disc() -> Program:
    """The point of the disc nearest to (6, 5): (4.2, 2.6), and its row's multiplier is -3/4.

    x - (6, 5) = 2 mu (x - (3, 1)) with x = (3, 1) + 2 (3, 4) / 5 gives mu = -3/4.
    """
    problem = disc()
    problem.costs, problem.near = np.zeros(2), np.array([6.0, 5.0])
    return problem


def corner() -> Program:
    """Minimise x0 under x0 - 2 x1 >= 1, x0 + x1 = 4: x = (3, 1), multipliers 1/3 and 2/3."""
    slopes = np.array([[1.0, -2.0], [1.0, 1.0]])
    return Program(
        costs=np.array([1.0, 0.0]),
        row_values=lambda x: slopes @ x,
        row_slopes=lambda _x: slopes,
        lower=np.array([1.0, 4.0]),
        upper=np.array([np.inf, 4.0]),
        x_lower=np.full(2, -np.inf),
        x_upper=np.full(2, np.inf),
    )


def under_hyperbola() -> Program:
    """Minimise x1 under x0 x1 >= 2 and 0 <= x0 <= 4: x = (4, 1/2), where the bound of x0 is active."""
    return Program(
        costs=np.array([0.0, 1.0]),
        row_values=lambda x: np.array([x[0] * x[1]]),
        row_slopes=lambda x: np.array([[x[1], x[0]]]),
        lower=np.array([2.0]),
        upper=np.array([np.inf]),
        x_lower=np.array([0.0, 0.0]),
        x_upper=np.array([4.0, np.inf]),
    )


def impossible() -> Program:
    """A point in the unit disc that lies beyond x0 = 2."""
    return Program(
        costs=np.array([1.0, 0.0]),
        row_values=lambda x: np.array([x @ x, x[0]]),
        row_slopes=lambda x: np.array([2.0 * x, [1.0, 0.0]]),
        lower=np.array([-np.inf, 2.0]),
        upper=np.array([1.0, np.inf]),
        x_lower=np.full(2, -np.inf),
        x_upper=np.full(2, np.inf),
    )
