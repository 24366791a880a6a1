"""Checks for implausible figures in a task: a number may be in another unit.

`USUAL` lists the largest usual figures of tasks and of robots.
"""

from __future__ import annotations

import math
import re
from collections.abc import Iterable, Iterator, Mapping

from brachis.robot.joints import TURN
from brachis.robot.plausibility import Issue, issue_above
from brachis.task import SpeedTable, Task, ToolLimits

_OR_NULL = ", or null for no limit"
_OF_SIZE = " for an arm of this size"
_OF_MASS = " for this mass"
USUAL = {
    # Delta robots move at 10 m/s and accelerate at 15 g.
    "tool_limits.speed": ("the limit looks like mm/s", 50.0, "m/s", _OR_NULL),
    "tool_limits.process_speed": ("the speed looks like mm/s", 50.0, "m/s", ""),
    "tool_limits.acceleration": (
        "the limit looks like mm/s^2",
        300.0,
        "m/s^2",
        _OR_NULL,
    ),
    "tool_limits.angular_speed": (
        "the limit looks like degrees per second",
        60.0,
        "rad/s",
        _OR_NULL,
    ),
    "path_start": ("the angle looks like degrees", TURN, "rad", ""),
    "path": ("the turn of the angle looks like degrees", 2.0 * TURN, "rad", ""),
    "path.dwell": ("the time looks like ms", 100.0, "s", ""),
    "approach": ("the length looks like mm", 2.0, "m", ""),
    "link": ("the distance from the previous joint looks like mm", 20.0, "m", ""),
    # This figure is multiplied by the arm's length.
    "robot.tool_offset.xyz": ("the distance looks like mm", 2.0, "m", _OF_SIZE),
    "robot.mounting.xyz": ("the distance looks like mm", 200.0, "m", ""),
    "scene": ("the length looks like mm", 30.0, "m", ""),
    "collisions": ("the length looks like mm", 0.5, "m", ""),
    "robot.gravity": ("the acceleration looks like mm/s^2", 100.0, "m/s^2", ""),
    # The strongest arms with a reach of 1 m carry 130 kg; the payload grows with the square of the reach.
    "robot.payload.mass": ("the mass looks like g", 150.0, "kg", _OF_SIZE),
    # This figure is multiplied by the arm's length.
    "robot.payload.com": (
        "the distance from the tool frame looks like mm",
        1.0,
        "m",
        _OF_SIZE,
    ),
    # This figure is multiplied by the mass and by the square of the arm's length.
    "robot.payload.inertia": (
        "the inertia looks like kg mm^2",
        1.0,
        "kg m^2",
        _OF_MASS,
    ),
    # In the heaviest arms, one body weighs 150 kg times the square of the reach in metres.
    "body mass": ("the mass looks like g", 1e3, "kg", _OF_SIZE),
    # This figure is multiplied by the mass; it is that of bodies 10 m wide.
    "body inertia": ("the inertia looks like kg mm^2", 100.0, "kg m^2", _OF_MASS),
    # This is the moment of inertia of 1 g at 10 cm; smaller moments hardly change the torques.
    "massless inertia": (
        "moments of inertia without mass are left out",
        1e-5,
        "kg m^2",
        ", or a mass > 0 kg",
    ),
}
"""For each key of the task or part of the robot: the warning about a larger figure, the largest usual figure, its unit,
and a remark on it. Some of the largest figures are relative to the size or the mass of the robot.
"""


def check_figure(
    key: str, value: float, scale: float = 1.0, where: str = ""
) -> Iterator[Issue]:
    """Compare a value with `scale` times the largest usual value."""
    message, largest, unit, aside = USUAL[key]
    advice = f"{value:.6g} mm are {value / 1000.0:.6g} m" if unit == "m" else ""
    largest *= scale
    return issue_above(
        where or key, message, value, largest, unit, aside, advice=advice
    )


def of_task(task: Task) -> tuple[Issue, ...]:
    """Check a task's tool limits, bodies and angles, its parts, and the points that its path was fitted to."""
    return (*_parts(task), *_ends(task), *_bodies(task), *_angles(task), *_fits(task))


def _fits(task: Task) -> Iterator[Issue]:
    """Check the points that the path was fitted to, and the permitted distance of the path from them."""
    for fit in task.fits:
        where = f"path: {fit.source}"
        if fit.doubt:
            usual = "a path within the robot's reach"
            yield Issue(where, fit.doubt, f"{fit.length:.4g} m", usual)
        tolerance = fit.position_tolerance
        # Even the coarsest scans scatter by only a few mm.
        yield from issue_above(
            f"{where}: tolerance.position",
            "the tolerance looks like mm",
            tolerance,
            5e-3,
            "m",
            advice=f"{tolerance:.6g} m are {1e3 * tolerance:.6g} mm; write '{tolerance:.6g} mm' for mm",
        )


def _bodies(task: Task) -> Iterator[Issue]:
    """Compare the sizes and positions of a scene's bodies, and the clearances around them, with a large robot cell."""
    for body in task.scene:
        largest = max(body.size, *map(abs, body.position))
        yield from check_figure("scene", largest, where=f"scene: {body.name}")
    settings = task.collisions
    yield from check_figure(
        "collisions", settings.clearance, where="collisions.clearance"
    )
    for link, padding in settings.padding.items():
        yield from check_figure(
            "collisions", padding, where=f"collisions.padding.{link}"
        )


def _parts(task: Task) -> Iterator[Issue]:
    """Check the tool limits, lengths and times of a task, and of the parts of its program."""
    parts = {f"program[{i}].": part for i, part in enumerate(task.program)}
    for key, part in {"": task, **parts}.items():
        limits = getattr(part, "tool_limits", None)
        if limits is not None:
            yield from _tool_limits(limits, key)
        figures = [
            ("path.dwell", f"path[{i}].dwell", segment.dwell)
            for i, segment in enumerate(getattr(part, "path", ()))
        ]
        for name in ("approach", "retract", "dwell"):
            usual = "path.dwell" if name == "dwell" else "approach"
            figures.append((usual, name, getattr(part, name, 0.0)))
        for usual, name, value in figures:
            yield from check_figure(usual, value, where=f"{key}{name}")


def _tool_limits(limits: ToolLimits, key: str) -> Iterator[Issue]:
    """Check the highest tool limit of each kind; feed rates are left out, as they have their own units."""
    speed = limits.speed
    values = {
        "speed": speed.speed if isinstance(speed, SpeedTable) else [speed],
        "process_speed": [section.speed for section in limits.process_speed],
        "acceleration": [limits.acceleration],
        "angular_speed": [limits.angular_speed],
    }
    for kind, figures in values.items():
        name = f"tool_limits.{kind}"
        yield from check_figure(name, _largest(figures), where=f"{key}{name}")


def _ends(task: Task) -> Iterator[Issue]:
    """Check the speeds at both ends of the path."""
    meant = "degrees per second" if task.task_space == "joints" else "mm/s"
    message = f"the speed looks like {meant}"
    for name, speed in zip(("start", "end"), task.boundary.given_speeds, strict=True):
        key = f"boundary.{name}_speed"
        value = _largest([speed])
        yield from issue_above(key, message, value, 50.0, task.speed_unit)


def _largest(values: Iterable[float | None]) -> float:
    """Return the largest value below 1e5; larger values stand for "no limit"."""
    return max(
        (value for value in values if value is not None and value < 1e5), default=0.0
    )


def _angles(task: Task) -> Iterator[Issue]:
    """Find angles that are in rad but should be in degrees: multiples of an eighth of a turn, up to two turns.

    An angle has to agree with such a multiple to two decimals: 3.14 is half a turn, but 5.5 is not seven eighths of a
    turn.
    """
    splines = {"__all__": {"bspline", "spline"}}
    content = task.model_dump(
        include={
            "path_start": True,
            "path": True,
            "program": True,
            "frames": True,
            "scene": True,
            "robot": {"mounting", "tool_offset"},
        },
        exclude={"path": splines, "program": {"__all__": {"path": splines}}},
    )
    for key, degrees in _in_degrees("", content):
        eighths = round(degrees / (0.125 * TURN))
        if 1 <= abs(eighths) <= 16 and abs(degrees - 0.125 * TURN * eighths) < 2e-3:
            usual = f"{math.degrees(degrees):.4g} deg for that angle"
            yield Issue(key, "the angle looks like rad", f"{degrees:.6g} deg", usual)


def _in_degrees(key: str, content: object) -> Iterator[tuple[str, float]]:
    """Yield all numbers under keys that end in ``_deg``, with their dotted keys."""
    if isinstance(content, Mapping):
        for name, value in content.items():
            yield from _in_degrees(f"{key}.{name}" if key else name, value)
    elif isinstance(content, list | tuple):
        for number, value in enumerate(content):
            yield from _in_degrees(f"{key}[{number}]", value)
    elif isinstance(content, float) and re.search(r"_deg(\[\d\])?$", key):
        yield key, content
