"""A motion that leaves the branch between collocation points is solved again, with more of them there."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

import brachis
from brachis.common.arrays import greville
from brachis.common.deadline import NEVER
from brachis.errors import UnreachableError
from brachis.kernel import Fault, PathMotion
from brachis.kinematics import ClosedFormMap
from brachis.optimise.backends import SolverOptions, SolveStatus, solvers_for
from brachis.optimise.guess import starting_point
from brachis.optimise.improve import SolvedProgram, SolverSession
from brachis.optimise.refine import add_points_where_lost
from brachis.search import continuation
from brachis.search.differential_ik import differential_ik_paths
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
    places = greville(phase.knots, phase.degree)
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


@pytest.mark.parametrize("found_after", [1, 9])
def test_it_is_solved_again_from_the_start(program, swinging, monkeypatch, found_after):
    few, lost = swinging
    x = next(starting_points(program))
    begun = []

    def solve(program, start, solve, _margins):
        answer = lost if len(begun) < found_after else x
        begun.append((program.collocation_points, start))
        report = solve(program, start)
        report = replace(report, x=answer, status=SolveStatus.OPTIMAL)
        return SolvedProgram(program, (report,))

    (backend,) = solvers_for("uno")
    session = SolverSession(backend, SolverOptions(max_iterations=1), NEVER)
    monkeypatch.setattr(continuation, "solve_by_margin_continuation", solve)
    solved = continuation.solve_within_branch(few, x, session)
    counts = [count for count, _ in begun]
    assert counts[:2] == [5, 8]
    assert len(counts) == (2 if found_after == 1 else 3)
    assert all(start is x for _, start in begun)
    assert solved.program.collocation_points == counts[-1]
    assert len(solved.reports) == len(counts)
    np.testing.assert_array_equal(solved.report.x, x if found_after == 1 else lost)


def test_the_last_point_may_be_lost_and_a_phase_with_a_given_speed(monkeypatch):
    program, _ = brachis.transcribe(
        brachis.examples.scara_line,
        redundant_joints=["j1"],
        intervals=6,
        tool_limits={"process_speed": [{"speed": 0.1, "s": [0.3, 0.6]}]},
    )
    assert any(phase.time_law is not None for phase in program.phases)
    paths = [next(differential_ik_paths(phase.joint_map)) for phase in program.phases]
    x = starting_point(program, paths, [None] * len(paths))
    assert add_points_where_lost(program, x) is None
    honest = ClosedFormMap.kernel_inputs

    def lose_the_last(self, y, sample):
        found = honest(self, y, sample)
        targets = found["targets"].copy()
        targets[-1] = np.nan
        return found | {"targets": targets}

    monkeypatch.setattr(ClosedFormMap, "kernel_inputs", lose_the_last)
    finer = add_points_where_lost(program, x)
    added = [
        np.setdiff1d(fine.t_norm, phase.t_norm)
        for fine, phase in zip(finer.phases, program.phases, strict=True)
    ]
    assert all(len(own) == 3 for own in added)
    assert all(
        own.min() > phase.t_norm[-2]
        for own, phase in zip(added, program.phases, strict=True)
    )


def test_a_motion_that_turns_too_far_between_points_gets_points_everywhere(
    program, monkeypatch
):
    x = next(starting_points(program))

    monkeypatch.setattr(PathMotion, "evaluate", lambda _motion: Fault.TURNS_TOO_FAR)
    finer = add_points_where_lost(program, x)
    gaps = program.collocation_points - 1
    assert finer.collocation_points == program.collocation_points + 3 * gaps
