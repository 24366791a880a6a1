"""Figures that are allowed and hardly meant: degrees for rad, mm for m, g for kg. Warnings, and hints for errors."""

from __future__ import annotations

import math
import warnings
from collections.abc import Iterator, Sequence
from dataclasses import asdict, dataclass

import numpy as np

from brachis.errors import PlausibilityError
from brachis.robot import Robot, TaskMap
from brachis.robot.task_map.rows import YAW
from brachis.task import Task

_TURN = 2.0 * math.pi
_FASTEST = {"rad": 60.0, "m": 50.0}
"""The quickest axes of small SCARA and delta robots turn at 50 rad/s; rails move at 10 m/s. In degrees and mm: more."""
_WIDEST = {"rad": 120.0, "m": 50.0}
"""Joints with cables make two turns either way, others may be given a dozen turns; in degrees, few ranges are narrower
than 120. Few rails are longer than 30 m."""
_OPEN_END = {"rad": 800.0, "m": 1e5}
"""A range end beyond this is written for "no limit": in degrees, ranges end at two turns, 720."""
_FAR_POSTURE = 2.0 * _TURN
_LARGEST_SCALE = 10.0
_LONGEST_LINK = 20.0
_HEAVIEST = 1e3
"""A moving body of the heaviest arms weighs 150 kg for each square metre of their reach."""
_WIDEST_BODY = 10.0
_THOUSAND = 1000.0
_ROUNDED = 1e-3
"""Places are given to the millimetre."""


class PlausibilityWarning(UserWarning):
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


def tell(remarks: tuple[Remark, ...], *, strict: bool, stacklevel: int = 2) -> tuple[Remark, ...]:
    """Warn of every remark, or refuse them all; return them.

    Parameters
    ----------
    remarks : tuple of Remark
    strict : bool
        Whether they are errors.
    stacklevel : int, optional
        As of `warnings.warn`; 2 blames the caller.

    Raises
    ------
    PlausibilityError
    """
    if strict and remarks:
        raise PlausibilityError([str(remark) for remark in remarks])
    for remark in remarks:
        warnings.warn(str(remark), PlausibilityWarning, stacklevel=stacklevel)
    return remarks


def of_robot(robot: Robot) -> tuple[Remark, ...]:
    """Look at limits, friction, lengths and masses of a robot."""
    return (*_limits(robot), *_scales(robot), *_friction(robot), *_lengths(robot), *_masses(robot))


def of_places(
    task_map: TaskMap,
    start: np.ndarray | None,
    end: np.ndarray | None,
    path_start: Sequence[float] | None,
) -> tuple[Remark, ...]:
    """Look at what a task says about where the robot is.

    Parameters
    ----------
    task_map : TaskMap
    start, end : (n,) ndarray or None
        Postures, None where free.
    path_start : sequence of float or None
        As in the task.
    """
    remarks, robot = [], task_map.robot
    for key, posture in (("start.joints", start), ("end.joints", end)):
        given = np.zeros(robot.n) if posture is None else posture
        for name, unit, value in zip(robot.joint_names, robot.position_units, given, strict=True):
            if unit == "rad" and abs(value) > _FAR_POSTURE:
                found = f"{value:.6g} rad"
                remarks.append(Remark(f"{key}.{name}", "the position looks like degrees", found, "within two turns"))
    if path_start is not None and YAW in task_map.rows and abs(path_start[-1]) > _TURN:
        found = f"{path_start[-1]:.6g} rad"
        remarks.append(Remark("path_start", "yaw looks like degrees", found, "within one turn"))
    return tuple(remarks)


def of_points(task: Task) -> tuple[Remark, ...]:
    """Look at the points that a task's path was fitted to."""
    return tuple(
        Remark(f"path: {fit.source}", fit.doubt, f"{fit.length:.4g} m", "a path within the robot's reach")
        for fit in task.fits
        if fit.doubt
    )


def of_end_time(t_end: float, least: float) -> tuple[Remark, ...]:
    """Look at a motion's end time, s, beside the `least` that the planner allows, s."""
    if t_end > 1.01 * least:
        return ()
    message = "the end time is the least that the planner knows, so that no limit holds the motion back"
    return (Remark("t_end", message, f"{t_end:.6g} s", "more; see the units of limits, lengths and masses"),)


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
    reach = _reach(robot)
    if not (away > 10.0 * reach and away / _THOUSAND < 2.0 * reach):
        return None
    return f"The path looks like mm: it is {away:.4g} m away from a robot that reaches about {reach:.3g} m"


def place_hint(task_map: TaskMap, place: np.ndarray, target: np.ndarray) -> str | None:
    """Say that a target, (c,), looks like mm where the tool's place, (c,), is about there in m."""
    axes = len(task_map.axes)
    away = np.abs(place[:axes] - target[:axes] / _THOUSAND).max(initial=0.0)
    near = away <= _ROUNDED and np.abs(place[:axes] - target[:axes]).max(initial=0.0) > _ROUNDED
    return "The path looks like mm: divided by 1000 it is where the tool is" if near else None


def _limits(robot: Robot) -> Iterator[Remark]:
    """Look at velocity limits and position ranges."""
    limits, stated = robot.limits, {"rad": "degrees", "m": "mm"}
    unscaled = limits.velocity / robot.settings.limits.scale.velocity / robot.settings.speed_override
    columns = zip(
        robot.joint_names,
        robot.position_units,
        unscaled,
        limits.position_lower,
        limits.position_upper,
        strict=True,
    )
    for name, unit, velocity, lower, upper in columns:
        # A power of ten is written for "no limit".
        if np.isfinite(velocity) and velocity > _FASTEST[unit] and not round(math.log10(velocity), 9).is_integer():
            message = f"the velocity limit looks like {stated[unit]} per second"
            usual = f"below {_FASTEST[unit]:g} {unit}/s"
            yield Remark(f"robot.limits.velocity.{name}", message, f"{velocity:.6g} {unit}/s", usual)
        if upper - lower > _WIDEST[unit] and max(abs(lower), abs(upper)) <= _OPEN_END[unit]:
            message = f"the position range looks like {stated[unit]}"
            found = f"[{lower:.6g}, {upper:.6g}] {unit}"
            usual = f"less than {_WIDEST[unit]:.3g} {unit} wide, or open (null)"
            yield Remark(f"robot.limits.position.{name}", message, found, usual)


def _scales(robot: Robot) -> Iterator[Remark]:
    for kind, factor in robot.settings.limits.scale.model_dump().items():
        if factor > _LARGEST_SCALE:
            message = "the factor raises limits far beyond what was stated"
            yield Remark(
                f"robot.limits.scale.{kind}", message, f"{factor:g}", "0.1 to 1; a percentage is divided by 100"
            )


def _friction(robot: Robot) -> Iterator[Remark]:
    """Look at damping of the URDF, which is often there to calm a simulation."""
    limits, stated = robot.limits, robot.stated.friction["viscous"]
    for i, damping in enumerate(stated):
        fastest, torque = limits.velocity[i], limits.torque[i]
        slow = np.isfinite([fastest, torque]).all() and fastest <= _FASTEST[robot.position_units[i]]
        if slow and damping == robot.friction.viscous[i] and damping * fastest > torque:
            unit = {"rad": "Nm s/rad", "m": "N s/m"}[robot.position_units[i]]
            message = "the damping of the URDF takes more than the largest torque at the largest speed"
            usual = f"below {torque / fastest:.3g} {unit}; viscous: null leaves it out"
            yield Remark(f"robot.friction.viscous.{robot.joint_names[i]}", message, f"{damping:.6g} {unit}", usual)


def _lengths(robot: Robot) -> Iterator[Remark]:
    for name, length in zip((*robot.joint_names[1:], robot.tool_frame), _link_lengths(robot), strict=True):
        if length > _LONGEST_LINK:
            message = "the distance from the joint before looks like mm"
            yield Remark(f"URDF origin of {name}", message, f"{length:.6g} m", f"less than {_LONGEST_LINK:g} m")


def _masses(robot: Robot) -> Iterator[Remark]:
    heaviest = _HEAVIEST * max(1.0, _reach(robot)) ** 2
    for name, inertia in zip(robot.joint_names, list(robot.model.inertias)[1:], strict=True):
        where = f"URDF inertials that joint {name} moves"
        if inertia.mass > heaviest:
            usual = f"less than {heaviest:.3g} kg for an arm of this size"
            yield Remark(where, "the mass looks like g", f"{inertia.mass:.6g} kg", usual)
        moment = float(np.linalg.eigvalsh(inertia.inertia)[-1])
        if moment > inertia.mass * _WIDEST_BODY**2:
            usual = f"less than {inertia.mass * _WIDEST_BODY**2:.3g} kg m^2 for this mass"
            yield Remark(where, "the inertia looks like kg mm^2", f"{moment:.6g} kg m^2", usual)


def _link_lengths(robot: Robot) -> list[float]:
    """Distances from joint to joint, and from the last joint to the tool frame, m."""
    placements = [*list(robot.model.jointPlacements)[2:], robot.model.frames[robot.frame_id].placement]
    return [float(np.linalg.norm(placement.translation)) for placement in placements]


def _reach(robot: Robot) -> float:
    """How far the tool frame can be from the first joint at most, m."""
    limits = robot.limits
    slides = [
        max(abs(lower), abs(upper))
        for lower, upper, unit in zip(limits.position_lower, limits.position_upper, robot.position_units, strict=True)
        if unit == "m"
    ]
    return sum(_link_lengths(robot)) + sum(slides)
