"""Poses that lead to a polynomial: a wrist joint, or one of three parallel joints, redundant on a rail."""

from __future__ import annotations

import numpy as np
import pytest

from brachis.errors import DecompositionError
from brachis.ik import ChainGeometry, NotApplicableError, find
from brachis.ik.displacement import Displacement
from brachis.ik.polynomial import polynomial
from brachis.ik.polynomial_equations import Equations
from brachis.ik.trigonometric import real_roots, sample_angles
from brachis.robot import task_map_of
from support.arms import (
    MOUNT,
    SKEW,
    TOOL,
    PoseBench,
    X,
    Y,
    Z,
    on_random_rail,
    rolling,
    tx90l,
    ur10,
    zero_crossing,
)

UR, TX = (arm.with_tool(TOOL) for arm in (ur10(), tx90l()))


CASES = {
    **{f"UR10 on a rail, {j}": (UR.with_slide(0, Y).robot(), (j,)) for j in (2, 3, 4)},
    **{
        f"UR10 on a skew rail, {j}": (UR.with_slide(0, SKEW).robot(MOUNT), (j,))
        for j in (2, 3, 4)
    },
    **{
        f"UR10 with a slide after pan, {j}": (UR.with_slide(1, SKEW).robot(MOUNT), (j,))
        for j in (2, 3, 4)
    },
    **{
        f"UR10 with a rail at its tool, {j}": (
            UR.with_slide(0, Y).mirrored.robot(MOUNT),
            (j,),
        )
        for j in (4, 3, 2)
    },
    **{f"TX90L on a rail, {j}": (TX.with_slide(0, Y).robot(), (j,)) for j in (4, 5, 6)},
    **{
        f"TX90L on a skew rail, {j}": (TX.with_slide(0, SKEW).robot(MOUNT), (j,))
        for j in (4, 5, 6)
    },
    **{
        f"TX90L with a slide after joint 1, {j}": (
            TX.with_slide(1, SKEW).robot(MOUNT),
            (j,),
        )
        for j in (4, 5, 6)
    },
    **{
        f"TX90L with a rail at its tool, {j}": (
            TX.with_slide(0, SKEW).mirrored.robot(MOUNT),
            (j,),
        )
        for j in (2, 1, 0)
    },
    "UR10 that rolls, 3": (rolling(UR.with_slide(0, Y)), (3, 7)),
    "TX90L that rolls, 5": (rolling(TX.with_slide(0, Y)), (5, 7)),
    **{
        f"UR10 with random senses and zeros, {j}": (on_random_rail(UR, j), (j,))
        for j in (2, 3, 4)
    },
    **{
        f"TX90L with random senses and zeros, {j}": (on_random_rail(TX, j), (j,))
        for j in (4, 5, 6)
    },
}
FEW = [
    "UR10 on a rail, 3",
    "TX90L on a rail, 4",
    "TX90L on a rail, 5",
    "TX90L on a rail, 6",
    "UR10 on a skew rail, 2",
]


def bench_of(name, **options):
    robot, redundant = CASES[name]
    return PoseBench(polynomial, robot, redundant, **options)


def own_class(bench, solved, q):
    """Distances of postures from the nearest answer of their determinant's sign, and the margins of this sign."""
    margin = bench.solver.branch_margins(q, 0)[:, 0]
    distance = bench.distance(solved, q)
    nearest = np.where(
        margin > 0.0, distance[:, :6].min(axis=1), distance[:, 6:].min(axis=1)
    )
    return nearest, np.abs(margin)


@pytest.mark.parametrize("name", CASES)
def test_every_answer_is_right_and_none_is_left_out(name):
    bench = bench_of(name)
    assert bench.solver.kind == "polynomial"
    assert bench.solver.branches == ("determinant_positive", "determinant_negative")
    assert bench.solver.alternatives == 6
    solved = bench.answers(bench.q)
    _, branch, postures = bench.check_answers(solved)

    nearest, margin = own_class(bench, solved, bench.q)
    assert nearest[margin > 1e-4].max() < 1e-6
    ratio = bench.determinant(bench.q) / bench.solver.branch_margins(bench.q, 0)[:, 0]
    np.testing.assert_allclose(ratio, ratio[0], rtol=1e-6)
    signed = bench.solver.branch_margins(postures, 0)[:, 0]
    np.testing.assert_array_equal(signed > 0.0, branch < 6)
    other_sign = bench.solver.branch_margins(postures[:9], 1)
    np.testing.assert_allclose(other_sign, -signed[:9, None], atol=1e-12)
    assert 0.8 < np.abs(bench.margins(bench.q)).max() < 3.0

    # Every pose has as many answers of one sign as of the other.
    finite = np.isfinite(solved).all(axis=2)
    balanced = finite[:, :6].sum(axis=1) == finite[:, 6:].sum(axis=1)
    assert np.count_nonzero(~balanced) <= 1
    assert set(np.unique(finite.sum(axis=1)[balanced])) >= {2, 4, 6}
    bench.check_gradient()


@pytest.mark.parametrize("name", FEW)
def test_answers_of_a_sign_are_distinct_and_in_ascending_order(name):
    bench = bench_of(name)
    solved = bench.answers(bench.q).reshape(-1, 6, 6)
    angle = solved[:, :, 1]
    steps = np.diff(angle, axis=1)
    assert not np.any(steps < -0.01)
    finite = np.isfinite(angle)
    assert np.all(np.diff(finite.astype(int), axis=1) <= 0), (
        "the first alternatives are filled"
    )
    assert np.nanmin(np.abs(np.diff(solved, axis=1)).max(axis=2)) > 1e-6


@pytest.mark.parametrize("name", FEW)
def test_the_nearest_answer_of_the_sign_follows_smooth_curves(name):
    bench = bench_of(name)
    changes = 0
    for seed in range(4):
        q = bench.curve(seed)
        solved = bench.answers(q)
        nearest, margin = own_class(bench, solved, q)
        assert nearest[margin > 1e-4].max() < 1e-6, "the curve loses its answer"
        sign = np.sign(bench.solver.branch_margins(q, 0)[:, 0])
        np.testing.assert_array_equal(
            np.diff(sign) != 0.0, np.diff(np.sign(bench.determinant(q))) != 0.0
        )
        changes += np.count_nonzero(np.diff(sign))
    assert changes >= 1, "no curve crossed a boundary: the test shows nothing"


# Not joint 5 of the TX90L: with q5 = 0 held, joints 4 and 6 turn about one axis and answers are not isolated.
@pytest.mark.parametrize("name", [name for name in FEW if name != "TX90L on a rail, 5"])
def test_answers_of_both_signs_meet_where_the_margin_vanishes(name):
    bench, met = bench_of(name), 0
    for seed in range(6):
        found = zero_crossing(
            lambda q: bench.solver.branch_margins(q, 0)[:, 0], bench.curve(seed)
        )
        if found is None:
            continue
        gaps = []
        for share in (0.1, 0.01):
            near = (found[0] + share * found[1])[None]
            distance = bench.distance(bench.answers(near), near)[0]
            assert min(distance) < 1e-6
            gaps.append(max(distance[:6].min(), distance[6:].min()))
        assert gaps[1] < 0.2 * gaps[0]
        met += 1
    assert met >= 2


@pytest.mark.parametrize("name", [name for name in CASES if "on a rail" in name])
@pytest.mark.parametrize("noise", [0.0, 1e-9, 1e-6, 1e-3])
def test_postures_with_right_angles(name, noise):
    # The polynomial has a fourfold root where the arm points along the rail, double ones at right angles of the wrist.
    bench = bench_of(name)
    rng = np.random.default_rng(3)
    special = rng.choice(np.pi * np.array([-0.5, 0.0, 0.25, 0.5, 1.0]), bench.q.shape)
    q = np.where(
        rng.random(bench.q.shape) < 0.5, special, bench.q
    ) + noise * rng.normal(size=bench.q.shape)
    nearest, margin = own_class(bench, bench.answers(q), q)
    regular = margin > 1e-3
    assert np.mean(regular) > 0.5
    assert (
        np.count_nonzero(nearest[regular] > 1e-6) <= 1
    )  # yet more answers coincide there


def test_resultant_is_of_degree_six_and_vanishes_at_the_posture():
    for name in FEW:
        bench = bench_of(name, postures=200)
        equation = Displacement.of(
            bench.geometry,
            bench.redundant,
            bench.poses(bench.q),
            bench.q[:, bench.redundant],
        )
        equations = Equations.of(equation, turn=1, slide=0)
        samples = equations.resultant(2.0 * np.pi * np.arange(32) / 32)
        spectrum = np.abs(np.fft.rfft(samples, axis=0))
        assert np.all(spectrum[7:] < 1e-12 * spectrum.max(axis=0))
        assert np.all(spectrum[6].max() > 1e-6 * spectrum.max())
        own = np.array(
            [
                equations[np.array([k])].resultant(bench.q[k, 1:2])[0, 0]
                for k in range(200)
            ]
        )
        assert np.all(np.abs(own) < 1e-11 * np.abs(samples).max(axis=0))


def test_real_roots_of_known_polynomials():
    angles = sample_angles(6)
    known = np.array([-2.0, 0.3, 0.3001, 1.7])

    def product(q):
        return np.prod([np.sin(q - root) for root in known], axis=0)

    wild = product(angles) * (2.0 + np.cos(angles))
    rows = np.stack(
        [
            wild,
            np.zeros(16),
            np.full(16, np.nan),
            np.ones(16),
            1.5 + np.cos(2.0 * angles),
        ],
        axis=1,
    )
    roots = real_roots(rows, 6)
    found = np.sort(np.mod(roots[np.isfinite(roots[:, 0]), 0], 2.0 * np.pi))
    np.testing.assert_allclose(
        found,
        np.sort(np.mod(np.concatenate([known, known + np.pi]), 2.0 * np.pi)),
        atol=1e-8,
    )
    assert np.isnan(roots[:, 1:]).all()


def test_out_of_reach_is_nan_without_a_warning():
    bench = bench_of("TX90L on a rail, 5", postures=5)
    far = bench.poses(bench.q)
    far[:, 2] += 10.0
    assert np.isnan(bench.solver.solve(far, bench.q[:, [5]])).all()
    assert np.isnan(
        bench.solver.solve(np.full((2, 12), np.nan), np.zeros((2, 1)))
    ).all()
    assert bench.solver.solve(far[:0], np.empty((0, 1))).shape == (0, 2, 6, 6)


def test_registry_finds_it_and_says_so():
    robot, _ = CASES["TX90L on a rail, 5"]
    match = find(robot, task_map_of(robot, "pose"), ["j6"], families=[polynomial])
    assert match.family == "polynomial"


@pytest.mark.parametrize("j", ["j3", "j4", "j5"])
def test_rail_that_never_helps_is_refused(j):
    robot = UR.with_slide(0, Z).robot(MOUNT)
    with pytest.raises(DecompositionError) as caught:
        find(robot, task_map_of(robot, "pose"), [j], families=[polynomial])
    assert (
        caught.value.reasons["polynomial"]
        == "j1 never moves the arm along the parallel axes"
    )


def refusal(robot, redundant, rows="pose"):
    with pytest.raises(NotApplicableError) as caught:
        polynomial.build(ChainGeometry.of(robot), task_map_of(robot, rows), redundant)
    return str(caught.value)


def test_reasons():
    rail = UR.with_slide(0, Y).robot()
    assert refusal(rail, (0,)) == "one slide is needed among the six joints, not 0"
    two = UR.with_slide(0, Y).with_slide(0, X).robot()
    assert refusal(two, (3, 4)) == "one slide is needed among the six joints, not 2"
    assert (
        refusal(rail, (1,)) == "three successive axes are parallel: that is closed form"
    )
    assert (
        refusal(rail, (6,)) == "three successive axes are parallel: that is closed form"
    )
    assert refusal(TX.with_slide(0, Y).robot(), (2,)).startswith(
        "not j1 and a revolute joint before two with parallel"
    )
    assert refusal(rail, (1, 2)) == "5 joints would be left over, not six"
    assert refusal(rail, (0, 1, 2, 3), ["x", "y", "z"]) == "only for poses"
