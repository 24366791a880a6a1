"""Every backend on small programs whose optima are known by hand."""

import dataclasses
import os
import sys
from importlib.machinery import ModuleSpec
from pathlib import Path
from types import ModuleType

import numpy as np
import pytest
from numpy.testing import assert_allclose, assert_array_equal

import brachis
from brachis.errors import UnknownNameError
from brachis.optimise.backends import (
    NAMES,
    SOLVERS,
    SolverOptions,
    SolveStatus,
    interior_solver,
    residual,
    solvers_for,
    uno,
)
from brachis.optimise.backends.monitor import SolveMonitor
from support.programs import corner, disc, impossible, nearest_in_disc, under_hyperbola
from support.scripts import output_of
from support.solvers import INSTALLED

ROOT = Path(__file__).parents[3]
OPTIONS = SolverOptions()
STARTS = ([4.9, 1.2], [1.5, 1.3], [2.0, 2.6], [1.2, 1.05], [1.2, 0.3])
"""Within the disc, from where trial points leave it."""


@pytest.fixture(params=INSTALLED)
def name(request):
    return request.param


def solve(name, problem, x, options=OPTIONS, progress=None):
    (backend,) = solvers_for(name)
    start = np.array(x, dtype=float)
    report = backend.solve(problem, start, options, progress)
    assert_array_equal(start, x)
    return report


@pytest.mark.parametrize(
    "make, start, optimum, multipliers",
    [
        (disc, [4.0, 0.5], [1.0, 1.0], [-0.25]),
        (corner, [0.0, 0.0], [3.0, 1.0], [1.0 / 3.0, 2.0 / 3.0]),
        (under_hyperbola, [1.0, 3.0], [4.0, 0.5], [0.25]),
        (nearest_in_disc, [3.0, 0.5], [4.2, 2.6], [-0.75]),
    ],
)
def test_known_optima(name, make, start, optimum, multipliers):
    problem = make()
    report = solve(name, problem, start)
    assert report.status is SolveStatus.OPTIMAL
    assert report.status.usable
    assert report.solver == name
    assert_allclose(report.x, optimum, atol=1e-4)
    assert report.objective == problem.objective(report.x)
    assert report.violation == residual(problem, report.x) <= 1e-5
    assert report.iterations >= 1
    assert report.wall_time > 0.0
    assert_allclose(report.multipliers, multipliers, atol=1e-4)


def test_large_bounds_are_held_as_exactly_as_others(name):
    problem = dataclasses.replace(
        corner(),
        costs=-np.ones(2),
        row_values=lambda x: x,
        row_slopes=lambda _x: np.eye(2),
        lower=np.array([90.0, 180.0]),
        upper=np.array([120.0, 220.0]),
        x_lower=np.zeros(2),
        x_upper=np.full(2, 1000.0),
    )
    report = solve(name, problem, [100.0, 200.0])
    assert report.status.usable
    assert report.violation <= 1e-5
    assert_allclose(report.x, [120.0, 220.0], atol=1e-3)


# At (2, 1) the objective stands still while the row comes true.
def test_optimal_means_that_first_order_conditions_hold(name):
    report = solve(name, under_hyperbola(), [1.0, 1.0])
    if report.status is SolveStatus.OPTIMAL:
        assert_allclose(report.x, [4.0, 0.5], atol=1e-4)
    else:
        assert report.status is SolveStatus.ACCEPTABLE


@pytest.mark.parametrize("edge", [0.99, 0.9])
def test_backs_off_from_points_without_values(name, edge):
    refusals = 0
    for start in STARTS:
        problem = disc(reachable=lambda x: x[0] > edge)
        report = solve(name, problem, start)
        assert report.status.usable
        assert_allclose(report.x, [1.0, 1.0], atol=1e-3)
        refusals += problem.refusals
    assert refusals, "no trial point was beyond the edge: the test shows nothing"


def test_infeasible_problem(name):
    report = solve(name, impossible(), [0.3, 0.2])
    assert not report.status.usable
    assert report.status in (SolveStatus.INFEASIBLE, SolveStatus.FAILED)
    assert report.violation > 0.3
    assert report.violation == residual(impossible(), report.x)


def test_iteration_limit(name):
    report = solve(name, disc(), [40.0, -30.0], SolverOptions(max_iterations=2))
    assert report.status is SolveStatus.ITERATION_LIMIT
    assert report.iterations <= 3
    assert "max_iterations" in report.status.value


@pytest.mark.usefixtures("wall_clock")
@pytest.mark.parametrize("time_limit", [0.005, 0.015, 0.025, 0.035, 0.1])
def test_the_time_may_end_in_any_of_the_first_evaluations(name, time_limit):
    """IPOPT ended the whole process if a Jacobian had no value at its first point."""
    problem = disc(pause=0.01)
    report = solve(name, problem, [40.0, -30.0], SolverOptions(time_limit=time_limit))
    assert report.status is SolveStatus.TIME_LIMIT
    assert report.status.value == "time limit reached"
    assert report.wall_time >= time_limit
    assert len(problem.evaluations) <= 4 + time_limit / 0.01, "it went on"


def test_without_time_no_solve_begins(name):
    report = solve(name, disc(), [40.0, -30.0], SolverOptions(time_limit=0.0))
    assert report.status is SolveStatus.TIME_LIMIT
    assert (report.iterations, report.x.tolist()) == (0, [40.0, -30.0])


@pytest.mark.parametrize("kind", [KeyboardInterrupt, ZeroDivisionError])
def test_what_a_listener_raises_comes_out_at_once(name, kind):
    calls = []

    def progress(iteration, _objective):
        calls.append(iteration)
        if iteration == 2:
            raise kind

    with pytest.raises(kind):
        solve(name, disc(), [40.0, -30.0], progress=progress)
    assert calls == [1, 2]


@pytest.mark.parametrize("evaluation", [1, 4])
def test_interrupt_during_an_evaluation(name, evaluation):
    problem = disc(interrupt_at=evaluation)
    with pytest.raises(KeyboardInterrupt):
        solve(name, problem, [40.0, -30.0])
    assert len(problem.evaluations) == evaluation, (
        "the backend went on after the interrupt"
    )


@pytest.mark.parametrize("function", ["rows", "jacobian"])
def test_what_a_problem_raises_comes_out(name, function, monkeypatch):
    problem = disc()
    whole = getattr(problem, function)
    calls = []

    def fail(x):
        calls.append(x)
        if len(calls) > 3:
            raise ZeroDivisionError("a limit of the user's own")
        return whole(x)

    monkeypatch.setattr(problem, function, fail)
    with pytest.raises(ZeroDivisionError, match="own"):
        solve(name, problem, [40.0, -30.0])


# The objective is not the first variable here, as it is in a program of one phase.
def test_progress_tells_iteration_and_objective(name):
    problem, calls = under_hyperbola(), []
    report = solve(name, problem, [1.0, 3.0], progress=lambda *call: calls.append(call))
    assert [iteration for iteration, _ in calls] == list(
        range(1, report.iterations + 1)
    )
    assert calls[-1][1] == pytest.approx(0.5, abs=1e-3)


@pytest.mark.parametrize("make", [disc, impossible])
def test_solvers_print_nothing(name, make, capfd):
    solve(name, make(), [4.0, 0.5])
    captured = capfd.readouterr()
    assert (captured.out, captured.err) == ("", "")


@pytest.mark.parametrize(
    "is_installed, interior", [(True, "ipopt"), (False, "uno_interior")]
)
def test_registry(is_installed, interior, monkeypatch):
    module = ModuleType("ipyopt")
    module.__spec__ = ModuleSpec("ipyopt", None)
    monkeypatch.setitem(sys.modules, "ipyopt", module if is_installed else None)
    assert NAMES == ("auto", "uno", "ipopt", "uno_interior")
    automatic = [backend.name for backend in solvers_for("auto")]
    assert automatic == ["uno", interior]
    large = interior_solver("auto")
    assert large is SOLVERS[interior]
    assert large.is_interior
    assert interior_solver("uno") is None
    for each in {*SOLVERS} - {"ipopt"}:
        assert solvers_for(each) == (SOLVERS[each],)
    with pytest.raises(UnknownNameError, match="Did you mean 'ipopt'") as caught:
        solvers_for("ipop")
    assert caught.value.valid == NAMES


# Python's max passes over NaN.
@pytest.mark.parametrize(
    "problem, x, expected",
    [
        (disc(), [3.0, 1.0], 0.0),
        (disc(), [0.0, 1.0], 5.0),
        (disc(), [-51.0, 1.0], 54.0**2 - 4.0),
        (disc(), [np.nan, 1.0], np.inf),
        (disc(reachable=lambda _x: False), [3.0, 1.0], np.inf),
        (under_hyperbola(), [5.5, 1.0], 1.5),
        (under_hyperbola(), [-2.0, -1.0], 2.0),
    ],
)
def test_residual_is_the_worst_of_rows_and_bounds(problem, x, expected):
    assert residual(problem, np.array(x)) == pytest.approx(expected)


@pytest.mark.parametrize("bad", [np.nan, np.inf])
def test_backs_off_from_points_whose_rows_are_not_finite(name, bad):
    seen = []

    def rows(x):
        seen.append(x[0] < 0.9)
        return np.array([bad if seen[-1] else (x[0] - 3.0) ** 2 + (x[1] - 1.0) ** 2])

    for start in STARTS:
        report = solve(name, dataclasses.replace(disc(), row_values=rows), start)
        assert report.status.usable
        assert_allclose(report.x, [1.0, 1.0], atol=1e-3)
    assert any(seen), "no trial point was bad: the test shows nothing"


def rows_of(bad):
    return {"row_values": lambda _x: np.array([bad])}


@pytest.mark.parametrize(
    "changes, x",
    [
        ({}, np.nan),
        ({}, np.inf),
        ({}, 1e300),
        (rows_of(np.nan), 4.0),
        (rows_of(np.inf), 4.0),
        ({"upper": np.array([np.nan])}, 4.0),
        ({"reachable": lambda _x: False}, 4.0),
    ],
)
def test_a_start_without_values_is_an_answer_without_iterations(name, changes, x):
    report = solve(name, dataclasses.replace(disc(), **changes), [x, 0.5])
    assert report.status is SolveStatus.EVALUATION_ERROR
    assert not report.status.usable
    assert not report.violation <= 1e-5
    assert report.solver == name


@pytest.mark.parametrize("bad", [np.nan, np.inf])
def test_slopes_that_are_not_finite_give_no_usable_answer(name, bad):
    slopes = np.array([[1.0, bad]])
    problem = dataclasses.replace(disc(), row_slopes=lambda _x: slopes)
    assert not solve(name, problem, [4.0, 0.5]).status.usable


PLAN = """
import brachis
line = brachis.load_task("examples/01_scara_line.yaml")
if {others_first}:
    brachis.plan(line, redundant_joints=["j1"], intervals=10)
print(repr(brachis.plan(line, redundant_joints=["j3"], intervals=20).t_end))
"""


def test_an_answer_does_not_depend_on_what_the_process_solved_before():
    folder = str(Path(brachis.__file__).parents[1])
    environment = {**os.environ, "PYTHONPATH": folder}

    def plan(others_first):
        code = PLAN.format(others_first=others_first)
        return output_of("-c", code, cwd=ROOT, env=environment)

    assert plan(others_first=True) == plan(others_first=False)


@pytest.mark.parametrize(
    "left, is_lost", [(0.995, True), (0.9, False)], ids=["creeps", "gains"]
)
def test_a_restoration_that_creeps_far_beyond_a_limit_is_given_up(left, is_lost):
    """Uno's callback: multiplier of the objective 0 in a restoration, violation, stationarity."""
    problem = corner()
    x = np.zeros(len(problem.x_lower))
    stall = uno._Stall(SolveMonitor(problem, OPTIONS, None), np.ones(len(x)))
    violations = 3.0 * left ** np.arange(40)
    stops = [stall(x, 0.0, own, 1e3, 0.0) for own in violations]
    assert stall.is_lost == is_lost
    assert any(stops) == is_lost
    assert not any(stops[:15])
