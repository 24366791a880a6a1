"""The scene: solids on the joints that carry them, pairs of them that must not touch, and the distances of pairs.

Balls around the solids tell which pairs are near. Of these alone Coal computes the distance, negative where they
overlap, with its two nearest points.
"""

from __future__ import annotations

import itertools
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import Any

import coal
import numpy as np
import pinocchio as pin
from lxml import etree

from brachis.common.files import read_text
from brachis.errors import TaskError, UnknownNameError
from brachis.robot import Robot
from brachis.robot.urdf_bodies import placement_matrix
from brachis.robot.urdf_elements import read_tree
from brachis.scene.chain import Chain, Placed
from brachis.scene.solids import (
    Solid,
    capsules_along,
    solid_of,
    solids_of_links,
)
from brachis.task import Task

Carrier = Callable[[Robot, str], tuple[int, np.ndarray]]
"""Returns the joint that moves a link, 0 for none, and where the link is in the joint's frame, (4, 4)."""
UNIT = 0.1
"""Distance of which ratios and values of limits are multiples, m."""
_EXACT = 1e-10
"""Tolerance of Coal's distances of solids that are apart, m."""
_ITERATIONS = 500
_POSTURES = 100
"""Random postures in which a pair that always touches is found."""


@dataclass(frozen=True, eq=False)
class Near:
    """Pairs that are near each other in some postures: M of them.

    Attributes
    ----------
    posture, pair : (M,) int ndarray
    distance : (M,) ndarray
        m, negative where they overlap.
    points : (M, 2, 3) ndarray
        Nearest points of both, in the world, m.
    normal : (M, 3) ndarray
        Unit vector from the first solid to the second one.
    """

    posture: np.ndarray
    pair: np.ndarray
    distance: np.ndarray
    points: np.ndarray
    normal: np.ndarray


@dataclass(frozen=True, eq=False)
class Scene:
    """Solids and the pairs of them that must not touch.

    Attributes
    ----------
    solids : tuple of Solid
    joints : (S,) int ndarray
        Joint that moves each, from 1 on; 0: it stands still.
    placements : (S, 4, 4) ndarray
        Of each in the frame of its joint, or in the world.
    pairs : (P, 2) int ndarray
    """

    solids: tuple[Solid, ...]
    joints: np.ndarray
    placements: np.ndarray
    pairs: np.ndarray

    def names(self, pair: int) -> str:
        """Name both solids of a pair."""
        first, second = self.pairs[pair]
        return f"{self.solids[first].name} and {self.solids[second].name}"

    def only(self, pairs: Sequence[int] | np.ndarray) -> Scene:
        """Return the scene with some of its pairs."""
        return Scene(self.solids, self.joints, self.placements, self.pairs[pairs])

    def __getstate__(self) -> dict[str, object]:
        """Leave out what Coal made of it."""
        return {key: vars(self)[key] for key in self.__dataclass_fields__}

    @cached_property
    def _functors(self) -> list[Any]:
        return [
            coal.ComputeDistance(*(self.solids[i].geometry for i in pair))
            for pair in self.pairs
        ]

    @cached_property
    def balls(self) -> tuple[np.ndarray, np.ndarray]:
        """Balls around the solids: centres in the joints' frames, (S, 3), and radii, (S,), m."""
        radii = np.array([solid.radius for solid in self.solids])
        local = np.array([solid.geometry.aabb_center for solid in self.solids])
        local = np.where(np.isfinite(radii)[:, None], local, 0.0)
        centres = np.einsum("sij,sj->si", self.placements[:, :3, :3], local)
        return centres + self.placements[:, :3, 3], radii

    def centres(self, placed: Placed) -> np.ndarray:
        """Place the centres of the balls around the solids, (K, S, 3), m."""
        rotations, origins = placed
        turned = np.einsum("ksij,sj->ksi", rotations[:, self.joints], self.balls[0])
        return np.asarray(turned + origins[:, self.joints])

    def bounds(self, placed: Placed) -> np.ndarray:
        """Return least distances that the pairs can have, (K, P), by the balls around them, m."""
        centres = self.centres(placed)
        radii = self.balls[1]
        first, second = self.pairs.T
        apart = np.linalg.norm(centres[:, first] - centres[:, second], axis=2)
        half_spaces = np.flatnonzero(np.isinf(radii))
        radii = np.where(np.isinf(radii), 0.0, radii)
        bounds = apart - radii[first] - radii[second]
        for number in half_spaces:
            plane = self.solids[number].geometry
            for mine, other in ((first, second), (second, first)):
                own = np.flatnonzero(mine == number)
                height = centres[:, other[own]] @ plane.n - plane.d
                bounds[:, own] = height - radii[other[own]]
        return np.asarray(bounds)

    @cached_property
    def _boxes(self) -> tuple[np.ndarray, np.ndarray]:
        """Boxes around the solids in their own axes: middles, (S, 3), and half lengths, (S, 3), m."""
        boxes = [solid.geometry.aabb_local for solid in self.solids]
        low = np.array([box.min_ for box in boxes])
        high = np.array([box.max_ for box in boxes])
        is_endless = np.isinf([solid.radius for solid in self.solids])[:, None]
        middle = np.where(is_endless, 0.0, 0.5 * low + 0.5 * high)
        return middle, np.where(is_endless, np.inf, 0.5 * high - 0.5 * low)

    def _place(self, placed: Placed) -> Placed:
        """Place the solids: rotations, (K, S, 3, 3), and origins, (K, S, 3), m."""
        rotations = placed[0][:, self.joints]
        origins = np.einsum("ksij,sj->ksi", rotations, self.placements[:, :3, 3])
        turned = rotations @ self.placements[:, :3, :3]
        return turned, origins + placed[1][:, self.joints]

    def near(self, placed: Placed, within: float) -> Near:
        """Find the pairs that are nearer than `within`, m, where the joints are placed so."""
        posture, pair = np.nonzero(self.bounds(placed) < within)
        kept = self._gaps(placed, posture, pair) < within
        found = self.measure(placed, posture[kept], pair[kept])
        kept = found.distance < within
        return Near(*(part[kept] for part in vars(found).values()))

    def _gaps(
        self, placed: Placed, posture: np.ndarray, pair: np.ndarray
    ) -> np.ndarray:
        """Gaps, (M,), m, between the boxes around the solids of pairs along the boxes' axes; no distance is less."""
        turned, origins = self._place(placed)
        middles, halves = self._boxes
        origins = origins + np.einsum("ksij,sj->ksi", turned, middles)
        first, second = self.pairs[pair].T
        apart = origins[posture, second] - origins[posture, first]
        axes = turned[posture, first], turned[posture, second]
        across = np.abs(np.swapaxes(axes[0], 1, 2) @ axes[1])
        with np.errstate(invalid="ignore"):  # a half-space has no end
            sides = (
                halves[first] + np.einsum("mij,mj->mi", across, halves[second]),
                halves[second] + np.einsum("mij,mi->mj", across, halves[first]),
            )
            gaps = [
                np.abs(np.einsum("mij,mi->mj", own, apart))
                - np.nan_to_num(side, nan=np.inf)
                for own, side in zip(axes, sides, strict=True)
            ]
        return np.asarray(np.maximum(*gaps).max(axis=1))

    def measure(self, placed: Placed, posture: np.ndarray, pair: np.ndarray) -> Near:
        """Compute the distances of pairs, (M,), in so many of the postures, (M,), in which the joints are placed."""
        count = len(posture)
        distance = np.empty(count)
        points = np.empty((count, 2, 3))
        normal = np.empty((count, 3))
        turned, origins = self._place(placed)
        first = coal.Transform3s()
        second = coal.Transform3s()
        request = coal.DistanceRequest()
        # That of solids that overlap is less exact: Coal gives up there where it is asked for more.
        request.gjk_tolerance = _EXACT
        request.gjk_max_iterations = _ITERATIONS
        result = coal.DistanceResult()
        chosen = self.pairs[pair]
        for m in range(count):
            k = posture[m]
            a, b = chosen[m]
            first.setTransform(turned[k, a], origins[k, a])
            second.setTransform(turned[k, b], origins[k, b])
            result.clear()
            distance[m] = self._functors[pair[m]](first, second, request, result)
            points[m, 0] = result.getNearestPoint1()
            points[m, 1] = result.getNearestPoint2()
            normal[m] = result.normal
        return Near(posture, pair, distance, points, normal)


def carrier_by_pinocchio(robot: Robot, link: str) -> tuple[int, np.ndarray]:
    """Find the joint that moves a link, and where the link is in the joint's frame."""
    frame = robot.model.frames[robot.model.getFrameId(link, pin.FrameType.BODY)]
    placed = frame.placement.homogeneous
    if link == robot.tool_frame:
        # The tool offset moves the tool frame, and not the link.
        offset = placement_matrix(robot.settings.tool_offset)
        placed = placed @ np.linalg.inv(offset)
    return int(frame.parentJoint), placed


def scene_of(
    robot: Robot, task: Task, carrier: Carrier = carrier_by_pinocchio
) -> Scene | None:
    """Put the bodies of a task's scene and of the robot together; None where nothing can collide.

    Parameters
    ----------
    robot : Robot
    task : Task
    carrier : callable, optional
        Tells what moves a link.

    Raises
    ------
    TaskError
        A body's link does not exist; the robot has no collision geometry; a mesh cannot be read.
    UrdfError
        The URDF's collision geometry cannot be read.
    """
    settings = task.collisions
    if settings.mode == "off" or not task.scene:
        return None
    folder = Path(robot.source).absolute().parent
    tree = read_tree(robot.urdf, robot.source)
    own = list(solids_of_links(tree, folder, settings.padding))
    if not own and settings.capsules == "auto":
        own = list(capsules_along(tree))
    if not own:
        raise TaskError(
            "the robot has no collision geometry",
            where="scene",
            found=f"no <collision> in {robot.source}",
            allowed="a URDF with <collision> elements",
            hint="Add them, or set collisions.capsules: auto, or collisions.mode: off",
        )
    solids = (*own, *(solid_of(body) for body in task.scene))
    joints = np.zeros(len(solids), dtype=int)
    placements = np.array([solid.placement for solid in solids])
    for number, solid in enumerate(solids):
        if solid.link is None:
            continue
        if solid.link not in tree.links:
            where = f"scene: {solid.name}.link"
            raise UnknownNameError("link", solid.link, tree.links, where=where)
        joints[number], placed = carrier(robot, solid.link)
        placements[number] = placed @ solid.placement
    scene = Scene(solids, joints, placements, np.empty((0, 2), dtype=int))
    disabled = [*settings.disable, *_disabled_in(settings.srdf)]
    pairs = [
        pair
        for pair in _moving_pairs(scene, len(own), settings.self_collision)
        if not _may_touch(scene, pair, disabled)
    ]
    scene = Scene(solids, joints, placements, np.reshape(pairs, (-1, 2)).astype(int))
    return scene.only(np.flatnonzero(~_always_touch(scene, robot)))


def _moving_pairs(scene: Scene, own: int, with_itself: bool) -> list[tuple[int, int]]:
    """List pairs that move relative to each other; links that meet at a joint may touch."""
    pairs = []
    for first, second in itertools.combinations(range(len(scene.solids)), 2):
        apart = abs(int(scene.joints[first] - scene.joints[second]))
        are_links = second < own
        if apart > (1 if are_links else 0) and (with_itself or not are_links):
            pairs.append((first, second))
    return pairs


def _disabled_in(srdf: str | None) -> list[tuple[str, str]]:
    """List the pairs of links that an SRDF file disables."""
    if srdf is None:
        return []
    where = f"collisions.srdf: {srdf}"
    text = read_text(Path(srdf), where=where, folder=Path.cwd())
    try:
        root = etree.fromstring(text.encode())
    except etree.XMLSyntaxError as error:
        problem = "the SRDF file is not XML"
        raise TaskError(problem, where=where, found=str(error)) from error
    found = root.iter("disable_collisions")
    return [(str(each.get("link1")), str(each.get("link2"))) for each in found]


def _may_touch(
    scene: Scene, pair: tuple[int, int], disabled: Sequence[tuple[str, str]]
) -> bool:
    """Tell whether a pair of solids, by their names or their links, is among those that are disabled."""
    first, second = ({scene.solids[i].name, scene.solids[i].link} for i in pair)
    return any(
        (a in first and b in second) or (a in second and b in first)
        for a, b in disabled
    )


def _always_touch(scene: Scene, robot: Robot) -> np.ndarray:
    """Tell which pairs overlap in every one of many random postures, (P,)."""
    low = np.maximum(robot.limits.position_lower, -np.pi)
    high = np.minimum(robot.limits.position_upper, np.pi)
    q = np.random.default_rng(0).uniform(low, high, (_POSTURES, robot.n))
    near = scene.near(Chain.of(robot.model).place(q), 0.0)
    return np.bincount(near.pair, minlength=len(scene.pairs)) == _POSTURES
