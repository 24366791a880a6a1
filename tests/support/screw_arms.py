"""Arms given by their axes at the zero posture: skew ones of every kind, and two that are built."""

from __future__ import annotations

import itertools
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from brachis.robot import Robot
from support.arms import SLIDE
from support.chains import Joint, chain_urdf

X, Y, Z = np.eye(3)


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
    mount = Joint("fixed", xyz=(0.3, -0.2, 0.5), rpy=(0.4, -0.7, 1.1), limit=None)
    points = np.array([np.zeros(3), *(axis.point for axis in axes), tool])
    *steps, last = (tuple(step) for step in np.diff(points, axis=0).tolist())
    joints = [
        Joint("revolute", tuple(axis.direction.tolist()), step)
        if axis.letter == "R"
        else Joint("prismatic", tuple(axis.direction.tolist()), step, limit=SLIDE)
        for axis, step in zip(axes, steps, strict=True)
    ]
    text = chain_urdf(joints, tool=last, mount=mount if tilted else None)
    return Robot.from_urdf("screws", urdf_text=text)


def bases():
    """Three joints for every recipe and kinds of joints: letters, directions, points."""
    rng = np.random.default_rng(17)

    def anywhere():
        return rng.uniform(-0.6, 0.6, 3)

    def direction():
        return unit(rng.normal(size=3))

    def across(normal):
        return unit(np.cross(normal, rng.normal(size=3)))

    def single(letter):
        return Axis(letter, direction(), anywhere())

    def pair(letters):
        """Two joints that move positions in the planes with one normal."""
        normal = direction()
        return [
            Axis(
                letter,
                normal * rng.choice([-1.0, 1.0]) if letter == "R" else across(normal),
                anywhere(),
            )
            for letter in letters
        ]

    arms = {}
    for letters, letter in itertools.product(("RR", "RP", "PR", "PP"), "RP"):
        arms[f"{letter}|{letters}"] = [single(letter), *pair(letters)]
        arms[f"{letters}|{letter}"] = [*pair(letters), single(letter)]
    for letter in "RP":
        point, axes = anywhere(), [direction(), direction()]
        # The axes' own points lie off the point where they meet.
        crossing = [
            Axis("R", axis, point + axis * rng.uniform(-0.3, 0.3)) for axis in axes
        ]
        arms[f"RxR {letter}"] = [*crossing, single(letter)]
        arms[f"{letter} RxR"] = [single(letter), *crossing]
    normal = direction()
    arms["cylinder"] = [
        Axis("P", normal, anywhere()),
        Axis("R", -normal, anywhere()),
        Axis("R", across(normal), anywhere()),
    ]
    return arms


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
    if rail is not None:
        axes.insert(0, Axis("P", rail, np.zeros(3)))
    return screw_robot(axes, tool=(0.03, 0.02, 1.4))


def panda():
    """The Franka Panda from its table of Denavit-Hartenberg parameters (Craig): no spherical wrist, but a shoulder."""
    quarter = np.pi / 2
    lengths = (0.0, 0.0, 0.0, 0.0825, -0.0825, 0.0, 0.088)
    offsets = (0.333, 0.0, 0.316, 0.0, 0.384, 0.0, 0.0)
    twists = (0.0, -quarter, quarter, quarter, -quarter, quarter, quarter)
    joints = []
    for a, d, alpha in zip(lengths, offsets, twists, strict=True):
        offset = (a, -d * np.sin(alpha), d * np.cos(alpha))
        joints.append(Joint("revolute", xyz=offset, rpy=(alpha, 0.0, 0.0)))
    text = chain_urdf(joints, tool=(0.01, 0.02, 0.2))
    return Robot.from_urdf("panda", urdf_text=text)
