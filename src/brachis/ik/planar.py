"""Planar chains: one or two non-redundant joints of any kind, three where yaw is prescribed.

With A, B, C the maps of the joints before, between and after the non-redundant joints a and b (`planar_chain`), the
target z fixes

    two joints    A^-1(z) = J_a(B(J_b(c))),  c = C(tool):    two circles, circle and line, or two lines
    one joint     one row of A(J_a(c)):                      a cosine, or a line
    with yaw      the last revolute joint c follows from the angle; the position of its centre is known, slides after
                  it run in known directions, and two joints are left.

Two branches at most; they differ by the sign of det J_nr, which is the branch margin.

A chain that moves in one plane, with plane vectors written as complex numbers.

With e1, e2 spanning the plane, the vector x e1 + y e2 is x + i y. A revolute joint turns the plane about its centre p:
w -> p + exp(i sigma q) (w - p); a prismatic joint shifts it: w -> w + d q. All joints before a joint act on what that
joint has done, so a chain is a composition of such maps, each of the form w -> alpha w + beta.
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass

import numpy as np

from brachis.ik.protocol import IKSolver, NotApplicableError, ik_family
from brachis.ik.screws import ChainGeometry
from brachis.ik.vectors import wrap
from brachis.robot import TaskMap
from brachis.robot.joints import complement
from brachis.robot.task_map import Pose, RowsAndYaw

_PARALLEL = 1e-9


@dataclass(frozen=True)
class PlanarChain:
    """Joints of a chain within their common plane.

    Attributes
    ----------
    revolute : (n,) bool ndarray
    sigma : (n,) ndarray
        +1 or -1, sense of each revolute joint about the plane's normal e1 x e2; 0 for prismatic joints.
    centre : (n,) complex ndarray
        Axis of each revolute joint at the zero posture, m.
    slide : (n,) complex ndarray
        Direction of each prismatic joint at the zero posture; 0 for one along the normal.
    tool : complex
        Tool frame origin at the zero posture, m.
    yaw : float
        Yaw at the zero posture, rad (0 if not prescribed).
    to_plane : (m_position, 2) ndarray, offset : (m_position,) ndarray
        Position rows of the task space are ``offset + to_plane @ (x, y)``.
    """

    revolute: np.ndarray
    sigma: np.ndarray
    centre: np.ndarray
    slide: np.ndarray
    tool: complex
    yaw: float
    to_plane: np.ndarray
    offset: np.ndarray

    @classmethod
    def of(cls, geometry: ChainGeometry, task_map: TaskMap) -> PlanarChain:
        """Find the plane from the screw axes.

        Raises
        ------
        NotApplicableError
            The joints do not move in one plane, or the rows cannot tell positions in it apart.
        """
        normal = _normal(geometry)
        first, second = _basis(normal, task_map)
        normal = np.cross(first, second)
        basis = first + 1j * second
        along = geometry.axes @ normal
        inert = ~geometry.revolute & (np.abs(along) > 1.0 - _PARALLEL)
        selection = np.eye(3)[list(task_map.axes)]
        if np.any(inert) and np.any(np.abs(selection @ normal) > _PARALLEL):
            raise NotApplicableError(
                "a slide along the plane's normal changes the prescribed rows"
            )
        to_plane = selection @ np.column_stack([first, second])
        offset = selection @ (normal * (normal @ geometry.tool_position))
        if (
            np.linalg.matrix_rank(to_plane, tol=_PARALLEL) < min(2, len(to_plane))
            or len(to_plane) > 2
        ):
            raise NotApplicableError(
                "the prescribed rows do not fit the plane in which the joints move"
            )
        yaw = 0.0
        if isinstance(task_map, RowsAndYaw):
            if abs(normal[task_map.world_axis]) < 1.0 - _PARALLEL:
                raise NotApplicableError("yaw turns in another plane than the joints")
            yaw = float(np.angle(basis @ geometry.tool_rotation[:, task_map.tool_axis]))
        return cls(
            revolute=geometry.revolute,
            sigma=np.where(geometry.revolute, np.sign(along), 0.0),
            centre=np.where(geometry.revolute, geometry.points @ basis, 0.0),
            slide=np.where(geometry.revolute | inert, 0.0, geometry.axes @ basis),
            tool=complex(basis @ geometry.tool_position),
            yaw=yaw,
            to_plane=to_plane,
            offset=offset,
        )

    def compose(
        self, joints: Iterable[int], q: np.ndarray
    ) -> tuple[np.ndarray, np.ndarray]:
        """Coefficients (alpha, beta), each (K,), of the map of some joints, first outermost, at postures (K, n)."""
        alpha = np.ones(len(q), dtype=complex)
        beta = np.zeros(len(q), dtype=complex)
        for i in joints:
            if self.revolute[i]:
                turn = np.exp(1j * self.sigma[i] * q[:, i])
                beta = beta + alpha * self.centre[i] * (1.0 - turn)
                alpha = alpha * turn
            else:
                beta = beta + alpha * self.slide[i] * q[:, i]
        return alpha, beta

    def jacobian_determinant(
        self, q: np.ndarray, columns: list[int], rows: int
    ) -> np.ndarray:
        """Compute the determinant of the task Jacobian's columns of some joints, up to a constant factor.

        Parameters
        ----------
        q : (K, n) ndarray
            Real or complex: written with cosines and sines, not complex numbers, so that complex steps work.
        columns : list of int
            As many joints as rows.
        rows : int
            1: one position row; 2: both plane coordinates; 3: these and yaw.

        Returns
        -------
        (K,) ndarray
        """
        x, y, angle = (
            np.full(len(q), value, dtype=q.dtype)
            for value in (self.tool.real, self.tool.imag, 0.0)
        )
        # From the tool inwards: (x, y) is the tool as the joints seen so far have moved it.
        levers: dict[int, tuple[np.ndarray, np.ndarray]] = {}
        turns: dict[int, tuple[np.ndarray, np.ndarray]] = {}
        for i in range(len(self.revolute) - 1, -1, -1):
            if self.revolute[i]:
                cos = np.cos(q[:, i])
                sin = self.sigma[i] * np.sin(q[:, i])
                dx = x - self.centre[i].real
                dy = y - self.centre[i].imag
                x = self.centre[i].real + cos * dx - sin * dy
                y = self.centre[i].imag + sin * dx + cos * dy
                levers[i] = (self.centre[i].imag - y, x - self.centre[i].real)
                turns[i] = (cos, sin)
            else:
                x = x + self.slide[i].real * q[:, i]
                y = y + self.slide[i].imag * q[:, i]
                levers[i] = (
                    np.full_like(angle, self.slide[i].real),
                    np.full_like(angle, self.slide[i].imag),
                )
        matrix = np.empty((len(q), rows, len(columns)), dtype=q.dtype)
        for position, joint in enumerate(columns):
            vx, vy = levers[joint]
            for i in range(joint - 1, -1, -1):
                if self.revolute[i]:
                    cos, sin = turns[i]
                    vx, vy = cos * vx - sin * vy, sin * vx + cos * vy
            vector = (vx, vy)
            if rows == 1:
                matrix[:, 0, position] = (
                    self.to_plane[0, 0] * vx + self.to_plane[0, 1] * vy
                )
            else:
                matrix[:, 0, position], matrix[:, 1, position] = vector
            if rows == 3:
                matrix[:, 2, position] = float(self.revolute[joint])
        return _determinant(matrix)


def _determinant(matrix: np.ndarray) -> np.ndarray:
    """Compute determinants (K,) of matrices (K, m, m), m <= 3; written out, faster than LAPACK's batch."""
    if matrix.shape[1] == 1:
        return matrix[:, 0, 0]
    if matrix.shape[1] == 2:
        return matrix[:, 0, 0] * matrix[:, 1, 1] - matrix[:, 0, 1] * matrix[:, 1, 0]
    return np.einsum(
        "ki,ki->k", matrix[:, :, 0], np.cross(matrix[:, :, 1], matrix[:, :, 2])
    )


def _normal(geometry: ChainGeometry) -> np.ndarray:
    """Direction to which all revolute axes are parallel and each slide parallel or perpendicular."""
    turning = np.flatnonzero(geometry.revolute)
    if len(turning) == 0:
        raise NotApplicableError("no joint is revolute")
    normal = geometry.axes[turning[0]]
    for i in range(geometry.n):
        cosine = abs(geometry.axes[i] @ normal)
        name = geometry.joint_names[i]
        if geometry.revolute[i] and cosine < 1.0 - _PARALLEL:
            raise NotApplicableError(
                f"not planar: the axes of {geometry.joint_names[turning[0]]} and {name} are not parallel"
            )
        if not geometry.revolute[i] and _PARALLEL < cosine < 1.0 - _PARALLEL:
            raise NotApplicableError(
                f"not planar: {name} slides at an angle to the plane"
            )
    return normal


def _basis(normal: np.ndarray, task_map: TaskMap) -> tuple[np.ndarray, np.ndarray]:
    """Two orthonormal vectors of the plane; the rows' own axes where the rows span it."""
    wanted = np.eye(3)[list(task_map.axes[:2])]
    if len(wanted) == 2 and np.all(np.abs(wanted @ normal) < _PARALLEL):
        return wanted[0], wanted[1]
    first = np.cross(normal, np.eye(3)[int(np.argmin(np.abs(normal)))])
    first /= np.linalg.norm(first)
    return first, np.cross(normal, first)


_SAMPLES = 64
_LABELS = {
    "RR": "elbow",
    "RP": "reach",
    "PR": "reach",
    "PP": "slides",
    "R": "swing",
    "P": "slide",
}


class PlanarSolver(IKSolver):
    """Closed form of a planar chain; see the module's formulas."""

    def __init__(
        self, chain: PlanarChain, redundant: tuple[int, ...], *, yaw: bool
    ) -> None:
        self._chain = chain
        self._n = len(chain.revolute)
        self._redundant = list(redundant)
        self._rest = complement(self._n, redundant)
        self._yaw = yaw
        turning = [i for i in self._rest if chain.revolute[i]]
        self._last = turning[-1] if yaw else self._n
        self._pair = [i for i in self._rest if i != self._last]
        self._scale = self._largest_determinant()
        pattern = "".join("R" if chain.revolute[i] else "P" for i in self._pair)
        label = _LABELS[pattern]
        self.branches: tuple[str, ...] = (f"{label}_positive", f"{label}_negative")

    def _largest_determinant(self) -> float:
        """Size of det J_nr over random postures, by which branch margins are made dimensionless."""
        postures = np.random.default_rng(0).uniform(-np.pi, np.pi, (_SAMPLES, self._n))
        determinant = self._chain.jacobian_determinant(
            postures, self._rest, len(self._rest)
        )
        scale = float(np.abs(determinant).max())
        if scale < 1e-9:
            raise NotApplicableError("J_nr is singular everywhere")
        return scale

    def _plane_target(self, targets: np.ndarray) -> np.ndarray:
        """Plane coordinates (K,) of targets with two position rows."""
        position = targets[:, :2] - self._chain.offset
        plane = np.linalg.solve(self._chain.to_plane, position.T)
        return plane[0] + 1j * plane[1]

    def solve(self, targets: np.ndarray, q_r: np.ndarray) -> np.ndarray:
        """See `IKSolver.solve`."""
        known = np.zeros((len(q_r), self._n))
        known[:, self._redundant] = q_r
        with np.errstate(invalid="ignore", divide="ignore"):
            if len(self._pair) == 1 and not self._yaw:
                roots = self._single(targets, known)
            elif self._yaw:
                roots = self._with_yaw(targets, known)
            else:
                roots = self._two(
                    self._plane_target(targets), known, self._chain.tool, range(self._n)
                )
        return self._by_sign(known, roots)[:, :, None]

    def _by_sign(self, known: np.ndarray, roots: np.ndarray) -> np.ndarray:
        """Order the roots (K, 2, m) by the sign of det J_nr; NaN where a sign has none."""
        count = len(known)
        q = np.repeat(known[:, None], 2, axis=1)
        q[:, :, self._rest] = roots
        determinant = self._chain.jacobian_determinant(
            q.reshape(2 * count, -1), self._rest, len(self._rest)
        )
        first_positive = determinant.reshape(count, 2) > 0.0
        first_negative = determinant.reshape(count, 2) < 0.0
        ordered = np.full_like(roots, np.nan)
        for slot, match in enumerate((first_positive, first_negative)):
            root = np.argmax(match, axis=1)
            found = np.any(match, axis=1)
            ordered[found, slot] = roots[found, root[found]]
        return ordered

    def branch_margins(self, q: np.ndarray, branch: int) -> np.ndarray:
        """See `IKSolver.branch_margins`: det J_nr, divided by its largest size."""
        determinant = self._chain.jacobian_determinant(q, self._rest, len(self._rest))
        return (1.0 if branch == 0 else -1.0) * determinant[:, None] / self._scale

    def _single(self, targets: np.ndarray, known: np.ndarray) -> np.ndarray:
        """One joint for one position row: row = Re(conj(nu) z)."""
        chain = self._chain
        joint = self._pair[0]
        nu = chain.to_plane[0, 0] + 1j * chain.to_plane[0, 1]
        alpha, beta = chain.compose(range(joint), known)
        after_alpha, after_beta = chain.compose(range(joint + 1, self._n), known)
        tool = after_alpha * chain.tool + after_beta
        value = targets[:, 0] - chain.offset[0]
        if chain.revolute[joint]:
            level = value - (np.conj(nu) * (alpha * chain.centre[joint] + beta)).real
            lever = np.conj(nu) * alpha * (tool - chain.centre[joint])
            swing = np.arccos(level / np.abs(lever))
            angles = np.stack([swing, -swing], axis=1) - np.angle(lever)[:, None]
            return (chain.sigma[joint] * wrap(angles))[:, :, None]
        rate = (np.conj(nu) * alpha * chain.slide[joint]).real
        slide = (value - (np.conj(nu) * (alpha * tool + beta)).real) / rate
        return np.repeat(slide[:, None, None], 2, axis=1)

    def _two(
        self, z: np.ndarray, known: np.ndarray, tool: complex, joints: range
    ) -> np.ndarray:
        """Two joints a, b for a point in the plane that the `joints` carry from `tool`: (K, 2, 2)."""
        chain, (a, b) = self._chain, self._pair
        alpha, beta = chain.compose(range(a), known)
        between = chain.compose(range(a + 1, b), known)
        after = chain.compose(range(b + 1, len(joints)), known)
        w = (z - beta) / alpha
        c = after[0] * tool + after[1]
        if chain.revolute[a] and chain.revolute[b]:
            return self._circles(w - chain.centre[a], between, c)
        if chain.revolute[a]:
            return self._circle_line(w - chain.centre[a], between, c)
        if chain.revolute[b]:
            lever = between[0] * (c - chain.centre[b])
            centre = between[0] * chain.centre[b] + between[1]
            return self._line_circle(
                w - centre, np.broadcast_to(chain.slide[a], w.shape), lever, b
            )
        return _lines(
            w - (between[0] * c + between[1]),
            chain.slide[a],
            between[0] * chain.slide[b],
        )

    def _circles(
        self, w: np.ndarray, between: tuple[np.ndarray, np.ndarray], c: np.ndarray
    ) -> np.ndarray:
        """Solve w = exp(i a) (L1 + exp(i b) L2)."""
        chain, (a, b) = self._chain, self._pair
        first = between[0] * chain.centre[b] + between[1] - chain.centre[a]
        second = between[0] * (c - chain.centre[b])
        cosine = (np.abs(w) ** 2 - np.abs(first) ** 2 - np.abs(second) ** 2) / (
            2.0 * np.abs(first) * np.abs(second)
        )
        bend = np.arccos(cosine)
        relative = np.stack([bend, -bend], axis=1)
        inner = relative - np.angle(second / first)[:, None]
        outer = np.angle(
            w[:, None] / (first[:, None] + np.exp(1j * inner) * second[:, None])
        )
        return np.stack([chain.sigma[a] * outer, chain.sigma[b] * wrap(inner)], axis=2)

    def _circle_line(
        self, w: np.ndarray, between: tuple[np.ndarray, np.ndarray], c: np.ndarray
    ) -> np.ndarray:
        """Solve w = exp(i a) (g + u t), u of unit length."""
        chain, (a, b) = self._chain, self._pair
        g = between[0] * c + between[1] - chain.centre[a]
        u = between[0] * chain.slide[b]
        along = (np.conj(g) * u).real
        root = np.sqrt(along**2 + np.abs(w) ** 2 - np.abs(g) ** 2)
        slide = np.stack([root, -root], axis=1) - along[:, None]
        outer = np.angle(w[:, None] / (g[:, None] + u[:, None] * slide))
        return np.stack([chain.sigma[a] * outer, slide], axis=2)

    def _line_circle(
        self, h: np.ndarray, u: np.ndarray, lever: np.ndarray, turning: int
    ) -> np.ndarray:
        """Solve h = u t + exp(i theta) lever, u of unit length; answers (t, theta)."""
        across = (np.conj(u) * h).imag
        along = (np.conj(u) * h).real
        root = np.sqrt(np.abs(lever) ** 2 - across**2)
        slide = along[:, None] + np.stack([root, -root], axis=1)
        angle = np.angle((h[:, None] - u[:, None] * slide) / lever[:, None])
        return np.stack([slide, self._chain.sigma[turning] * angle], axis=2)

    def _with_yaw(self, targets: np.ndarray, known: np.ndarray) -> np.ndarray:
        """Three joints for a point and an angle: (K, 2, 3)."""
        chain = self._chain
        last = self._last
        turned = targets[:, 2] - chain.yaw
        after_last = chain.compose(range(last + 1, self._n), known)
        world = np.exp(1j * turned) / after_last[0]
        z = self._plane_target(targets) - world * (
            after_last[0] * chain.tool + after_last[1] - chain.centre[last]
        )
        late = [i for i in self._pair if i > last]
        early = [i for i in self._pair if i < last]
        if not late:
            pair = self._two(z, known, complex(chain.centre[last]), range(last))
        else:
            directions = [
                world * chain.compose(range(last + 1, i), known)[0] * chain.slide[i]
                for i in late
            ]
            pair = self._late(z, known, early, directions)
        angles = np.zeros((len(targets), 2))
        others = [i for i in range(self._n) if i != last and chain.revolute[i]]
        for i in others:
            angles = angles + chain.sigma[i] * (
                pair[:, :, self._pair.index(i)]
                if i in self._pair
                else known[:, i, None]
            )
        final = chain.sigma[last] * wrap(turned[:, None] - angles)
        order = [(*self._pair, last).index(i) for i in self._rest]
        return np.concatenate([pair, final[:, :, None]], axis=2)[:, :, order]

    def _late(
        self,
        z: np.ndarray,
        known: np.ndarray,
        early: list[int],
        directions: list[np.ndarray],
    ) -> np.ndarray:
        """Two joints of which one or both are slides after the last revolute joint, along known world directions."""
        chain = self._chain
        last = self._last
        if not early:
            alpha, beta = chain.compose(range(last), known)
            return _lines(
                z - (alpha * chain.centre[last] + beta), directions[0], directions[1]
            )
        a = early[0]
        alpha, beta = chain.compose(range(a), known)
        between = chain.compose(range(a + 1, last), known)
        point = between[0] * chain.centre[last] + between[1]
        if not chain.revolute[a]:
            return _lines(
                z - (alpha * point + beta), alpha * chain.slide[a], directions[0]
            )
        centre = alpha * chain.centre[a] + beta
        answers = self._line_circle(
            z - centre, directions[0], alpha * (point - chain.centre[a]), a
        )
        return answers[:, :, ::-1]


def _lines(
    h: np.ndarray, first: np.ndarray | complex, second: np.ndarray | complex
) -> np.ndarray:
    """Solve h = first t1 + second t2: (K, 2, 2), the one answer twice."""
    determinant = (np.conj(first) * second).imag
    answers = np.stack(
        [
            (np.conj(h) * second).imag / determinant,
            (np.conj(first) * h).imag / determinant,
        ],
        axis=1,
    )
    return np.repeat(answers[:, None], 2, axis=1)


@ik_family(
    "planar",
    source="two circles, circle and line, two lines: elementary plane geometry",
)
def planar(
    geometry: ChainGeometry, task_map: TaskMap, redundant: tuple[int, ...]
) -> PlanarSolver:
    """Fit the family: all joints move in one plane that the prescribed rows can see."""
    if isinstance(task_map, Pose):
        raise NotApplicableError("a whole pose is prescribed")
    chain = PlanarChain.of(geometry, task_map)
    yaw = isinstance(task_map, RowsAndYaw)
    rest = complement(geometry.n, redundant)
    if yaw and not any(geometry.revolute[i] for i in rest):
        raise NotApplicableError("no revolute joint is left to set yaw")
    return PlanarSolver(chain, redundant, yaw=yaw)
