"""Joint motion along a path as a function of y = (s, sigma), in a chart around a known joint path.

The rows C of sigma = C(s) q - p(s) are transversal to the self-motion along the reference q_ref(s): J_aug = [J; C] is
regular there. It is also regular around the reference, as far as its smallest singular value stays away from zero. If
one matrix C suffices for the whole path, C is constant and p = 0. Postures are computed by Newton's method. For the
formulas of the motion see `path_map`.

The self-motion at a posture is the null space of the task Jacobian, with an orthonormal basis N, (n, r). Rows C are
transversal if C N is regular. For orthonormal rows, the smallest singular value of C N is 1 if the rows span the null
space itself, and 0 if they are orthogonal to one of its directions. The best constant rows are the leading eigenvectors
of the mean of N N^T. If these are not transversal enough, the rows follow the null space. At each place, the basis of
the null space is then rotated to be as close as possible to the previous basis (orthogonal Procrustes problem; P. H.
Schoenemann, Psychometrika 31, 1966).
"""

from __future__ import annotations

from dataclasses import dataclass, field
from functools import cached_property
from typing import ClassVar

import numpy as np

from brachis.common.arrays import LastCall, apply_each
from brachis.errors import UnreachableError
from brachis.ik.newton import Newton, null_spaces
from brachis.kernel import Fault, Spline
from brachis.kinematics.path_map import PathMap, PathState
from brachis.path import Path, PathSample
from brachis.robot import TaskMap

CHART = "chart"
"""Label of a chart, used where a closed form has the label of a branch."""
DEGREE = 5
"""Degree of the splines that interpolate rows which follow the null space."""
_SINGULAR = 1e-9
"""If the smallest singular values along the reference are below this, the chart counts as singular, without margin."""
_ENOUGH = 0.35
"""Minimum transversality of the rows along the reference."""
_PLACES = (9, 17, 33, 65, 129)
"""Numbers of places for the splines of rows that follow the null space. The first number that suffices is used."""


@dataclass(frozen=True, eq=False)
class ChartRows:
    """Rows C (r, n) and offsets p (r,), constant or B-splines of s.

    Attributes
    ----------
    coefficients : (B, r, n + 1) ndarray
        Coefficients of [C, p]. If C and p are constant, there is a single entry; otherwise the entries are the control
        points of splines of degree 5.
    knots : (B + 6,) ndarray
        Knots of the splines; empty if the rows are constant.
    """

    coefficients: np.ndarray
    knots: np.ndarray = field(default_factory=lambda: np.empty(0))

    @classmethod
    def constant(cls, rows: np.ndarray) -> ChartRows:
        """Return rows, (r, n), that are the same along the whole path, with p = 0."""
        return cls(np.concatenate([rows, np.zeros((len(rows), 1))], axis=1)[None])

    @classmethod
    def along(cls, s: np.ndarray, rows: np.ndarray, reference: np.ndarray) -> ChartRows:
        """Interpolate rows, (S, r, n), and p = C q_ref by splines, from reference postures, (S, n), at S places."""
        offset = np.einsum("sij,sj->si", rows, reference)
        values = np.concatenate([rows, offset[:, :, None]], axis=2)
        spline = Spline.through(s, values, DEGREE)
        return cls(spline.control_points, spline.knots)

    @property
    def r(self) -> int:
        """Number of rows."""
        return int(self.coefficients.shape[1])

    @property
    def is_constant(self) -> bool:
        """Whether the rows are the same along the path. If so, sigma depends only on the posture."""
        return not len(self.knots)

    @property
    def selected(self) -> tuple[int, ...]:
        """The joints that the rows select, ascending; empty unless all rows are unit vectors."""
        rows = self.coefficients[0, :, :-1]
        joints = np.argmax(rows, axis=1)
        selects = self.is_constant and np.array_equal(
            rows, np.eye(rows.shape[1])[joints]
        )
        return tuple(joints.tolist()) if selects else ()

    @cached_property
    def _spline(self) -> Spline:
        return Spline(self.knots, self.coefficients, DEGREE)

    @cached_property
    def _orders_at(self) -> LastCall[np.ndarray]:
        return LastCall(self._orders)

    def _orders(self, s: np.ndarray) -> np.ndarray:
        """Return [C, p] and three derivatives with respect to s, (4, K, r, n + 1), if they are splines."""
        return np.array([self._spline(s, order) for order in range(4)])

    def at(self, s: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Return C, (K, r, n), and p, (K, r), at path coordinates, (K,)."""
        values = (
            self.coefficients.repeat(len(s), axis=0)
            if self.is_constant
            else self._orders_at(s)[0]
        )
        return values[:, :, :-1], values[:, :, -1]

    def values(self, s: np.ndarray, q: np.ndarray) -> np.ndarray:
        """Return sigma, (K, r), in postures, (K, n), at path coordinates, (K,)."""
        rows, offset = self.at(s)
        return apply_each(rows, q) - offset

    def kernel_inputs(self, s: np.ndarray) -> dict[str, np.ndarray]:
        """Return [C, p] at path coordinates, (K,), and its derivatives, in the form that the kernel needs."""
        if self.is_constant:
            return {"rows": self.coefficients[0]}
        orders = self._orders_at(s)
        return {"rows": orders[0], "row_derivatives": orders[1:]}


class ChartMap(PathMap):
    """The `JointMap` of a robot, a path and a chart, with y = (s, sigma).

    Parameters
    ----------
    task_map : TaskMap
        Task map of the robot.
    path : Path
    rows : ChartRows
        Rows C and offsets p.
    s : (S,) ndarray
        Path coordinates of the reference, from 0 to 1.
    reference : (S, n) ndarray
        Postures q_ref at these coordinates, close enough for linear interpolation between them.
    """

    branch_label = CHART
    faults: ClassVar = {
        Fault.NO_POSTURE: "the chart has no posture there",
        Fault.SINGULAR: "the motion leaves the chart: det J_aug changes its sign",
    }

    def __init__(
        self,
        task_map: TaskMap,
        path: Path,
        rows: ChartRows,
        s: np.ndarray,
        reference: np.ndarray,
    ) -> None:
        super().__init__(task_map, path, reference[0])
        names = self.robot.joint_names
        self.rows = rows
        self.r = rows.r
        self.redundant_joints = tuple(names[i] for i in rows.selected)
        self.s = s
        self.reference = reference
        self._newton = Newton(task_map)
        null = null_spaces(self._newton.task_coordinates(reference)[1])
        across = rows.at(s)[0] @ null  # may be singular at some places
        self_motion = null @ np.linalg.pinv(across, rcond=_SINGULAR)
        sigma = rows.values(s, reference)
        table = np.column_stack([reference, sigma, self_motion.reshape(len(s), -1)])
        self._lines = Spline.through(s, table, 1)
        self._reference_at = LastCall(self._between)
        n = self.robot.n
        even = np.linspace(0.0, 1.0, 33)
        augmented = self._augmented_at(even, self._between(even)[:, :n])
        least = np.linalg.svd(augmented, compute_uv=False)[:, -1]
        self._typical = max(float(np.median(least)), _SINGULAR)
        self._start_margin = float(least[0]) / self._typical
        # If the determinant is zero, it has no sign, and no posture has the required one.
        self.side = float(np.sign(np.linalg.det(augmented[0]))) or np.nan

    def _augmented_at(self, s: np.ndarray, q: np.ndarray) -> np.ndarray:
        """Return J_aug, (K, n, n), in postures, (K, n), at path coordinates, (K,)."""
        return np.concatenate(
            [self._newton.task_coordinates(q)[1], self.rows.at(s)[0]], axis=1
        )

    def _between(self, s: np.ndarray) -> np.ndarray:
        """Interpolate postures, sigma and dq/dsigma of the reference linearly, (K, n + r + n r)."""
        return self._lines(s.clip(self.s[0], self.s[-1]))

    def self_motion_rows(self, s: float) -> np.ndarray:
        """Return the rows C, (r, n), at s."""
        return np.asarray(self.rows.at(np.array([s]))[0][0])

    def coordinates(self, s: float, q: np.ndarray) -> np.ndarray:
        """Return y = (s, sigma), (1 + r,), in a posture, (n,); NaN if the posture is NaN."""
        return self.curves(np.array([s]), q[None])[0]

    def curves(self, s: np.ndarray, q: np.ndarray) -> np.ndarray:
        """Return y, (K, 1 + r), in postures, (K, n), at path coordinates, (K,)."""
        return np.column_stack([s, self.rows.values(s, q)])

    def kernel_inputs(self, y: np.ndarray, sample: PathSample) -> dict[str, np.ndarray]:
        """Return the targets, the rows and the reference, from which Newton's method starts."""
        s = y[:, 0]
        inputs = {"targets": sample.target, "reference": self._reference_at(s)}
        return inputs | self.rows.kernel_inputs(s)

    def start_margins(self) -> np.ndarray:
        """Return the margin at the beginning of the reference."""
        return np.array([self._start_margin])

    def margins(self, state: PathState) -> np.ndarray:
        """Return the smallest singular value of J_aug, (K, 1), relative to its median along the reference."""
        return state.least_singular[0][:, None] / self._typical

    def margin_gradient(self, state: PathState) -> tuple[np.ndarray, np.ndarray]:
        """Differentiate the margins with respect to q, (K, 1, n), and s, (K, 1)."""
        by_q, by_s = state.motion.singular_slopes(*state.least_singular)
        return by_q[:, None] / self._typical, by_s[:, None] / self._typical


def chart_around(
    task_map: TaskMap,
    path: Path,
    s: np.ndarray,
    reference: np.ndarray,
    rows: ChartRows | None = None,
) -> ChartMap:
    """Build a chart around a joint path.

    Parameters
    ----------
    task_map : TaskMap
    path : Path
    s : (S,) ndarray
        Path coordinates from 0 to 1. Of several places with the same coordinate, the first one is used; at 1, the last
        one.
    reference : (S, n) ndarray
        Postures at these coordinates.
    rows : ChartRows, optional
        Rows of the chart. By default they are chosen automatically.

    Returns
    -------
    ChartMap

    Raises
    ------
    UnreachableError
        The null space turns faster than the rows can follow. This happens close to singularities of the arm.
    """
    growing = _growing(s)
    s = s[growing]
    reference = reference[growing]
    if rows is not None:
        return ChartMap(task_map, path, rows, s, reference)
    newton = Newton(task_map)
    null = newton.self_motions(reference)
    scales = newton.scales
    r = null.shape[2]
    constant = np.linalg.eigh(np.einsum("kir,kjr->ij", null, null))[1][:, ::-1][:, :r].T
    if transversality(constant[None], null).min(initial=np.inf) >= _ENOUGH:
        chosen = ChartRows.constant(constant / scales)
        return ChartMap(task_map, path, chosen, s, reference)
    following = np.swapaxes(_continue_bases(null), 1, 2) / scales
    for count in _PLACES:
        places = np.unique(
            np.linspace(0, len(s) - 1, min(count, len(s))).round().astype(int)
        )
        if len(places) <= DEGREE:
            continue
        chosen = ChartRows.along(s[places], following[places], reference[places])
        if transversality(chosen.at(s)[0] * scales, null).min() >= _ENOUGH:
            return ChartMap(task_map, path, chosen, s, reference)
    raise UnreachableError(
        "the task Jacobian is nearly singular along the reference: no chart fits around it"
    )


def _growing(s: np.ndarray) -> np.ndarray:
    """Return indices of path coordinates, (S,): the first, the last, and those at which they have grown."""
    furthest = np.maximum.accumulate(s)
    apart = 1e-7
    grown = np.append(True, np.diff(furthest) > apart) & (s < s[-1] - apart)
    grown[0] = grown[-1] = True
    return np.flatnonzero(grown)


def transversality(rows: np.ndarray, null: np.ndarray) -> np.ndarray:
    """Return the smallest singular values of C N, (K,), for rows (K, r, n) and bases (K, n, r); inf if r is 0.

    Rows and bases refer to the scaled joints, as in `Newton.self_motions`.
    """
    if not null.shape[2]:
        return np.full(len(null), np.inf)
    return np.linalg.svd(rows @ null, compute_uv=False)[:, -1]


def moving_most(null: np.ndarray) -> np.ndarray:
    """Select by pivoting the r joints, (K, r), ascending, that move most in null spaces, (K, n, r)."""
    residual = null.copy()
    chosen = []
    for _ in range(null.shape[2]):
        joint = np.argmax(np.linalg.norm(residual, axis=2), axis=1)
        chosen.append(joint)
        row = residual[np.arange(len(residual)), joint]
        unit = row / np.maximum(np.linalg.norm(row, axis=1, keepdims=True), 1e-300)
        residual = (
            residual
            - np.einsum("knr,kr->kn", residual, unit)[:, :, None] * unit[:, None]
        )
    return np.sort(
        np.array(chosen, dtype=int).reshape(null.shape[2], len(null)).T, axis=1
    )


def _continue_bases(null: np.ndarray) -> np.ndarray:
    """Rotate each basis, (S, n, r), within its null space so that it is closest to the previous one."""
    turned = null.copy()
    for k in range(1, len(null)):
        u, _, vt = np.linalg.svd(null[k].T @ turned[k - 1])
        turned[k] = null[k] @ u @ vt
    return turned
