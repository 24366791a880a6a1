"""Motion of all joints along a path, and its derivatives; see `brachis.kinematics.path_map`."""

from __future__ import annotations

import ctypes
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from enum import IntEnum
from functools import lru_cache
from typing import Any

import numpy as np

from brachis.kernel.chain import Chain
from brachis.kernel.library import (
    Structured,
    address,
    as_contiguous,
    as_doubles_at_points,
    call,
    call_checked,
    declare_fields,
    shape_of,
)
from brachis.kernel.newton import Prescribed
from brachis.kernel.postures import Branch

_INPUTS = {
    "y": "Kc",
    "ydot": "Kc",
    "yddot": "Kc",
    "targets": "Kz",
    "xi": "Km",
    "xi_ds": "Km",
    "xi_dds": "Km",
    "rows": "Krw",
    "row_derivatives": "3Krw",
    "reference": "Kg",
    "t": "K",
    "near": "Kn",
}
"""The arrays that the library reads, and their shapes, with K points, n joints, c curves, m prescribed rows, z task
coordinates, r rows of w = n + 1 numbers, and g = n + r + n r numbers of a chart's reference."""
_OUTPUTS = {
    "answers": "Kam",
    "levels": "Kr",
    "q": "Kn",
    "drift": "3Kr",
    "twists": "6Kn",
    "inverse": "Knn",
    "determinants": "K",
    "gradient": "Knc",
    "qdot": "Kn",
    "qddot": "Kn",
    "qdot_y": "Knc",
    "qddot_y": "Knc",
    "qddot_ydot": "Knc",
}
"""The arrays that the library writes; `a` is the number of solutions of a closed form."""
_OF_MOTION = ("ydot", "yddot", "xi", "xi_ds", "xi_dds")
"""Inputs that are needed for the motion, but not for postures alone."""


class Fault(IntEnum):
    """Reason why the motion cannot be computed. The numbers are those of postures.c."""

    NO_POSTURE = 1
    SINGULAR = 2
    TURNS_TOO_FAR = 3


class _PathMotion(ctypes.Structure):
    """The structure `path_motion` of motion.h."""

    _fields_ = declare_fields(
        f"p arm task branch; l count rows_step; d side;p {' '.join((*_INPUTS, *_OUTPUTS))}"
    )


@lru_cache
def _lay_out(**sizes: int) -> tuple[dict[str, tuple[int, ...]], np.dtype[Any]]:
    """Return the shapes of the inputs, and one record type for all outputs."""
    shapes = {name: shape_of(letters, sizes) for name, letters in _INPUTS.items()}
    written = [
        (name, float, shape_of(letters, sizes)) for name, letters in _OUTPUTS.items()
    ]
    return shapes, np.dtype(written)


def _written(name: str) -> Any:
    """Return a property for one of the arrays that the library writes."""
    return property(lambda motion: motion.written[name])


@dataclass(frozen=True, eq=False)
class PathMotion(Structured):
    """Motion at K points along a path.

    Call `prepare` first. If the closed form has no formula, then write its solutions to `answers`. If postures are
    known, write them to `q`. Postures must be known if there is neither a `branch` nor ``inputs["reference"]``.

    Attributes
    ----------
    chain : Chain
    prescribed : Prescribed
    branch : Branch or None
        Branch on which postures are found; None in a chart.
    side : float
        Required sign of det J_aug; 0 allows both signs.
    inputs : dict of str to ndarray
        The curves ``y``, (K, 1 + r), and ``rows`` [C, p], (K, r, n + 1), or (r, n + 1) if all points share them, are
        always needed. A closed form or a chart also needs ``targets``, (K, coordinates). A chart also needs its
        ``reference``, (K, n + r + n r): posture, sigma and dq/dsigma. `evaluate` also needs ``ydot`` and ``yddot``, and
        the path's ``xi``, ``xi_ds`` and ``xi_dds``, (K, m). If rows change along the path, it also needs their three
        derivatives, ``row_derivatives``, (3, K, r, n + 1). Turns are counted with either times ``t``, (K,), or postures
        ``near``, (K, n), that are known to be close.
    rows_step : int
        Offset between the rows of successive points, in doubles; 0 if all points share them.
    written : ndarray
        Everything that the library writes, including the arrays below.
    answers : (K, A, m) ndarray
        Solutions of a closed form.
    q, qdot, qddot : (K, n) ndarray
    twists : (6, K, n) ndarray
        Columns of the tool's Jacobian.
    inverse : (K, n, n) ndarray
        Inverse of J_aug, which is the task Jacobian with the rows of the conditions below it.
    determinants : (K,) ndarray
        Determinants of J_aug.
    gradient : (K, n, 1 + r) ndarray
        dq/dy.
    """

    chain: Chain
    prescribed: Prescribed
    branch: Branch | None
    side: float
    inputs: dict[str, np.ndarray]
    rows_step: int
    written: np.ndarray

    @classmethod
    def prepare(
        cls,
        chain: Chain,
        prescribed: Prescribed,
        inputs: Mapping[str, np.ndarray],
        *,
        branch: Branch | None = None,
        side: float = 0.0,
    ) -> PathMotion:
        """Check the inputs and allocate the outputs; see `PathMotion`.

        Raises
        ------
        ValueError
            An array is missing or has the wrong shape, or the branch belongs to a different chain. In each case the
            library would read beyond the ends of arrays.
        """
        n = chain.n
        m = prescribed.count
        alternatives = 0
        needed = ["y", "rows"]
        if "reference" in inputs or (branch is not None and branch.answers_of):
            needed.append("targets")
        _need(inputs, needed)
        if branch is not None:
            branch.check_fits(n, n - m, prescribed.coordinates)
            alternatives = branch.alternatives
        shapes, record = _lay_out(
            K=len(inputs["y"]),
            n=n,
            m=m,
            r=n - m,
            c=1 + n - m,
            w=n + 1,
            z=prescribed.coordinates,
            g=n + (n - m) * (n + 1),
            a=alternatives,
        )
        arrays = {
            name: as_contiguous(values, shapes[name])
            for name, values in inputs.items()
            if name != "rows"
        }
        arrays["rows"], step = as_doubles_at_points(inputs["rows"], shapes["rows"])
        written = np.empty((), record)
        return cls(chain, prescribed, branch, side, arrays, step, written)

    answers = _written("answers")
    q = _written("q")
    qdot = _written("qdot")
    qddot = _written("qddot")
    twists = _written("twists")
    inverse = _written("inverse")
    determinants = _written("determinants")
    gradient = _written("gradient")

    def _make_structure(self) -> _PathMotion:
        inputs = self.inputs
        first = self.written.ctypes.data
        record: Any = self.written.dtype.fields
        return _PathMotion(
            self.chain.address,
            self.prescribed.address,
            None if self.branch is None else self.branch.address,
            len(inputs["y"]),
            self.rows_step,
            self.side,
            *[address(inputs[name]) if name in inputs else None for name in _INPUTS],
            *[first + offset for _, offset in record.values()],
        )

    def find_postures(self) -> np.ndarray:
        """Find only the postures, (K, n). A posture that does not exist is NaN."""
        call("brachis_postures", self.address)
        postures: np.ndarray = self.q
        return postures

    def evaluate(self) -> Fault | None:
        """Find postures and motion. Return the fault, or None if there was none."""
        _need(self.inputs, _OF_MOTION)
        fault = call("brachis_evaluate", self.address)
        return Fault(fault) if fault else None

    def derivatives(self) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Return dqdot/dy, dqddot/dy and dqddot/dydot, (K, n, 1 + r) each."""
        call("brachis_path_derivatives", self.address)
        written = self.written
        return written["qdot_y"], written["qddot_y"], written["qddot_ydot"]

    def singular_slopes(
        self, values: np.ndarray, vectors: np.ndarray
    ) -> tuple[np.ndarray, np.ndarray]:
        """Differentiate the smallest singular values of J_aug, (K,), with respect to q, (K, n), and s, (K,)."""
        count, n = self.qdot.shape
        by_q, by_s = call_checked(
            "brachis_singular_slopes", self.address, values, vectors, K=count, n=n
        )
        return by_q, by_s


def _need(inputs: Mapping[str, np.ndarray], names: Sequence[str]) -> None:
    """Raise an error if inputs are missing."""
    missing = [name for name in names if name not in inputs]
    if missing:
        raise ValueError(f"{', '.join(missing)} of the motion is missing")


def find_least_singular(inverses: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Find the smallest singular value, (K,), and its right vector for matrices with given inverses, (K, n, n)."""
    values, vectors = call_checked("brachis_least_singular", inverses)
    return values, vectors
