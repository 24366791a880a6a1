"""The joints of a robot with what is in use: limits, masses, friction."""

from __future__ import annotations

import numpy as np

from brachis import ik
from brachis.robot import Robot
from brachis.robot.limits import MAGNITUDES
from brachis.robot.units import UNITS, shown_unit

NONE = "none"
WORDS = ("joint", "type")
"""Columns that are no figures with units."""
_FRICTION = ("viscous", "coulomb", "armature")


def joint_rows(robot: Robot, *, degrees: bool = False) -> list[dict[str, str]]:
    """Name, type, axis, limits, mass and friction of every joint, with units; `NONE` where there is none.

    The mass is that of the links that the joint carries up to the next one, with the payload at the last one.
    """
    geometry, limits = ik.ChainGeometry.of(robot), robot.limits
    rows = []
    for i, (name, unit) in enumerate(zip(robot.joint_names, robot.position_units, strict=True)):
        friction = {key: getattr(robot.friction, key)[i] for key in _FRICTION}
        rows.append(
            {
                "joint": name,
                "type": "revolute" if geometry.revolute[i] else "prismatic",
                "axis at zero": " ".join(f"{round(component, 6) + 0.0:.4g}" for component in geometry.axes[i]),
                "range": _range(limits.position_lower[i], limits.position_upper[i], unit, degrees=degrees),
                **{
                    kind.replace("_", " "): _limit(limits.both_ways(kind)[:, i], UNITS[kind][unit], degrees=degrees)
                    for kind in MAGNITUDES
                },
                "mass": f"{robot.model.inertias[i + 1].mass:.4g} kg",
                **{key: f"{value:.4g} {UNITS[key][unit]}" if value else NONE for key, value in friction.items()},
            }
        )
    return rows


def _range(lower: float, upper: float, unit: str, *, degrees: bool) -> str:
    if np.isinf([lower, upper]).all():
        return NONE
    shown, factor = shown_unit(unit, degrees=degrees)
    return f"{factor * lower:.4g} to {factor * upper:.4g} {shown}"


def _limit(pair: np.ndarray, unit: str, *, degrees: bool) -> str:
    """Write a limit, or two where they differ in both directions."""
    unit, factor = shown_unit(unit, degrees=degrees)
    lower, upper = factor * pair
    if np.isinf(upper):
        return NONE
    return f"{upper:.4g} {unit}" if -lower == upper else f"{lower:.4g} to {upper:.4g} {unit}"
