"""Which chart to lay around a joint path: rows transversal to the self-motion along it, constant where one set will do.

The self-motion at a posture is the null space of the task Jacobian, with an orthonormal basis N (n, r). Rows C are
transversal where C N is regular; with orthonormal rows the least singular value of C N is 1 where they span the null
space itself and 0 where they miss a part of it. The best constant rows are the leading eigenvectors of the mean of
N N^T. Where these are not transversal enough, rows follow the null space, continued from place to place by the rotation
that brings its basis nearest to the one before (orthogonal Procrustes problem; P. H. Schoenemann, Psychometrika 31,
1966).
"""

from __future__ import annotations

import numpy as np

from brachis.errors import UnreachableError
from brachis.ik.newton import Newton, null_spaces
from brachis.kinematics.chart import DEGREE, ChartMap, ChartRows
from brachis.path import Path
from brachis.robot import TaskMap

_ENOUGH = 0.35
"""Least transversality of rows along the reference."""
_PLACES = (9, 17, 33, 65, 129)
"""Numbers of places through which rows that follow the null space are led, as few as are enough."""


def chart_around(
    task_map: TaskMap,
    path: Path,
    s: np.ndarray,
    reference: np.ndarray,
    rows: ChartRows | None = None,
) -> ChartMap:
    """Lay a chart around a joint path.

    Parameters
    ----------
    task_map : TaskMap
    path : Path
    s : (S,) ndarray
        Path coordinates from 0 to 1; where they do not grow, the first one counts, and at 1 the last one.
    reference : (S, n) ndarray
        Postures there.
    rows : ChartRows, optional
        Chosen here if not given.

    Returns
    -------
    ChartMap

    Raises
    ------
    UnreachableError
        The null space turns faster than rows can follow, as it does beside singularities of the arm.
    """
    kept = _growing(s)
    s = s[kept]
    reference = reference[kept]
    if rows is not None:
        return ChartMap(task_map, path, rows, s, reference)
    null = null_spaces(Newton(task_map).task_coordinates(reference)[1])
    r = null.shape[2]
    constant = np.linalg.eigh(np.einsum("kir,kjr->ij", null, null))[1][:, ::-1][:, :r].T
    if transversality(constant[None], null).min(initial=np.inf) >= _ENOUGH:
        return ChartMap(task_map, path, ChartRows.constant(constant), s, reference)
    following = np.swapaxes(_continue_bases(null), 1, 2)
    for count in _PLACES:
        places = np.unique(
            np.linspace(0, len(s) - 1, min(count, len(s))).round().astype(int)
        )
        if len(places) <= DEGREE:
            continue
        chosen = ChartRows.along(s[places], following[places], reference[places])
        if transversality(chosen.at(s)[0], null).min() >= _ENOUGH:
            return ChartMap(task_map, path, chosen, s, reference)
    raise UnreachableError(
        "the task Jacobian is nearly singular along the reference: no chart fits around it"
    )


def _growing(s: np.ndarray) -> np.ndarray:
    """Return where path coordinates (S,) have grown since the one before, and the first and the last place."""
    furthest = np.maximum.accumulate(s)
    apart = 1e-7
    grown = np.append(True, np.diff(furthest) > apart) & (s < s[-1] - apart)
    grown[0] = grown[-1] = True
    return np.flatnonzero(grown)


def transversality(rows: np.ndarray, null: np.ndarray) -> np.ndarray:
    """Least singular value of C N, (K,), of rows (K, r, n) and bases (K, n, r); infinite without redundancy."""
    if not null.shape[2]:
        return np.full(len(null), np.inf)
    return np.asarray(np.linalg.svd(rows @ null, compute_uv=False)[:, -1])


def moving_most(null: np.ndarray) -> np.ndarray:
    """For null spaces, (K, n, r), the r joints, (K, r), ascending, whose rows span most, by pivoting."""
    left = null.copy()
    chosen = []
    for _ in range(null.shape[2]):
        joint = np.argmax(np.linalg.norm(left, axis=2), axis=1)
        chosen.append(joint)
        row = left[np.arange(len(left)), joint]
        unit = row / np.maximum(np.linalg.norm(row, axis=1, keepdims=True), 1e-300)
        left = left - np.einsum("knr,kr->kn", left, unit)[:, :, None] * unit[:, None]
    return np.sort(
        np.array(chosen, dtype=int).reshape(null.shape[2], len(null)).T, axis=1
    )


def _continue_bases(null: np.ndarray) -> np.ndarray:
    """Turn each basis, (S, n, r), within its null space to be nearest to the one before."""
    turned = null.copy()
    for k in range(1, len(null)):
        left, _, right = np.linalg.svd(null[k].T @ turned[k - 1])
        turned[k] = null[k] @ left @ right
    return turned
