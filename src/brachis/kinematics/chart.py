"""Joint motion along a path as a function of y = (s, sigma), in a chart around a known joint path.

The rows C of sigma = C(s) q - p(s) are transversal to the self-motion along the reference q_ref(s): J_aug = [J; C] is
regular there, and as far around it as its least singular value stays away from zero. Where one C does for the whole
path, it is constant and p = 0. Postures follow by Newton's method. The formulas of the motion stand in `path_map`.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from brachis.errors import UnreachableError
from brachis.ik.newton import Newton
from brachis.kinematics.joint_map import apply_each
from brachis.kinematics.path_map import Bend, PathMap, PathState
from brachis.path import Path, PathSample
from brachis.robot import TaskMap

if TYPE_CHECKING:
    from scipy.interpolate import BSpline

CHART = "chart"
"""Label in the place of a branch's."""
DEGREE = 5
"""Of the splines through rows that follow the null space."""
_SINGULAR = 1e-9
"""A reference with a smaller least singular value is singular all along; its chart has no margin anywhere."""


@dataclass(frozen=True, eq=False)
class ChartRows:
    """Rows C (r, n) and offsets p (r,), constant or B-splines of s.

    Attributes
    ----------
    coefficients : (B, r, n + 1) ndarray
        Of [C, p]: one where they are constant, else the control points of splines of degree 5.
    knots : (B + 6,) ndarray or None
        None where they are constant.
    """

    coefficients: np.ndarray
    knots: np.ndarray | None = None

    @classmethod
    def constant(cls, rows: np.ndarray) -> ChartRows:
        """Take the same rows, (r, n), along the whole path, and p = 0."""
        return cls(np.concatenate([rows, np.zeros((len(rows), 1))], axis=1)[None])

    @classmethod
    def along(cls, s: np.ndarray, rows: np.ndarray, reference: np.ndarray) -> ChartRows:
        """Lead splines through rows, (S, r, n), and C q_ref = p, with reference postures (S, n), at S places."""
        from scipy.interpolate import make_interp_spline

        offset = np.einsum("sij,sj->si", rows, reference)
        spline = make_interp_spline(
            s, np.concatenate([rows, offset[:, :, None]], axis=2), k=DEGREE
        )
        return cls(np.asarray(spline.c), np.asarray(spline.t))

    @classmethod
    def of_arrays(cls, coefficients: np.ndarray, knots: np.ndarray) -> ChartRows:
        """Read what `arrays` gave."""
        return cls(coefficients, knots if len(knots) else None)

    @property
    def r(self) -> int:
        """Number of rows."""
        return int(self.coefficients.shape[1])

    @property
    def closes(self) -> bool:
        """Whether postures that are the same at both ends of the path have the same sigma there."""
        return self.knots is None

    def arrays(self) -> tuple[np.ndarray, np.ndarray]:
        """Coefficients and knots as they are saved: no knots where the rows are constant."""
        return self.coefficients, np.empty(0) if self.knots is None else self.knots

    @property
    def selected(self) -> tuple[int, ...]:
        """The joints that the rows select, ascending; none where they are other rows than unit rows."""
        rows = self.coefficients[0, :, :-1]
        unit = self.knots is None and bool(
            np.all((rows == 0.0) | (rows == 1.0)) and np.all(rows.sum(axis=1) == 1.0)
        )
        return tuple(int(joint) for joint in np.argmax(rows, axis=1)) if unit else ()

    def _spline(self) -> BSpline:
        from scipy.interpolate import BSpline

        return BSpline(np.asarray(self.knots), self.coefficients, DEGREE)

    def at(self, s: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """C, (K, r, n), and p, (K, r), at path coordinates (K,)."""
        if self.knots is None:
            shape = (len(s), *self.coefficients.shape[1:])
            values = np.broadcast_to(self.coefficients, shape)
        else:
            values = self._spline()(s)
        return values[:, :, :-1], values[:, :, -1]

    def values(self, s: np.ndarray, q: np.ndarray) -> np.ndarray:
        """Sigma, (K, r), in postures (K, n) at path coordinates (K,)."""
        rows, offset = self.at(s)
        return apply_each(rows, q) - offset

    def bend(self, s: np.ndarray, q: np.ndarray) -> Bend | None:
        """How rows change along the path, in postures (K, n) at path coordinates (K,); None where they do not."""
        if self.knots is None:
            return None
        spline = self._spline()
        values = np.array([spline(s, nu=order) for order in (1, 2, 3)])
        rows = values[..., :-1]
        return Bend(rows, np.einsum("okij,kj->oki", rows, q) - values[..., -1])


class ChartMap(PathMap):
    """Robot, path and chart put together: the `JointMap` with y = (s, sigma).

    Parameters
    ----------
    task_map : TaskMap
        Of the robot.
    path : Path
    rows : ChartRows
        C and p.
    s : (S,) ndarray
        Path coordinates of the reference, from 0 to 1.
    reference : (S, n) ndarray
        Postures q_ref there, so near each other that straight lines join them.
    """

    branch_label = CHART
    no_posture = "the chart has no posture there"

    def __init__(
        self,
        task_map: TaskMap,
        path: Path,
        rows: ChartRows,
        s: np.ndarray,
        reference: np.ndarray,
    ) -> None:
        from scipy.interpolate import make_interp_spline

        robot = task_map.robot
        self.robot = robot
        self.task_map = task_map
        self.path = path
        self.rows = rows
        self.r = rows.r
        self.redundant_joints = tuple(robot.joint_names[i] for i in rows.selected)
        self.s = s
        self.reference = reference
        self.start = np.asarray(reference[0])
        self._newton = Newton(task_map)
        augmented = self._augmented_at(s, reference)
        inverse = np.linalg.pinv(augmented, rcond=_SINGULAR)  # not regular throughout
        self_motion = inverse[:, :, task_map.m :].reshape(len(s), -1)
        sigma = rows.values(s, reference)
        self._lines = make_interp_spline(
            s, np.concatenate([reference, sigma, self_motion], axis=1), k=1
        )
        even = np.linspace(0.0, 1.0, 33)
        augmented = self._augmented_at(even, self._between(even)[0])
        least = np.linalg.svd(augmented, compute_uv=False)[:, -1]
        self._typical = max(float(np.median(least)), _SINGULAR)
        self._start_margin = float(least[0]) / self._typical
        self._side = float(np.sign(np.linalg.det(augmented[0])))

    def _augmented_at(self, s: np.ndarray, q: np.ndarray) -> np.ndarray:
        """J_aug, (K, n, n), in postures (K, n) at path coordinates (K,)."""
        return np.concatenate(
            [self._newton.task_coordinates(q)[1], self.rows.at(s)[0]], axis=1
        )

    def _between(self, s: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Postures (K, n), sigma (K, r) and dq/dsigma (K, n, r) of the reference, by straight lines in between."""
        n = self.robot.n
        table = self._lines(s.clip(self.s[0], self.s[-1]))
        q, sigma, self_motion = np.split(table, [n, n + self.r], axis=1)
        return q, sigma, self_motion.reshape(len(s), n, self.r)

    def coordinates(self, s: float, q: np.ndarray) -> np.ndarray:
        """Value of y = (s, sigma), (1 + r,), in a posture, (n,); NaN where that is NaN."""
        return self.curves(np.array([s]), q[None])[0]

    def curves(self, s: np.ndarray, q: np.ndarray) -> np.ndarray:
        """Values of y, (K, 1 + r), in postures (K, n) at path coordinates (K,)."""
        return np.column_stack([s, self.rows.values(s, q)])

    def postures(
        self,
        y: np.ndarray,
        sample: PathSample | None = None,
        *,
        near: np.ndarray | None = None,
    ) -> np.ndarray:
        """Joint positions, (K, n), at any times; without `near` the search begins at the reference."""
        s = y[:, 0]
        targets = (sample or self.path.sample(s)).target
        rows, offset = self.rows.at(s)
        wanted = y[:, 1:] + offset
        if near is not None:
            return self._newton.solve(targets, near, rows, wanted)
        reference, sigma, self_motion = self._between(s)
        aside = apply_each(self_motion, y[:, 1:] - sigma)
        # Within 0.8 rad or m the reference's own self-motion says where a posture is.
        near_enough = np.abs(aside).max(axis=1, initial=0.0) < 0.8
        guess = np.where(near_enough[:, None], reference + aside, reference)
        return self._newton.solve(targets, guess, rows, wanted)

    def bend(self, s: np.ndarray, q: np.ndarray) -> Bend | None:
        """Return how the rows change along the path."""
        return self.rows.bend(s, q)

    def invert(self, s: np.ndarray, jacobian: np.ndarray) -> np.ndarray:
        """Invert J_aug."""
        augmented = np.concatenate([jacobian, self.rows.at(s)[0]], axis=1)
        if (np.sign(np.linalg.det(augmented)) != self._side).any():
            raise UnreachableError(
                "the motion leaves the chart: det J_aug changes its sign"
            )
        try:
            return np.asarray(np.linalg.inv(augmented))
        except np.linalg.LinAlgError as error:
            raise UnreachableError("the chart is singular") from error

    def start_margins(self) -> np.ndarray:
        """Margin of the reference at its beginning."""
        return np.array([self._start_margin])

    def margins(self, state: PathState) -> np.ndarray:
        """Least singular value of J_aug, (K, 1), as a part of its median along the reference."""
        return state.least_singular[0][:, None] / self._typical

    def margin_gradient(self, state: PathState) -> tuple[np.ndarray, np.ndarray]:
        """Differentiate by singular vectors u and v of the least singular value: it changes by u^T dJ_aug v."""
        least, v = state.least_singular
        u = least[:, None] * np.einsum("kji,kj->ki", state.inverse, v)
        m = self.task_map.m
        moved = self.task_map.velocity_slopes(state.twists, v)
        by_q = np.einsum("ki,kij->kj", u[:, :m], moved)
        by_s = np.zeros(len(v))
        if state.bend:
            by_s = np.einsum("ki,kij,kj->k", u[:, m:], state.bend.rows[0], v)
        return by_q[:, None] / self._typical, by_s[:, None] / self._typical
