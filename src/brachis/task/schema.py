"""The JSON Schema of the task file, for editors."""

from __future__ import annotations

import re
from collections.abc import Iterator
from functools import cache
from typing import Any

from brachis.task.models import Task

_UNITS = r"kg m\^2|kg|N m s/rad|N m|N|m/s\^2|m/s|m|rad/s\^[23]|rad/s|rad|s|W|degrees"
_STATED = re.compile(
    rf"(?:^|[,(] ?)((?:{_UNITS})(?: \((?:force, )?[^) ]*\))?)(?=[.,;: )]|$)"
)
"""A unit as descriptions of keys state it: ``Length, m.``; that of prismatic joints follows in brackets."""


def json_schema() -> dict[str, Any]:
    """Return the JSON Schema of a task file.

    An editor with the YAML language server completes and checks keys with it, given a first line
    ``# yaml-language-server: $schema=task.schema.json``. What crosses several keys (yaw only with two position rows, no
    blend on the last segment) is checked by `brachis.task.load_task` alone.
    """
    schema = Task.model_json_schema(mode="validation")
    return {
        "$schema": "https://json-schema.org/draft/2020-12/schema",
        "$id": "urn:brachis:task:1",
        **schema,
        "required": [
            key for key in schema["required"] if key != "start"
        ],  # a path of joints may begin without it
        "title": "brachis task",
    }


def unit_of(key: str) -> str:
    """Return the unit of a dotted key of a task, as its description states it; empty where it states none.

    Examples
    --------
    >>> from brachis.task.schema import unit_of
    >>> unit_of("robot.payload.mass"), unit_of("path.0.line.angle_deg"), unit_of("spline.intervals")
    ('kg', 'deg', '')
    """
    if key.endswith("_deg"):
        return "deg"
    schema = _task_schema()
    found = [schema]
    stated = ""
    for part in key.split("."):
        found = [below for each in found for below in _below(each, part, schema)]
        units = [
            match[1]
            for each in found
            if (match := _STATED.search(each.get("description", "")))
        ]
        stated = (
            units[0]
            if units
            else ""
            if any("description" in each for each in found)
            else stated
        )
    return stated


@cache
def _task_schema() -> dict[str, Any]:
    return json_schema()


def _below(
    schema: dict[str, Any], part: str, whole: dict[str, Any]
) -> Iterator[dict[str, Any]]:
    """Yield what the schema says of a key, or of an entry of a list; every alternative of it."""
    if "$ref" in schema:
        yield from _below(whole["$defs"][schema["$ref"].rsplit("/", 1)[1]], part, whole)
    for each in (*schema.get("anyOf", ()), *schema.get("oneOf", ())):
        yield from _below(each, part, whole)
    if part in schema.get("properties", {}):
        yield schema["properties"][part]
    for inner in (schema.get("items"), schema.get("additionalProperties")):
        if isinstance(inner, dict):
            yield inner
