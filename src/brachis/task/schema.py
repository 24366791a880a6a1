"""The JSON Schema of the task file, for editors."""

from __future__ import annotations

from typing import Any

from brachis.task.models import Task


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
        "required": [key for key in schema["required"] if key != "start"],  # a path of joints may begin without it
        "title": "brachis task",
    }
