"""The scene: solids carried by joints, the pairs of solids that must not touch, and the distances within pairs.

Balls and boxes around the solids are used to select close pairs. Only for these pairs, Coal computes the signed
distance and the two closest points.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any

import coal
import numpy as np

from brachis.scene.chain import Placed
from brachis.scene.solids import Solid

UNIT = 0.1
"""Distance, m, that corresponds to 1 in the values and ratios of the distance limits."""


@dataclass(frozen=True, eq=False)
class ClosePairs:
    """M pairs of solids; the two solids of each pair are close to each other in one posture.

    Attributes
    ----------
    posture, pair : (M,) int ndarray
    distance : (M,) ndarray
        Distance, m; negative if the solids overlap.
    points : (M, 2, 3) ndarray
        Closest points of the two solids, in the world frame, m.
    normal : (M, 3) ndarray
        Unit vector from the first solid to the second one.
    """

    posture: np.ndarray
    pair: np.ndarray
    distance: np.ndarray
    points: np.ndarray
    normal: np.ndarray

    def only(self, chosen: np.ndarray) -> ClosePairs:
        """Select some of the pairs, by index or mask."""
        return ClosePairs(*(value[chosen] for value in vars(self).values()))


@dataclass(frozen=True, eq=False)
class Scene:
    """Solids, and the pairs of solids that must not touch.

    Attributes
    ----------
    solids : tuple of Solid
    joints : (S,) int ndarray
        Number of the joint that moves each solid, counted from 1; 0 if it does not move.
    placements : (S, 4, 4) ndarray
        Placement of each solid in the frame of its joint, or in the world.
    pairs : (P, 2) int ndarray
    robot_count : int
        Number of solids that belong to the robot; they come first.
    """

    solids: tuple[Solid, ...]
    joints: np.ndarray
    placements: np.ndarray
    pairs: np.ndarray
    robot_count: int

    def names(self, pair: int) -> str:
        """Return the names of the two solids of a pair."""
        first, second = self.pairs[pair]
        return f"{self.solids[first].name} and {self.solids[second].name}"

    def with_pairs(self, chosen: np.ndarray) -> Scene:
        """Return the scene with some of its pairs, selected by index or mask."""
        return replace(self, pairs=self.pairs[chosen])

    def __getstate__(self) -> dict[str, object]:
        """Leave out cached objects of Coal."""
        return {key: vars(self)[key] for key in self.__dataclass_fields__}

    @cached_property
    def _functors(self) -> list[Any]:
        return [
            coal.ComputeDistance(*(self.solids[i].geometry for i in pair))
            for pair in self.pairs
        ]

    @cached_property
    def balls(self) -> tuple[np.ndarray, np.ndarray]:
        """Balls around the solids: centres in the frames of the joints, (S, 3), and radii, (S,), m."""
        radii = np.array([solid.radius for solid in self.solids])
        local = np.array([solid.geometry.aabb_center for solid in self.solids])
        local = np.where(np.isfinite(radii)[:, None], local, 0.0)
        centres = np.einsum("sij,sj->si", self.placements[:, :3, :3], local)
        return centres + self.placements[:, :3, 3], radii

    def centres(self, placed: Placed) -> np.ndarray:
        """Compute the centres of the balls around the solids in the world, (K, S, 3), m."""
        rotations, origins = placed
        turned = np.einsum("ksij,sj->ksi", rotations[:, self.joints], self.balls[0])
        return turned + origins[:, self.joints]

    def bounds(self, placed: Placed) -> np.ndarray:
        """Return lower bounds on the distances of the pairs, (K, P), m, from the balls around the solids."""
        centres = self.centres(placed)
        radii = self.balls[1]
        first, second = self.pairs.T
        apart = np.linalg.norm(centres[:, first] - centres[:, second], axis=2)
        half_spaces = np.flatnonzero(np.isinf(radii))
        turned, origins = self._place(placed) if len(half_spaces) else placed
        radii = np.where(np.isinf(radii), 0.0, radii)
        bounds = apart - radii[first] - radii[second]
        for number in half_spaces:
            plane = self.solids[number].geometry
            for mine, partner in ((first, second), (second, first)):
                plane_pairs = np.flatnonzero(mine == number)
                away = centres[:, partner[plane_pairs]] - origins[:, number, None]
                height = away @ turned[:, number] @ plane.n - plane.d
                bounds[:, plane_pairs] = height - radii[partner[plane_pairs]]
        return bounds

    @cached_property
    def _boxes(self) -> tuple[np.ndarray, np.ndarray]:
        """Boxes around the solids along their own axes: centres, (S, 3), and half lengths, (S, 3), m."""
        boxes = [solid.geometry.aabb_local for solid in self.solids]
        low = np.array([box.min_ for box in boxes])
        high = np.array([box.max_ for box in boxes])
        is_endless = np.isinf([solid.radius for solid in self.solids])[:, None]
        middle = np.where(is_endless, 0.0, 0.5 * low + 0.5 * high)
        return middle, np.where(is_endless, np.inf, 0.5 * high - 0.5 * low)

    def _place(self, placed: Placed) -> Placed:
        """Compute the placements of the solids: rotations, (K, S, 3, 3), and origins, (K, S, 3), m."""
        rotations = placed[0][:, self.joints]
        origins = np.einsum("ksij,sj->ksi", rotations, self.placements[:, :3, 3])
        turned = rotations @ self.placements[:, :3, :3]
        return turned, origins + placed[1][:, self.joints]

    def find_close(self, placed: Placed, within: float) -> ClosePairs:
        """Find the pairs that are closer than `within`, m, for placed joints."""
        posture, pair = np.nonzero(self.bounds(placed) < within)
        is_close = self._gaps(placed, posture, pair) < within
        close = self.measure(placed, posture[is_close], pair[is_close])
        return close.only(close.distance < within)

    def find_closest(self, placed: Placed) -> ClosePairs:
        """Find the closest pair in each posture."""
        bounds = self.bounds(placed)
        every = np.arange(len(bounds))
        estimate = self.measure(placed, every, bounds.argmin(axis=1))
        posture, pair = np.nonzero(bounds <= estimate.distance[:, None])
        close = self.measure(placed, posture, pair)
        order = np.lexsort((close.distance, close.posture))
        first = np.unique(close.posture[order], return_index=True)[1]
        return close.only(order[first])

    def _gaps(
        self, placed: Placed, posture: np.ndarray, pair: np.ndarray
    ) -> np.ndarray:
        """Return lower bounds on the distances, (M,), m: gaps between the boxes of each pair along the boxes' axes."""
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
                np.abs(np.einsum("mij,mi->mj", box_axes, apart))
                - np.nan_to_num(side, nan=np.inf)
                for box_axes, side in zip(axes, sides, strict=True)
            ]
        return np.maximum(*gaps).max(axis=1)

    def measure(
        self, placed: Placed, posture: np.ndarray, pair: np.ndarray
    ) -> ClosePairs:
        """Compute the distances of M pairs of solids, each pair in one of the postures of the placed joints."""
        count = len(posture)
        distance = np.empty(count)
        points = np.empty((count, 2, 3))
        normal = np.empty((count, 3))
        turned, origins = self._place(placed)
        first = coal.Transform3s()
        second = coal.Transform3s()
        request = coal.DistanceRequest()
        # Accuracy for solids that are apart, m. The depth of overlaps is less exact: Coal fails if more accuracy is
        # required.
        request.gjk_tolerance = 1e-10
        request.gjk_max_iterations = 500
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
        # If Coal fails, the solids overlap deeply; depths above 1 m are cut off.
        distance = np.maximum(np.nan_to_num(distance, nan=-np.inf), -1.0)
        return ClosePairs(posture, pair, distance, points, normal)
