"""The optimisation problem of a saved motion, solved again: for files without sensitivities, and for checks.

Task, URDF, redundant joints and branch (or the chart), knots and control points are saved. The problem is built over
these knots, with the branch margin that the motion keeps, solved from the saved control points and refined as in a
plan. The start is an optimum already, so this takes a few iterations and ends at the same one. Splines along the timing
of a joint path have too many knots for that: as in a plan, the problem over fewer of them has the multipliers.
"""

from __future__ import annotations

import time
from collections.abc import Sequence

import numpy as np

from brachis.common.arrays import spread
from brachis.common.deadline import Deadline
from brachis.common.progress import Listener, ignore
from brachis.common.threads import use_one_thread
from brachis.errors import (
    DecompositionError,
    PlanningError,
    UnknownNameError,
    UnreachableError,
)
from brachis.ik import Family
from brachis.kinematics import ChartRows, JointMap, JointSpaceMap, chart_around
from brachis.optimise.backends import solvers_for
from brachis.optimise.grid import FixedGrid
from brachis.optimise.improve import SolvedProgram, SolverSession
from brachis.optimise.motion import Motion
from brachis.optimise.phase_timing import time_phases
from brachis.optimise.program import Program
from brachis.optimise.refine import RefinementOptions, refine
from brachis.optimise.retiming import begin_with_timing, is_timing_all, keep
from brachis.optimise.transcription import maps_by_leg, program_over
from brachis.problem.problem import Decomposition, Problem, decompositions_of
from brachis.robot.custom_limits import LimitModel
from brachis.robot.task_map import JOINTS
from brachis.trajectory import Trajectory

_INTERVALS = 60
"""Intervals, about, over which the timing of a joint path that is free is solved again: then it was 1 % slower."""
_EVALUATIONS = 110
"""A solve takes as long as so many evaluations of rows and slopes: the median of 30 motions, where it was 20 to 420."""
_SLOWER_BY_INTERVALS = 0.03
"""Part of the time by which these may make a motion slower."""


def solve_again(
    trajectory: Trajectory,
    listener: Listener = ignore,
    *,
    families: Sequence[Family] = (),
    own_limits: Sequence[LimitModel] = (),
) -> SolvedProgram:
    """Solve the problem of a saved motion from where it ended; a timing alone stays as it is.

    Parameters
    ----------
    trajectory : Trajectory
        As `brachis.plan` made it, or loaded.
    listener : callable, optional
        Is told how long it will take, then of every iteration.
    families, own_limits : sequence, optional
        Those with which the motion was planned, as of `brachis.plan`: they are not saved with it.

    Returns
    -------
    SolvedProgram
        As ``result.candidate.refined`` of the plan.

    Raises
    ------
    InputError
        The closed form or the branch is not known here; see `brachis.plan`.
    PlanningError
        The motion is not an optimum of its problem: no solver of the task came back to it; or the task's time limit
        was too short for that.
    """
    task = trajectory.task
    deadline = Deadline.after(task.search.time_limit)
    options = RefinementOptions.of(task.refinement, deadline)
    ends = []
    with use_one_thread():
        program, x = _problem(trajectory, families, own_limits)
        first = program.phases[0].joint_map
        longest = 1e-3
        is_timed = task.spline.intervals == "auto" and is_timing_all(program)
        if is_timed:
            if not first.r:
                return SolvedProgram(program, (keep(program, x),))
            begun = begin_with_timing(
                program,
                time_phases(program, x),
                task.spline.tolerance,
                _INTERVALS,
                task.spline.points_per_interval,
            )
            program, x = begun or (program, x)
            longest = _SLOWER_BY_INTERVALS
        listener(_announce(program, x, task.search.time_limit))
        has_law = any(phase.time_law is not None for phase in program.phases)
        for backend in solvers_for(task.solver.name):
            if deadline.passed:
                break
            solve = SolverSession.for_task(
                backend,
                task.solver,
                first,
                deadline,
                listener,
                has_time_law=has_law,
            )
            try:
                refined = refine(program, solve(program, x), solve, options)
            except UnreachableError:
                continue
            if not refined.converged:
                continue
            slower = trajectory.t_end / refined.t_end - 1.0
            if -longest <= slower <= task.search.slower + 1e-3:
                return refined
            ends.append(f"t_E = {refined.t_end:.6g} s by {refined.report.solver}")
    if deadline.passed:
        raise PlanningError(
            f"the time was up before the saved motion (t_E = {trajectory.t_end:.6g} s) was solved again: its "
            "sensitivities are unknown",
            where="search.time_limit",
            found=f"{task.search.time_limit:g} s",
            hint="Run brachis bottleneck on the task file with a larger search.time_limit: it plans again",
        )
    what = "a different optimum" if ends else "no optimum"
    raise PlanningError(
        f"solving the saved motion (t_E = {trajectory.t_end:.6g} s) again found {what}: its sensitivities are unknown",
        found=", ".join(ends) or None,
        hint="If the motion was planned with own_limits, pass them here too: they are not saved with it, as in "
        "brachis.bottleneck.report(motion, own_limits=[...]). Otherwise run brachis bottleneck on the task file: it "
        "plans again",
    )


def _announce(program: Program, x: np.ndarray, longest: float) -> str:
    """Say how long a solve from x, (v,), will take, s, from the time that its functions take there."""
    began = time.perf_counter()
    program.rows(x)
    program.jacobian(x)
    seconds = _EVALUATIONS * (time.perf_counter() - began)
    return (
        f"solving the problem of the motion again takes about {seconds:.1g} s, no more than {longest:g} s "
        "(search.time_limit)"
    )


def _problem(
    trajectory: Trajectory,
    families: Sequence[Family],
    own_limits: Sequence[LimitModel],
) -> tuple[Program, np.ndarray]:
    """Build the problem over the saved knots; the motion is its point x."""
    task = trajectory.task
    robot = trajectory.robot
    is_on_branch = task.task_space != JOINTS and not len(trajectory.chart_rows)
    if is_on_branch:
        names = [
            name for name in trajectory.redundant_joints if name in robot.urdf_joints
        ]
        chosen = {"redundant_joints": tuple(names), "branch": trajectory.branch}
        task = task.model_copy(update=chosen)
    problem = Problem.of(robot, task, own_limits)
    joint_map: JointMap
    if is_on_branch:
        decomposition = _find_decomposition(problem, families)
        joint_map = decomposition.joint_map(trajectory.q[0], decomposition.branches[0])
    elif task.task_space == JOINTS:
        joint_map = JointSpaceMap(problem.robot, problem.path)
    else:
        rows = ChartRows(trajectory.chart_rows, trajectory.chart_knots)
        s = trajectory.path_coordinate(trajectory.times)
        path = problem.path
        joint_map = chart_around(problem.task_map, path, s, trajectory.q, rows)
    parts = zip(trajectory.phases, trajectory.phase_splines, strict=True)
    moving = [(phase, spline) for phase, spline in parts if not phase.is_dwell]
    starts = trajectory.position([phase.begin for phase, _ in moving])
    grids = []
    motions = []
    for (_, spline), law in zip(moving, problem.time_laws, strict=True):
        t_norm = spread(np.unique(spline.knots), task.spline.points_per_interval)
        grids.append(FixedGrid(spline.knots, spline.degree, t_norm))
        points = spline.control_points[0 if law is None else 1 :]
        motions.append(Motion(spline.t_end, spline.knots, spline.degree, points, law))
    program = program_over(problem, maps_by_leg(problem, joint_map, starts), grids)
    # Limits that are far from their bounds all along the motion are left out.
    near = program.with_phases(
        phase.restrict_to(motion.at(phase.t_norm * motion.t_end)[0])
        for phase, motion in zip(program.phases, motions, strict=True)
    )
    return near, near.variables_from(motions)


def _find_decomposition(problem: Problem, families: Sequence[Family]) -> Decomposition:
    """Find the closed form and the branch of a saved motion, which its problem names.

    Raises
    ------
    DecompositionError
        No closed form fits: the motion was planned with one that is not known here.
    """
    try:
        (decomposition,) = decompositions_of(problem, families)
    except (DecompositionError, UnknownNameError) as error:
        raise DecompositionError(
            "the motion was planned with a closed form that is not known here; pass it as to brachis.plan, as in "
            "brachis.bottleneck.report(motion, families=[...]), or install the package that has it",
            redundant_joints=problem.task.redundant_joints,
            found=f"{error}",
        ) from error
    return decomposition
