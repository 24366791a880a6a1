"""Arms given by their axes at the zero posture: skew ones of every kind, and two that are built."""

from __future__ import annotations

import itertools
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from brachis.robot import Robot
from support.chains import Joint, chain_urdf

X, Y, Z = np.eye(3)
SLIDE = {"lower": -5.0, "upper": 5.0, "velocity": 1.0, "effort": 50.0}


@dataclass(frozen=True)
class Axis:
    """A joint by the letter R or P, its direction, and a point on it."""

    letter: str
    direction: np.ndarray
    point: np.ndarray


def unit(vector: Sequence[float]) -> np.ndarray:
    return np.asarray(vector, dtype=float) / np.linalg.norm(vector)


def screw_robot(
    axes: Sequence[Axis],
    tool: Sequence[float] = (0.4, -0.3, 0.2),
    *,
    tilted: bool = True,
) -> Robot:
    """Robot with joints j1, j2, ...; its base is tilted and displaced unless this is switched off."""
    joints, before = [], np.zeros(3)
    for axis in axes:
        kind, more = (
            ("revolute", {}) if axis.letter == "R" else ("prismatic", {"limit": SLIDE})
        )
        step = tuple((axis.point - before).tolist())
        joints.append(
            Joint(kind, axis=tuple(axis.direction.tolist()), xyz=step, **more)
        )
        before = axis.point
    mount = (
        Joint("fixed", xyz=(0.3, -0.2, 0.5), rpy=(0.4, -0.7, 1.1), limit=None)
        if tilted
        else None
    )
    last = tuple((np.asarray(tool) - before).tolist())
    return Robot.from_urdf(
        "screws", urdf_text=chain_urdf(joints, tool=last, mount=mount)
    )


def bases():
    """Three joints for every recipe and kinds of joints: letters, directions, points."""
    rng = np.random.default_rng(17)

    def anywhere():
        return rng.uniform(-0.6, 0.6, 3)

    def direction():
        return unit(rng.normal(size=3))

    def across(normal):
        return unit(np.cross(normal, rng.normal(size=3)))

    def pair(letters, normal):
        """Two joints that move positions in planes with this normal."""
        return [
            Axis(
                k,
                normal * rng.choice([-1.0, 1.0]) if k == "R" else across(normal),
                anywhere(),
            )
            for k in letters
        ]

    made = {}
    for letters, other in itertools.product(("RR", "RP", "PR", "PP"), "RP"):
        made[f"{other}|{letters}"] = [
            Axis(other, direction(), anywhere()),
            *pair(letters, direction()),
        ]
        made[f"{letters}|{other}"] = [
            *pair(letters, direction()),
            Axis(other, direction(), anywhere()),
        ]
    for other in "RP":
        point, axes = anywhere(), [direction(), direction()]
        # The axes' own points lie off the point where they meet.
        crossing = [
            Axis("R", axis, point + axis * rng.uniform(-0.3, 0.3)) for axis in axes
        ]
        made[f"RxR {other}"] = [*crossing, Axis(other, direction(), anywhere())]
        made[f"{other} RxR"] = [Axis(other, direction(), anywhere()), *crossing]
    normal = direction()
    made["cylinder"] = [
        Axis("P", normal, anywhere()),
        Axis("R", -normal, anywhere()),
        Axis("R", across(normal), anywhere()),
    ]
    return made


BASES = bases()


def wrist(rng, centre=(0.3, 0.5, -0.2)):
    """Three skew directions through one point."""
    directions = [unit(rng.normal(size=3)) for _ in range(3)]
    return [
        Axis("R", axis, np.array(centre) + axis * rng.uniform(-0.3, 0.3))
        for axis in directions
    ]


def extra(rng, letter):
    return Axis(letter, unit(rng.normal(size=3)), rng.uniform(-0.5, 0.5, 3))


def seven_joints(rail=None):
    """An arm with spherical shoulder and wrist, j1 to j7, and on a rail j1 to j8."""
    heights = (0.1575, 0.36, 0.5645, 0.78, 0.9645, 1.18, 1.261)
    axes = [
        Axis("R", axis, np.array([0.0, 0.0, height]))
        for axis, height in zip((Z, Y, Z, -Y, Z, Y, Z), heights, strict=True)
    ]
    return screw_robot(
        [Axis("P", rail, np.zeros(3)), *axes] if rail is not None else axes,
        tool=(0.03, 0.02, 1.4),
    )


def panda():
    """The Franka Panda from its table of Denavit-Hartenberg parameters (Craig): no spherical wrist, but a shoulder."""
    quarter = np.pi / 2
    rows = [
        (0.0, 0.333, 0.0),
        (0.0, 0.0, -quarter),
        (0.0, 0.316, quarter),
        (0.0825, 0.0, quarter),
    ]
    rows += [(-0.0825, 0.384, -quarter), (0.0, 0.0, quarter), (0.088, 0.0, quarter)]
    joints = []
    for a, d, alpha in rows:
        offset = (a, -d * np.sin(alpha), d * np.cos(alpha))
        joints.append(Joint("revolute", xyz=offset, rpy=(alpha, 0.0, 0.0)))
    return Robot.from_urdf(
        "panda", urdf_text=chain_urdf(joints, tool=(0.01, 0.02, 0.2))
    )
