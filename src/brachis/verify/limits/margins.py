"""Distances of a motion from singular postures and from the ends of joint ranges, computed with the URDF's chain.

Let p be the point that follows the path, and let a joint have an axis z through the point o. For a revolute joint, its
column of the Jacobian consists of z x (p - o) and z; for a prismatic joint, of z and 0.
"""

from __future__ import annotations

import numpy as np

from brachis.common.arrays import cross
from brachis.verify.limits.protocol import LimitCheck, Worst, worst_between
from brachis.verify.mechanics import tool_placements
from brachis.verify.motion import CheckedMotion, MotionStates
from brachis.verify.report import Margin


def find_margins(motion: CheckedMotion, states: MotionStates) -> tuple[Margin, ...]:
    """Find the arm's smallest singular value, and the smallest distance of a joint from an end of its range."""
    margins: list[Margin] = []
    if not np.isfinite(states.q).all():
        return ()
    if motion.task_map.is_of_tool:
        singular = _singular_values(motion, states)
        k = np.argmin(singular)
        time = float(states.t[k])
        name = "smallest singular value"
        margins.append(Margin(name, float(singular[k]), "-", "arm", time))
    used, names = _parts_of_ranges(motion, states)
    if names:
        place, joint = np.unravel_index(np.argmax(used), used.shape)
        distance = 50.0 * (1.0 - float(used[place, joint]))
        time = float(states.t[place])
        name = "smallest distance from the end of a range"
        margins.append(Margin(name, distance, "%", names[joint], time))
    return tuple(margins)


def _singular_values(motion: CheckedMotion, states: MotionStates) -> np.ndarray:
    """Return smallest singular values, (K,), of the Jacobian of the prescribed rows with respect to the arm's joints.

    The singular values are the square roots of the smallest eigenvalues of J J^T, accurate to within 1e-8 of the
    largest singular value.
    """
    rotations, origins = states.joints
    tool = tool_placements(motion.robot, states.q, states.joints)[0].T
    columns = []
    for number, body in enumerate(motion.robot.urdf_dynamics.bodies, 1):
        axis = (rotations[:, number] @ body.axis).T
        arm = cross(axis, tool - origins[:, number].T)
        columns.append((axis, 0.0 * axis) if body.sliding else (arm, axis))
    every = np.array(columns).reshape(len(columns), 6, -1).T
    jacobian = every[:, motion.task_map.prescribed.parts]
    squares = np.linalg.eigvalsh(jacobian @ jacobian.swapaxes(1, 2))[:, 0]
    return np.sqrt(squares.clip(min=0.0))


def _parts_of_ranges(
    motion: CheckedMotion, states: MotionStates
) -> tuple[np.ndarray, list[str]]:
    """Return distances from the middle of joint ranges, (K, c), scaled to 1 at the ends, and the joints' names."""
    count = len(motion.robot.urdf_joints)
    ends = motion.robot.limits.both_ways("position")[:, :count]
    joints = np.flatnonzero(np.isfinite(ends).all(axis=0))
    lower, upper = ends[:, joints]
    away = np.abs(states.q.take(joints, axis=1) - 0.5 * (lower + upper))
    names = [motion.robot.joint_names[joint] for joint in joints]
    return away / (0.5 * (upper - lower)), names


def _worst_singularity(motion: CheckedMotion) -> Worst | None:
    """Find the largest 2 - value / margin, which is 1 where the margin is just kept and 2 in a singular posture."""
    margin = motion.task.margins.singularity
    if margin is None:
        return None

    def ratios(states: MotionStates) -> np.ndarray:
        """Return 2 - value / margin for the smallest singular values, (K, 1)."""
        return 2.0 - _singular_values(motion, states)[:, None] / margin

    return worst_between(motion, ratios, ("arm",))


def _worst_joint_end(motion: CheckedMotion) -> Worst | None:
    """Find the largest ratio of a joint's distance from the middle of its range to the allowed distance."""
    share = motion.task.margins.joint_ends
    _, names = _parts_of_ranges(motion, motion.states.only([0]))
    if share is None or not names:
        return None

    def ratios(states: MotionStates) -> np.ndarray:
        """Return the distances from the middles of the ranges divided by the allowed distances, (K, c)."""
        return _parts_of_ranges(motion, states)[0] / (1.0 - 2.0 * share)

    return worst_between(motion, ratios, names)


MARGIN_CHECKS: dict[str, LimitCheck] = {
    "singularity": _worst_singularity,
    "joint_ends": _worst_joint_end,
}
