"""Ends in motion and periodic motions: conditions that hold for every x, and exact derivatives with them."""

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.interpolate import BSpline

from brachis.optimise.boundary import Boundary, EndCondition, periodic
from brachis.optimise.bspline import clamped_knots
from support.arrays import assert_near
from support.jacobians import comparable_rows, dense, differences
from support.phases import phase_of, reachable_points

BREAKS = np.array([0.0, 0.1, 0.25, 0.5, 0.6, 0.85, 0.95, 1.0])
RATE = 0.6


def moving(case, degree, derivatives):
    """A phase with every kind of limit that begins and ends in motion; its redundant joints are free there."""
    phase = phase_of(case, degree=degree, rest="velocity" if degree == 2 else "full")
    sides = []
    for side, rate in ((phase.boundary.start, RATE), (phase.boundary.end, 2.0 * RATE)):
        given = np.array([rate, 0.0][:derivatives])
        free = [replace(own, derivatives=np.empty(0)) for own in side[1:]]
        sides.append((EndCondition(side[0].value, given), *free))
    return phase.with_grid(phase.grid, Boundary(*sides))


def going_round(case, degree):
    phase = phase_of(case, degree=degree, rest="velocity" if degree == 2 else "full")
    return phase.with_grid(phase.grid, replace(phase.boundary, periodic=True))


PHASES = {
    "moving, r0": lambda: moving("r0", 3, 1),
    "moving, constant speed, r0": lambda: moving("r0", 4, 2),
    "moving, constant speed, r2": lambda: moving("r2", 3, 2),
    "periodic, r0": lambda: going_round("r0", 3),
    "periodic, r1": lambda: going_round("r1", 4),
    "periodic, r2": lambda: going_round("r2", 3),
}


@pytest.fixture(params=PHASES, scope="module")
def phase(request):
    return PHASES[request.param]()


def test_jacobian_equals_differences(phase):
    for x in reachable_points(phase, 2):
        # Curves of torque over speed bend within 1e-3.
        exact, expected = dense(phase, x), differences(phase, x, 2e-6)
        count = phase._layout.progress.fixed_terms.shape[1]
        kinds = {
            limit.kind: rows.ravel()[comparable_rows(phase, limit, x)]
            for limit, rows in zip(phase.limits, phase.value_rows, strict=True)
            if not limit.guarantee.is_mean
        }
        kinds["progress"] = np.arange(len(phase.lower) - count, len(phase.lower))
        assert count >= 3
        for kind, rows in kinds.items():
            wrong = np.abs(exact[rows] - expected[rows]).max(axis=1)
            error = wrong.max() / np.abs(expected[rows]).max()
            assert error <= 1e-6, f"{kind}: relative error {error:.1e}"


def test_the_way_to_x_and_back(phase):
    for x in reachable_points(phase, 2):
        np.testing.assert_allclose(phase.variables_from(phase.motion(x)), x, atol=1e-13)


@settings(max_examples=50)
@given(
    degree=st.integers(2, 6),
    start=st.just(np.nan) | st.floats(-3.0, 3.0),
    jump=st.floats(-3.0, 3.0),
    seed=st.integers(0, 99),
)
def test_periodic_splines(degree, start, jump, seed):
    knots = clamped_knots(degree, BREAKS)
    spline = periodic(knots, degree, start, jump)
    free = np.random.default_rng(seed).normal(size=spline.free)
    points = spline.control_points(free, 1.0)
    assert_near(
        spline.free_matrix.dense() @ free + spline.fixed_terms[0], points, 1e-12
    )
    curve = BSpline(knots, points, degree)
    for order in range(min(degree, 4)):
        first, last = curve(np.array([0.0, 1.0]), nu=order)
        assert last - first == pytest.approx(
            jump if order == 0 else 0.0, abs=1e-9 * (1.0 + np.abs(points).max()) * 400
        )
    if not np.isnan(start):
        assert float(curve(0.0)) == pytest.approx(start, abs=1e-12)
    np.testing.assert_allclose(spline.free_from(points, 1.0), free, atol=1e-12)
    assert spline.free == len(points) - min(degree, 4) - (not np.isnan(start))
