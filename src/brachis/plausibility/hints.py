"""Hints for errors that come of degrees for rad, mm for m, or another order; and what no robot of its size reaches."""

from __future__ import annotations

import itertools
import math
from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np
import pinocchio as pin

from brachis.errors import PathError, write_apart
from brachis.plausibility.size import reach
from brachis.robot import TaskMap
from brachis.robot.task_map.rows import AXES

if TYPE_CHECKING:
    from brachis.path import Path

_TURN = 2.0 * math.pi
_THOUSAND = 1000.0
_ROUNDED = 1e-3
"""Places are given to the millimetre."""
_HARDLY = 3.0
"""Nobody misses the robot by more than so many times its reach."""
_STATIONS = 401


def position_hint(value: float, lower: float, upper: float, unit: str) -> str | None:
    """Say what a position, rad or m, beyond its range looks like, if it would be within it in degrees or mm."""
    if unit == "rad" and abs(value) > _TURN and lower <= math.radians(value) <= upper:
        return f"It looks like degrees: {value:.6g} deg are {math.radians(value):.6g} rad"
    largest = max(abs(lower), abs(upper))
    if unit == "m" and abs(value) > 10.0 * largest and lower <= value / _THOUSAND <= upper:
        return f"It looks like mm: {value:.6g} mm are {value / _THOUSAND:.6g} m"
    return None


def check_within_reach(task_map: TaskMap, path: Path) -> None:
    """Refuse a path of the tool that is farther away than the arm's links and slides together can reach.

    Raises
    ------
    PathError
    """
    if not task_map.axes:  # of joints
        return
    s = np.linspace(0.0, 1.0, _STATIONS)
    robot, axes = task_map.robot, list(task_map.axes)
    base = np.array(robot.model.jointPlacements[1].translation)[axes]
    away = np.linalg.norm(path.sample(s).target[:, : len(axes)] - base, axis=1)
    far = reach(robot)
    if not away.max() > far * (1.0 + _ROUNDED):
        return
    beyond = s[away > far]
    furthest = float(away.max())
    found, most = write_apart(furthest, far)
    looks = furthest > _HARDLY * far and furthest / _THOUSAND < _HARDLY * far
    raise PathError(
        f"the path is out of reach from s = {beyond[0]:.3g} on",
        s_interval=(float(beyond[0]), float(beyond[-1])),
        found=f"{found} m away from the robot's first joint at s = {s[int(np.argmax(away))]:.3g}",
        allowed=f"at most {most} m, which is all links and slides in one line",
        hint=f"The path looks like mm: divided by 1000 it is {furthest / _THOUSAND:.3g} m away"
        if looks
        else "Shorten or move the path, or the robot's mounting",
    )


def place_hint(here: np.ndarray, stated: np.ndarray, rows: Sequence[str]) -> str | None:
    """Say what a stated position, (p,), looks like where the tool is elsewhere: mm, or rows that are swapped."""
    if not np.abs(here - stated).max(initial=0.0) > _ROUNDED:
        return None
    if np.abs(here - stated / _THOUSAND).max() <= _ROUNDED:
        return "The path looks like mm: divided by 1000 it is where the tool is"
    for order in itertools.permutations(range(len(here))) if len(here) <= len(AXES) else ():
        if np.abs(here[list(order)] - stated).max() <= _ROUNDED:
            found = ", ".join(rows[i] for i in order)
            return f"It looks like the order {found}: the tool is there if they are read so"
    return None


def turn_hint(here: np.ndarray, stated: np.ndarray) -> str | None:
    """Say that an orientation, a rotation matrix (3, 3), looks like a quaternion with w last, where that is `here`."""
    read = pin.Quaternion(stated)
    meant = pin.Quaternion(read.z, read.w, read.x, read.y).matrix()
    near = np.abs(meant - here).max() <= _ROUNDED < np.abs(stated - here).max()
    return "If it is a quaternion x, y, z, w: write quaternion_xyzw" if near else None
