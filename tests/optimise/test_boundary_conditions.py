"""Boundary conditions hold for every x, whatever the solver does; and x keeps its meaning on other grids."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.testing import assert_allclose
from scipy.interpolate import BSpline

from brachis.optimise.boundary import BoundarySpline, EndCondition, sum_powers
from brachis.optimise.bspline import clamped_knots
from support.arrays import assert_near
from support.jacobians import differences_of
from support.phases import CASES, phase_of, reachable_points

BREAKS = np.array([0.0, 0.1, 0.25, 0.5, 0.6, 0.85, 0.95, 1.0])


def test_given_end_posture():
    # An end posture on the path: the closed form at s = 1 with a chosen redundant joint.
    free = phase_of("r1")
    y = np.array([[0.0, 0.1], [0.5, 0.12], [1.0, 0.15]])
    end_q = free.joint_map.postures(y)[-1]
    phase = phase_of("r1", end=end_q.tolist())
    assert phase.variables == free.variables - 1
    for x in reachable_points(phase, 3):
        state = phase.state(x)
        assert_allclose(state.q[-1], end_q, atol=1e-9)
        assert_allclose(state.ydot[-1], 0.0, atol=1e-10)


@pytest.mark.parametrize("case", CASES)
def test_states_are_those_of_the_curves(case):
    phase = phase_of(case)
    (x,) = reachable_points(phase, 1)
    motion, state = phase.motion(x), phase.state(x)
    assert motion.t_end == x[0]
    assert_allclose(motion.breaks, np.linspace(0.0, x[0], 6), atol=1e-14)
    spline = BSpline(motion.knots * x[0], motion.control_points.T, motion.degree)
    t = phase.t_norm * x[0]
    curves = (state.y, state.ydot, state.yddot, state.ydddot)
    for order, (curve, moved) in enumerate(zip(curves, motion.at(t), strict=True)):
        assert_near(curve, spline(t, nu=order), 1e-9, least=1.0)
        assert_near(moved, curve, 1e-10, least=1.0)
    assert_allclose(state.q[0], phase.joint_map.start, atol=1e-9)


@settings(max_examples=80)
@given(
    degree=st.integers(2, 6),
    counts=st.tuples(st.integers(0, 3), st.integers(0, 3)),
    values=st.tuples(*[st.just(np.nan) | st.floats(-3.0, 3.0)] * 2),
    duration=st.floats(0.1, 10.0),
    seed=st.integers(0, 99),
)
def test_splines_meet_what_their_ends_prescribe_for_any_duration(
    degree, counts, values, duration, seed
):
    rng = np.random.default_rng(seed)
    knots = clamped_knots(degree, BREAKS)
    ends = [
        EndCondition(value, rng.normal(size=min(count, degree - 1)))
        for value, count in zip(values, counts, strict=True)
    ]
    spline = BoundarySpline.between(knots, degree, *ends)
    free = rng.normal(size=spline.free)
    points = spline.control_points(free, duration)
    curve = BSpline(knots * duration, points, degree)
    size = 1.0 + np.abs(points).max()
    tied = 0
    for end, time in zip(ends, (0.0, duration), strict=True):
        for order, expected in enumerate([end.value, *end.derivatives]):
            if np.isnan(expected):
                continue
            # The first interval is a tenth, the last one a twentieth.
            rounding = 1e-14 * size * (20.0 * degree / duration) ** order
            assert float(curve(time, nu=order)) == pytest.approx(expected, abs=rounding)
            tied += 1
    assert spline.free == len(points) - tied
    slope = sum_powers(spline.fixed_terms, duration, slope=True)
    by_differences = differences_of(
        lambda x: spline.fixed_points(float(x[0])), np.array([duration]), 1e-3
    )
    assert_near(by_differences[:, 0], slope, 1e-9, least=1.0)
    assert_allclose(spline.free_from(points, duration), free, atol=1e-9)
