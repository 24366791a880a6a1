"""Poses solved by EAIK: against Pinocchio on random and on awkward postures, and what is refused."""

import functools
import sys

import numpy as np
import pytest
from numpy.testing import assert_allclose

from brachis.errors import DecompositionError
from brachis.ik import ChainGeometry, NotApplicableError, check_answers, find
from brachis.ik.eaik import eaik
from brachis.ik.snapping import PolishedSolver
from brachis.robot import task_map_of
from support.factored_bench import Bench
from support.pose_arms import (
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
from support.scripts import output_of

pytest.importorskip("eaik")

PER_SIGN = 8


def bench_of(robot, redundant, postures=600):
    return Bench(robot(), redundant, postures, family=eaik)


def margin_of(bench, q):
    """Branch margin of the positive label, (K,)."""
    return bench.solver.branch_margins(q, 0)[:, 0]


def gap_in_label(bench, q, solved):
    """Distance (K,) of each posture from the nearest answer with the label of the posture's sign."""
    sign = (margin_of(bench, q) < 0.0).astype(int)
    labelled = solved.reshape(len(q), 2, PER_SIGN, 6)[np.arange(len(q)), sign]
    return bench.distance(labelled, q).min(axis=1)


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
PARAMETERS = [
    pytest.param(robot, redundant, id=f"{name}-{redundant}")
    for name, (robot, choices) in CASES.items()
    for redundant in choices
]


@pytest.mark.parametrize("robot, redundant", PARAMETERS)
def test_all_postures_are_found_and_all_answers_right(robot, redundant):
    bench = bench_of(robot, redundant)
    q, solver = bench.q, bench.solver
    assert solver.branches == ("determinant_positive", "determinant_negative")
    assert solver.alternatives == PER_SIGN
    solved = bench.solve(q)
    sample, answer, postures = bench.check_answers(solved)
    assert np.nanmax(solved) <= np.pi
    assert np.nanmin(solved) > -np.pi
    branch = answer // PER_SIGN

    margin = margin_of(bench, postures)
    assert np.array_equal(margin > 0.0, branch == 0), (
        "an answer has the other sign's label"
    )
    assert 0.5 < np.abs(margin).max() < 20.0, "margins are of the order of one"
    clear = np.abs(margin) > 1e-5
    ratio = margin[clear] / bench.determinant(postures)[clear]
    assert_allclose(ratio, ratio[0], rtol=1e-6)

    margins = np.abs(margin_of(bench, q))
    # Nearer to the boundary an URDF's rounding decides whether there is an answer.
    clear = margins > 1e-5
    assert np.mean(clear) > 0.98
    assert np.all(gap_in_label(bench, q, solved)[clear] < 1e-9 / margins[clear])
    regular = np.ones(len(q), dtype=bool)
    regular[sample[np.abs(margin) < 1e-5]] = False
    exists = np.isfinite(solved).all(axis=2).reshape(-1, 2, PER_SIGN)
    counts = exists.sum(axis=2)[regular]
    assert np.array_equal(counts[:, 0], counts[:, 1]), (
        "answers of either sign are equally many"
    )
    check_answers(bench.robot, bench.space, tuple(redundant), solver)


@pytest.mark.parametrize(
    "robot, redundant",
    [(ur, ()), (iiwa, (2,)), (panda_lengths, (5,)), (much_redundant, (0, 1, 4, 9))],
)
def test_margin_gradient(robot, redundant):
    bench_of(robot, redundant, 20).check_gradient()


@pytest.mark.parametrize(
    "robot, redundant",
    [
        (iiwa, (2,)),
        (iiwa, (4,)),
        (iiwa, (1,)),
        (panda_lengths, (4,)),
        (panda_lengths, (5,)),
    ],
)
def test_held_values_at_which_axes_become_almost_parallel(robot, redundant):
    bench = bench_of(robot, redundant)
    rng = np.random.default_rng(6)
    q, count = bench.q, len(bench.q)
    is_exact = rng.uniform(size=count) < 0.1
    off = np.where(is_exact, 0.0, 10.0 ** rng.uniform(-16.0, -3.0, count))
    parallel = rng.choice([0.0, 0.5 * np.pi, np.pi], count)
    q[:, redundant[0]] = parallel + off * rng.choice([-1.0, 1.0], count)
    bench.q = q[np.abs(margin_of(bench, q)) > 5e-3]
    assert len(bench.q) > count / 5
    solved = bench.solve(bench.q)
    assert gap_in_label(bench, bench.q, solved).max() < 1e-7
    bench.check_answers(solved)


def test_values_that_recur_and_values_that_are_dropped_give_the_same_answers(
    monkeypatch,
):
    bench = bench_of(iiwa, (2,), 200)
    q = bench.q
    q[:, 2] = np.tile(np.linspace(-1.0, 1.0, 20), 10)
    first = bench.solve(q)
    assert gap_in_label(bench, q, first).max() < 1e-6
    monkeypatch.setattr("brachis.ik.eaik._KEPT", 5)
    for _ in range(2):
        assert_allclose(bench.solve(q[::-1]), first[::-1], atol=1e-12)
    one_by_one = np.concatenate([bench.solve(posture[None]) for posture in q])
    assert_allclose(one_by_one, first, atol=1e-12)


def rows(robot, *names):
    return task_map_of(robot, list(names) or "pose")


@pytest.mark.parametrize(
    "robot, redundant, names, reason",
    [
        (
            iiwa,
            (3,),
            (),
            "J_nr is singular everywhere: there is always a motion of the tool that needs j4",
        ),
        (iiwa, (0, 1, 2, 3), ("x", "y", "z"), "this family solves only for poses"),
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


def test_the_compiled_part_of_eaik_alone_loads_and_that_on_demand():
    code = """
import sys
import brachis.ik.eaik as answers
assert not [name for name in sys.modules if name.startswith("eaik")]
assert answers.is_installed()
assert "eaik.pybindings.EAIK" in sys.modules
print(sorted({"urchin", "trimesh", "pyglet", "eaik.IK_Robot"} & set(sys.modules)))
"""
    assert output_of("-W", "error", "-c", code).strip() == "[]"
