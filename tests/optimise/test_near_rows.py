"""A solve that sees the rows near their bounds ends where one ends that sees all."""

from dataclasses import replace

import numpy as np
import pytest

from brachis.optimise.backends import (
    Curvature,
    SolverOptions,
    SolveStatus,
    residual,
    solvers_for,
)
from brachis.optimise.near_rows import solve_near_rows, solve_near_values

COUNT = 600
ANGLES = np.linspace(0.0, 2.0 * np.pi, COUNT, endpoint=False)


class Disc:
    """Go as far down as possible within the tangents of a circle; a third variable is square to it."""

    x_lower = np.full(3, -10.0)
    x_upper = np.full(3, 10.0)
    lower = np.full(COUNT, -np.inf)
    upper = np.ones(COUNT)
    jacobian_rows = np.repeat(np.arange(COUNT), 2)
    jacobian_columns = np.tile([0, 1], COUNT)

    def objective(self, x):
        return float(x[1] + x[2] ** 2)

    def gradient(self, x):
        return np.array([0.0, 1.0, 2.0 * x[2]])

    def rows(self, x):
        return np.cos(ANGLES) * x[0] + np.sin(ANGLES) * x[1]

    def jacobian(self, _x):
        return np.column_stack([np.cos(ANGLES), np.sin(ANGLES)]).ravel()

    def curvature(self, _x):
        return None

    @property
    def value_numbers(self):
        """The tangents are six values at a hundred places each."""
        return np.arange(COUNT) // 100


def solve_with_uno(program, x, **options):
    (uno,) = solvers_for("uno")
    return uno.solve(program, x, SolverOptions(**options), None)


class Counting:
    """Solves with Uno, and notes how many rows it is given."""

    def __init__(self):
        self.rows = []

    def __call__(self, problem, x):
        self.rows.append(len(problem.lower))
        return solve_with_uno(problem, x, tolerance=1e-9)


def inside(angle):
    """A point close to the circle at an angle."""
    return 0.999 * np.array([np.cos(angle), np.sin(angle), 0.0])


@pytest.fixture
def solve():
    return Counting()


@pytest.mark.parametrize("angle", [-1.5, -1.2])
def test_few_rows_are_enough(solve, angle):
    report = solve_near_rows(Disc(), inside(angle), solve)
    assert max(solve.rows) < COUNT / 2
    assert report.status is SolveStatus.OPTIMAL
    assert report.objective == pytest.approx(-1.0, abs=1e-8)
    assert report.violation == residual(Disc(), report.x) <= 1e-8


def test_multipliers_belong_to_all_rows(solve):
    report = solve_near_rows(Disc(), np.array([0.05, -0.99, 0.0]), solve)
    assert report.multipliers.shape == (COUNT,)
    matrix = Disc().jacobian(report.x).reshape(COUNT, 2)
    np.testing.assert_allclose(report.multipliers @ matrix, [0.0, 1.0], atol=1e-6)


@pytest.mark.parametrize(
    "start, is_few",
    [([0.1, -0.2, 0.0], False), ([0.0, -1.3, 0.0], True), ([0.0, -1.6, 0.0], False)],
    ids=["few rows hold it back", "a little beyond the rows", "far beyond the rows"],
)
def test_few_rows_are_enough_only_from_near_the_rows(solve, start, is_few):
    report = solve_near_rows(Disc(), np.array(start), solve)
    assert (solve.rows[0] < COUNT) == is_few
    assert report.objective == pytest.approx(-1.0, abs=1e-8)


def test_where_curvature_is_known_fewer_rows_have_to_hold(solve):
    class Curved(Disc):
        def curvature(self, x):
            hessian = np.diag([0.0, 0.0, 2.0])
            return Curvature(
                lambda _x, factor, _rows: factor * hessian, np.zeros(COUNT)
            )

    start = np.array([0.0, -0.9501, 0.0])
    holding = np.count_nonzero(1.0 - Disc().rows(start) < 0.05)
    assert 3 <= holding < 6
    solve_near_rows(Disc(), start, solve)
    assert solve.rows == [COUNT]
    solve.rows.clear()
    report = solve_near_rows(Curved(), start, solve)
    assert max(solve.rows) < COUNT / 2
    assert report.objective == pytest.approx(-1.0, abs=1e-8)


def test_rows_that_an_answer_violates_come_back(solve):
    class Cut(Disc):
        upper = np.append(np.ones(COUNT), 0.3)
        lower = np.full(COUNT + 1, -np.inf)
        jacobian_rows = np.append(Disc.jacobian_rows, COUNT)
        jacobian_columns = np.append(Disc.jacobian_columns, 0)

        def rows(self, x):
            return np.append(super().rows(x), x[0])

        def jacobian(self, x):
            return np.append(super().jacobian(x), 1.0)

        def objective(self, x):
            return -float(x[0]) + float(x[2] ** 2)

        def gradient(self, x):
            return np.array([-1.0, 0.0, 2.0 * x[2]])

    report = solve_near_rows(Cut(), np.array([-0.3, 0.95, 0.0]), solve)
    assert report.x[0] == pytest.approx(0.3, abs=1e-8)
    assert report.violation <= 1e-8


def test_rows_may_stay_whatever_their_distance(solve):
    start = inside(-1.3)
    far = int(np.argmax(1.0 - Disc().rows(start)))
    solve_near_rows(Disc(), start, solve)
    solve_near_rows(Disc(), start, solve, kept_rows=[far])
    assert solve.rows[-1] == solve.rows[0] + 1


def test_a_solve_that_ran_out_of_iterations_is_the_last():
    solves = []

    def solve(problem, x):
        solves.append(len(problem.lower))
        report = solve_with_uno(problem, x, max_iterations=2)
        return replace(report, status=SolveStatus.ITERATION_LIMIT, violation=1.0)

    report = solve_near_rows(Disc(), inside(-1.5), solve)
    assert report.status is SolveStatus.ITERATION_LIMIT
    assert len(solves) == 1


def test_a_solve_omits_values_that_are_far_everywhere(solve):
    start = np.array([0.0, -0.9, 0.0])
    report = solve_near_values(Disc(), start, solve)
    assert solve.rows == [COUNT // 2]
    assert report.objective == pytest.approx(-1.0, abs=1e-8)
    assert len(report.multipliers) == COUNT


def test_values_that_an_answer_violates_come_back(solve):
    report = solve_near_values(Disc(), np.array([0.8, 0.0, 0.0]), solve)
    assert len(solve.rows) > 1
    assert solve.rows == sorted(set(solve.rows))
    assert report.objective == pytest.approx(-1.0, abs=1e-8)
    assert report.violation <= 1e-8


@pytest.mark.parametrize("is_answer, rows", [(True, COUNT // 2), (False, COUNT)])
def test_an_answer_goes_on_with_whole_values_where_few_rows_hold_it(
    solve, is_answer, rows
):
    start = np.array([0.0, -0.9, 0.0])
    solve_near_rows(Disc(), start, solve, is_answer=is_answer)
    assert solve.rows == [rows]
