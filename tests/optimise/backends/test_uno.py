"""What is particular to Uno."""

from dataclasses import replace

import numpy as np
import pytest

from brachis.optimise.backends import SolverOptions, SolveStatus, solvers_for
from support.programs import disc


@pytest.mark.parametrize("widening", [1e-6, 1e-4])
def test_a_solve_uses_no_more_than_the_widening(widening):
    options = SolverOptions(tolerance=1e-4, widening=widening)
    report = solvers_for("uno")[0].solve(disc(), np.array([4.0, 0.5]), options, None)
    assert 0.1 * widening < report.violation <= 2.0 * widening


def test_the_best_feasible_iterate_is_the_answer_where_time_runs_out():
    better = np.array([2.0, 0.25])

    def run_out_of_time(monitor, x, *_rest):
        monitor.keep(better, monitor.program.objective(better), 0.0)
        monitor.timed_out = True
        return monitor.report("uno", SolveStatus.TIME_LIMIT, 100.0 * x, np.zeros(1), "")

    (backend,) = solvers_for("uno")
    slow = replace(backend, run=run_out_of_time)
    report = slow.solve(disc(), np.array([4.0, 0.5]), SolverOptions(), None)
    np.testing.assert_array_equal(report.x, better)
    assert report.status is SolveStatus.TIME_LIMIT
    assert report.feasible
