"""Large solves in a process of their own, which is ended when its time is up."""

import dataclasses
import multiprocessing
import os
import signal
import sys
import time

import numpy as np
import pytest
from numpy.testing import assert_allclose, assert_array_equal

from brachis.optimise.backends import (
    SolverOptions,
    SolveStatus,
    child_process,
    solvers_for,
    uno,
)
from support.programs import disc
from support.solvers import INSTALLED

pytestmark = pytest.mark.skipif(
    not sys.platform.startswith("linux"),
    reason="what is patched here is only forked there",
)
START, OPTIONS = np.array([4.0, 0.5]), SolverOptions()


@pytest.fixture(autouse=True)
def everything_is_large(monkeypatch):
    monkeypatch.setattr(child_process, "ENTRIES", 0)


def own_children():
    """Processes of solves; other tests may have left workers that wait for more to do."""
    return [
        process.name
        for process in multiprocessing.active_children()
        if not process.name.startswith("Loky")
    ]


def solve(options=OPTIONS, progress=None, name="uno"):
    return solvers_for(name)[0].solve(disc(), START, options, progress)


@pytest.mark.parametrize("name", INSTALLED)
def test_the_answer_and_the_progress_are_those_of_a_solve_here(name, monkeypatch):
    calls = {"apart": [], "here": []}
    far = solve(progress=lambda *call: calls["apart"].append(call), name=name)
    monkeypatch.setattr(child_process, "ENTRIES", 10)
    near = solve(progress=lambda *call: calls["here"].append(call), name=name)
    assert calls["here"]
    assert_allclose(
        calls["apart"], calls["here"], atol=1e-6
    )  # another process may have other BLAS threads
    for entry in dataclasses.fields(far):
        if entry.name != "wall_time":
            there, here = getattr(far, entry.name), getattr(near, entry.name)
            if np.asarray(here).dtype.kind == "f":
                assert_allclose(there, here, atol=1e-6)
            else:
                assert there == here


@pytest.mark.parametrize("apart", [True, False])
def test_a_small_problem_is_solved_apart_if_it_asks_for_it(apart, monkeypatch):
    monkeypatch.setattr(child_process, "ENTRIES", 1000)
    solved_by = []
    honest = uno.call_uno

    def note(*arguments):
        solved_by.append(os.getpid())
        return honest(*arguments)

    monkeypatch.setattr(uno, "call_uno", note)
    assert solve(SolverOptions(apart=apart)).status.usable
    assert solved_by == ([] if apart else [os.getpid()])


def test_a_small_problem_that_is_silent_for_long_ends(monkeypatch):
    monkeypatch.setattr(child_process, "ENTRIES", 1000)
    monkeypatch.setattr(child_process, "_SILENCE", 0.1)
    monkeypatch.setattr(uno, "call_uno", lambda *_: time.sleep(1e6))
    report = solve(SolverOptions(apart=True))
    assert report.status is SolveStatus.STALLED
    assert report.message == "ended: a subproblem took too long"
    assert_array_equal(report.x, START)
    assert not own_children()


def test_a_solver_that_does_not_come_back_ends_with_its_time(monkeypatch):
    monkeypatch.setattr(uno, "call_uno", lambda *_: time.sleep(1e6))
    report = solve(SolverOptions(time_limit=0.1))
    assert report.status is SolveStatus.TIME_LIMIT
    assert report.message == "ended: it did not finish in time"
    assert_array_equal(report.x, START)
    assert report.violation == 0.0, "the start is feasible, and stays"
    assert not own_children()


def test_what_a_solve_had_found_before_it_was_ended_is_its_answer(monkeypatch):
    better = np.array([2.0, 0.25])

    def find_and_hang(monitor, *_):
        for x, violation in (better, 0.0), (START, 0.0), (0.0 * START, 1.0):
            objective = monitor.program.objective(x)
            monitor.keep(x, objective, violation)
            monitor.between_iterations(objective)
        time.sleep(1e6)

    monkeypatch.setattr(uno, "call_uno", find_and_hang)
    report = solve(SolverOptions(time_limit=0.3))
    assert report.status is SolveStatus.TIME_LIMIT
    assert disc().objective(better) < disc().objective(START)
    assert_array_equal(report.x, better)
    assert report.objective == disc().objective(better)
    assert not own_children()


def test_without_a_time_limit_it_goes_on_to_its_end():
    assert solve(SolverOptions(time_limit=np.inf)).status is SolveStatus.OPTIMAL


def test_the_system_ends_it_even_if_nobody_waits(monkeypatch):
    monkeypatch.setattr(uno, "call_uno", lambda *_: time.sleep(1e6))
    context = multiprocessing.get_context("fork")
    _, sender = context.Pipe(duplex=False)
    process = context.Process(
        target=child_process._work,
        args=(
            sender,
            uno.run,
            disc(),
            START,
            SolverOptions(time_limit=0.05),
        ),
    )
    process.start()
    process.join()
    assert process.exitcode == -signal.SIGALRM


def test_a_solver_that_crashes_is_a_failure(monkeypatch):
    monkeypatch.setattr(
        uno, "call_uno", lambda *_: os.kill(os.getpid(), signal.SIGKILL)
    )
    report = solve()
    assert (report.status, report.message) == (SolveStatus.FAILED, "crashed")


def test_errors_are_raised_here(monkeypatch):
    monkeypatch.setitem(sys.modules, "unopy", None)
    with pytest.raises(ImportError, match="unopy"):
        solve()


def test_ctrl_c_ends_it():
    def progress(_iteration, _objective):
        os.kill(os.getpid(), signal.SIGINT)

    with pytest.raises(KeyboardInterrupt):
        solve(progress=progress)
    assert not own_children()


def test_a_process_that_may_start_none_solves_itself(monkeypatch):
    monkeypatch.setitem(multiprocessing.current_process()._config, "daemon", 1)
    monkeypatch.setattr(
        child_process,
        "subprocess_solve",
        lambda *_: pytest.fail("a daemonic process may have no children"),
    )
    assert solve().status is SolveStatus.OPTIMAL
