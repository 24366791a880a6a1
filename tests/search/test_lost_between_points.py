"""A motion that leaves the branch between collocation points is solved again, with more of them there."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

import brachis
from brachis.common.deadline import NEVER
from brachis.errors import UnreachableError
from brachis.optimise.backends import SolverOptions, SolveStatus
from brachis.optimise.improve import SolverSession
from brachis.optimise.refine import add_points_where_lost
from brachis.search import candidates
from support.starts import starting_points


@pytest.fixture
def program():
    made, _ = brachis.transcribe(
        brachis.examples.scara_line, redundant_joints=["j1"], intervals=10
    )
    return made


@pytest.fixture
def swinging(program):
    """Over five points, a motion that is reachable at all of them, and not between the last two."""
    few = program.with_points([np.linspace(0.0, 1.0, 5)])
    (phase,) = few.phases
    motion = phase.motion(next(starting_points(program)))
    places = phase.splines[1].greville
    points = motion.control_points.copy()
    swing = np.where((places > 0.15) & (places < 0.85), np.sin(8.0 * np.pi * places), 0)
    points[1] += 2.0 * swing
    return few, phase.variables_from(replace(motion, control_points=points))


def test_points_are_added_where_the_branch_is_left(swinging):
    few, x = swinging
    few.states(x)
    finer = add_points_where_lost(few, x)
    (phase,) = finer.phases
    new = np.setdiff1d(phase.t_norm, np.linspace(0.0, 1.0, 5))
    np.testing.assert_allclose(new, [0.8125, 0.875, 0.9375])
    with pytest.raises(UnreachableError):
        finer.states(x)


def test_nothing_is_added_to_a_motion_that_is_reachable(program):
    assert add_points_where_lost(program, next(starting_points(program))) is None


def test_it_is_solved_again_from_the_start(program, swinging, monkeypatch):
    few, lost = swinging
    x = next(starting_points(program))
    begun = []

    def solve(program, start, solve, _margins):
        answer = lost if not begun else x
        begun.append((program.collocation_points, start))
        report = solve(program, start)
        report = replace(report, x=answer, status=SolveStatus.OPTIMAL)
        return candidates.SolvedProgram(program, (report,))

    (backend,) = candidates.solvers_for("uno")
    session = SolverSession(backend, SolverOptions(max_iterations=1), NEVER)
    monkeypatch.setattr(candidates, "solve_by_margin_continuation", solve)
    solved = candidates._solve_where_it_exists(few, x, session)
    assert [count for count, _ in begun] == [5, 8]
    assert all(start is x for _, start in begun)
    assert solved.program.collocation_points == 8
    assert len(solved.reports) == 2
    np.testing.assert_array_equal(solved.report.x, x)
