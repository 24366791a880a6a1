"""What a closed form owes whose branches are told apart by factors of det J_nr, checked against Pinocchio."""

from __future__ import annotations

import numpy as np

from brachis.ik import ChainGeometry
from brachis.ik.spherical_wrist import spherical_wrist
from brachis.robot import task_map_of
from support.closed_forms import check_margin_gradient, margins_of, wrap


class Bench:
    """Random postures of a robot, their task coordinates by Pinocchio, and a solver for some redundant joints."""

    def __init__(
        self,
        robot,
        redundant,
        postures=300,
        seed=5,
        family=spherical_wrist,
        rows="pose",
    ):
        self.robot, self.redundant = robot, list(redundant)
        self.space = task_map_of(robot, rows)
        self.rest = [i for i in range(robot.n) if i not in redundant]
        self.turning = robot.revolute[self.rest]
        self.q = np.random.default_rng(seed).uniform(-np.pi, np.pi, (postures, robot.n))
        self.solver = family.build(
            ChainGeometry.of(robot), self.space, tuple(redundant)
        )

    def targets(self, q):
        return self.space.values(q)

    def solve(self, q):
        """Non-redundant joints (K, B A, m) that reach the targets of postures."""
        solved = self.solver.solve(self.targets(q), q[:, self.redundant])
        shape = (len(self.solver.branches), self.solver.alternatives, self.space.m)
        assert solved.shape == (len(q), *shape)
        return solved.reshape(len(q), -1, self.space.m)

    def answers(self, q):
        """Postures (K, B A, n) that reach the targets of the given ones."""
        solved = self.solve(q)
        postures = np.repeat(q[:, None], solved.shape[1], axis=1)
        postures[:, :, self.rest] = solved
        return postures

    def distance(self, solved, q):
        """Largest difference (K, ...) of answers from the non-redundant joints of postures; infinite for NaN."""
        joints = q[:, *[None] * (solved.ndim - 2), self.rest]
        gap = np.abs(wrap(solved - joints, self.turning)).max(axis=-1)
        return np.where(np.isnan(gap), np.inf, gap)

    def check_answers(self, solved):
        """Put the answers for the random postures to the test; return their samples, branches and postures."""
        sample, branch = np.nonzero(np.isfinite(solved).all(axis=2))
        count = self.space.m * len(sample)
        assert np.isfinite(solved).sum() == count, "an answer is NaN in part"
        postures = self.q[sample]
        postures[:, self.rest] = solved[sample, branch]
        # A slide that runs almost across the way it has to go goes far: positions are good to their own size.
        ways = np.where(self.turning, 0.0, postures[:, self.rest])
        size = 1.0 + np.abs(ways).max(axis=1)
        targets = self.targets(self.q)[sample]
        miss = np.abs(self.space.difference(self.targets(postures), targets))
        assert (miss.max(axis=1) / size).max() < 1e-8
        return sample, branch, postures

    def margins(self, q):
        """Margins (K, B, k) of all branches."""
        return margins_of(self.solver, q)

    def determinant(self, q):
        return np.linalg.det(self.space.jacobian(self.space.twists(q))[:, :, self.rest])

    def check(self, *, with_gradient=True):
        """Hold the closed form to its promises; slopes of margins are recorded anew for every one, which takes time."""
        solved = self.solve(self.q)
        _, branch, postures = self.check_answers(solved)
        angles = postures[:, self.rest][:, self.turning]
        assert np.all((angles > -np.pi) & (angles <= np.pi))

        margins = self.margins(self.q)
        assert margins.shape[2] <= 3
        largest = np.abs(margins).max(axis=(0, 1))
        assert np.all((largest > 0.8) & (largest < 3.0)), (
            "margins are of the order of one"
        )
        inside = (margins > 0.0).all(axis=2)
        assert np.all(inside.sum(axis=1) == 1), "a posture is in exactly one branch"
        label = np.argmax(inside, axis=1)
        assert set(label) == set(range(len(self.solver.branches)))
        product = np.abs(margins[:, 0]).prod(axis=1)
        gap = self.distance(solved[np.arange(len(label)), label], self.q)
        assert (gap * product)[product > 1e-6].max() < 1e-10
        for b in range(len(self.solver.branches)):
            margin = self.solver.branch_margins(postures[branch == b], b)
            assert margin.min(initial=np.inf) > -1e-7

        determinant = self.determinant(self.q)
        ratio = determinant[product > 1e-4] / margins[product > 1e-4, 0].prod(axis=1)
        np.testing.assert_allclose(ratio, ratio[0], rtol=1e-7)
        if with_gradient:
            self.check_gradient()
        return self

    def check_gradient(self):
        """Compare the margins' derivatives with differences."""
        check_margin_gradient(self.solver, self.q[:20], atol=1e-8)

    def check_labels_along_curves(self):
        """Labels follow their branch along smooth curves, and determinants change sign where margins do."""
        rng, t = np.random.default_rng(11), np.linspace(0.0, 1.0, 2001)[:, None]
        n, changes, followed = self.robot.n, 0, 0
        for _ in range(4):
            amplitude = rng.uniform(0.5, 2.0, n)
            sway = amplitude * np.sin(2.0 * np.pi * t * rng.uniform(0.3, 1.0, n))
            q = rng.uniform(-2.0, 2.0, n) + sway
            postures = self.answers(q)
            for branch in range(postures.shape[1]):
                exists = np.isfinite(postures[:, branch]).all(axis=1)
                margin = np.full(len(t), -1.0)
                margin[exists] = self.solver.branch_margins(
                    postures[exists, branch], branch
                ).min(axis=1)
                assert np.all(margin[exists] > -1e-7), (
                    "an answer lies outside its own branch"
                )
                steps = np.diff(postures[:, branch][:, self.rest], axis=0)
                inside = (margin[1:] > 0.15) & (margin[:-1] > 0.15)
                assert (
                    np.abs(wrap(steps, self.turning))[inside].max(initial=0.0) < 0.2
                ), "the branch jumps"
                followed += np.count_nonzero(inside)
            crossings = np.diff(np.sign(self.margins(q)[:, 0]), axis=0) != 0.0
            turned = np.diff(np.sign(self.determinant(q))) != 0.0
            np.testing.assert_array_equal(turned, crossings.sum(axis=1) % 2 == 1)
            changes += np.count_nonzero(turned)
        assert changes >= 2, "no curve crossed a boundary: the test shows nothing"
        assert followed > 4000
