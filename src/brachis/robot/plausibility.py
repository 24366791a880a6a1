"""Figures that are hardly meant, as warnings or errors.

A figure beside what such figures usually are.

How large a robot is.

Hints for errors that come of degrees for rad, mm for m, or another order; and what no robot of its size reaches.
"""

from __future__ import annotations

import itertools
import math
import warnings
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import asdict, dataclass

import numpy as np
import pinocchio as pin

from brachis.errors import BrachisWarning, PlausibilityError
from brachis.robot import Robot
from brachis.robot.task_map.protocol import AXES


class PlausibilityWarning(BrachisWarning):
    """A figure of the robot, the task or the motion is hardly meant.

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
class Remark:
    """A figure that is allowed and hardly meant.

    Attributes
    ----------
    where : str
        Task key, or joint or link of the robot.
    message : str
        What it looks like.
    found : str
        The figure with its unit.
    usual : str
        What such figures usually are.
    """

    where: str
    message: str
    found: str
    usual: str

    def __str__(self) -> str:
        """Say it in one line."""
        return f"{self.where}: {self.message}; found {self.found}; usual: {self.usual}"

    def to_dict(self) -> dict[str, str]:
        """Return plain data for JSON."""
        return asdict(self)


def _together(remarks: tuple[Remark, ...]) -> tuple[Remark, ...]:
    """Make one remark of those that say the same of several joints."""
    groups: dict[tuple[str, str], list[Remark]] = {}
    for remark in remarks:
        groups.setdefault((remark.where.rpartition(".")[0], remark.message), []).append(
            remark
        )
    return tuple(
        group[0] if len(group) == 1 else _of_all(stem, group)
        for (stem, _), group in groups.items()
    )


def _of_all(stem: str, group: list[Remark]) -> Remark:
    """Make one remark of several below a key."""
    found = ", ".join(
        f"{remark.where.removeprefix(f'{stem}.')} {remark.found}" for remark in group
    )
    return Remark(
        stem,
        group[0].message,
        found,
        "; ".join(dict.fromkeys(remark.usual for remark in group)),
    )


def tell(
    remarks: tuple[Remark, ...], *, strict: bool | None, stacklevel: int = 2
) -> tuple[Remark, ...]:
    """Warn of remarks, or refuse some or all of them; return them, one for all joints of which they say the same.

    Parameters
    ----------
    remarks : tuple of Remark
    strict : bool or None
        Whether they are errors; None: those of the start posture are.
    stacklevel : int, optional
        As of `warnings.warn`; 2 blames the caller.

    Raises
    ------
    PlausibilityError
    """
    remarks = _together(remarks)
    refused = [
        str(each)
        for each in remarks
        if strict or (strict is None and each.where.startswith("start.joints"))
    ]
    if refused:
        raise PlausibilityError(refused)
    for remark in remarks:
        warnings.warn(str(remark), PlausibilityWarning, stacklevel=stacklevel)
    return remarks


@dataclass(frozen=True)
class Figure:
    """A figure, and the largest one that is usual.

    Attributes
    ----------
    where : str
        Task key, or joint or link of the robot.
    message : str
        What it looks like where it is larger.
    value, usual : float
        In `unit`; a NaN is never remarked upon.
    unit : str
    aside : str
        What is said behind what is usual: for what, or what else to write.
    shown : str
        The figure in words, where it is more than one number.
    """

    where: str
    message: str
    value: float
    usual: float
    unit: str
    aside: str = ""
    shown: str = ""


def remarks(figures: Iterable[Figure]) -> Iterator[Remark]:
    """Remark upon the figures that are larger than usual."""
    for figure in figures:
        if figure.value > figure.usual:
            found = figure.shown or f"{figure.value:.6g}"
            usual = f"below {figure.usual:.3g} {figure.unit}{figure.aside}"
            yield Remark(figure.where, figure.message, f"{found} {figure.unit}", usual)


def link_lengths(robot: Robot) -> list[float]:
    """Distances from joint to joint, and from the last joint to the tool frame, m."""
    placements = [
        *list(robot.model.jointPlacements)[2:],
        robot.model.frames[robot.frame_id].placement,
    ]
    return [float(np.linalg.norm(placement.translation)) for placement in placements]


def reach(robot: Robot) -> float:
    """How far the tool frame can be from the first joint at most, m, in the ranges of slides that the URDF states."""
    slides = [
        max(
            abs(end)
            for end in (lower, upper, stated.lower, stated.upper)
            if end is not None
        )
        for lower, upper, stated, unit in zip(
            robot.limits.position_lower,
            robot.limits.position_upper,
            robot.stated_limits,
            robot.position_units,
            strict=True,
        )
        if unit == "m"
    ]
    return sum(link_lengths(robot)) + sum(slides)


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
        return (
            f"It looks like degrees: {value:.6g} deg are {math.radians(value):.6g} rad"
        )
    largest = max(abs(lower), abs(upper))
    if (
        unit == "m"
        and abs(value) > 10.0 * largest
        and lower <= value / _THOUSAND <= upper
    ):
        return f"It looks like mm: {value:.6g} mm are {value / _THOUSAND:.6g} m"
    return None


def place_hint(here: np.ndarray, stated: np.ndarray, rows: Sequence[str]) -> str | None:
    """Say what a stated position, (p,), looks like where the tool is elsewhere: mm, or rows that are swapped."""
    if not np.abs(here - stated).max(initial=0.0) > _ROUNDED:
        return None
    if np.abs(here - stated / _THOUSAND).max() <= _ROUNDED:
        return "The path looks like mm: divided by 1000 it is where the tool is"
    for order in (
        itertools.permutations(range(len(here))) if len(here) <= len(AXES) else ()
    ):
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
