"""Motion of all joints along a path, and its derivatives; see `brachis.kinematics.path_map`."""

from __future__ import annotations

import ctypes
from dataclasses import dataclass, fields, replace
from functools import cached_property

import numpy as np

from brachis.kernel.chain import Chain
from brachis.kernel.library import address, as_doubles, load
from brachis.kernel.newton import Prescribed


@dataclass(frozen=True, eq=False)
class Conditions:
    """Linear functions C(s) q - p(s) of the joints at K points of a path.

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


@dataclass(frozen=True, eq=False)
class _Given:
    """What the library reads, contiguous; see `course` of path_motion.c."""

    xi: np.ndarray
    xi_ds: np.ndarray
    xi_dds: np.ndarray
    rows: np.ndarray
    ydot: np.ndarray
    yddot: np.ndarray
    turning: np.ndarray | None = None
    drift: np.ndarray | None = None

    @cached_property
    def structure(self) -> _Course:
        """Return the addresses; they hold as long as this object lives."""
        parts = (getattr(self, own.name) for own in fields(self))
        return _Course(*(None if own is None else address(own) for own in parts))

    def __getstate__(self) -> dict[str, object]:
        """Leave addresses behind."""
        return {own.name: getattr(self, own.name) for own in fields(self)}


class _Course(ctypes.Structure):
    """`course` of path_motion.c."""

    _fields_ = [(own.name, ctypes.c_void_p) for own in fields(_Given)]


@dataclass(frozen=True, eq=False)
class PathMotion:
    """Motion at K points.

    Attributes
    ----------
    chain : Chain
    prescribed : Prescribed
    given : _Given
        From which it was computed.
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
    given: _Given
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
        postures = as_doubles(q, (count, chain.n))
        xi, xi_ds, xi_dds = path
        ydot, yddot = curves
        given = _Given(
            xi=as_doubles(xi, (count, m)),
            xi_ds=as_doubles(xi_ds, (count, m)),
            xi_dds=as_doubles(xi_dds, (count, m)),
            rows=as_doubles(conditions.rows, (count, r, n)),
            ydot=as_doubles(ydot, (count, 1 + r)),
            yddot=as_doubles(yddot, (count, 1 + r)),
        )
        if conditions.turning is not None or conditions.drift is not None:
            given = replace(
                given,
                turning=as_doubles(conditions.turning, (2, count, r, n)),
                drift=as_doubles(conditions.drift, (3, count, r)),
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
            ctypes.byref(given.structure),
            count,
            address(postures),
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
            ctypes.byref(self.given.structure),
            len(self.qdot),
            *map(address, (*own, qdot_y, qddot_ydot, qddot_y)),
        )
        return qdot_y, qddot_y, qddot_ydot

    def singular_slopes(
        self, values: np.ndarray, vectors: np.ndarray
    ) -> tuple[np.ndarray, np.ndarray]:
        """Differentiate what `find_least_singular` gives for J_aug, (K,), by q, (K, n), and by s, (K,)."""
        by_q = np.empty_like(self.qdot)
        by_s = np.empty(len(by_q))
        singular = as_doubles(values, by_s.shape), as_doubles(vectors, by_q.shape)
        load().brachis_singular_slopes(
            self.chain.n,
            ctypes.addressof(self.prescribed.structure),
            ctypes.byref(self.given.structure),
            len(by_q),
            *map(address, (self.twists, self.inverse, *singular, by_q, by_s)),
        )
        return by_q, by_s


def find_least_singular(inverses: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Find the least singular values, (K,), of matrices with these inverses, (K, n, n), and right singular vectors."""
    count, n, _ = inverses.shape
    values = np.empty(count)
    vectors = np.empty((count, n))
    kept = as_doubles(inverses, (count, n, n))
    load().brachis_least_singular(count, n, *map(address, (kept, values, vectors)))
    return values, vectors
