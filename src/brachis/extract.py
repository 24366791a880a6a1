"""From an answer of the optimiser to a trajectory."""

from __future__ import annotations

import numpy as np

from brachis.attempt import Attempt, Start
from brachis.kinematics import ChartMap, interpolate
from brachis.nlp import Program
from brachis.refine import Refined
from brachis.trajectory import CONTINUOUS_TORQUE, Trajectory

_SAME_TIME = 1e-7
_BESIDE = 1e-4


def extract(start: Start, refined: Refined) -> Trajectory:
    """Turn the answer of a program into a trajectory that can be evaluated without the closed form.

    Parameters
    ----------
    start : Start
    refined : Refined

    Returns
    -------
    Trajectory

    Raises
    ------
    UnreachableError
        The motion leaves the branch between the collocation points.
    """
    (phase,), (motion,) = refined.program.phases, refined.program.motions(refined.x)
    joint_map, task = phase.joint_map, start.problem.task
    assert joint_map.path is not None  # noqa: S101  (a task has a path)
    joins = motion.times_of(joint_map.path.breaks[1:-1])
    gaps = np.abs(joins[:, None] - motion.breaks).min(axis=1, initial=np.inf)
    breaks = np.union1d(motion.breaks, joins[gaps > _SAME_TIME * motion.t_end])
    nodes = interpolate(joint_map, motion.at, breaks, jumps=motion.degree < CONTINUOUS_TORQUE)
    robot = joint_map.robot
    rows, knots = joint_map.rows.arrays() if isinstance(joint_map, ChartMap) else (np.empty((0, 0, 0)), np.empty(0))
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


def where_it_failed(attempt: Attempt) -> Program | None:
    """Add collocation points where the verification found a limit exceeded; None where it found no such place."""
    trajectory, refined = attempt.trajectory, attempt.refined
    if trajectory is None or refined is None or attempt.verification is None:
        return None
    failed = [check for check in attempt.verification.checks if not check.passed]
    if not failed or any(not check.of_limit or check.time is None for check in failed):
        return None
    t_norm = np.array([check.time for check in failed]) / trajectory.t_end
    near = t_norm[:, None] + _BESIDE * np.array([-1.0, 0.0, 1.0])
    (phase,) = refined.program.phases
    return refined.program.resampled([np.union1d(phase.t_norm, np.clip(near.ravel(), 0.0, 1.0))])
