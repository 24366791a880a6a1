"""A family of closed forms for the tool position of arms that turn, tilt and reach.

The tilting axis n is perpendicular to the turning axis a. S is a point on n at a distance e in front of a. The boom
slides along d, away from S, and may lean to one side: g = d . n. For a target at the height h above S and at the
distance rho from a, the boom's length L and the tool's distance x in front of S follow from

    (e + x)^2 + (g L)^2 = rho^2   and   x^2 + h^2 = (1 - g^2) L^2,

a quadratic equation for x. Its two solutions are the branches. Redundant joints, such as a rail, come before the arm.
"""

from __future__ import annotations

import numpy as np

from brachis.common.arrays import cross
from brachis.ik import (
    ChainGeometry,
    IKSolver,
    NotApplicableError,
    PosedScrews,
    ik_family,
)
from brachis.ik.vectors import across, angle_about, dot, meeting_point
from brachis.robot import TaskMap

ROUNDING = 1e-9
METRE = 1.0
"""Size of the arm, m, by which margins are made dimensionless."""


class PolarSolver(IKSolver):
    """Turn, tilt and reach for batches of targets; see the module's formulas."""

    branches = ("forwards", "backwards")

    def __init__(self, geometry: ChainGeometry) -> None:
        self._geometry = geometry
        screws = geometry.screws_at(np.zeros((1, geometry.n)))
        turn, tilt, boom = axes(screws)
        self._lean = float(dot(boom, tilt)[0])
        self._flat = 1.0 - self._lean**2
        self._offset = float(
            dot(cross(tilt, turn), shoulder(screws) - screws.points[:, -3])[0]
        )

    def solve(self, targets: np.ndarray, q_r: np.ndarray) -> np.ndarray:
        """Return (K, 2, 1, 3) for tool positions (K, 3) and redundant joints (K, r)."""
        screws = self._geometry.screws_with(
            range(q_r.shape[1]), q_r
        )  # the arm at zero, moved by the joints before it
        turn_axis, tilt_axis, boom = axes(screws)
        lean, flat, offset = self._lean, self._flat, self._offset
        front, start = (
            cross(tilt_axis, turn_axis),
            shoulder(screws) - screws.points[:, -3],
        )
        away = targets.T - screws.points[:, -3]
        sideways, height = across(turn_axis, away), dot(turn_axis, away - start)
        with np.errstate(invalid="ignore"):  # out of reach: NaN
            root = np.sqrt(
                flat * (dot(sideways, sideways) - (lean * offset) ** 2)
                - (lean * height) ** 2
            )
        answers = np.empty((len(targets), 2, 1, 3))
        for branch, sign in enumerate((1.0, -1.0)):
            forward = sign * root - flat * offset
            reach = np.sqrt((forward**2 + height**2) / flat)
            tilted = front * forward + turn_axis * height + tilt_axis * (lean * reach)
            turn = angle_about(turn_axis, start + tilted, away)
            tilt = angle_about(tilt_axis, boom, tilted)
            answers[:, branch, 0] = np.stack(
                [turn, tilt, reach - length(screws)], axis=1
            )
        return answers

    def branch_margins(self, q: np.ndarray, branch: int) -> np.ndarray:
        """Return (K, 2): the tool's distance from where the two answers meet, and the boom's length, m."""
        screws = self._geometry.screws_at(q)
        turn_axis, tilt_axis, _ = axes(screws)
        forward = (
            dot(cross(tilt_axis, turn_axis), screws.tool_position - shoulder(screws))
            + self._flat * self._offset
        )
        return (
            np.stack([forward if branch == 0 else -forward, length(screws)], axis=1)
            / METRE
        )


def axes(screws: PosedScrews) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return the directions of turning, tilting and reaching, each (3, K)."""
    return screws.axes[:, -3], screws.axes[:, -2], screws.axes[:, -1]


def shoulder(screws: PosedScrews) -> np.ndarray:
    """Return S, where the boom's line meets the tilting axis, (3, K), m."""
    return meeting_point(
        screws.axes[:, -2],
        screws.points[:, -2],
        screws.axes[:, -1],
        screws.tool_position,
    )


def length(screws: PosedScrews) -> np.ndarray:
    """Return the distance of the tool from S along the boom, (K,), m."""
    return dot(screws.axes[:, -1], screws.tool_position - shoulder(screws))


@ik_family("polar", source="this module's docstring")
def polar(
    geometry: ChainGeometry, task_map: TaskMap, redundant: tuple[int, ...]
) -> PolarSolver:
    """Fit the family, or say why it does not."""
    if task_map.rows != ("x", "y", "z"):
        raise NotApplicableError("it serves the three rows of the position")
    if redundant != tuple(range(geometry.n - 3)):
        raise NotApplicableError(
            "the redundant joints have to come before the arm's three"
        )
    if list(geometry.revolute[-3:]) != [True, True, False]:
        raise NotApplicableError(
            "the last three joints are not revolute, revolute, prismatic"
        )
    screws = geometry.screws_at(np.zeros((1, geometry.n)))
    turn_axis, tilt_axis, boom = axes(screws)
    if abs(dot(turn_axis, tilt_axis)) > ROUNDING:
        raise NotApplicableError(
            "the tilting axis is not perpendicular to the turning axis"
        )
    gap = dot(cross(tilt_axis, boom), screws.tool_position - screws.points[:, -2])
    if abs(dot(tilt_axis, boom)) > 1.0 - ROUNDING or abs(gap) > ROUNDING:
        raise NotApplicableError("the boom's line does not meet the tilting axis")
    if abs(dot(tilt_axis, shoulder(screws) - screws.points[:, -3])) > ROUNDING:
        raise NotApplicableError(
            "where the boom's line meets the tilting axis is not in front of the turning axis"
        )
    return PolarSolver(geometry)
