"""A pull towards a point: of motions that are about equally fast, a solver then finds the one nearest to it.

With several redundant joints, or few limits that hold the motion back, very many motions are about equally fast. A
solver that only has to mend a small violation may wander among them, to where other limits are exceeded by far.
"""

from __future__ import annotations

import numpy as np

from brachis.optimise.backends import Curvature, Problem


class Pulled:
    """A program with half the squared distance from a point, times a weight, added to its objective; a `Problem`.

    Parameters
    ----------
    program : Problem
    x : (v,) ndarray
        The point.
    weight : float
        Objective per square of a variable's unit.
    """

    def __init__(self, program: Problem, x: np.ndarray, weight: float) -> None:
        self._program = program
        self._x = x
        self._weight = weight
        self.x_lower = program.x_lower
        self.x_upper = program.x_upper
        self.lower = program.lower
        self.upper = program.upper
        self.jacobian_rows = program.jacobian_rows
        self.jacobian_columns = program.jacobian_columns
        self.rows = program.rows
        self.jacobian = program.jacobian

    def objective(self, x: np.ndarray) -> float:
        """Objective of the program, and the pull."""
        pull = 0.5 * self._weight * float(np.sum((x - self._x) ** 2))
        return self._program.objective(x) + pull

    def gradient(self, x: np.ndarray) -> np.ndarray:
        """Gradient of the objective."""
        return self._program.gradient(x) + self._weight * (x - self._x)

    def curvature(self, x: np.ndarray) -> Curvature:
        """Return what the program knows of its Hessian, and that of the pull."""
        own = self._program.curvature(x)
        of_pull = self._weight * np.eye(len(x))

        def find_hessian(
            x: np.ndarray, objective_multiplier: float, multipliers: np.ndarray
        ) -> np.ndarray:
            """Return the known part of the program, and that of the pull."""
            hessian = objective_multiplier * of_pull
            if own is not None:
                hessian += own.hessian(x, objective_multiplier, multipliers)
            return hessian

        guess = np.zeros(len(self.lower)) if own is None else own.multipliers
        return Curvature(find_hessian, guess)
