"""How far the tool leaves the path, by the URDF's own chain and the path alone, over what the task allows.

With the rotation D of the tool in the axes of the path's orientation, and its third column z, the tool's axis there:

    tilt = acos z_z,   lead = asin z_x,   side = atan2(z_y, z_z),   roll = atan2(-D_xy, D_xx).
"""

from __future__ import annotations

import numpy as np

from brachis.common.arrays import apply_each
from brachis.verify.limits.protocol import LimitCheck, Worst, worst_between
from brachis.verify.mechanics import joint_placements, real_tool_placements
from brachis.verify.motion import Given, MotionStates

_ANGLES = ("lead", "side", "roll")


def _worst_range(given: Given) -> Worst | None:
    """Find the largest part of a range that the tool uses; None without ranges."""
    tolerances = given.task.tolerances
    angles = {way: getattr(tolerances.orientation, way) for way in _ANGLES}
    lengths = {way: getattr(tolerances.position, way) for way in "xyz"}
    every = angles | lengths
    ranges = {way: ends for way, ends in every.items() if ends not in (None, "free")}
    if not ranges:
        return None

    def ratios(states: MotionStates) -> np.ndarray:
        """Return the used parts of the ranges, (K, c)."""
        found = _deviations(given, states)
        columns = []
        for way, (low, high) in ranges.items():
            away = found[way] - 0.5 * (low + high)
            if way in _ANGLES:
                away = np.remainder(away + 180.0, 360.0) - 180.0
            columns.append(np.abs(away) / (0.5 * (high - low)))
        return np.stack(columns, axis=1)

    return worst_between(given, ratios, [f"tool {way}" for way in ranges])


def _worst_size(given: Given, name: str, largest: float | None) -> Worst | None:
    """Find the largest ratio of a tilt, or of a distance, to the largest that is allowed; None without one."""
    if largest is None:
        return None

    def ratios(states: MotionStates) -> np.ndarray:
        """Return the sizes over the largest one, (K, 1)."""
        return _deviations(given, states)[name][:, None] / largest

    return worst_between(given, ratios, ("tool",))


def _deviations(given: Given, states: MotionStates) -> dict[str, np.ndarray]:
    """Angles, degrees, and displacements, m, by which the tool is not where the path wants it, (K,) each."""
    joints = joint_placements(given.robot, states.q)
    origin, rotation = real_tool_placements(given.robot, *joints)
    target = given.path.sample(np.clip(states.s, 0.0, 1.0)).target
    shift = origin - target[:, :3]
    wanted = target[:, 3:].reshape(-1, 3, 3) if given.task.of_poses else rotation
    back = np.swapaxes(wanted, 1, 2)
    turned = back @ rotation
    if given.task.tolerances.position.axes == "tool":
        shift = apply_each(back, shift)
    x, y, z = turned[:, :, 2].T
    radians = {
        "tilt": np.arctan2(np.hypot(x, y), z),
        "lead": np.arcsin(np.clip(x, -1.0, 1.0)),
        "side": np.arctan2(y, z),
        "roll": np.arctan2(-turned[:, 0, 1], turned[:, 0, 0]),
    }
    found = {way: np.degrees(angle) for way, angle in radians.items()}
    found |= zip("xyz", shift.T, strict=True)
    return {**found, "distance": np.linalg.norm(shift, axis=1)}


TOLERANCE_CHECKS: dict[str, LimitCheck] = {
    "tool_tilt": lambda given: _worst_size(
        given, "tilt", given.task.tolerances.orientation.tilt
    ),
    "tool_distance": lambda given: _worst_size(
        given, "distance", given.task.tolerances.position.sphere
    ),
    "tool_range": _worst_range,
}
