"""From a solved program to a verified motion: refinement, trajectory, verification."""

from __future__ import annotations

import contextlib

import numpy as np

from brachis.errors import UnreachableError
from brachis.kinematics import ChartMap, interpolate
from brachis.optimise.backends import SolverReport
from brachis.optimise.candidate import Candidate, InitialGuess
from brachis.optimise.improve import Solve, SolvedProgram
from brachis.optimise.program import Program
from brachis.optimise.refine import RefinementOptions, refine
from brachis.trajectory import CONTINUOUS_TORQUE, Trajectory
from brachis.verify import verify_trajectory

_SAME_TIME = 1e-7
_BESIDE = 1e-4


def extract(start: InitialGuess, refined: SolvedProgram) -> Trajectory:
    """Turn the answer of a program into a trajectory that can be evaluated without the closed form.

    Parameters
    ----------
    start : Start
    refined : SolvedProgram

    Returns
    -------
    Trajectory

    Raises
    ------
    UnreachableError
        The motion leaves the branch between the collocation points.
    """
    (phase,) = refined.program.phases
    (motion,) = refined.program.motions(refined.x)
    joint_map = phase.joint_map
    task = start.problem.task
    assert joint_map.path is not None
    joins = motion.times_of(joint_map.path.breaks[1:-1])
    gaps = np.abs(joins[:, None] - motion.breaks).min(axis=1, initial=np.inf)
    breaks = np.union1d(motion.breaks, joins[gaps > _SAME_TIME * motion.t_end])
    nodes = interpolate(
        joint_map, motion.at, breaks, jumps=motion.degree < CONTINUOUS_TORQUE
    )
    robot = joint_map.robot
    rows, knots = (
        joint_map.rows.arrays()
        if isinstance(joint_map, ChartMap)
        else (np.empty((0, 0, 0)), np.empty(0))
    )
    return Trajectory(
        task=task,
        urdf=robot.urdf,
        robot=robot,
        redundant_joints=joint_map.redundant_joints,
        branch=joint_map.branch_label,
        times=nodes.times,
        q=nodes.q,
        qdot=nodes.qdot,
        qddot=nodes.qddot,
        qddot_before=nodes.qddot_before,
        knots=motion.knots,
        degree=motion.degree,
        control_points=motion.control_points,
        chart_rows=rows,
        chart_knots=knots,
    )


def with_points_at_violations(attempt: Candidate) -> Program | None:
    """Add collocation points where the verification found a limit exceeded; None where it found no such place."""
    trajectory = attempt.trajectory
    refined = attempt.refined
    if trajectory is None or refined is None or attempt.verification is None:
        return None
    failed = [check for check in attempt.verification.checks if not check.passed]
    if not failed or any(not check.of_limit or check.time is None for check in failed):
        return None
    t_norm = np.array([check.time for check in failed]) / trajectory.t_end
    near = t_norm[:, None] + _BESIDE * np.array([-1.0, 0.0, 1.0])
    (phase,) = refined.program.phases
    return refined.program.with_grid(
        [np.union1d(phase.t_norm, np.clip(near.ravel(), 0.0, 1.0))]
    )


_SECOND_LOOKS = 4
"""Times that a motion which the verification refuses is refined again where it failed."""


def refine_and_verify(
    attempt: Candidate,
    program: Program,
    reports: tuple[SolverReport, ...],
    solve: Solve,
    options: RefinementOptions,
) -> Candidate:
    """Refine and verify; only verify where the time is up.

    Parameters
    ----------
    attempt : Attempt
        Of which the program is made.
    program : Program
    reports : tuple of SolverReport
        Of all solves so far; the last one is the program's.
    solve : callable
        ``solve(program, x)`` returns a `SolverReport`.
    options : RefinementOptions

    Returns
    -------
    Attempt
    """
    refined = refine(program, reports[-1], solve, options)
    done = _verified(attempt, reports[:-1], refined)
    for _ in range(_SECOND_LOOKS if options.max_rounds else 0):
        finer = None if options.deadline.passed else with_points_at_violations(done)
        if finer is None:
            break
        report = solve(finer, refined.x)
        if not report.status.usable:
            break
        refined = refine(finer, report, solve, options)
        done = _verified(attempt, reports[:-1], refined)
    return done


def _verified(
    attempt: Candidate, before: tuple[SolverReport, ...], refined: SolvedProgram
) -> Candidate:
    """Make the trajectory of a refined program and verify it; `before` are the reports of earlier solves."""
    start = attempt.start
    assert start is not None
    problem = start.problem
    trajectory = None
    verification = None
    if refined.converged and np.isfinite(refined.violation):
        with contextlib.suppress(UnreachableError):
            trajectory = extract(start, refined)
            verification = verify_trajectory(trajectory, own_limits=problem.further)
    return attempt.finished(
        reports=(*before, *refined.reports),
        refined=refined,
        trajectory=trajectory,
        verification=verification,
        tolerance=problem.task.refinement.tolerance,
    )
