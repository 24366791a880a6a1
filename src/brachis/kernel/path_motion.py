"""Motion of all joints along a path, and its derivatives; see `brachis.kinematics.path_map`."""

from __future__ import annotations

import ctypes
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from brachis.kernel.chain import Chain
from brachis.kernel.library import address, as_doubles, as_doubles_at_points, load
from brachis.kernel.newton import Prescribed


@dataclass(frozen=True, eq=False)
class Conditions:
    """Linear functions C(s) q - p(s) of the joints at K points of a path.

    Attributes
    ----------
    rows : (K, r, n) ndarray
        C; (r, n) where it is constant.
    turning : (2, K, r, n) ndarray or None
        C' and C''; None where C is constant and p = 0.
    drift : (3, K, r) ndarray or None
        e = C' q - p', e' = C'' q - p'' and e'', likewise.
    """

    rows: np.ndarray
    turning: np.ndarray | None = None
    drift: np.ndarray | None = None


_GIVEN = ("q", "xi", "xi_ds", "xi_dds", "rows", "ydot", "yddot", "turning", "drift")
_FOUND = ("twists", "inverse", "determinants", "gradient", "qdot", "qddot")
_SLOPES = ("qdot_y", "qddot_y", "qddot_ydot")


class _PathMotion(ctypes.Structure):
    """`path_motion` of motion.h."""

    _fields_ = [
        ("arm", ctypes.c_void_p),
        ("asked", ctypes.c_void_p),
        ("count", ctypes.c_long),
        ("rows_step", ctypes.c_long),
        *((name, ctypes.c_void_p) for name in (*_GIVEN, *_FOUND, *_SLOPES)),
        ("is_differentiated", ctypes.c_long),
    ]


@dataclass(frozen=True, eq=False)
class PathMotion:
    """Motion at K points.

    Attributes
    ----------
    chain : Chain
    prescribed : Prescribed
    given : tuple of (ndarray or None)
        From which it was computed, contiguous: what is named in `_GIVEN`.
    rows_step : int
        Offset between the rows of successive points, in doubles; 0 if all points share them.
    twists : (6, K, n) ndarray
        Columns of the tool's Jacobian.
    inverse : (K, n, n) ndarray
        Of J_aug, the task Jacobian with the rows of the conditions below.
    determinants : (K,) ndarray
        Of J_aug.
    gradient : (K, n, 1 + r) ndarray
        dq/dy.
    qdot, qddot : (K, n) ndarray
    slopes : tuple of (K, n, 1 + r) ndarray
        Room for dqdot/dy, dqddot/dy and dqddot/dydot.
    """

    chain: Chain
    prescribed: Prescribed
    given: tuple[np.ndarray | None, ...]
    rows_step: int
    twists: np.ndarray
    inverse: np.ndarray
    determinants: np.ndarray
    gradient: np.ndarray
    qdot: np.ndarray
    qddot: np.ndarray
    slopes: tuple[np.ndarray, np.ndarray, np.ndarray]

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
        count = len(q)
        n = chain.n
        m = prescribed.count
        c = 1 + n - m
        given = [as_doubles(q, (count, n))]
        given += [as_doubles(own, (count, m)) for own in path]
        rows, step = as_doubles_at_points(conditions.rows, (count, n - m, n))
        given.append(rows)
        given += [as_doubles(own, (count, c)) for own in curves]
        turning = conditions.turning
        drift = conditions.drift
        if turning is not None or drift is not None:
            turning = as_doubles(turning, (2, count, n - m, n))
            drift = as_doubles(drift, (3, count, n - m))
        slopes = np.empty((3, count, n, c))
        motion = cls(
            chain,
            prescribed,
            (*given, turning, drift),
            step,
            np.empty((6, count, n)),
            np.empty((count, n, n)),
            np.empty(count),
            np.empty((count, n, c)),
            np.empty((count, n)),
            np.empty((count, n)),
            (slopes[0], slopes[1], slopes[2]),
        )
        load().brachis_path_motion(motion.address)
        return motion

    @cached_property
    def _structure(self) -> _PathMotion:
        """What the library reads, and where it writes."""
        found = (getattr(self, name) for name in _FOUND)
        parts = (*self.given, *found, *self.slopes)
        addresses = (None if own is None else address(own) for own in parts)
        asked = ctypes.addressof(self.prescribed.structure)
        before = (self.chain.address, asked, len(self.qdot), self.rows_step)
        return _PathMotion(*before, *addresses)

    @property
    def address(self) -> int:
        """Where the library finds the motion."""
        return ctypes.addressof(self._structure)

    def __getstate__(self) -> dict[str, object]:
        """Leave addresses behind."""
        return {name: value for name, value in vars(self).items() if name[0] != "_"}

    def derivatives(self) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Differentiate qdot by y, and qddot by y and by ydot, (K, n, 1 + r) each; once."""
        load().brachis_path_derivatives(self.address)
        return self.slopes

    def singular_slopes(
        self, values: np.ndarray, vectors: np.ndarray
    ) -> tuple[np.ndarray, np.ndarray]:
        """Differentiate what `find_least_singular` gives for J_aug, (K,), by q, (K, n), and by s, (K,)."""
        by_q = np.empty_like(self.qdot)
        by_s = np.empty(len(by_q))
        singular = as_doubles(values, by_s.shape), as_doubles(vectors, by_q.shape)
        places = map(address, (*singular, by_q, by_s))
        load().brachis_singular_slopes(self.address, *places)
        return by_q, by_s


def find_least_singular(inverses: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Find the least singular values, (K,), of matrices with these inverses, (K, n, n), and right singular vectors."""
    count, n, _ = inverses.shape
    values = np.empty(count)
    vectors = np.empty((count, n))
    kept = as_doubles(inverses, (count, n, n))
    load().brachis_least_singular(count, n, *map(address, (kept, values, vectors)))
    return values, vectors
