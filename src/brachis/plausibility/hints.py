"""Hints for errors that come of degrees for rad, or mm for m."""

from __future__ import annotations

import math

import numpy as np

from brachis.plausibility.size import reach
from brachis.robot import TaskMap

_TURN = 2.0 * math.pi
_THOUSAND = 1000.0
_ROUNDED = 1e-3
"""Places are given to the millimetre."""


def position_hint(value: float, lower: float, upper: float, unit: str) -> str | None:
    """Say what a position, rad or m, beyond its range looks like, if it would be within it in degrees or mm."""
    if unit == "rad" and abs(value) > _TURN and lower <= math.radians(value) <= upper:
        return f"It looks like degrees: {value:.6g} deg are {math.radians(value):.6g} rad"
    largest = max(abs(lower), abs(upper))
    if unit == "m" and abs(value) > 10.0 * largest and lower <= value / _THOUSAND <= upper:
        return f"It looks like mm: {value:.6g} mm are {value / _THOUSAND:.6g} m"
    return None


def path_hint(task_map: TaskMap, targets: np.ndarray) -> str | None:
    """Say that targets, (K, c), far out of reach look like mm, if they would be about within reach so."""
    robot, axes = task_map.robot, list(task_map.axes)
    base = np.array(robot.model.jointPlacements[1].translation)[axes]
    away = float(np.linalg.norm(targets[:, : len(axes)] - base, axis=1).max())
    far = reach(robot)
    if not (away > 10.0 * far and away / _THOUSAND < 2.0 * far):
        return None
    return f"The path looks like mm: it is {away:.4g} m away from a robot that reaches about {far:.3g} m"


def place_hint(task_map: TaskMap, place: np.ndarray, target: np.ndarray) -> str | None:
    """Say that a target, (c,), looks like mm where the tool's place, (c,), is about there in m."""
    axes = len(task_map.axes)
    away = np.abs(place[:axes] - target[:axes] / _THOUSAND).max(initial=0.0)
    near = away <= _ROUNDED and np.abs(place[:axes] - target[:axes]).max(initial=0.0) > _ROUNDED
    return "The path looks like mm: divided by 1000 it is where the tool is" if near else None
