"""What a program minimises: values, exact gradients against differences, and bounds on durations."""

import numpy as np
import pytest

from brachis.optimise.objective import LeastAcceleration
from brachis.optimise.program import Program
from support.arrays import assert_near
from support.jacobians import differences_of
from support.phases import CASES, phase_of, reachable_points


def program_with_weights(case, knots="uniform"):
    """A program that minimises accelerations, its phase, and the weights of the joints."""
    phase = phase_of(case)
    if knots == "free":
        phase = phase.with_free_knots(0.1)
    weights = np.linspace(0.5, 2.0, len(CASES[case][0]))
    objective = LeastAcceleration(weights, np.array([5.0]))
    return Program([phase]).with_objective(objective), phase, weights


@pytest.mark.parametrize("knots", ["uniform", "free"])
@pytest.mark.parametrize("case", CASES)
def test_gradient_of_least_acceleration_equals_differences(case, knots):
    program, phase, _ = program_with_weights(case, knots)
    for x in reachable_points(phase, 2):
        exact = program.gradient(x)
        expected = differences_of(program.objective, x, 1e-5)
        assert np.count_nonzero(exact) > 0.9 * len(exact)
        assert_near(exact, expected, 1e-6)


@pytest.mark.parametrize("knots", ["uniform", "free"])
def test_curvature_of_least_acceleration_is_that_of_its_squares(knots):
    program, phase, weights = program_with_weights("r2", knots)
    (x,) = reachable_points(phase, 1)
    gaps = np.diff(phase.t_norm)
    shares = 0.5 * (np.append(0.0, gaps) + np.append(gaps, 0.0))

    def residuals(x):
        """Terms whose squares the objective adds up."""
        return (np.sqrt(shares)[:, None] * phase.state(x).qddot * weights).ravel()

    slopes = differences_of(residuals, x, 1e-5)
    curvature = program.curvature(x)
    hessian = curvature.hessian(x, 0.5, np.zeros(len(program.lower)))
    assert_near(hessian, slopes.T @ slopes, 1e-6)


def test_value_is_the_mean_square_over_time():
    program, phase, weights = program_with_weights("r1")
    (x,) = reachable_points(phase, 1)
    t_norm = np.linspace(0.0, 1.0, 4001)
    squares = (phase.with_points(t_norm).state(x).qddot * weights) ** 2
    expected = np.trapezoid(squares.sum(axis=1), t_norm)
    uneven = phase.with_points(np.union1d(t_norm, [0.123, 0.1231, 0.7]))
    value = program.minimised.value(uneven, x)
    assert value == pytest.approx(expected, rel=1e-6)
