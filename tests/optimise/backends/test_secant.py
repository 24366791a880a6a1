"""Hessians of which a part is known, and solves with them."""

import numpy as np
import pytest
from numpy.testing import assert_allclose

from brachis.optimise.backends import Curvature, SolverOptions, solvers_for
from brachis.optimise.backends.secant import SecantHessian
from support.programs import Program

SIZE = 30
RNG = np.random.default_rng(4)
COSTS = RNG.normal(size=SIZE)
FACTORS = RNG.normal(size=(SIZE, SIZE)) * np.geomspace(1.0, 30.0, SIZE)
SQUARES = FACTORS.T @ FACTORS
OPTIMUM = -np.linalg.solve(SQUARES, COSTS)
OPTIMUM = OPTIMUM / np.sqrt(OPTIMUM @ SQUARES @ OPTIMUM)


class Ellipsoid(Program):
    """Minimise a linear cost inside an ellipsoid; `known` is the part of its curvature that it states."""

    known: float | None = 1.0

    def curvature(self, _x):
        if self.known is None:
            return None
        return Curvature(
            lambda _x, _factor, multipliers: (
                -2.0 * self.known * multipliers[0] * SQUARES
            ),
            np.array([-1.0]),
        )


def ellipsoid(known):
    program = Ellipsoid(
        COSTS,
        lambda x: np.array([x @ SQUARES @ x]),
        lambda x: 2.0 * (SQUARES @ x)[None],
        np.array([-np.inf]),
        np.ones(1),
        np.full(SIZE, -10.0),
        np.full(SIZE, 10.0),
    )
    program.known = known
    return program


def solve(known):
    (uno,) = solvers_for("uno")
    start = 0.1 * np.ones(SIZE) / np.sqrt(SIZE)
    return uno.solve(ellipsoid(known), start, SolverOptions(1e-8), None)


@pytest.mark.parametrize("known", [1.0, 0.5])
def test_the_optimum_on_an_ellipsoid_is_found_in_few_iterations(known):
    report = solve(known)
    assert report.status.usable
    assert_allclose(COSTS @ report.x, COSTS @ OPTIMUM, rtol=1e-7)
    assert report.iterations < 0.5 * solve(None).iterations


def test_ipopt_uses_the_known_part_if_it_is_damped():
    (ipopt,) = solvers_for("ipopt")
    start = 0.1 * np.ones(SIZE) / np.sqrt(SIZE)
    plain, damped = (
        ipopt.solve(ellipsoid(1.0), start, SolverOptions(1e-8, damping=damping), None)
        for damping in (0.0, 1e-3)
    )
    assert damped.status.usable
    assert_allclose(COSTS @ damped.x, COSTS @ OPTIMUM, rtol=1e-6)
    assert damped.iterations < 0.5 * plain.iterations


def test_steps_teach_the_missing_curvature():
    problem = ellipsoid(0.7)
    known = problem.curvature(None)
    hessian = SecantHessian(problem, known)
    multipliers = np.array([-1.3])
    exact = 2.6 * SQUARES
    x = np.zeros(SIZE)
    rng = np.random.default_rng(5)
    hessian(x, 1.0, multipliers)
    for _ in range(5):
        step = rng.normal(size=SIZE)
        x = x + step
        found = hessian(x, 1.0, multipliers)
    assert_allclose(found @ step, exact @ step, rtol=1e-9)
    # A restoration teaches nothing.
    assert_allclose(hessian(x + step, 0.0, multipliers), found, rtol=1e-12)


def test_no_eigenvalue_is_negative():
    problem = ellipsoid(3.0)  # more than there is
    hessian = SecantHessian(problem, problem.curvature(None))
    rng = np.random.default_rng(6)
    for _ in range(4):
        found = hessian(rng.normal(size=SIZE), 1.0, np.array([-1.0]))
        assert np.linalg.eigvalsh(found).min() > -1e-9 * np.abs(found).max()


def test_without_multipliers_the_last_ones_count():
    problem = ellipsoid(1.0)
    hessian = SecantHessian(problem, problem.curvature(None))
    none = np.zeros(1)
    assert_allclose(hessian(np.zeros(SIZE), 1.0, none), 2.0 * SQUARES)
    hessian(np.ones(SIZE), 1.0, np.array([-3.0]))
    again = hessian(np.ones(SIZE), 1.0, none)
    assert_allclose(again, 6.0 * SQUARES, rtol=1e-9)


def test_in_a_restoration_the_objective_keeps_some_curvature():
    problem = ellipsoid(1.0)
    known = Curvature(lambda _x, factor, _rows: factor * SQUARES, np.zeros(1))
    hessian = SecantHessian(problem, known)
    for factor, part in ((1.0, 1.0), (0.0, 0.01)):
        found = hessian(np.zeros(SIZE), factor, np.zeros(1))
        assert_allclose(found, part * SQUARES, atol=1e-12)


def test_what_one_solve_learnt_the_next_one_knows():
    problem = ellipsoid(0.7)
    learnt = 0.6 * SQUARES  # the rest of 2 SQUARES with the multiplier 1
    multipliers = np.array([-1.0])
    hessian = SecantHessian.of(problem, np.zeros(SIZE), learnt)
    found = hessian(np.zeros(SIZE), 1.0, multipliers)
    assert_allclose(found, 2.0 * SQUARES, atol=1e-12)


def test_what_a_hessian_raises_comes_out():
    def fail(*_given):
        raise ZeroDivisionError("a limit of the user's own")

    program = ellipsoid(1.0)
    program.curvature = lambda _x: Curvature(fail, np.array([-1.0]))
    (uno,) = solvers_for("uno")
    with pytest.raises(ZeroDivisionError, match="own"):
        uno.solve(program, np.zeros(SIZE), SolverOptions(), None)
