"""What a program minimises: values, exact gradients against differences, and bounds on durations."""

from __future__ import annotations

import numpy as np
import pytest

from brachis.optimise.objective import LeastAcceleration
from brachis.optimise.program import Program
from support.jacobians import differences_of
from support.phases import CASES, phase_of, reachable_points


def weights_of(case: str) -> np.ndarray:
    return np.linspace(0.5, 2.0, len(CASES[case][0]))


@pytest.mark.parametrize("knots", ["uniform", "free"])
@pytest.mark.parametrize("case", CASES)
def test_gradient_of_least_acceleration_equals_differences(case, knots):
    phase = phase_of(case)
    if knots == "free":
        phase = phase.with_free_knots(0.1)
    program = Program([phase]).with_objective(
        LeastAcceleration(weights_of(case), np.array([5.0]))
    )
    for x in reachable_points(phase, 2):
        exact = program.gradient(x)
        expected = differences_of(program.objective, x, 1e-5)
        assert np.count_nonzero(exact) > 0.9 * len(exact)
        np.testing.assert_allclose(exact, expected, atol=1e-6 * np.abs(expected).max())


@pytest.mark.parametrize("knots", ["uniform", "free"])
def test_curvature_of_least_acceleration_is_that_of_its_squares(knots):
    phase = phase_of("r2")
    if knots == "free":
        phase = phase.with_free_knots(0.1)
    weights = weights_of("r2")
    program = Program([phase]).with_objective(
        LeastAcceleration(weights, np.array([5.0]))
    )
    (x,) = reachable_points(phase, 1)
    gaps = np.diff(phase.t_norm)
    shares = 0.5 * (np.append(0.0, gaps) + np.append(gaps, 0.0))

    def residuals(x: np.ndarray) -> np.ndarray:
        """Terms whose squares the objective adds up."""
        return (np.sqrt(shares)[:, None] * phase.state(x).qddot * weights).ravel()

    slopes = differences_of(residuals, x, 1e-5)
    known = program.curvature(x)
    assert known is not None
    found = known.hessian(x, 0.5, np.zeros(len(program.lower)))
    expected = slopes.T @ slopes
    size = np.abs(expected).max()
    np.testing.assert_allclose(found, expected, atol=1e-6 * size)


def test_value_is_the_mean_square_over_time():
    phase = phase_of("r1").with_points(
        np.union1d(np.linspace(0.0, 1.0, 4001), [0.123, 0.1231, 0.7])
    )
    weights = weights_of("r1")
    (x,) = reachable_points(phase, 1)
    t_norm = np.linspace(0.0, 1.0, 4001)
    qddot = phase.with_points(t_norm).state(x).qddot
    expected = np.mean(
        0.5 * ((qddot[1:] * weights) ** 2 + (qddot[:-1] * weights) ** 2).sum(axis=1)
    )
    assert LeastAcceleration(weights, np.array([5.0])).value(phase, x) == pytest.approx(
        expected, rel=1e-6
    )
