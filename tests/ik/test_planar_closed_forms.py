"""Planar chains: every pattern of up to four revolute and prismatic joints, every decomposition, by Pinocchio."""

from __future__ import annotations

import functools
import itertools

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from brachis.errors import DecompositionError
from brachis.ik.planar import planar
from support.chains import planar_robot
from support.closed_forms import Bench, wrapped

robot_of = functools.cache(planar_robot)
PATTERNS = [
    "".join(letters) for n in (2, 3, 4) for letters in itertools.product("RP", repeat=n)
]
ROWS = {
    "xy": (["x", "y"], ["x", "y", "yaw"], ["x"]),
    "xz": (["x", "z"], ["x", "z", "pitch"], ["z"]),
    "tilted": (["x", "y"], ["z", "y"], ["z"]),
}
POSTURES = {"xy": 60, "xz": 60, "tilted": 40}
CASES = [
    pytest.param(pattern, plane, rows, id=f"{pattern}-{plane}-{'+'.join(rows)}")
    for plane, choices in ROWS.items()
    for rows in choices
    for pattern in PATTERNS
    if len(pattern) >= len(rows)
]


def roots(pattern: str, rows: list[str], redundant: tuple[int, ...]) -> int:
    """How many answers plane geometry allows: two if a circle is met, one if only lines are."""
    left = [letter for i, letter in enumerate(pattern) if i not in redundant]
    if len(rows) == 3:
        left.remove("R")  # it follows from the angle
    return 2 if "R" in left else 1


@pytest.mark.parametrize(("pattern", "plane", "rows"), CASES)
def test_every_decomposition_that_exists_is_found_and_right(pattern, plane, rows):
    bench = Bench(robot_of(pattern, plane), rows, POSTURES[plane])
    for redundant, exists in bench.decompositions():
        if exists:
            candidate = bench.check(
                redundant, distinct_roots=roots(pattern, rows, redundant)
            )
            bench.check_margin_gradient(candidate)
        else:
            with pytest.raises(DecompositionError) as caught:
                bench.find(redundant)
            reasons = " ".join(caught.value.reasons.values())
            assert (
                "singular everywhere" in reasons
                or "prismatic joints do not change orientations" in reasons
            )


@pytest.mark.parametrize("rows", [["x", "y"], ["y"], ["x", "y", "yaw"]], ids="+".join)
@pytest.mark.parametrize("pattern", ["RPP", "PRPP", "PPRP", "PRP"])
def test_slides_that_the_linear_family_would_take_first(pattern, rows):
    bench = Bench(robot_of(pattern), rows, 120)
    tried = 0
    for redundant, exists in bench.decompositions():
        if exists:
            candidate = bench.check(
                redundant, (planar,), distinct_roots=roots(pattern, rows, redundant)
            )
            assert candidate.family == "planar"
            tried += 1
    assert tried


@pytest.mark.parametrize(
    ("rows", "plane"), [(["y", "x", "yaw"], "xy"), (["z", "x", "pitch"], "xz")], ids=str
)
def test_rows_in_reversed_order_with_yaw(rows, plane):
    for pattern in ("RRR", "RPR", "PRRR"):
        bench = Bench(robot_of(pattern, plane), rows, 120)
        for redundant, exists in bench.decompositions():
            assert exists
            bench.check(redundant, distinct_roots=roots(pattern, rows, redundant))


def test_two_links_reach_the_annulus_between_them_and_nothing_else():
    # Lengths follow from the URDF: joint 2 lies at (0.39, -0.05), the tool at (0.33, 0.04) from it.
    first, second = np.hypot(0.39, 0.05), np.hypot(0.33, 0.04)
    bench = Bench(robot_of("RR"), ["x", "y"], 10)
    solver = bench.find(()).solver
    shoulder = np.array([0.1, -0.2]) + np.array([0.0, 0.05])
    rng = np.random.default_rng(3)
    distance, angle = rng.uniform(0.0, 1.2, 2000), rng.uniform(-np.pi, np.pi, 2000)
    targets = shoulder + distance[:, None] * np.stack(
        [np.cos(angle), np.sin(angle)], axis=1
    )
    inside = (distance > abs(first - second)) & (distance < first + second)
    assert 0.2 < inside.mean() < 0.8
    finite = np.isfinite(solver.solve(targets, np.empty((2000, 0)))[:, :, 0]).all(
        axis=2
    )
    np.testing.assert_array_equal(finite, np.repeat(inside[:, None], 2, axis=1))


@settings(max_examples=60)
@given(
    pattern=st.sampled_from(["RR", "RP", "PR", "PP", "RRP", "PRR", "RPR", "RRRR"]),
    far=st.tuples(st.floats(-4.0, 4.0), st.floats(-4.0, 4.0)),
    free=st.lists(st.floats(-20.0, 20.0), min_size=2, max_size=2),
)
def test_a_finite_answer_reaches_any_target_and_none_is_left_out(pattern, far, free):
    bench = Bench(robot_of(pattern), ["x", "y"], 1)
    redundant = tuple(range(bench.robot.n - 2))
    q_r = np.array(free)[None, : len(redundant)]
    solver = bench.find(redundant).solver
    answers = solver.solve(np.array([far]), q_r)[0, :, 0]
    for answer in answers[np.isfinite(answers).all(axis=1)]:
        posture = np.concatenate([q_r[0], answer])
        assert bench.miss(posture[None], np.array([far]))[0] < 1e-8 * (
            1.0 + np.abs(posture).max()
        )
    if not np.isfinite(answers).any():
        # Nothing comes nearer than the two joints' own reach: the gap is real, not an oversight.
        grid = np.stack(
            np.meshgrid(*[np.linspace(-np.pi, np.pi, 61)] * 2), axis=-1
        ).reshape(-1, 2)
        turning = bench.turning[len(redundant) :]
        grid = np.where(turning, grid, grid * 4.0)
        postures = np.concatenate([np.repeat(q_r, len(grid), axis=0), grid], axis=1)
        distance = np.linalg.norm(bench.space.values(postures) - np.array(far), axis=1)
        best = postures[int(np.argmin(distance))]
        for _ in range(60):
            jacobian = bench.space.jacobian(bench.space.twists(best[None]))[0][
                :, len(redundant) :
            ]
            gap = np.array(far) - bench.space.values(best[None])[0]
            best[len(redundant) :] += np.linalg.solve(
                jacobian.T @ jacobian + 1e-6 * np.eye(2), jacobian.T @ gap
            )
        assert np.linalg.norm(bench.space.values(best[None])[0] - np.array(far)) > 1e-7


@pytest.mark.parametrize("pattern", ["RRR", "RPR", "PRR", "RRP", "RRRR"])
@pytest.mark.parametrize("rows", [["x", "y"], ["x", "y", "yaw"]], ids="+".join)
def test_labels_follow_the_branch_along_smooth_curves(pattern, rows):
    bench = Bench(robot_of(pattern), rows, 50)
    rng, t = np.random.default_rng(11), np.linspace(0.0, 1.0, 2001)[:, None]
    n, changes, followed = bench.robot.n, 0, 0
    for (redundant, _), _ in itertools.product(bench.decompositions(), range(4)):
        solver, rest = bench.find(redundant).solver, bench.rest(redundant)
        q = rng.uniform(-2.0, 2.0, n) + rng.uniform(0.5, 2.0, n) * np.sin(
            2.0 * np.pi * t * rng.uniform(0.3, 1.0, n)
        )
        answers = solver.solve(bench.space.values(q), q[:, list(redundant)])[:, :, 0]
        for branch in range(2):
            postures = q.copy()
            postures[:, rest] = answers[:, branch]
            exists = np.isfinite(postures).all(axis=1)
            margin = np.full(len(t), -1.0)
            margin[exists] = solver.branch_margins(postures[exists], branch)[:, 0]
            assert np.all(margin[exists] > 0.0), "an answer lies outside its own branch"
            steps = np.abs(wrapped(np.diff(postures, axis=0), bench.turning)).max(
                axis=1
            )
            inside = (margin[1:] > 0.05) & (margin[:-1] > 0.05)
            assert steps[inside].max(initial=0.0) < 0.1, "the branch jumps"
            followed += np.count_nonzero(inside)
        sign = np.sign(solver.branch_margins(q, 0)[:, 0])
        determinant = np.linalg.det(
            bench.space.jacobian(bench.space.twists(q))[:, :, rest]
        )
        np.testing.assert_array_equal(
            np.flatnonzero(np.diff(sign)), np.flatnonzero(np.diff(np.sign(determinant)))
        )
        changes += np.count_nonzero(np.diff(sign))
    assert changes >= 2, "no curve crossed a boundary: the test shows nothing"
    assert followed > 4000
