"""The change of t_E for a limit that rises by a finite step, from the problem linearised at its answer.

Multipliers are derivatives: they hold for steps so small that the same rows stay active. The linear program

    minimise dt_E    over dx    subject to    lower <= rows(x) + J dx <= upper

with the raised limit lets other rows take over within the step. Its optimum is no lower than what the multipliers
promise, since they are feasible for its dual; it tells how much of the promise other limits take back.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from brachis.nlp import Program

if TYPE_CHECKING:
    from scipy import sparse

_NEAR = 0.1
"""Rows farther from their bounds are left out at first; dimensionless."""
_LARGEST_STEP = 1.0
"""Of any variable: directions that change nothing to first order are not followed without end."""
_TOUCHED = 1e-9


def rows_and_jacobian(program: Program, x: np.ndarray) -> tuple[np.ndarray, sparse.csr_array]:
    """Evaluate the rows of a program, (c,), and their Jacobian, (c, v).

    Raises
    ------
    UnreachableError
        A collocation point is out of the branch's reach.
    """
    from scipy import sparse  # noqa: PLC0415

    places = (program.jacobian_rows, program.jacobian_columns)
    shape = (len(program.lower), len(x))
    return program.rows(x), sparse.coo_array((program.jacobian(x), places), shape=shape).tocsr()


def linearised_change(program: Program, x: np.ndarray) -> float | None:
    """Predict the change of t_E from the answer to a problem with less strict limits.

    Parameters
    ----------
    program : Program
        With the raised limit.
    x : (v,) ndarray
        Answer to the problem before.

    Returns
    -------
    float or None
        s; None where the linear program has no answer.

    Raises
    ------
    UnreachableError
        A collocation point is out of the branch's reach.
    """
    from scipy import sparse  # noqa: PLC0415

    rows, jacobian = rows_and_jacobian(program, x)
    below, above = np.isfinite(program.lower), np.isfinite(program.upper)
    slopes = sparse.vstack([-jacobian[np.flatnonzero(below)], jacobian[np.flatnonzero(above)]], format="csr")
    room = np.concatenate([(rows - program.lower)[below], (program.upper - rows)[above]])
    lowest = np.clip(program.x_lower - x, -_LARGEST_STEP, 0.0)
    highest = np.clip(program.x_upper - x, 0.0, _LARGEST_STEP)
    kept, gradient = room < _NEAR, program.gradient(x)
    while True:
        step = _solved(gradient, slopes[np.flatnonzero(kept)].toarray(), room[kept], lowest, highest)
        if step is None:
            return None
        overrun = slopes @ step > room + _TOUCHED
        if not (overrun & ~kept).any():
            return float(gradient @ step)
        kept |= overrun


def _solved(
    gradient: np.ndarray, slopes: np.ndarray, room: np.ndarray, lowest: np.ndarray, highest: np.ndarray
) -> np.ndarray | None:
    """Solve the linear program over some of the rows; None where it has no answer."""
    from scipy.optimize import linprog  # noqa: PLC0415

    bounds = list(zip(lowest.tolist(), highest.tolist(), strict=True))
    found = linprog(gradient, A_ub=slopes, b_ub=room, bounds=bounds, method="highs")
    return np.asarray(found.x) if found.success else None
