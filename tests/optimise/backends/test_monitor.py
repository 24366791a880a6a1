"""What the layer between programs and backends keeps, and when it ends a solve."""

import numpy as np
import pytest

from brachis.optimise.backends import SolverOptions, SolveStatus
from brachis.optimise.backends.monitor import SolveMonitor
from support.programs import disc

INSIDE = np.array([2.0, 0.25])
OUTSIDE = np.array([400.0, 50.0])


@pytest.mark.parametrize(
    "status, is_kept",
    [(SolveStatus.ITERATION_LIMIT, True), (SolveStatus.INFEASIBLE, False)],
)
def test_of_a_solve_that_ends_early_the_best_acceptable_iterate_is_reported(
    status, is_kept
):
    monitor = SolveMonitor(disc(), SolverOptions(acceptable=0.05), None)
    monitor.keep(INSIDE, 1.0, 0.04)  # 1.04
    monitor.keep(OUTSIDE, 1.03, 0.02)  # 1.0506
    monitor.keep(OUTSIDE, 0.1, 0.06)  # violates too much
    report = monitor.report("any", status, OUTSIDE, np.zeros(1), "")
    np.testing.assert_array_equal(report.x, INSIDE if is_kept else OUTSIDE)


@pytest.mark.parametrize(
    "objectives, has_settled",
    [
        ([1.0, 1.2, 1.4, 1.6, 1.8, 2.0], False),
        ([1.0, 2.0, 2.0, 1.8, 1.6, 1.4], False),
        ([1.0, 2.0, 2.0, 2.0, 2.0, 2.0], True),
    ],
    ids=["rises", "comes down again", "stays"],
)
def test_an_interior_point_method_has_settled_once_nothing_changes(
    objectives, has_settled
):
    options = SolverOptions(progress=1e-3, patience=2)
    monitor = SolveMonitor(disc(), options, None)
    ends = [monitor.ends_interior(value, 0.0, 1e-9) for value in objectives]
    assert ends[-1] == has_settled


def test_with_a_large_barrier_nothing_has_settled():
    monitor = SolveMonitor(disc(), SolverOptions(patience=2), None)
    assert not any(monitor.ends_interior(1.0, 0.0, 0.1) for _ in range(10))
