"""Screening: the fastest guesses that differ, whatever time or backend is missing."""

import dataclasses

import numpy as np
import pytest

from brachis import Line, examples
from brachis.common.deadline import NEVER, Deadline
from brachis.optimise.retiming import COARSE, ROUGH
from brachis.problem.problem import Problem, decompositions_of
from brachis.robot.from_task import robot_from_settings
from brachis.search import guesses as module
from brachis.search import screening
from brachis.task import load_task, task_with
from support.scara import scara

MOST = 2


def quiet(_text):
    """Listen to nothing."""


@pytest.fixture(scope="module")
def guesses():
    """Guesses of a task with a free start posture, as the lattice gives them."""
    task = task_with(
        start="free",
        path_start=[1.2, 0.4],
        task_space=["x", "y"],
        path=Line(by=[-1.2, 0.9]),
    )
    problem = Problem.of(scara(), task)
    (level,) = module.SEARCH_LEVELS["fast"]
    many = dataclasses.replace(
        level, in_charts=100, only_minima=False, cells_per_turn=24
    )
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(module, "screen", lambda guesses, *_others: guesses)
        patch.setattr(module, "random_joint_paths", lambda *_arguments: [])
        every = module.chart_guesses(problem, decompositions_of(problem), many)
    assert len(every) > MOST
    return every[:12]


def test_the_fastest_that_differ_pass(guesses):
    kept = screening.screen(guesses, MOST, NEVER, quiet)
    assert 1 <= len(kept) <= MOST
    estimates = [guess.estimate for guess in kept]
    assert estimates == sorted(estimates)
    assert max(estimates) <= 1.03 * min(estimates)
    for guess in kept:
        q = guess.joint_map.postures(guess.joint_path)
        targets = guess.problem.path.sample(guess.joint_path[:, 0]).target
        np.testing.assert_allclose(guess.problem.task_map.values(q), targets, atol=1e-9)


def test_few_guesses_are_improved_too(guesses):
    (better,) = screening.screen(guesses[:1], MOST, NEVER, quiet)
    assert better.is_improved
    assert better.estimate < guesses[0].estimate


def test_without_time_guesses_pass_that_differ(guesses):
    late = screening.screen(guesses, MOST, Deadline(0.0), quiet)
    assert late[0].origin == guesses[0].origin
    assert len({guess.origin for guess in late}) == MOST
    assert not any(guess.is_improved for guess in late)


def test_dwells_leave_few_guesses_to_improve(guesses, monkeypatch):
    tried = []

    def improve(guess, *_arguments):
        tried.append(guess)
        time = 10.0 + int(guess.origin.split(",")[0].split()[-1]) / 10.0
        return dataclasses.replace(guess, estimate=time, is_improved=True)

    monkeypatch.setattr(screening, "improve_quickly", improve)
    monkeypatch.setattr(type(guesses[0].problem), "dwell_time", 9.9)
    untimed = [dataclasses.replace(guess, estimate=np.inf) for guess in guesses]
    kept = screening.screen(3 * untimed, 6, NEVER, quiet)
    assert len(kept) == screening._FEWEST
    assert len(tried) <= (screening._MOST + 2) * screening._FEWEST < len(3 * untimed)


def test_no_further_guess_is_looked_at_where_the_least_end_time_is_met_again(
    guesses, monkeypatch
):
    looked_at = []

    def quickly(guess, _deadline, effort, _charts, _listener):
        if effort.places == ROUGH.places:
            return guess
        looked_at.append(guess)
        times = [1.5, 1.0, np.inf, 1.02, 1.001, 1.009, 1.008]
        return dataclasses.replace(guess, estimate=times[len(looked_at) - 1])

    monkeypatch.setattr(screening, "improve_quickly", quickly)
    monkeypatch.setattr(screening, "is_same", lambda *_guesses: False)
    kept = screening.screen(guesses, MOST, NEVER, quiet)
    assert len(looked_at) == 7
    assert [guess.estimate for guess in kept] == [1.0, 1.001]


def test_the_best_of_a_coarse_search_are_searched_again(guesses, monkeypatch):
    searched = {COARSE.places: [], ROUGH.places: []}

    def rank(guess, _deadline, effort, _charts, _listener):
        searched[effort.places].append(guess.origin)
        number = [own.origin for own in guesses].index(guess.origin)
        return dataclasses.replace(guess, estimate=2.0 - 0.1 * number)

    monkeypatch.setattr(screening, "improve_quickly", rank)
    monkeypatch.setattr(screening, "is_same", lambda *_guesses: False)
    screening.screen(guesses, MOST, NEVER, quiet)
    origins = [guess.origin for guess in guesses]
    assert searched[COARSE.places][0] == origins[0]
    assert sorted(searched[COARSE.places]) == sorted(origins)
    assert searched[ROUGH.places] == origins[::-1][: 2 * MOST]


def test_joint_paths_of_several_redundant_joints_are_screened_with_closed_forms():
    task = load_task(examples.free_roll)
    problem = Problem.of(robot_from_settings(task.robot), task)
    (decomposition,) = decompositions_of(problem)
    (level,) = module.SEARCH_LEVELS["fast"]
    found = module.lattice_guesses(decomposition, level)
    assert isinstance(found, list)
    assert len(found) == level.joint_paths // 2
    assert all(guess.is_improved for guess in found)
    estimates = [guess.estimate for guess in found]
    assert estimates == sorted(estimates)
    # Those of the shortest joint paths alone.
    few = dataclasses.replace(level, joint_paths=2)
    (shortest,) = module.lattice_guesses(decomposition, few)
    assert shortest.is_improved
    assert estimates[0] <= shortest.estimate
