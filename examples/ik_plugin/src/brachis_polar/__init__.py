"""A family of closed forms for brachis: arms that turn, tilt and reach, for the position of their tool.

The turning axis a and the tilting axis n meet at a right angle in S, and the boom slides along d, away from S and
perpendicular to n. The distance of the target from S gives the reach, its height along a the tilt, and its direction
about a the turn. Turned by half a turn and tilted over backwards the arm reaches the same target: two branches.
Redundant joints, a rail for example, come before the arm.
"""

from __future__ import annotations

import numpy as np

from brachis.ik import ChainGeometry, NotApplicableError, PosedScrews, ik_family
from brachis.ik.vectors import across, angle_about, cross, dot
from brachis.robot import TaskSpace

ROUNDING = 1e-9


class PolarSolver:
    """Turn, tilt and reach for batches of targets; see the module's formulas."""

    kind = "closed_form"
    branches = ("forwards", "backwards")

    def __init__(self, geometry: ChainGeometry) -> None:
        self._geometry = geometry

    def solve(self, targets: np.ndarray, q_r: np.ndarray) -> np.ndarray:
        """Return (K, 2, 3) for tool positions (K, 3) and redundant joints (K, r)."""
        screws = self._geometry.held(range(q_r.shape[1]), q_r)  # the arm at zero, moved by the joints before it
        turn_axis, tilt_axis, boom = (screws.axes[:, i] for i in (-3, -2, -1))
        away = targets.T - meeting_point(screws)
        height = dot(turn_axis, away)
        sideways = across(turn_axis, away)
        level = np.sqrt(dot(sideways, sideways))
        reach = np.sqrt(dot(away, away)) - length(screws)
        answers = np.empty((len(targets), 2, 3))
        for branch, sign in enumerate((1.0, -1.0)):
            tilted = turn_axis * height + cross(tilt_axis, turn_axis) * (sign * level)
            tilt = angle_about(tilt_axis, boom, tilted)
            answers[:, branch] = np.stack([angle_about(turn_axis, tilted, away), tilt, reach], axis=1)
        return answers

    def branch_margins(self, q: np.ndarray, branch: int) -> np.ndarray:
        """Return (K, 2): the boom's tilt away from the turning axis, and its length."""
        screws = self._geometry.posed(q)
        turn_axis, tilt_axis, boom = (screws.axes[:, i] for i in (-3, -2, -1))
        lean = dot(boom, cross(tilt_axis, turn_axis))
        return np.stack([lean if branch == 0 else -lean, length(screws)], axis=1)


def meeting_point(screws: PosedScrews) -> np.ndarray:
    """Return S, (3, K), m."""
    tilt_axis, on_tilt = screws.axes[:, -2], screws.points[:, -2]
    return on_tilt + tilt_axis * dot(tilt_axis, screws.points[:, -3] - on_tilt)


def length(screws: PosedScrews) -> np.ndarray:
    """Return the distance of the tool from S along the boom, (K,), m."""
    return dot(screws.axes[:, -1], screws.tool_position - meeting_point(screws))


@ik_family("polar", source="this module's docstring")
def polar(geometry: ChainGeometry, task_space: TaskSpace, redundant: tuple[int, ...]) -> PolarSolver:
    """Fit the family, or say why it does not."""
    if task_space.rows != ("x", "y", "z"):
        raise NotApplicableError("it serves the three rows of the position")
    if redundant != tuple(range(geometry.n - 3)):
        raise NotApplicableError("the redundant joints have to come before the arm's three")
    if list(geometry.revolute[-3:]) != [True, True, False]:
        raise NotApplicableError("the last three joints are not revolute, revolute, prismatic")
    screws = geometry.posed(np.zeros((1, geometry.n)))
    turn_axis, tilt_axis, boom = (screws.axes[:, i] for i in (-3, -2, -1))
    centre = meeting_point(screws)
    off_axis = across(turn_axis, centre - screws.points[:, -3])
    off_boom = across(boom, screws.tool_position - centre)
    if max(abs(dot(tilt_axis, turn_axis)), abs(dot(tilt_axis, boom))) > ROUNDING:
        raise NotApplicableError("the tilting axis is not perpendicular to the turning axis and the boom")
    if max(np.abs(off_axis).max(), np.abs(off_boom).max()) > ROUNDING:
        raise NotApplicableError("the axes and the boom do not meet")
    return PolarSolver(geometry)
