"""A robot as a stick figure: positions of its joints by forward kinematics."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import pinocchio as pin

from brachis.robot import Robot

_AXIS_TOLERANCE = 1e-6


@dataclass(frozen=True, eq=False)
class Skeleton:
    """Postures as polylines in the world frame, m.

    Attributes
    ----------
    bones : (K, 2 n + 2, 3) ndarray
        Base, every joint before and after its motion (the same point for a revolute joint), tool.
    joints : (K, n, 3) ndarray
        Origins of the joint frames.
    tool : (K, 3) ndarray
        Tool positions.
    """

    bones: np.ndarray
    joints: np.ndarray
    tool: np.ndarray


def skeleton(robot: Robot, q: np.ndarray) -> Skeleton:
    """Stick figures of the postures `q`, (K, n)."""
    model, data = robot.model, robot.model.createData()
    base, n = int(model.getFrameId(robot.base_frame)), robot.n
    bones = np.empty((len(q), 2 * n + 2, 3))
    for points, posture in zip(bones, q, strict=True):
        pin.framesForwardKinematics(model, data, posture)
        points[0] = data.oMf[base].translation
        for joint in range(1, n + 1):
            points[2 * joint - 1] = (data.oMi[model.parents[joint]] * model.jointPlacements[joint]).translation
            points[2 * joint] = data.oMi[joint].translation
        points[-1] = data.oMf[robot.frame_id].translation
    return Skeleton(bones, bones[:, 2:-1:2], bones[:, -1])


def drawing_plane(robot: Robot, q: np.ndarray, axes: Sequence[int]) -> tuple[int, int] | None:
    """World axes (0, 1, 2) of the plane in which a planar chain moves; None for other chains.

    Parameters
    ----------
    robot : Robot
    q : (n,) ndarray
        Any posture: joint axes that are parallel in one are so in all.
    axes : sequence of int
        World axes of the task space's position rows. Two of them fix the plane; one leaves a choice.
    """
    data = robot.model.createData()
    columns = np.asarray(pin.computeJointJacobians(robot.model, data, q)).reshape(6, robot.n)  # (6,) for one joint
    revolute = robot.revolute
    turning, sliding = columns[3:, revolute], columns[:3, ~revolute]
    for normal in (2, 1, 0):
        in_plane = [axis for axis in range(3) if axis != normal]
        turns_about = np.abs(turning[in_plane]).max(initial=0.0) < _AXIS_TOLERANCE
        slides_in = np.abs(sliding[normal]).max(initial=0.0) < _AXIS_TOLERANCE
        if normal not in axes[:2] and turns_about and slides_in:
            return in_plane[0], in_plane[1]
    return None
