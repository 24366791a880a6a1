"""What a closed form with a spherical wrist owes, checked against Pinocchio on random postures."""

from __future__ import annotations

import numpy as np

from brachis.ik import ChainGeometry, margin_gradient
from brachis.ik.spherical_wrist import spherical_wrist
from brachis.kinematics import TaskKinematics
from brachis.robot import TaskSpace


def wrapped(delta, turning):
    return np.where(turning, np.remainder(delta + np.pi, 2.0 * np.pi) - np.pi, delta)


class Bench:
    """Random postures of a robot, their poses by Pinocchio, and the solver for some redundant joints."""

    def __init__(self, robot, redundant, postures=2000, seed=5):
        self.robot, self.redundant = robot, list(redundant)
        self.space = TaskSpace.of(robot, "pose")
        self.rest = [i for i in range(robot.n) if i not in redundant]
        self.turning = np.array([unit == "rad" for unit in robot.position_units])[self.rest]
        self.q = np.random.default_rng(seed).uniform(-np.pi, np.pi, (postures, robot.n))
        self.solver = spherical_wrist.build(ChainGeometry.of(robot), self.space, tuple(redundant))

    def poses(self, q):
        return self.space.values(*self.robot.tool_placements(q))

    def answers(self, q):
        """Postures (K, B, n) that reach the poses of the given ones."""
        solved = self.solver.solve(self.poses(q), q[:, self.redundant])
        assert solved.shape == (len(q), len(self.solver.branches), 6)
        postures = np.repeat(q[:, None], solved.shape[1], axis=1)
        postures[:, :, self.rest] = solved
        return postures

    def margins(self, q):
        """Margins (K, B, k) of all branches."""
        return np.stack([self.solver.branch_margins(q, b) for b in range(len(self.solver.branches))], axis=1)

    def determinant(self, q):
        return np.linalg.det(TaskKinematics(self.robot, self.space).jacobian(q)[:, :, self.rest])

    def check(self):
        """Hold the closed form to its promises."""
        postures = self.answers(self.q)
        finite = np.isfinite(postures).all(axis=2)
        solved = postures[:, :, self.rest]
        assert np.array_equal(finite, np.isfinite(solved).any(axis=2)), "an answer is NaN in part"
        angles = solved[finite][:, self.turning]
        assert np.all((angles > -np.pi) & (angles <= np.pi))
        sample, branch = np.nonzero(finite)
        size = 1.0 + np.abs(np.where(self.turning, 0.0, solved[finite])).max(axis=1)
        targets = self.poses(self.q)
        miss = np.abs(self.space.difference(self.poses(postures[finite]), targets[sample])).max(axis=1)
        assert (miss / size).max() < 1e-8

        margins = self.margins(self.q)
        assert margins.shape[2] <= 3
        largest = np.abs(margins).max(axis=(0, 1))
        assert np.all((largest > 0.8) & (largest < 3.0)), "margins are of the order of one"
        inside = (margins > 0.0).all(axis=2)
        assert np.all(inside.sum(axis=1) == 1), "a posture is in exactly one branch"
        own = np.argmax(inside, axis=1)
        assert set(own) == set(range(len(self.solver.branches)))
        product = np.abs(margins[:, 0]).prod(axis=1)
        back = wrapped(solved[np.arange(len(own)), own] - self.q[:, self.rest], self.turning)
        assert (np.abs(back).max(axis=1) * product)[product > 1e-6].max() < 1e-9
        for b in range(len(self.solver.branches)):
            assert self.solver.branch_margins(postures[sample[branch == b], b], b).min() > -1e-7

        determinant = self.determinant(self.q)
        ratio = determinant[product > 1e-4] / margins[product > 1e-4, 0].prod(axis=1)
        np.testing.assert_allclose(ratio, ratio[0], rtol=1e-7)
        self.check_gradient()
        return self

    def check_gradient(self):
        q, h = self.q[:20], 1e-5
        for branch in (0, len(self.solver.branches) - 1):
            exact = margin_gradient(self.solver, q, branch)
            for joint, step in enumerate(h * np.eye(self.robot.n)):
                upper, lower = (self.solver.branch_margins(q + s, branch) for s in (step, -step))
                np.testing.assert_allclose(exact[:, :, joint], (upper - lower) / (2.0 * h), atol=1e-8)
