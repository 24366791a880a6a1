"""Pydantic's validation errors in plain words: the key, the wrong value, the allowed values, and a hint."""

from __future__ import annotations

import re
from collections.abc import Callable, Iterator, Mapping
from dataclasses import is_dataclass
from itertools import groupby
from typing import Final, TypeVar, get_args, get_type_hints

from pydantic import ValidationError
from pydantic_core import ErrorDetails

from brachis.errors import TaskError, suggest
from brachis.task.fields import (
    REFUSED,
    WRONG_FORM,
    WRONG_KEYS,
    Model,
    describe_fields,
    plain,
    required_keys,
)
from brachis.task.units import unit_of

_M = TypeVar("_M", bound=Model)
_MOST_MISTAKES = 20
"""Maximum number of mistakes in a message, so that it fits on a screen. An array of strings could give thousands."""
_Location = tuple[str | int, ...]
"""Location of a value as given by pydantic: keys, indices and tags of unions."""


def validate(model: type[_M], content: object, source: str) -> _M:
    """Return a model made from its content, in which arrays are accepted as lists.

    Parameters
    ----------
    model : type
    content : object
        Content in the form of a task file, or a model.
    source : str
        File name or other origin of the content, for messages.

    Raises
    ------
    TaskError
        The content does not fit the model.
    """
    try:
        return model.model_validate(plain(content))
    except ValidationError as error:
        raise task_error(error, source, model) from None


def task_error(error: ValidationError, source: str, model: type[Model]) -> TaskError:
    """Return the `TaskError` that states a validation error in plain words.

    Parameters
    ----------
    error : ValidationError
        The error of pydantic.
    source : str
        File name or other origin of the task.
    model : type
        The validated model, whose fields are the allowed keys.
    """
    details = [
        detail for detail in error.errors(include_url=False) if not _is_echo(detail)
    ]
    # The same mistake in several items of a list is reported once.
    mistakes = [
        [*places]
        for _, places in groupby(
            details, lambda detail: [repr(detail["input"]), *_names_in(detail["loc"])]
        )
    ]
    errors = [_one(places, source, model) for places in mistakes[:_MOST_MISTAKES]]
    if len(mistakes) == 1:
        return errors[0]
    lines = "".join(f"\n  {mistake}" for mistake in errors)
    if len(mistakes) > len(errors):
        lines += f"\n  and {len(mistakes) - len(errors)} more"
    return TaskError(f"{len(mistakes)} mistakes{lines}", where=source)


def show(value: object) -> str:
    """Return a value as written in a task file, shortened, with its type if the type may be the mistake."""
    if isinstance(value, Model):
        value = value.model_dump(exclude_unset=True)
    if value is None:
        return "null"
    if isinstance(value, bool):
        return f"{str(value).lower()} (a boolean)"
    if isinstance(value, str):
        return f"{_shorten(repr(value))} (a string)"
    if isinstance(value, Mapping):
        keys = _shorten(", ".join(map(str, value)))
        return f"a mapping with the keys {keys}" if keys else "an empty mapping"
    if isinstance(value, list | tuple):
        items = [
            item.model_dump(mode="json", exclude_unset=True)
            if isinstance(item, Model)
            else item
            for item in value
        ]
        # As in YAML, keys have no quotes.
        text = re.sub(r"'(\w+)':", r"\1:", repr(items))
        return f"{_shorten(text)} (a list)"
    text = repr(value)
    return type(value).__name__ if "\n" in text else _shorten(text)


def _shorten(text: str) -> str:
    return text if len(text) <= 60 else f"{text[:57]}..."


def _one(places: list[ErrorDetails], source: str, model: type[Model]) -> TaskError:
    """Return the error for one mistake; it names only the first place with this mistake."""
    detail, *others = places
    problem, *facts = _DESCRIPTIONS.get(detail["type"], _describe)(detail, model)
    key = _write_location(detail["loc"], detail.get("ctx", {}).get("key", ""))
    if detail["type"] != REFUSED and key in _ALLOWED_AT:
        facts = [facts[0], _ALLOWED_AT[key]]
    if others:
        key += f" and {len(others)} more"
    return TaskError(
        problem,
        where=": ".join(filter(None, (source, key))),
        **dict(zip(("found", "allowed", "hint"), facts, strict=False)),
    )


def _is_tag(step: str | int) -> bool:
    return str(step).startswith("<")


def _names_in(location: _Location) -> list[str]:
    """Return the keys of a location, without indices and tags."""
    return [step for step in location if isinstance(step, str) and not _is_tag(step)]


def _write_location(location: _Location, key: str) -> str:
    """Return, without tags, a location and a key below it in the form ``path[0].line.to``."""
    keys = [
        f"[{step}]" if isinstance(step, int) else step
        for step in location
        if not _is_tag(step) and step != "[key]"
    ]
    return ".".join(filter(None, [*keys, key])).replace(".[", "[")


def models_in(annotation: object) -> Iterator[type]:
    """Yield the models and dataclasses in an annotation."""
    if isinstance(annotation, type) and (
        issubclass(annotation, Model) or is_dataclass(annotation)
    ):
        yield annotation
    for argument in get_args(annotation):
        yield from models_in(argument)


def _fields_of(model: type) -> Mapping[str, object]:
    """Return the annotations of the fields of a model or dataclass, by field name."""
    if issubclass(model, Model):
        return {name: field.annotation for name, field in model.model_fields.items()}
    return get_type_hints(model)


def _models_at(location: _Location, model: type[Model]) -> list[type]:
    """Return the models that are possible at a location."""
    models: list[type] = [model]
    for step in location:
        if _is_tag(step):
            models = [
                parent for parent in models if f"<{parent.__name__}>" == step
            ] or models
            continue
        fields = [_fields_of(parent) for parent in models]
        if any(step in annotations for annotations in fields):
            models = [
                inner
                for annotations in fields
                for inner in models_in(annotations.get(str(step)))
            ]  # otherwise the step is a name in a mapping
    return models


def _keys_at(location: _Location, model: type[Model]) -> list[str]:
    """Return the allowed keys at a location."""
    return [
        name for parent in _models_at(location, model) for name in _fields_of(parent)
    ]


def key_paths(name: str, model: type[Model]) -> list[str]:
    """Return the shortest dotted keys of up to three names that end in a name, such as ``refinement.tolerance``."""
    level: list[tuple[str, type]] = [("", model)]
    for _ in range(3):
        paths = [
            f"{path}{name}" for path, parent in level if name in _fields_of(parent)
        ]
        if paths:
            return list(dict.fromkeys(paths))
        level = [
            (f"{path}{key}.", inner)
            for path, parent in level
            for key, annotation in _fields_of(parent).items()
            for inner in models_in(annotation)
        ]
    return []


def _description_at(location: _Location, model: type[Model]) -> str | None:
    """Return the description of the key at a location."""
    names = _names_in(location)
    if not names:
        return None
    last = names[-1]
    models = _models_at(location[: location.index(last)], model)
    texts = {describe_fields(parent).get(last, "") for parent in models} - {""}
    if len(texts) != 1:
        return None
    return f"{last}: {' '.join(texts.pop().split()).removesuffix('.')}"


def _is_echo(detail: ErrorDetails) -> bool:
    """Return whether a list only seems too short because pydantic does not count wrong items."""
    return (
        detail["type"] == "too_short"
        and len(detail["input"]) >= detail["ctx"]["min_length"]
    )


_Parts = tuple[str, *tuple[str | None, ...]]
"""The problem, the wrong value, the allowed values and a hint; the last ones may be absent."""


def _missing(detail: ErrorDetails, model: type[Model]) -> _Parts:
    if isinstance(detail["loc"][-1], int):
        return "the list is too short: this item is missing", show(detail["input"])
    about = _description_at(detail["loc"], model)
    return "this required key is missing", None, None, about


def _unknown(detail: ErrorDetails, model: type[Model]) -> _Parts:
    location = detail["loc"]
    name = str(location[-1])
    keys = _keys_at(location[:-1], model)
    near = suggest(name, keys)
    hint = near or _KEYS_OF_OTHERS.get(name)
    paths = [] if near else _nearest_keys(name, location[:-1], model)
    if paths and _write_location(location, "") not in paths:
        hint = f"This key belongs elsewhere: {' or '.join(paths)}"
    allowed = None if hint and not near and len(keys) > 12 else ", ".join(keys)
    return "unknown key", name, allowed, hint


def _nearest_keys(name: str, location: _Location, model: type[Model]) -> list[str]:
    """Return the keys that end in a name: the shortest below a location, else one around it, else the shortest."""
    ends = range(len(location), -1, -1)
    for place in (location[:end] for end in ends):
        paths = [
            _write_location(place, path)
            for parent in _models_at(place, model)
            for path in key_paths(name, parent)
            if path == name or place in (location, ())
        ]
        if paths:
            return list(dict.fromkeys(paths))
    return []


def _refusal(detail: ErrorDetails, _model: type[Model]) -> _Parts:
    facts = detail["ctx"]
    shown = None if facts["found"] is None else show(facts["found"])
    return facts["problem"], shown, facts["allowed"] or None


def _wrong_keys(detail: ErrorDetails, model: type[Model]) -> _Parts:
    facts = detail["ctx"]
    content = detail["input"]
    problem = facts["problem"]
    allowed = facts["allowed"]
    shown = show(content)
    if isinstance(content, list):
        return problem, shown, allowed, "Leave out the brackets around it"
    if isinstance(content, Model):
        shown = _shorten(repr(content))
        content = content.model_dump(exclude_unset=True)
    known = re.findall(r"\w+", allowed)
    models = _models_at(detail["loc"], model)
    keys = {*known, *_keys_at(detail["loc"], model)}
    stated = content if isinstance(content, Mapping) else {}
    unknown = [name for name in stated if name not in keys]
    for name in unknown:
        hint = _KEYS_OF_OTHERS.get(name) or suggest(name, known)
        if hint:
            return problem, f"the unknown key {name}", allowed, hint
    for parent in models:
        for field, annotation in _fields_of(parent).items():
            for inner in models_in(annotation):
                needed = required_keys(inner) if issubclass(inner, Model) else ()
                if needed and {*needed} <= {*unknown}:
                    value = f"{{{needed[0]}: ...}}"
                    hint = f"{value} belongs in {field}: write {{{field}: {value}}}"
                    return problem, shown, allowed, hint
    return problem, shown, allowed


def _describe(detail: ErrorDetails, model: type[Model]) -> _Parts:
    """Describe a mistake using the tables; for a wrong type, add the allowed keys and the description of the key."""
    shown = show(detail["input"])
    location = detail["loc"]
    if location and location[-1] == "[key]":
        return "a name must be a string", shown, "a string, in quotes if necessary"
    if detail["type"] in _TYPES:
        allowed = _TYPES[detail["type"]]
        keys = _keys_at(location, model) if allowed == _MAPPING else []
        if keys:
            allowed += f" with keys among {', '.join(keys)}"
        return "wrong type", shown, allowed, _description_at(location, model)
    problem, form = _PROBLEMS.get(detail["type"], (detail["msg"], ""))
    facts = detail.get("ctx", {})
    hint = suggest(detail["input"], re.findall(r"'(\w+)'", facts.get("expected", "")))
    allowed = form.format(**facts)
    unit = unit_of(".".join(_names_in(location)))
    if problem == _OUT_OF_RANGE and unit:
        allowed += f", in {unit}"
    return problem, shown, allowed or None, hint


_ALLOWED_AT: Final = {
    "brachis": "1",
    "path": "a list of segments, such as [{line: {to: [...]}}], or [{csv: {file: ...}}] for a file of points",
    "scene": "a list of bodies, [{box: [1, 1, 1]}, ...], or {file: cell.yaml}",
    "spline.degree": "a whole number, 3 to 7 with rest: full (from 2 with rest: velocity, from 4 with rest: jerk)",
    "spline.intervals": "auto, or a whole number from 4 to 10000",
    "search.jobs": "auto (all processors), or a whole number >= 1",
    "search.seed": "a whole number >= 0",
}
"""Allowed values of keys of a task whose type alone does not state them."""
_KEYS_OF_OTHERS: Final = {
    "objective": "brachis always minimises the end time",
    "tool": "The frame that follows the path is robot.tool_frame",
    "posture": "To use a named posture, write start: home and postures: {home: [...]}",
    "wait": "A wait is {dwell: 0.5}, in s",
    "points": "For a file of points write csv: {file: ...}, for a list of points spline: {through: [...]}",
}
"""Hints for keys that brachis does not have."""
_MAPPING = "a mapping"
_TYPES: Final = {
    "float_type": "a number",
    "int_type": "a whole number",
    "bool_type": "true or false",
    "string_type": "a string",
    "tuple_type": "a list",
    "dict_type": _MAPPING,
    "model_type": _MAPPING,
    "dataclass_type": _MAPPING,
    "none_required": "null",
}
"""Expected types, by pydantic's name of the error."""
_OUT_OF_RANGE = "out of range"
_PROBLEMS: Final = {
    "finite_number": ("not a finite number", "a finite number"),
    "greater_than": (_OUT_OF_RANGE, "> {gt:g}"),
    "greater_than_equal": (_OUT_OF_RANGE, ">= {ge:g}"),
    "less_than": (_OUT_OF_RANGE, "< {lt:g}"),
    "less_than_equal": (_OUT_OF_RANGE, "<= {le:g}"),
    "literal_error": ("not one of the allowed values", "{expected}"),
    "too_short": ("too few items", "at least {min_length}"),
    "too_long": ("too many items", "at most {max_length}"),
    "string_too_short": ("the string is empty", "a string of at least one character"),
    WRONG_FORM: ("wrong form", "{allowed}"),
}
"""Problem and allowed values, with pydantic's facts in braces, by pydantic's name of the error."""
_DESCRIPTIONS: Final[dict[str, Callable[[ErrorDetails, type[Model]], _Parts]]] = {
    REFUSED: _refusal,
    WRONG_KEYS: _wrong_keys,
    "missing": _missing,
    "extra_forbidden": _unknown,
    "unexpected_keyword_argument": _unknown,
}
"""Functions for mistakes that need more than the tables, by pydantic's name of the error."""
