"""Motion of all joints along a path, and its derivatives; see `brachis.kinematics.path_map`."""

from __future__ import annotations

import ctypes
from dataclasses import dataclass

import numpy as np

from brachis.kernel.chain import Chain
from brachis.kernel.library import address, as_doubles, load
from brachis.kernel.newton import Prescribed


@dataclass(frozen=True, eq=False)
class Conditions:
    """Linear conditions on the joints at K points of a path: C(s) q - p(s).

    Attributes
    ----------
    rows : (K, r, n) ndarray
        C.
    turning : (2, K, r, n) ndarray or None
        C' and C''; None where C is constant and p = 0.
    drift : (3, K, r) ndarray or None
        e = C' q - p', e' = C'' q - p'' and e'', likewise.
    """

    rows: np.ndarray
    turning: np.ndarray | None = None
    drift: np.ndarray | None = None


class _Course(ctypes.Structure):
    """`course` of path_motion.c."""

    _fields_ = [
        (name, ctypes.c_void_p)
        for name in (
            "xi",
            "xi_ds",
            "xi_dds",
            "rows",
            "turning",
            "drift",
            "ydot",
            "yddot",
        )
    ]


@dataclass(frozen=True, eq=False)
class PathMotion:
    """Motion at K points.

    Attributes
    ----------
    chain : Chain
    prescribed : Prescribed
    given : tuple of ndarray
        xi, xi_ds and xi_dds, (K, m); the conditions; ydot and yddot, (K, 1 + r).
    twists : (6, K, n) ndarray
        Columns of the tool's Jacobian.
    inverse : (K, n, n) ndarray
        Of J_aug, the task Jacobian with the rows of the conditions below.
    determinants : (K,) ndarray
        Of J_aug.
    gradient : (K, n, 1 + r) ndarray
        dq/dy.
    qdot, qddot : (K, n) ndarray
    """

    chain: Chain
    prescribed: Prescribed
    given: tuple[np.ndarray | None, ...]
    twists: np.ndarray
    inverse: np.ndarray
    determinants: np.ndarray
    gradient: np.ndarray
    qdot: np.ndarray
    qddot: np.ndarray

    @classmethod
    def of(
        cls,
        chain: Chain,
        prescribed: Prescribed,
        q: np.ndarray,
        path: tuple[np.ndarray, np.ndarray, np.ndarray],
        conditions: Conditions,
        curves: tuple[np.ndarray, np.ndarray],
    ) -> PathMotion:
        """Compute the motion in postures, (K, n), with ``path`` = xi, xi_ds, xi_dds and ``curves`` = ydot, yddot."""
        count, n = q.shape
        m = prescribed.count
        r = n - m
        turning = conditions.turning
        drift = conditions.drift
        given = (
            *(as_doubles(own, (count, m)) for own in path),
            as_doubles(conditions.rows, (count, r, n)),
            None if turning is None else as_doubles(turning, (2, count, r, n)),
            None if drift is None else as_doubles(drift, (3, count, r)),
            *(as_doubles(own, (count, 1 + r)) for own in curves),
        )
        found = (
            np.empty((6, count, n)),
            np.empty((count, n, n)),
            np.empty(count),
            np.empty((count, n, 1 + r)),
            np.empty((count, n)),
            np.empty((count, n)),
        )
        load().brachis_path_motion(
            chain.address,
            ctypes.addressof(prescribed.structure),
            ctypes.byref(_course(given)),
            count,
            address(as_doubles(q, (count, chain.n))),
            *map(address, found),
        )
        return cls(chain, prescribed, given, *found)

    def derivatives(self) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Differentiate qdot by y, and qddot by y and by ydot, (K, n, 1 + r) each."""
        qdot_y, qddot_ydot, qddot_y = np.empty((3, *self.gradient.shape))
        own = (self.twists, self.inverse, self.gradient, self.qdot, self.qddot)
        load().brachis_path_derivatives(
            self.chain.n,
            ctypes.addressof(self.prescribed.structure),
            ctypes.byref(_course(self.given)),
            len(self.qdot),
            *map(address, (*own, qdot_y, qddot_ydot, qddot_y)),
        )
        return qdot_y, qddot_y, qddot_ydot


def least_singular(inverses: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Find the least singular values, (K,), of matrices with these inverses, (K, n, n), and right singular vectors."""
    count, n, _ = inverses.shape
    values = np.empty(count)
    vectors = np.empty((count, n))
    kept = as_doubles(inverses, (count, n, n))
    load().brachis_least_singular(count, n, *map(address, (kept, values, vectors)))
    return values, vectors


def _course(given: tuple[np.ndarray | None, ...]) -> _Course:
    return _Course(*(None if own is None else address(own) for own in given))
