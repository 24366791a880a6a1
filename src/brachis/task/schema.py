"""The JSON Schema of the task file, for editors."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

from brachis.task.fields import Model, describe_fields
from brachis.task.limit_models import LimitSpec
from brachis.task.models import Task


def json_schema() -> dict[str, Any]:
    """Return the JSON Schema of a task file.

    An editor with the YAML language server uses the schema to complete and check keys, if the task file begins with
    ``# yaml-language-server: $schema=task.schema.json``. Conditions that involve several keys, such as no blend on the
    last segment, are checked only by `brachis.task.load_task`.
    """
    schema = Task.model_json_schema(mode="validation")
    known: list[type] = [LimitSpec, *_subclasses(Model)]
    models = {model.__name__: model for model in known}
    schemas: dict[str, Any] = {"Task": schema, **schema["$defs"]}
    for name in models.keys() & schemas.keys():
        for key, description in describe_fields(models[name]).items():
            schemas[name]["properties"][key].setdefault("description", description)
    return {
        "$schema": "https://json-schema.org/draft/2020-12/schema",
        "$id": "urn:brachis:task:1",
        **schema,
        "required": [
            key for key in schema["required"] if key != "start"
        ],  # a joint path may begin without it
        "title": "brachis task",
    }


def _subclasses(model: type[Model]) -> Iterator[type[Model]]:
    for subclass in model.__subclasses__():
        yield subclass
        yield from _subclasses(subclass)
