"""Poses solved by EAIK: against Pinocchio on random and on awkward postures, and what is refused."""

from __future__ import annotations

import functools
import subprocess
import sys

import numpy as np
import pytest

from brachis.errors import DecompositionError
from brachis.ik import (
    ChainGeometry,
    NotApplicableError,
    check_answers,
    find,
)
from brachis.ik.eaik import eaik, exact_axes
from brachis.ik.snapping import PolishedSolver
from brachis.robot import task_map_of
from support.closed_forms import wrapped
from support.pose_arms import (
    FAMILIES,
    X,
    Y,
    Z,
    family,
    gen3,
    iiwa,
    iiwa_by_angles,
    much_redundant,
    panda,
    panda_lengths,
    rail_arm,
    telescope,
    ur,
)

pytest.importorskip("eaik")

PER_SIGN = 8


class Bench:
    """Random postures of a robot, their poses, and the solver for some redundant joints."""

    def __init__(self, robot, redundant, postures=600, seed=5):
        self.robot, self.redundant = robot, list(redundant)
        self.space = task_map_of(robot, "pose")
        self.rest = [i for i in range(robot.n) if i not in redundant]
        self.q = np.random.default_rng(seed).uniform(-np.pi, np.pi, (postures, robot.n))
        self.solver = eaik.build(ChainGeometry.of(robot), self.space, tuple(redundant))

    def poses(self, q):
        return self.space.values(q)

    def solve(self, q):
        """Answers (K, 2, 8, 6) for the poses of postures."""
        return self.solver.solve(self.poses(q), q[:, self.redundant])

    def margin(self, q):
        """Branch margin of the positive label, (K,)."""
        return self.solver.branch_margins(q, 0)[:, 0]

    def own_gap(self, q, answers):
        """Distance (K,) of each posture from the nearest answer with the label of the posture's own sign."""
        sign = (self.margin(q) < 0.0).astype(int)
        own = answers[np.arange(len(q)), sign]
        gap = np.abs(wrapped(own - q[:, None, self.rest], np.ones(6, dtype=bool))).max(
            axis=2
        )
        return np.where(np.isnan(gap), np.inf, gap).min(axis=1)


CASES = {
    "ur": (ur, [()]),
    "iiwa": (iiwa, [(i,) for i in (0, 1, 2, 4, 5, 6)]),
    "panda_lengths": (panda_lengths, [(i,) for i in (3, 4, 5, 6)]),
    "panda": (panda, [(i,) for i in (3, 4, 5, 6)]),
    "rail_arm": (rail_arm, [(0,)]),
    "much_redundant": (much_redundant, [(0, 1, 4, 9), (0, 1, 8, 9), (0, 1, 2, 9)]),
    "telescope": (telescope, [(2, 3)]),
    "rounded": (functools.partial(iiwa_by_angles, 1.57079633), [(0,), (2,)]),
}
CASES |= {
    f"family {kind}": (functools.partial(family, kind), [()]) for kind in FAMILIES
}
PARAMETERS = [
    pytest.param(robot, redundant, id=f"{name}-{redundant}")
    for name, (robot, choices) in CASES.items()
    for redundant in choices
]


@pytest.mark.parametrize(("robot", "redundant"), PARAMETERS)
def test_all_postures_are_found_and_all_answers_right(robot, redundant):
    bench = Bench(robot(), redundant)
    q, rest, solver = bench.q, bench.rest, bench.solver
    assert solver.branches == ("determinant_positive", "determinant_negative")
    assert solver.alternatives == PER_SIGN
    answers = bench.solve(q)
    assert answers.shape == (len(q), 2, PER_SIGN, 6)
    finite = np.isfinite(answers).all(axis=3)
    assert np.array_equal(finite, np.isfinite(answers).any(axis=3)), (
        "an answer is NaN in part"
    )
    assert np.nanmax(answers) <= np.pi
    assert np.nanmin(answers) > -np.pi

    sample, branch, _ = np.nonzero(finite)
    postures = q[sample]
    postures[:, rest] = answers[finite]
    assert (
        np.abs(
            bench.space.difference(bench.poses(postures), bench.poses(q)[sample])
        ).max()
        < 1e-8
    )

    margin = bench.margin(postures)
    assert np.array_equal(margin > 0.0, branch == 0), (
        "an answer has the other sign's label"
    )
    assert 0.5 < np.abs(margin).max() < 20.0, "margins are of the order of one"
    determinant = np.linalg.det(
        bench.space.jacobian(bench.space.twists(postures))[:, :, rest]
    )
    clear = np.abs(margin) > 1e-5
    ratio = margin[clear] / determinant[clear]
    np.testing.assert_allclose(ratio, ratio[0], rtol=1e-6)

    own = np.abs(bench.margin(q))
    clear = (
        own > 1e-5
    )  # nearer to the boundary an URDF's rounding decides whether there is an answer
    assert np.mean(clear) > 0.98
    assert np.all(bench.own_gap(q, answers)[clear] < 1e-9 / own[clear])
    regular = np.ones(len(q), dtype=bool)
    regular[sample[np.abs(margin) < 1e-5]] = False
    by_sign = finite.sum(axis=2)
    assert np.array_equal(by_sign[regular, 0], by_sign[regular, 1]), (
        "answers of either sign are equally many"
    )
    check_answers(bench.robot, bench.space, tuple(redundant), solver)


@pytest.mark.parametrize(
    ("robot", "redundant"),
    [(ur, ()), (iiwa, (2,)), (panda_lengths, (5,)), (much_redundant, (0, 1, 4, 9))],
)
def test_margin_gradient(robot, redundant):
    bench = Bench(robot(), redundant, 20)
    for branch in (0, 1):
        exact = bench.solver.margin_gradient(bench.q, branch)
        for joint, step in enumerate(1e-6 * np.eye(bench.robot.n)):
            change = bench.solver.branch_margins(
                bench.q + step, branch
            ) - bench.solver.branch_margins(bench.q - step, branch)
            np.testing.assert_allclose(exact[:, :, joint], change / 2e-6, atol=1e-8)


@pytest.mark.parametrize(
    ("robot", "redundant"),
    [
        (iiwa, (2,)),
        (iiwa, (4,)),
        (iiwa, (1,)),
        (panda_lengths, (4,)),
        (panda_lengths, (5,)),
    ],
)
def test_held_values_at_which_axes_become_almost_parallel(robot, redundant):
    bench = Bench(robot(), redundant)
    rng = np.random.default_rng(6)
    q, count = bench.q, len(bench.q)
    off = np.where(
        rng.uniform(size=count) < 0.1, 0.0, 10.0 ** rng.uniform(-16.0, -3.0, count)
    )
    q[:, redundant[0]] = rng.choice(
        [0.0, 0.5 * np.pi, np.pi], count
    ) + off * rng.choice([-1.0, 1.0], count)
    q = q[np.abs(bench.margin(q)) > 5e-3]
    assert len(q) > count / 5
    answers = bench.solve(q)
    assert bench.own_gap(q, answers).max() < 1e-7
    exists = np.isfinite(answers).all(axis=3)
    sample = np.nonzero(exists)[0]
    postures = q[sample]
    postures[:, bench.rest] = answers[exists]
    assert (
        np.abs(
            bench.space.difference(bench.poses(postures), bench.poses(q)[sample])
        ).max()
        < 1e-8
    )


def test_values_that_recur_and_values_that_are_dropped_give_the_same_answers(
    monkeypatch,
):
    bench = Bench(iiwa(), (2,), 200)
    q = bench.q
    q[:, 2] = np.tile(np.linspace(-1.0, 1.0, 20), 10)
    first = bench.solve(q)
    assert bench.own_gap(q, first).max() < 1e-6
    monkeypatch.setattr("brachis.ik.eaik._KEPT", 5)
    for _ in range(2):
        np.testing.assert_allclose(bench.solve(q[::-1]), first[::-1], atol=1e-12)
    one_by_one = np.concatenate([bench.solve(posture[None]) for posture in q])
    np.testing.assert_allclose(one_by_one, first, atol=1e-12)


def rows(robot, *names):
    return task_map_of(robot, list(names) or "pose")


@pytest.mark.parametrize(
    ("robot", "redundant", "names", "reason"),
    [
        (
            iiwa,
            (3,),
            (),
            "J_nr is singular everywhere: there is always a motion of the tool that needs j4",
        ),
        (iiwa, (0, 1, 2, 3), ("x", "y", "z"), "this family solves only poses"),
        (
            rail_arm,
            (1,),
            (),
            "EAIK needs six revolute joints besides the redundant ones; prismatic: j1",
        ),
        *(
            (panda_lengths, (i,), (), "EAIK cannot decompose this arm")
            for i in (0, 1, 2)
        ),
        *((gen3, (i,), (), "EAIK cannot decompose this arm") for i in range(7)),
    ],
)
def test_refusals(robot, redundant, names, reason):
    robot = robot()
    with pytest.raises(NotApplicableError, match=reason) as caught:
        eaik.build(ChainGeometry.of(robot), rows(robot, *names), redundant)
    assert "digits" not in str(caught.value)


def test_angles_that_the_urdf_rounds_too_far_are_named_as_the_cause():
    robot = iiwa_by_angles(1.5708)
    with pytest.raises(NotApplicableError, match="EAIK cannot decompose this arm"):
        eaik.build(ChainGeometry.of(robot), rows(robot), (2,))
    # The registry then looks at the ideal arm; of one that is farther off it says what is the matter.
    assert isinstance(find(robot, rows(robot), ["j3"]).solver, PolishedSolver)
    robot = iiwa_by_angles(1.57)
    with pytest.raises(DecompositionError) as caught:
        find(robot, rows(robot), ["j7"])
    assert "rounds angles, as in 1.57" in caught.value.reasons["eaik"]


def test_without_eaik_the_reason_is_that(monkeypatch):
    monkeypatch.setitem(sys.modules, "eaik.pybindings.EAIK", None)
    robot = ur()
    with pytest.raises(NotApplicableError, match="not installed"):
        eaik.build(ChainGeometry.of(robot), rows(robot), ())


def test_only_the_compiled_part_of_eaik_is_loaded_and_that_when_needed():
    code = """
import sys
import brachis.ik.eaik as answers
assert not [name for name in sys.modules if name.startswith("eaik")]
assert answers.is_installed()
assert "eaik.pybindings.EAIK" in sys.modules
print(sorted({"urchin", "trimesh", "pyglet", "eaik.IK_Robot"} & set(sys.modules)))
"""
    done = subprocess.run(
        [sys.executable, "-W", "error", "-c", code],
        capture_output=True,
        text=True,
        check=True,
    )
    assert done.stdout.strip() == "[]"


def lines_apart(axes, points, first, second):
    """Distance of two straight lines that are not parallel."""
    normal = np.cross(axes[:, first, 0], axes[:, second, 0])
    return abs(normal @ (points[:, second, 0] - points[:, first, 0])) / np.linalg.norm(
        normal
    )


def test_exact_axes():
    rng = np.random.default_rng(8)
    frame = np.linalg.qr(rng.normal(size=(3, 3)))[0]
    centre = np.array([0.3, -0.2, 0.7])
    exact = frame @ np.array([Z, Y, Y, Z, Y, X]).T
    axes = exact + 1e-9 * rng.normal(size=(3, 6))
    axes /= np.linalg.norm(axes, axis=0)
    # The first two meet in one place, the last three in the centre, each given by some point along it.
    places = (
        centre[:, None]
        + frame
        @ np.array(
            [[0, 0, -2], [0, 0, -2], [1, 0, -1], [0, 0, 0], [0, 0, 0], [0, 0, 0.0]]
        ).T
    )
    points = places + exact * rng.normal(size=6) + 1e-9 * rng.normal(size=(3, 6))
    axes, points = axes[:, :, None], points[:, :, None]
    assert lines_apart(axes, points, 3, 4) > 1e-12

    turned, moved = exact_axes(axes, points, 1e-8)
    np.testing.assert_array_equal(turned[:, 1], turned[:, 2])
    np.testing.assert_array_equal(turned[:, 1], turned[:, 4])
    np.testing.assert_array_equal(turned[:, 0], turned[:, 3])
    assert lines_apart(turned, moved, 0, 1) < 1e-15
    assert lines_apart(turned, moved, 3, 4) < 1e-15
    np.testing.assert_array_equal(moved[:, 4], moved[:, 5])
    np.testing.assert_allclose(turned, axes, atol=1e-8)
    shift = moved - points
    across = shift - axes * np.sum(shift * axes, axis=0)
    assert np.abs(across).max() < 3e-8, "axes move along themselves only"

    left, still = exact_axes(axes, points, 1e-13)
    np.testing.assert_array_equal(left, axes)
    assert lines_apart(left, still, 3, 4) > 1e-12
