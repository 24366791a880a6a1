"""Planar chains: every pattern of up to four revolute and prismatic joints, every decomposition, by Pinocchio."""

import functools
import itertools

import numpy as np
import pytest

from brachis.errors import DecompositionError
from support.chains import planar_robot
from support.closed_forms import Bench

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


def roots(pattern, rows, redundant):
    """How many answers plane geometry allows: two if a circle is met, one if only lines are."""
    left = [letter for i, letter in enumerate(pattern) if i not in redundant]
    if len(rows) == 3:
        left.remove("R")  # it follows from the angle
    return 2 if "R" in left else 1


@pytest.mark.parametrize("pattern, plane, rows", CASES)
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
