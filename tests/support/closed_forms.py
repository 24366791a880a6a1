"""What every closed form owes, checked against Pinocchio on random postures."""

from __future__ import annotations

import itertools
from collections.abc import Iterator, Sequence

import numpy as np

from brachis.ik import Family, IKSolver, TriedDecomposition, find
from brachis.robot import Robot, task_map_of


def wrap(delta: np.ndarray, angles: np.ndarray) -> np.ndarray:
    """Differences, modulo 2 pi where `angles`."""
    return np.where(angles, np.remainder(delta + np.pi, 2.0 * np.pi) - np.pi, delta)


def margins_of(solver: IKSolver, q: np.ndarray) -> np.ndarray:
    """Margins (K, B, k) of all branches."""
    branches = range(len(solver.branches))
    return np.stack([solver.branch_margins(q, b) for b in branches], axis=1)


def check_margin_gradient(solver: IKSolver, q: np.ndarray, atol: float) -> None:
    """Compare the margins' derivatives by complex steps with central differences, in the first and last branch."""
    h = 1e-5
    for branch in {0, len(solver.branches) - 1}:
        exact = solver.margin_gradient(q, branch)
        for joint, step in enumerate(h * np.eye(q.shape[1])):
            upper, lower = (solver.branch_margins(q + s, branch) for s in (step, -step))
            np.testing.assert_allclose(
                exact[:, :, joint], (upper - lower) / (2.0 * h), atol=atol
            )


class Bench:
    """A robot and task space with random postures, their task coordinates and Jacobians by Pinocchio."""

    def __init__(
        self, robot: Robot, rows: Sequence[str], postures: int, seed: int = 5
    ) -> None:
        self.robot = robot
        self.space = task_map_of(robot, rows)
        self.q = np.random.default_rng(seed).uniform(-np.pi, np.pi, (postures, robot.n))
        self.targets = self.space.values(self.q)
        self.jacobian = self.space.jacobian(self.space.twists(self.q))
        self.turning = robot.revolute
        self.angles = np.array([unit == "rad" for unit in self.space.units])

    def decompositions(self) -> Iterator[tuple[tuple[int, ...], bool]]:
        """Every choice of redundant joints, and whether its J_nr is regular anywhere."""
        for redundant in itertools.combinations(
            range(self.robot.n), self.robot.n - self.space.m
        ):
            yield redundant, bool(np.abs(self.determinant(redundant)).max() > 1e-6)

    def rest(self, redundant: Sequence[int]) -> list[int]:
        return [i for i in range(self.robot.n) if i not in redundant]

    def determinant(self, redundant: Sequence[int]) -> np.ndarray:
        """Det J_nr at the postures, from Pinocchio."""
        return np.linalg.det(self.jacobian[:, :, self.rest(redundant)])

    def find(
        self, redundant: Sequence[int], families: Sequence[Family] = ()
    ) -> TriedDecomposition:
        return find(
            self.robot,
            self.space,
            [self.robot.joint_names[i] for i in redundant],
            families=families,
        )

    def miss(self, postures: np.ndarray, targets: np.ndarray) -> np.ndarray:
        """Largest distance from the target of every posture, by Pinocchio's forward kinematics."""
        return np.abs(wrap(self.space.values(postures) - targets, self.angles)).max(
            axis=1
        )

    def check(
        self,
        redundant: Sequence[int],
        families: Sequence[Family] = (),
        *,
        distinct_roots: int,
    ) -> TriedDecomposition:
        """Hold a closed form to its promises; `distinct_roots` is how many answers geometry allows."""
        candidate = self.find(redundant, families)
        solver, q = candidate.solver, self.q
        joints = self.rest(redundant)
        assert solver is not None
        answers = solver.solve(self.targets, q[:, list(redundant)])
        assert answers.shape == (len(q), len(solver.branches), 1, self.space.m)
        answers = answers[:, :, 0]
        determinant = self.determinant(redundant)
        scale = np.abs(determinant).max()
        regular = np.abs(determinant) > 1e-6 * scale

        finite = np.isfinite(answers).all(axis=2)
        assert np.array_equal(finite, np.isfinite(answers).any(axis=2)), (
            "an answer is NaN in part"
        )
        sample, branch = np.nonzero(finite)
        assert len(sample) >= len(q) - 1
        postures = q[sample].copy()
        postures[:, joints] = answers[sample, branch]
        # A slide that runs almost along the circle it has to meet goes far: positions are good to their own size.
        size = 1.0 + np.abs(np.where(self.turning, 0.0, postures)).max(axis=1)
        assert (self.miss(postures, self.targets[sample]) / size).max() < 1e-8
        assert np.all(finite.sum(axis=1)[regular] == distinct_roots)

        margins = margins_of(solver, q)
        if margins.shape[2] == 0:  # the closed form is linear with a constant matrix
            assert np.ptp(determinant) < 1e-9 * scale
            label = np.zeros(len(q), dtype=int)
        else:
            assert margins.shape == (len(q), 2, 1)
            ratio = margins[:, 0, 0] / determinant
            np.testing.assert_allclose(ratio[regular], ratio[regular][0], rtol=1e-6)
            np.testing.assert_allclose(margins[:, 1], -margins[:, 0], atol=1e-12)
            assert 0.05 < np.abs(margins).max() < 20.0, (
                "margins are of the order of one"
            )
            label = np.argmax(margins[:, :, 0], axis=1)
        back = wrap(
            answers[np.arange(len(q)), label] - q[:, joints], self.turning[joints]
        )
        slack = 1e-9 * scale / np.abs(determinant)
        assert np.all(np.abs(back).max(axis=1)[regular] < slack[regular]), (
            "the posture's own branch gives another posture"
        )
        return candidate

    def check_margin_gradient(self, candidate: TriedDecomposition) -> None:
        """Compare the margins' derivatives with differences."""
        assert candidate.solver is not None
        check_margin_gradient(candidate.solver, self.q[:40], atol=1e-7)
