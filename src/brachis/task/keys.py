"""Dotted keys of a task: ``spline.intervals``, ``path.0.line.by`` or, as messages write it, ``path[0].line.by``."""

from __future__ import annotations

import re
from collections.abc import Mapping, MutableMapping
from typing import Any

from brachis.errors import TaskError
from brachis.task.messages import show
from brachis.task.yaml_reader import read_yaml

_INDEX = re.compile(r"\[(\d+)\]")


def set_key(content: MutableMapping[str, Any], key: str, value: object) -> None:
    """Set a dotted key of a task, as its file would be written, in place.

    Mappings that are absent or null on the way are made. Whether the key is one of a task is for `load_task` to say,
    which names the keys that are.

    Parameters
    ----------
    content : mutable mapping
        A task, not checked yet.
    key : str
        Names and, in lists, indices from 0, joined by dots.
    value : object
        What the task file would have there.

    Raises
    ------
    TaskError
        The way leads through a value that has no keys, or past the end of a list.

    Examples
    --------
    >>> task = {"path": [{"line": {"by": [1.0, 0.0]}}]}
    >>> set_key(task, "path.0.line.by", [0.0, 1.0])
    >>> set_key(task, "spline.intervals", 40)
    >>> task
    {'path': [{'line': {'by': [0.0, 1.0]}}], 'spline': {'intervals': 40}}
    """
    parts = _INDEX.sub(r".\1", key).split(".")
    if not all(parts):
        raise TaskError("no key", found=repr(key), allowed="names and indices joined by dots, such as path.0.line.by")
    place: Any = content
    for i, part in enumerate(parts[:-1]):
        step = _step(place, part, parts[:i], key)
        if isinstance(place, MutableMapping) and place.get(step) is None:
            place[step] = {}
        place = place[step]
    place[_step(place, parts[-1], parts[:-1], key)] = value


def _step(place: object, part: str, before: list[str], key: str) -> str | int:
    """Return what `place` has to be indexed with: a name in a mapping, a number within a list."""
    if isinstance(place, MutableMapping):
        return part
    where = ".".join(before)
    if not isinstance(place, list):
        hint = f"Set {where} itself"
        raise TaskError(f"{where} has no keys of its own", where=key, found=show(place), hint=hint)
    if not part.isdecimal() or int(part) >= len(place):
        allowed = f"{where}.0" + (f" to {where}.{len(place) - 1}" if len(place) > 1 else "") if place else "none"
        raise TaskError(f"{where} is a list of {len(place)}", where=key, found=f"{where}.{part}", allowed=allowed)
    return int(part)


def read_assignment(text: str) -> tuple[str, object]:
    """Read ``key=value``, the value as YAML.

    Raises
    ------
    TaskError
        There is no ``=``, or the value is no YAML.

    Examples
    --------
    >>> read_assignment("start.joints=[0.1, 0.2, 0.3]")
    ('start.joints', [0.1, 0.2, 0.3])
    """
    key, equals, value = text.partition("=")
    if not equals:
        raise TaskError("a key is set by key=value", found=repr(text), allowed="such as spline.intervals=40")
    return key.strip(), read_yaml(value, f"value of {key.strip()}")


def with_keys(content: Mapping[str, Any], changes: Mapping[str, object]) -> dict[str, Any]:
    """Return a task, not checked yet, with dotted keys set; `content` is left as it is."""
    changed = _copy(content)
    for key, value in changes.items():
        set_key(changed, key, value)
    return changed


def _copy(value: Any) -> Any:  # noqa: ANN401
    """Copy mappings and lists, which are what `set_key` writes into, and nothing else."""
    if isinstance(value, Mapping):
        return {key: _copy(each) for key, each in value.items()}
    return [_copy(each) for each in value] if isinstance(value, list | tuple) else value
