"""Arms whose URDF writes angles with few digits, as in 1.5708, between frames that stand anywhere on their axes."""

from __future__ import annotations

import itertools

import numpy as np
from scipy.spatial.transform import Rotation

from brachis.robot import Robot
from support.arms import SLIDE, TOOL, Arm, placement, tx90l, ur10
from support.chains import Joint, Vector, chain_urdf
from support.pose_arms import IIWA, IIWA_TOOL

Y = np.array([0.0, 1.0, 0.0])
QUARTERS = (
    np.pi / 2 * np.array(list(itertools.product((0.0, 1.0, -1.0, 2.0), repeat=3)))
)
"""Roll, pitch and yaw of all frames turned by quarters."""
TURNED = Rotation.from_euler("xyz", QUARTERS)
ANY_DIGITS = 15


def by_angles(
    arm: Arm, digits: int = 4, *, seed: int = 0, bent: float = 0.0, bent_joint: int = 4
) -> Robot:
    """Robot of an arm; its joints' frames are turned by quarters and slid along the axes at random.

    Parameters
    ----------
    arm : Arm
        Frames turned by quarters against each other.
    digits : int, optional
        Of roll, pitch and yaw after the point.
    seed : int, optional
    bent : float, optional
        By which roll and pitch of one joint's frame are wrong, rad.
    bent_joint : int, optional
        Place of this joint.
    """
    rng = np.random.default_rng(seed)
    joints, before, slid = [], Rotation.identity(), np.zeros(3)
    for i, step in enumerate(arm.steps):
        last = i == len(arm.letters)
        here = Rotation.identity() if last else TURNED[int(rng.integers(len(QUARTERS)))]
        along = np.zeros(3) if last else rng.uniform(-0.3, 0.3) * arm.axes[i]
        turn = Rotation.from_matrix(step[:3, :3])
        place = before.inv().apply(step[:3, 3] - slid + turn.apply(along))
        rpy = _angles(before.inv() * turn * here).round(digits)
        rpy[:2] += bent if i == bent_joint else 0.0
        slid, before = along, here
        if last:
            kind, axis, limit = "fixed", np.zeros(3), None
        else:
            kind, limit = (
                ("revolute", Joint("revolute").limit)
                if arm.letters[i] == "R"
                else ("prismatic", SLIDE)
            )
            axis = here.inv().apply(arm.axes[i]).round()
        joints.append(
            Joint(
                kind,
                axis=_vector(axis),
                xyz=_vector(place),
                rpy=_vector(rpy),
                limit=limit,
            )
        )
    return Robot.from_urdf("arm", urdf_text=chain_urdf(joints))


def _angles(rotation: Rotation) -> np.ndarray:
    """Roll, pitch and yaw; quarters as such, for these may have many."""
    gaps = (TURNED.inv() * rotation).magnitude()
    nearest = int(np.argmin(gaps))
    return QUARTERS[nearest] if gaps[nearest] < 1e-9 else rotation.as_euler("xyz")


def _vector(values: np.ndarray) -> Vector:
    x, y, z = (values + 0.0).tolist()
    return x, y, z


def iiwa() -> Arm:
    """Lengths of the LBR iiwa 14."""
    points = np.array([np.zeros(3), *(point for _, point in IIWA), IIWA_TOOL])
    return Arm(
        "R" * 7,
        tuple(np.array(axis) for axis, _ in IIWA),
        tuple(map(placement, np.diff(points, axis=0))),
    )


ARMS = {
    "TX90L on a rail": tx90l().with_slide(0, Y).with_tool(TOOL),
    "UR10": ur10().with_tool(TOOL),
    "UR10 on a rail": ur10().with_slide(0, Y).with_tool(TOOL),
    "iiwa": iiwa().with_tool(TOOL),
}
