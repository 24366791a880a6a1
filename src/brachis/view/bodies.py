"""What is drawn of a robot: for every joint what moves with it, and for joint 0, the world, what stands still."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
import pinocchio as pin

from brachis.trajectory import Trajectory
from brachis.view.placements import Placements, placements
from brachis.view.visuals import coloured, link_shapes

if TYPE_CHECKING:
    import trimesh

_BONE = (72, 101, 129, 255)
_JOINT = (230, 159, 0, 255)
_AXIS = (120, 130, 140, 255)
_THICKNESS = 0.012
"""Radius of a skeleton's links as a part of the robot's size."""
_POSTURES = 33
"""At which a motion is looked at to find its extent."""


@dataclass(frozen=True, eq=False)
class Bodies:
    """Shapes by the joint that moves them, in the joint's frame, m.

    Attributes
    ----------
    links : dict of int to list of Trimesh
        What the URDF says the links look like; joint 0 is the world.
    skeleton : dict of int to list of Trimesh
        Joints and the straight lines between them.
    unread : tuple of str
        Shapes of the URDF that cannot be shown, and why.
    lower, upper : (3,) ndarray
        Corners of the box that the whole robot keeps within, m.
    moving_lower, moving_upper : (3,) ndarray
        Of the box that its joints, what they move, and the tool keep within, m.
    """

    links: Mapping[int, Sequence[trimesh.Trimesh]]
    skeleton: Mapping[int, Sequence[trimesh.Trimesh]]
    unread: tuple[str, ...]
    lower: np.ndarray
    upper: np.ndarray
    moving_lower: np.ndarray
    moving_upper: np.ndarray

    @property
    def shows_links(self) -> bool:
        """Whether the links can be seen; otherwise the skeleton has to do."""
        return bool(self.links) and not self.unread


def bodies_of(trajectory: Trajectory) -> Bodies:
    """Read a robot's shapes, and draw its skeleton as large as the robot is."""
    robot = trajectory.robot
    shapes, unread = link_shapes(robot.urdf, Path(robot.source).absolute().parent)
    links: dict[int, list[trimesh.Trimesh]] = {}
    for name, meshes in shapes.items():
        frame = robot.model.frames[robot.model.getFrameId(name, pin.FrameType.BODY)]
        for mesh in meshes:
            mesh.apply_transform(frame.placement.homogeneous)
        links.setdefault(int(frame.parentJoint), []).extend(meshes)
    q = trajectory.position(np.linspace(0.0, trajectory.t_end, _POSTURES))
    found = placements(robot, q)
    size = float(np.ptp(found.positions.reshape(-1, 3), axis=0).max())
    skeleton = _skeleton(trajectory, max(size, 1e-3) * _THICKNESS)
    drawn = links or skeleton
    moving = {joint: meshes for joint, meshes in drawn.items() if joint}
    return Bodies(links, skeleton, tuple(unread), *_box(drawn, found), *_box(moving, found))


def _box(bodies: Mapping[int, Sequence[trimesh.Trimesh]], found: Placements) -> tuple[np.ndarray, np.ndarray]:
    """Corners of a box around joints, tool and bodies in all postures."""
    from scipy.spatial.transform import Rotation  # noqa: PLC0415

    points = [found.positions[:, 1:].reshape(-1, 3)]
    for joint, meshes in bodies.items():
        corners = np.concatenate([_corners(mesh.bounds) for mesh in meshes])
        turned = Rotation.from_quat(found.quaternions[:, joint], scalar_first=True).as_matrix() @ corners.T
        points.append((found.positions[:, joint, :, None] + turned).transpose(0, 2, 1).reshape(-1, 3))
    every = np.concatenate(points)
    return every.min(axis=0), every.max(axis=0)


def _corners(bounds: np.ndarray) -> np.ndarray:
    return np.array(np.meshgrid(*bounds.T)).reshape(3, -1).T


def _skeleton(trajectory: Trajectory, radius: float) -> dict[int, list[trimesh.Trimesh]]:
    """Draw every joint, and the link from it to the next one; along the axis of a prismatic joint where it slides."""
    robot = trajectory.robot
    model, tool = robot.model, robot.model.frames[robot.frame_id]
    base = model.frames[model.getFrameId(robot.base_frame, pin.FrameType.BODY)].placement.translation
    begins = [base, *np.zeros((robot.n, 3))]
    drawn: dict[int, list[trimesh.Trimesh]] = {joint: [] for joint in range(robot.n + 1)}
    for joint in range(robot.n):
        placement, axis = model.jointPlacements[joint + 1], _axis(model.joints[joint + 1])
        drawn[joint] += _rod(begins[joint], placement.translation, radius, _BONE)
        if robot.position_units[joint] == "m":
            low, high = (placement.act(axis * reach) for reach in _range(trajectory, joint))
            drawn[joint] += _rod(low, high, 0.5 * radius, _AXIS)
            drawn[joint + 1] += _block(3.0 * radius, _JOINT)
        else:
            half = 2.0 * radius * axis
            drawn[joint + 1] += _rod(-half, half, 1.7 * radius, _JOINT)
    drawn[tool.parentJoint] += _rod(begins[-1], tool.placement.translation, radius, _BONE)
    return {joint: meshes for joint, meshes in drawn.items() if meshes}


def _axis(joint: Any) -> np.ndarray:  # noqa: ANN401  (Pinocchio's joint model)
    """Axis of a joint in its own frame, (3,)."""
    subspace = np.asarray(joint.createData().S).reshape(6, -1)[:, 0]
    return subspace[:3] if np.any(subspace[:3]) else subspace[3:]


def _range(trajectory: Trajectory, joint: int) -> tuple[float, float]:
    """Positions between which a prismatic joint can move, m; where it has no ends, those of the motion."""
    limits, q = trajectory.robot.limits, trajectory.q[:, joint]
    low, high = float(limits.position_lower[joint]), float(limits.position_upper[joint])
    return (low if np.isfinite(low) else float(q.min()), high if np.isfinite(high) else float(q.max()))


def _rod(begin: np.ndarray, end: np.ndarray, radius: float, colour: tuple[int, ...]) -> list[trimesh.Trimesh]:
    """Cylinder between two points; nothing where they are one."""
    import trimesh  # noqa: PLC0415  (one second)

    if np.linalg.norm(end - begin) < 1e-9:  # noqa: PLR2004
        return []
    return [coloured(trimesh.creation.cylinder(radius, segment=[begin, end], sections=24), colour)]


def _block(size: float, colour: tuple[int, ...]) -> list[trimesh.Trimesh]:
    import trimesh  # noqa: PLC0415

    return [coloured(trimesh.creation.box((size, size, size)), colour)]
