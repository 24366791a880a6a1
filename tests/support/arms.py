"""Arms of six joints for poses, alone and on a rail, and what every solver for poses owes."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from scipy.spatial.transform import Rotation

from brachis.robot import Robot, bind
from support.chains import Joint, chain_urdf
from support.published import published_urdf

X, Y, Z = np.eye(3)
SLIDE = {"lower": -5.0, "upper": 5.0, "velocity": 1.0, "effort": 50.0}
UR10_A = (0.0, -0.612, -0.5723, 0.0, 0.0, 0.0)
UR10_D = (0.1273, 0.0, 0.0, 0.163941, 0.1157, 0.0922)
UR10_ALPHA = (np.pi / 2, 0.0, 0.0, np.pi / 2, -np.pi / 2, 0.0)
TX90L_STEPS = (
    (0.0, 0.0, 0.478),
    (0.05, 0.0, 0.0),
    (0.0, 0.05, 0.5),
    (0.0, 0.0, 0.0),
    (0.0, 0.0, 0.55),
    (0.0, 0.0, 0.1),
)


def placement(
    position: Sequence[float] = (0.0, 0.0, 0.0), rotation: Rotation | None = None
) -> np.ndarray:
    """Placement as a (4, 4) matrix."""
    matrix = np.eye(4)
    matrix[:3, 3] = position
    matrix[:3, :3] = np.eye(3) if rotation is None else rotation.as_matrix()
    return matrix


@dataclass(frozen=True)
class Arm:
    """Joints by their letters R and P, their axes, and the placement before each of them and, last, of the tool."""

    letters: str
    axes: tuple[np.ndarray, ...]
    steps: tuple[np.ndarray, ...]

    @property
    def mirrored(self) -> Arm:
        """The same arm held at its tool."""
        steps = tuple(np.linalg.inv(self.steps[::-1]))
        return Arm(self.letters[::-1], tuple(-np.array(self.axes[::-1])), steps)

    def with_slide(self, place: int, axis: Sequence[float]) -> Arm:
        """Put a slide before the joint at a place."""
        direction = np.array(axis) / np.linalg.norm(axis)
        letters = f"{self.letters[:place]}P{self.letters[place:]}"
        axes = (*self.axes[:place], direction, *self.axes[place:])
        return Arm(letters, axes, (*self.steps[:place], np.eye(4), *self.steps[place:]))

    def with_tool(self, tool: np.ndarray) -> Arm:
        """Exchange the tool."""
        return replace(self, steps=(*self.steps[:-1], self.steps[-1] @ tool))

    def with_senses_and_zeros(
        self, signs: Sequence[int], offsets: Sequence[float]
    ) -> Arm:
        """Change the senses of the joints, and turn or move what follows a joint by an offset."""
        steps = list(self.steps)
        for i, offset in enumerate(offsets):
            move = offset * self.axes[i]
            turn = placement(rotation=Rotation.from_rotvec(move))
            change = turn if self.letters[i] == "R" else placement(move)
            steps[i + 1] = change @ steps[i + 1]
        axes = (s * axis for s, axis in zip(signs, self.axes, strict=True))
        return Arm(self.letters, tuple(axes), tuple(steps))

    def robot(self, mount: np.ndarray | None = None) -> Robot:
        """Robot with joints j1, j2, ..."""
        joints = []
        for letter, axis, step in zip(
            self.letters, self.axes, self.steps, strict=False
        ):
            direction = tuple(axis.tolist())
            joints.append(
                Joint("revolute", direction, **_origin(step))
                if letter == "R"
                else Joint("prismatic", direction, limit=SLIDE, **_origin(step))
            )
        joints.append(Joint("fixed", limit=None, **_origin(self.steps[-1])))
        base = None if mount is None else Joint("fixed", limit=None, **_origin(mount))
        return Robot.from_urdf("arm", urdf_text=chain_urdf(joints, mount=base))


def _origin(matrix: np.ndarray) -> dict[str, Any]:
    rpy = Rotation.from_matrix(matrix[:3, :3]).as_euler("xyz")
    return {"xyz": tuple(matrix[:3, 3].tolist()), "rpy": tuple(rpy.tolist())}


def ur10() -> Arm:
    """UR10 by its Denavit-Hartenberg table."""
    after = [
        placement((a, 0.0, d), Rotation.from_euler("x", alpha))
        for a, d, alpha in zip(UR10_A, UR10_D, UR10_ALPHA, strict=True)
    ]
    return Arm("RRRRRR", (Z,) * 6, (np.eye(4), *after))


def tx90l() -> Arm:
    """TX90L by its axes at the zero posture."""
    return Arm(
        "RRRRRR",
        (Z, Y, Y, Z, Y, Z),
        (*(placement(step) for step in TX90L_STEPS), np.eye(4)),
    )


TOOL = placement((0.02, 0.05, 0.1), Rotation.from_rotvec((0.4, -0.3, 0.2)))
MOUNT = placement((0.3, -0.2, 0.5), Rotation.from_rotvec((0.4, -0.7, 1.1)))
SKEW = (0.3, 0.5, 0.81)


def on_random_rail(arm: Arm, seed: int) -> Robot:
    """An arm on a rail somewhere, whose joints have random senses and zeros."""
    rng = np.random.default_rng(seed)
    arm = arm.with_slide(0, rng.normal(size=3))
    mount = placement(rng.uniform(-1.0, 1.0, 3), Rotation.random(random_state=seed))
    signs = rng.choice([-1, 1], 7)
    return arm.with_senses_and_zeros(signs, rng.uniform(-3.0, 3.0, 7)).robot(mount)


def rolling(arm: Arm) -> Robot:
    """An arm whose tool rolls freely."""
    return bind(arm.robot(MOUNT), "pose_free_roll")[0]


def generic(letters: str = "RRRRRR", first: int = 1) -> Arm:
    """Directions and lengths as they come, but for three parallel axes, and two that meet after them."""
    rng = np.random.default_rng(3)
    n = rng.normal(size=3)
    axes = [n if i in range(first, first + 3) else rng.normal(size=3) for i in range(6)]
    steps = [placement(rng.uniform(-0.4, 0.4, 3)) for _ in range(7)]
    unit = tuple(axis / np.linalg.norm(axis) for axis in axes)
    if first == 1:
        steps[5] = placement(0.2 * unit[4] - 0.1 * unit[5])
    return Arm(letters, unit, tuple(steps))


def example_robot(name: str) -> Robot:
    """A UR arm of example-robot-data."""
    path = published_urdf(f"ur_description/urdf/{name}_robot.urdf")
    return Robot.from_urdf(path, tool_frame="tool0")
