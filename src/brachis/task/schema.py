"""The JSON Schema of the task file, for editors, and the units of its keys, for plots."""

from __future__ import annotations

from collections.abc import Iterator
from itertools import pairwise
from typing import Any

from brachis.task.fields import Model, describe_fields
from brachis.task.limit_models import LimitSpec
from brachis.task.models import Task

_UNITS = {
    "tool_offset.xyz": "m",
    "mounting.xyz": "m",
    "robot.gravity": "m/s^2",
    "robot.locked_joints": "rad (m)",
    "payload.mass": "kg",
    "payload.com": "m",
    "payload.inertia": "kg m^2",
    "limits.torque": "N m (force, N)",
    "limits.velocity": "rad/s (m/s)",
    "limits.acceleration": "rad/s^2 (m/s^2)",
    "limits.position": "rad (m)",
    "limits.power": "W",
    "limits.total_power": "W",
    "limits.rms_torque": "N m (force, N)",
    "limits.jerk": "rad/s^3 (m/s^3)",
    "limits.torque_rate": "N m/s (force, N/s)",
    "friction.armature": "kg m^2 (kg)",
    "friction.rotor_inertia": "kg m^2",
    "friction.viscous": "N m s/rad (N s/m)",
    "friction.coulomb": "N m (N)",
    "friction.coulomb_velocity": "rad/s (m/s)",
    "start.joints": "rad (m)",
    "end.joints": "rad (m)",
    "path_start.position": "m",
    "path.dwell": "s",
    "path_start.rotation_vector": "rad",
    "to.rotation_vector": "rad",
    "line.to": "m",
    "line.by": "m",
    "line.length": "m",
    "arc.center": "m",
    "arc.via": "m",
    "arc.to": "m",
    "circle.center": "m",
    "helix.center": "m",
    "helix.pitch": "m",
    "spline.through": "m",
    "bspline.control_points": "m",
    "boundary.start_speed": "m/s",
    "boundary.end_speed": "m/s",
    "tool_limits.speed": "m/s",
    "speed.s": "",
    "tool_limits.acceleration": "m/s^2",
    "tool_limits.angular_speed": "rad/s",
    "process_speed.speed": "m/s",
    "search.time_limit": "s",
    "solver.time_limit": "s",
}
"""Units by the last two names of a key; in brackets that of prismatic joints."""


def json_schema() -> dict[str, Any]:
    """Return the JSON Schema of a task file.

    An editor with the YAML language server completes and checks keys with it, given a first line
    ``# yaml-language-server: $schema=task.schema.json``. What crosses several keys (yaw only with two position rows, no
    blend on the last segment) is checked by `brachis.task.load_task` alone.
    """
    schema = Task.model_json_schema(mode="validation")
    known: list[type] = [LimitSpec, *_subclasses(Model)]
    models = {model.__name__: model for model in known}
    parts: dict[str, Any] = {"Task": schema, **schema["$defs"]}
    for name in models.keys() & parts.keys():
        for key, description in describe_fields(models[name]).items():
            parts[name]["properties"][key].setdefault("description", description)
    return {
        "$schema": "https://json-schema.org/draft/2020-12/schema",
        "$id": "urn:brachis:task:1",
        **schema,
        "required": [
            key for key in schema["required"] if key != "start"
        ],  # a path of joints may begin without it
        "title": "brachis task",
    }


def _subclasses(model: type[Model]) -> Iterator[type[Model]]:
    for own in model.__subclasses__():
        yield own
        yield from _subclasses(own)


def unit_of(key: str) -> str:
    """Return the unit of a dotted key of a task, or of a joint's or row's entry in it; empty where it has none.

    Examples
    --------
    >>> from brachis.task.schema import unit_of
    >>> unit_of("robot.payload.mass"), unit_of("path.0.line.angle_deg"), unit_of("spline.intervals")
    ('kg', 'deg', '')
    """
    if key.endswith("_deg"):
        return "deg"
    names = [part for part in key.split(".") if not part.isdecimal()]
    units = (_UNITS.get(".".join(pair)) for pair in reversed([*pairwise(names)]))
    return next((unit for unit in units if unit is not None), "")
