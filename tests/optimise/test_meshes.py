"""Meshes from coarse to fine, free knots and many knots from few, on the paper's arm: 90 degrees, 10 Nm, no gravity."""

import dataclasses

import numpy as np
import pytest
from numpy.testing import assert_allclose, assert_array_equal

import brachis
from brachis.common.deadline import NEVER, Deadline
from brachis.optimise.backends import SolverOptions, SolveStatus, solvers_for
from brachis.optimise.improve import SolvedProgram, SolverSession
from brachis.optimise.mesh import (
    adapt_mesh,
    coarsest,
    optimise_knots,
    refine_mesh,
    solve_by_levels,
)
from brachis.optimise.refine import RefinementOptions, refine
from brachis.task import SplineSettings, task_with
from support.effort import QUICK
from support.scara import START, scara
from support.solvers import solve
from support.starts import starting_points

FINE = {"velocity": 2.1207, "full": 2.1309}
"""End times with 100 (rest: velocity) and 200 (rest: full) even intervals, s."""


def task(joint="j1", **spline):
    line = brachis.Line(length=1.0, angle_deg=90)
    return task_with(
        start=START,
        task_space=["x", "y"],
        path=line,
        redundant_joints=[joint],
        spline=spline,
        **QUICK,
    )


@pytest.fixture(scope="module")
def solved():
    """Problem of 10 even intervals, and its solve."""
    program, _ = brachis.transcribe(scara(), task(intervals=10))
    return SolvedProgram(program, (solve(program, next(starting_points(program))),))


class Broken:
    """A solver that breaks down in every session."""

    name = "broken"
    is_interior = True

    def solve(self, program, x, _options=None, _progress=None):
        report = solve(program, x)
        return dataclasses.replace(report, status=SolveStatus.FAILED, violation=np.inf)


@pytest.mark.parametrize(
    "joint, intervals, longest",
    [("j1", 8, 2.285), ("j1", 12, 2.185), ("j3", 12, 2.38)],
)
def test_free_knots_make_few_intervals_fast(joint, intervals, longest):
    result = brachis.plan(scara(), task(joint, intervals=intervals, knots="free"))
    assert result.verified
    assert result.t_end < longest
    lengths = np.diff(np.unique(result.trajectory.knots))
    assert len(lengths) == intervals
    # Rest: full ramps the torque up and down in the first and the last interval: these are as short as allowed.
    assert_allclose(lengths[[0, -1]], 0.1 / intervals, rtol=1e-6)
    assert lengths.min() >= 0.1 / intervals * (1.0 - 1e-9)
    even = brachis.plan(scara(), task(joint, intervals=intervals))
    assert result.t_end < 0.93 * even.t_end


@pytest.mark.parametrize("rest", ["velocity", "full"])
def test_auto_is_within_half_a_percent_of_a_fine_mesh(rest):
    result = brachis.plan(scara(), task(intervals="auto", rest=rest))
    assert result.verified
    assert result.t_end < 1.005 * FINE[rest]
    assert len(np.unique(result.trajectory.knots)) - 1 < 500


def test_a_motion_along_a_branch_boundary_is_verified_too():
    """Rounding is amplified there; more nodes than it allows made torques of 7 % too much."""
    result = brachis.plan(scara(), task("j3", intervals="auto", tolerance=0.004))
    assert result.verified
    assert result.t_end < 2.345
    assert len(result.trajectory.times) < 1500


def test_a_smaller_tolerance_gives_a_faster_motion_on_more_intervals(solved):
    rough, fine = (
        refine_mesh(solved, solve, SplineSettings(tolerance=tolerance), NEVER)
        for tolerance in (0.1, 0.01)
    )
    assert solved.program.intervals < rough.program.intervals < fine.program.intervals
    assert fine.t_end < rough.t_end < solved.t_end
    assert rough.reports[0] is solved.report
    assert rough.program.phases[0].violation(rough.x).max() < 1e-5


@pytest.mark.parametrize("name", ["ipopt", None])
def test_a_round_that_fails_is_left_to_the_other_solver(solved, name):
    interior = solvers_for(name)[0] if name else None
    session = SolverSession(Broken(), SolverOptions(), NEVER, interior=interior)
    fine = refine_mesh(solved, session, SplineSettings(tolerance=0.02), NEVER)
    assert (fine.program.intervals > solved.program.intervals) == bool(name)
    assert (fine.not_completed == "") == bool(name)


def test_a_finer_mesh_with_a_slower_motion_is_not_kept(solved):
    def solve_slower(program, x):
        report = solve(program, x)
        slower = program.scale_time(report.x, 1.5)
        time = program.end_time(slower)
        return dataclasses.replace(report, x=slower, objective=time)

    spline = SplineSettings(tolerance=1e-3)
    same = refine_mesh(solved, solve_slower, spline, NEVER)
    assert same.program is solved.program
    assert len(same.reports) == 2


@pytest.mark.parametrize(
    "speed, task_space, name",
    [
        (0.1, "pose_free_roll", "ipopt"),
        (0.1, "pose", "uno"),
        (None, "pose_free_roll", "uno"),
    ],
)
def test_an_interior_point_method_solves_first_at_a_given_speed_if_two_joints_are_free(
    speed, task_space, name
):
    line = brachis.Line(by=[0.0, 0.05, 0.0], speed=speed)
    keys = {"start": [0.0, 0.5, 0.0, -1.2, 0.0, 1.0, 0.3], "task_space": task_space}
    program, _ = brachis.transcribe("iiwa14", path=line, **keys)
    active, interior = (solvers_for(solver)[0] for solver in ("uno", "ipopt"))
    names = []

    class Recorded:
        """A solver that notes when it is asked, and gives no motion."""

        def __init__(self, solver):
            self.name = solver.name
            self.is_interior = solver.is_interior

        def solve(self, program, x, _options=None, _progress=None):
            names.append(self.name)
            return Broken().solve(program, x)

    pair = Recorded(active), Recorded(interior)
    session = SolverSession(pair[0], SolverOptions(), NEVER, interior=pair[1])
    session(program, program.guess)
    assert names[0] == name


def test_what_cannot_be_solved_is_left_as_it_was(solved):
    failing = Broken().solve
    spline = SplineSettings(tolerance=1e-3)
    for same in (
        refine_mesh(solved, failing, spline, NEVER),
        optimise_knots(solved, failing, 0.1, RefinementOptions()),
    ):
        assert same.program is solved.program
        assert same.report is solved.report
        assert len(same.reports) > 1


def test_no_interval_is_so_short_that_points_fall_together(solved):
    moved = optimise_knots(solved, solve, 1e-9, RefinementOptions())
    assert np.diff(moved.program.phases[0].breaks).min() == pytest.approx(
        5e-5, rel=1e-3
    )


def test_a_free_solve_that_stalls_still_gives_good_knots(solved):
    def stalling(program, x):
        report = solve(program, x)
        if not len(program.phases[0].grid.lower):
            return report
        return dataclasses.replace(report, status=SolveStatus.STALLED)

    moved = optimise_knots(solved, stalling, 0.1, RefinementOptions())
    assert moved.usable
    assert moved.t_end < 0.95 * solved.t_end
    assert moved.program.variables == solved.program.variables, "knots are fixed again"


@pytest.mark.parametrize("intervals", [53, 100])
def test_nested_iteration_gives_the_answer_of_a_cold_solve_in_a_few_iterations(
    intervals,
):
    program, _ = brachis.transcribe(scara(), task(intervals=intervals))
    coarse = coarsest(program).with_margin(0.05)
    report = solve(coarse, next(starting_points(coarse)))
    nested = solve_by_levels(program, SolvedProgram(coarse, (report,)), solve)
    assert not nested.not_completed
    (phase,), (expected,) = nested.program.phases, program.phases
    assert_array_equal(phase.knots, expected.knots)
    assert_array_equal(phase.t_norm, expected.t_norm)
    first, *later = nested.reports
    assert first is report
    assert max(level.iterations for level in later) <= 10
    cold = solve(program, next(starting_points(program)))
    assert later[-1].objective == pytest.approx(cold.objective, rel=1e-4)


def test_no_level_is_begun_after_the_deadline(solved):
    def never(*_arguments):
        raise AssertionError("solved after the deadline")

    target, _ = brachis.transcribe(scara(), task(intervals=60))
    over = RefinementOptions(deadline=Deadline(0.0))
    assert solve_by_levels(target, solved, never, over.deadline).not_completed
    for spline in (
        SplineSettings(knots="free", intervals=10),
        SplineSettings(intervals="auto"),
    ):
        same = adapt_mesh(solved, never, spline, over)
        assert same.program is solved.program
        assert same.reports == solved.reports
        assert same.not_completed
    refined = refine(solved.program, solved.report, never, over)
    assert refined.reports == solved.reports


def test_many_intervals_are_planned_at_once_from_the_timing():
    result = brachis.plan(scara(), task(intervals=100))
    assert result.verified
    assert result.t_end == pytest.approx(2.1421, abs=5e-4)
    assert len(np.unique(result.trajectory.knots)) == 101
    reports = result.candidate.reports
    assert {len(report.x) for report in reports} == {196}
    assert sum(report.iterations for report in reports) < 60


def test_many_intervals_are_planned_from_few_where_the_timing_leaves_a_limit_out():
    result = brachis.plan(scara({"jerk": 2000.0}), task(intervals=50, degree=4))
    assert result.verified
    reports = result.candidate.reports
    assert len(reports[0].x) < 0.6 * len(reports[-1].x)


def test_a_mesh_is_refined_where_a_mean_torque_holds_the_motion():
    slow = scara().with_limits(rms_torque=9.0)
    short = {"path": [brachis.Line(by=[0.0, 0.6])], "redundant_joints": "auto"}
    even, adapted = (
        brachis.plan(slow, task(intervals=intervals), **short)
        for intervals in (80, "auto")
    )
    assert adapted.verified, str(adapted.verification)
    assert adapted.t_end < even.t_end
