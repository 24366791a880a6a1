"""From an answer of the optimiser to a trajectory and its verification."""

from __future__ import annotations

import numpy as np

from brachis.kinematics import Decomposition, interpolate
from brachis.refine import Refined
from brachis.setting import Setting
from brachis.task import Task
from brachis.trajectory import CONTINUOUS_TORQUE, Trajectory
from brachis.verify import Verification, VerifyOptions, verify_trajectory

_SAME_TIME = 1e-7


def judge(decomposition: Decomposition, refined: Refined, setting: Setting) -> tuple[Trajectory, Verification]:
    """Make the trajectory of an answer, and verify it.

    Parameters
    ----------
    decomposition : Decomposition
    refined : Refined
    setting : Setting

    Returns
    -------
    Trajectory
    Verification

    Raises
    ------
    UnreachableError
        The motion leaves the branch between the collocation points.
    """
    trajectory = _trajectory(decomposition, refined, setting.task)
    options = VerifyOptions(ratio_tolerance=setting.task.refinement.tolerance)
    return trajectory, verify_trajectory(trajectory, options, further=setting.further)


def _trajectory(decomposition: Decomposition, refined: Refined, task: Task) -> Trajectory:
    """Turn the answer into a trajectory that can be evaluated without the closed form."""
    (motion,) = refined.program.motions(refined.x)
    joins = motion.times_of(decomposition.path.breaks[1:-1])
    gaps = np.abs(joins[:, None] - motion.breaks).min(axis=1, initial=np.inf)
    breaks = np.union1d(motion.breaks, joins[gaps > _SAME_TIME * motion.t_end])
    nodes = interpolate(decomposition, motion.at, breaks, jumps=motion.degree < CONTINUOUS_TORQUE)
    robot = decomposition.robot
    return Trajectory(
        task=task,
        urdf=robot.urdf,
        robot=robot,
        redundant_joints=tuple(robot.joint_names[i] for i in decomposition.redundant),
        branch=decomposition.branch_label,
        times=nodes.times,
        q=nodes.q,
        qdot=nodes.qdot,
        qddot=nodes.qddot,
        qddot_before=nodes.qddot_before,
        knots=motion.knots,
        degree=motion.degree,
        control_points=motion.control_points,
    )
