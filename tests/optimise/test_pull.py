"""Of equally good points a pulled solve finds the one nearest to its start."""

import numpy as np
import pytest

from brachis.optimise.backends import Curvature, SolverOptions, solvers_for
from brachis.optimise.pull import Pulled


class HalfPlane:
    """Go as far down and left as a line allows: all points on the line are equally good."""

    x_lower = np.full(2, -10.0)
    x_upper = np.full(2, 10.0)
    lower = np.array([1.0])
    upper = np.array([np.inf])
    jacobian_rows = np.array([0, 0])
    jacobian_columns = np.array([0, 1])

    def objective(self, x):
        return float(x[0] + x[1])

    def gradient(self, _x):
        return np.ones(2)

    def rows(self, x):
        return np.array([x[0] + x[1]])

    def jacobian(self, _x):
        return np.ones(2)

    def curvature(self, _x):
        return None


START = np.array([3.0, 0.0])


@pytest.mark.parametrize("weight", [0.01, 0.1])
def test_the_nearest_of_equally_good_points_is_found(weight):
    (uno,) = solvers_for("uno")
    pulled = Pulled(HalfPlane(), START, weight)
    report = uno.solve(pulled, np.array([8.0, 5.0]), SolverOptions(1e-9), None)
    np.testing.assert_allclose(report.x, [2.0, -1.0], atol=1e-6)


def test_the_gradient_is_that_of_the_objective():
    pulled = Pulled(HalfPlane(), START, 0.3)
    x = np.array([1.0, 2.0])
    steps = 1e-6 * np.eye(2)
    slopes = [pulled.objective(x + own) - pulled.objective(x - own) for own in steps]
    np.testing.assert_allclose(pulled.gradient(x), np.array(slopes) / 2e-6, rtol=1e-8)


def test_the_curvature_is_that_of_the_pull():
    pulled = Pulled(HalfPlane(), START, 0.3)
    known = pulled.curvature(START)
    hessian = known.hessian(START, 2.0, np.zeros(1))
    np.testing.assert_allclose(hessian, 0.6 * np.eye(2))


def test_the_curvature_of_the_program_is_added():
    own = np.array([[2.0, 1.0], [1.0, 3.0]])

    class Curved(HalfPlane):
        def curvature(self, _x):
            return Curvature(lambda _x, factor, _rows: factor * own, np.array([-0.5]))

    known = Pulled(Curved(), START, 0.3).curvature(START)
    hessian = known.hessian(START, 2.0, np.zeros(1))
    np.testing.assert_allclose(hessian, 0.6 * np.eye(2) + 2.0 * own)
    assert known.multipliers == [-0.5]
