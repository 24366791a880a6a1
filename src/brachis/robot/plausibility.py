"""Implausible figures, such as degrees in place of rad or mm in place of m, reported as warnings or errors."""

from __future__ import annotations

import itertools
import math
import re
import warnings
from collections.abc import Iterator, Sequence
from dataclasses import asdict, dataclass, replace

import numpy as np
import pinocchio as pin

from brachis.errors import BrachisWarning, PlausibilityError
from brachis.robot import Robot
from brachis.robot.joints import TURN
from brachis.robot.task_map.protocol import AXES
from brachis.robot.urdf_elements import read_tree


class PlausibilityWarning(BrachisWarning):
    """A figure of the robot, the task or the motion is implausible.

    Examples
    --------
    >>> import brachis
    >>> import warnings
    >>> with warnings.catch_warnings(record=True) as caught:
    ...     warnings.simplefilter("always")
    ...     fast = {"velocity": 180.0}  # degrees per second
    ...     result = brachis.plan(brachis.examples.scara_line, limits=fast, redundant_joints=["j1"], intervals=8)
    >>> caught[0].category.__name__
    'PlausibilityWarning'
    """


@dataclass(frozen=True)
class Issue:
    """A figure that is allowed but implausible.

    Attributes
    ----------
    where : str
        Key of the task, or joint or link of the robot.
    message : str
        What the figure looks like.
    found : str
        The figure, with its unit.
    usual : str
        The usual range of such figures.
    advice : str
        What to write instead; empty if there is no advice.
    """

    where: str
    message: str
    found: str
    usual: str
    advice: str = ""

    def __str__(self) -> str:
        """Write the issue on one line."""
        text = f"{self.where}: {self.message}; found {self.found}; usual: {self.usual}"
        return f"{text}; {self.advice}" if self.advice else text

    def to_dict(self) -> dict[str, str]:
        """Return plain data for JSON."""
        return asdict(self)


def _join(stem: str, group: list[Issue]) -> Issue:
    """Join several issues that have the same message and belong to one key."""
    if len(group) == 1:
        return group[0]
    figures = ", ".join(
        f"{issue.where.removeprefix(f'{stem}.')} {issue.found}" for issue in group
    )
    usual = "; ".join(dict.fromkeys(issue.usual for issue in group))
    return replace(group[0], where=stem or "robot", found=figures, usual=usual)


def report_issues(
    issues: tuple[Issue, ...], *, strict: bool | None
) -> tuple[Issue, ...]:
    """Warn of issues, or refuse some or all of them. Return them; joints with the same message share one issue.

    Warnings refer to the caller of the function that calls this one. Otherwise see `refuse_issues`.
    """
    joined = refuse_issues(issues, strict=strict)
    for issue in joined:
        warnings.warn(str(issue), PlausibilityWarning, stacklevel=3)
    return joined


def refuse_issues(
    issues: tuple[Issue, ...], *, strict: bool | None
) -> tuple[Issue, ...]:
    """Refuse some or all issues. Return them; joints with the same message share one issue.

    Parameters
    ----------
    issues : tuple of Issue
    strict : bool or None
        Whether issues are errors. If None, only issues of postures are errors.

    Raises
    ------
    PlausibilityError
    """
    groups: dict[tuple[str, str], list[Issue]] = {}
    for issue in dict.fromkeys(issues):  # a posture may be both the start and the end
        stem = issue.where.rpartition(".")[0]
        groups.setdefault((stem, issue.message), []).append(issue)
    joined = tuple(_join(stem, group) for (stem, _), group in groups.items())
    refused = [
        str(issue)
        for issue in joined
        if strict
        or (strict is None and re.search(r"\.joints\b|^postures\.", issue.where))
    ]
    if refused:
        raise PlausibilityError(refused)
    return joined


def issue_above(
    where: str,
    message: str,
    value: float,
    usual: float,
    unit: str,
    aside: str = "",
    shown: str = "",
    advice: str = "",
) -> Iterator[Issue]:
    """Yield an issue if a figure is larger than usual.

    Parameters
    ----------
    where, message, advice : str
        See `Issue`.
    value, usual : float
        The figure and the largest usual figure, in `unit`. NaN causes no issue.
    unit : str
    aside : str, optional
        Text after the usual figure, such as the robot or limit that it is for.
    shown : str, optional
        Text for the figure, if it is not a single number.
    """
    if value > usual:
        figure = f"{shown or f'{value:.6g}'} {unit}"
        allowed = f"below {usual:.3g} {unit}{aside}"
        yield Issue(where, message, figure, allowed, advice)


def angle_issue(
    where: str, value: float, usual: float, more_advice: str = ""
) -> Iterator[Issue]:
    """Return an issue if the position of a revolute joint, rad, looks like degrees."""
    shown = f"{value:.6g}"
    advice = f"{shown} degrees are {math.radians(value):.6g} rad{more_advice}"
    message = "the position looks like degrees"
    return issue_above(
        where, message, abs(value), usual, "rad", shown=shown, advice=advice
    )


def find_locked_in_degrees(robot: Robot) -> Iterator[Issue]:
    """Check the angles at which joints are locked."""
    locked = robot.settings.locked_joints
    joints = read_tree(robot.urdf, robot.source).joints if locked else {}
    for name, value in locked.items():
        kind = joints[name].get("type")
        if kind != "prismatic":
            turns = 5.0 if kind == "continuous" else 2.0
            yield from angle_issue(
                f"robot.locked_joints.{name}", value, turns * TURN + 1e-3
            )


def link_lengths(robot: Robot) -> list[float]:
    """Return the distances from joint to joint, and from the last joint to the tool frame, m."""
    placements = [
        *list(robot.model.jointPlacements)[2:],
        robot.model.frames[robot.frame_id].placement,
    ]
    return [float(np.linalg.norm(placement.translation)) for placement in placements]


def reach(robot: Robot) -> float:
    """Return an upper bound on the distance of the tool frame from the first joint, m, within the slides' ranges."""
    farthest = np.abs(robot.limits.both_ways("position")).max(axis=0)
    slides = [
        max(farthest[i], abs(urdf.lower or 0.0), abs(urdf.upper or 0.0))
        for i, urdf in enumerate(robot.urdf_limits)
        if robot.position_units[i] == "m"
    ]
    return sum(link_lengths(robot)) + sum(slides)


def distances_from_base(
    robot: Robot, axes: Sequence[int], positions: np.ndarray
) -> np.ndarray:
    """Return the distances, (...), m, of positions, (..., p), from the first joint, along p axes of the world."""
    base = np.array(robot.model.jointPlacements[1].translation)[list(axes)]
    return np.linalg.norm(positions - base, axis=-1)


_ROUNDED = 1e-3
"""Tolerance for positions, m, and entries of rotation matrices; positions are often given to the millimetre."""


def position_hint(value: float, lower: float, upper: float, unit: str) -> str | None:
    """Return a hint if a position outside its range, rad or m, would be inside it in degrees or mm."""
    angle = math.radians(value)
    if unit == "rad" and abs(value) > 2.0 * math.pi and lower <= angle <= upper:
        return f"It looks like degrees: {value:.6g} deg are {angle:.6g} rad"
    length = value / 1000.0
    largest = max(abs(lower), abs(upper))
    if unit == "m" and abs(value) > 10.0 * largest and lower <= length <= upper:
        return f"It looks like mm: {value:.6g} mm are {length:.6g} m"
    return None


def distance_hint(away: float, far: float) -> str | None:
    """Return a hint if a path at a distance `away` from the first joint, m, may be in mm, given the reach `far`, m."""
    # A path in mm is hundreds of times too far away, not only slightly out of reach.
    if 0.05 * far < away / 1000.0 < 3.0 * far:
        return (
            f"The path looks like mm: divided by 1000 it is {away / 1000.0:.3g} m away"
        )
    return None


def place_hint(here: np.ndarray, stated: np.ndarray, rows: Sequence[str]) -> str | None:
    """Return a hint if a stated position, (p,), that is not the tool's, may be in mm or have swapped rows."""
    if not np.abs(here - stated).max(initial=0.0) > _ROUNDED:
        return None
    is_at_origin = np.abs(here).max() <= _ROUNDED
    if not is_at_origin and np.abs(here - stated / 1000.0).max() <= _ROUNDED:
        return "The path looks like mm: divided by 1000 it is where the tool is"
    if len(here) > len(AXES):
        return None
    for order in itertools.permutations(range(len(here))):
        if np.abs(here[list(order)] - stated).max() <= _ROUNDED:
            names = ", ".join(rows[i] for i in order)
            return f"The numbers may be in the order {names}: read in this order, they are where the tool is"
    return None


def turn_hint(here: np.ndarray, stated: np.ndarray) -> str | None:
    """Return a hint if an orientation, (3, 3), read as a quaternion with w last would be the orientation `here`."""
    read = pin.Quaternion(stated)
    meant = pin.Quaternion(read.z, read.w, read.x, read.y).matrix()
    near = np.abs(meant - here).max() <= _ROUNDED < np.abs(stated - here).max()
    return "If it is a quaternion x, y, z, w: write quaternion_xyzw" if near else None
