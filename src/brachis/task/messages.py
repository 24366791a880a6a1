"""Pydantic's validation errors in plain words: key, what was found, what is allowed, what to try."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass, is_dataclass, replace
from typing import Any, Final, get_args, get_type_hints

from pydantic import ValidationError
from pydantic_core import ErrorDetails

from brachis.errors import TaskError, nearest
from brachis.task.fields import REFUSED, WRONG_FORM, WRONG_KEYS, Model

_LONGEST_VALUE = 60
_DEEPEST = 3
"""Parts of a dotted key."""
_MAPPING = "a mapping"


@dataclass(frozen=True)
class _Complaint:
    """One mistake: the fields of a `TaskError` before the file's name is known."""

    problem: str
    found: str | None = None
    allowed: str | None = None
    hint: str | None = None
    key: str = ""


def task_error(error: ValidationError, source: str, model: type[Model]) -> TaskError:
    """Return the `TaskError` that says in plain words what `error` says.

    Parameters
    ----------
    error : ValidationError
        What pydantic found.
    source : str
        File name, or what else the task came from.
    model : type
        The model that was validated; its fields tell which keys are allowed.
    """
    details = error.errors(include_url=False)
    errors = [_one(detail, source, model) for detail in details if not _is_echo(detail)]
    if len(errors) == 1:
        return errors[0]
    lines = "".join(f"\n  {one}" for one in errors)
    return TaskError(f"{len(errors)} mistakes{lines}", where=source)


def show(value: object) -> str:
    """Return a value as a task file would write it, shortened, with its type where that is the question."""
    if value is None:
        return "null"
    if isinstance(value, bool):
        return f"{str(value).lower()} (a boolean)"
    if isinstance(value, str):
        return f"{_short(repr(value))} (a string)"
    if isinstance(value, Mapping):
        return f"a mapping with the keys {_short(', '.join(map(str, value)) or 'none')}"
    if isinstance(value, list | tuple):
        return f"{_short(repr(list(value)))} (a list)"
    return _short(repr(value))


def _short(text: str) -> str:
    return text if len(text) <= _LONGEST_VALUE else text[: _LONGEST_VALUE - 3] + "..."


def _one(detail: ErrorDetails, source: str, model: type[Model]) -> TaskError:
    describe = _DESCRIPTIONS.get(detail["type"], _unforeseen)
    complaint = describe(detail, model)
    key = _write_location(detail["loc"]) + complaint.key
    return TaskError(
        complaint.problem,
        found=complaint.found,
        allowed=complaint.allowed,
        where=f"{source}: {key}" if key else source,
        hint=complaint.hint,
    )


def _is_tag(part: str | int) -> bool:
    return isinstance(part, str) and part.startswith("<") and part.endswith(">")


def _write_location(location: tuple[str | int, ...]) -> str:
    """Return a location as ``path[0].line.to``, without the tags of unions."""
    text = ""
    for part in location:
        if _is_tag(part) or part == "[key]":
            continue
        text += f"[{part}]" if isinstance(part, int) else f".{part}"
    return text.removeprefix(".")


def models_in(annotation: object) -> Iterator[type]:
    """Yield the models, and dataclasses, that an annotation names."""
    if isinstance(annotation, type) and (
        issubclass(annotation, Model) or is_dataclass(annotation)
    ):
        yield annotation
    for part in get_args(annotation):
        yield from models_in(part)


def _fields_of(model: type) -> Mapping[str, object]:
    """Return the names of a model's fields, or of a dataclass's, and what they are annotated with."""
    if issubclass(model, Model):
        return {name: field.annotation for name, field in model.model_fields.items()}
    return get_type_hints(model)


def _models_at(location: tuple[str | int, ...], model: type[Model]) -> list[type]:
    """Return the models that may stand at a location."""
    models: list[type] = [model]
    for part in location:
        if _is_tag(part):
            chosen = [one for one in models if f"<{one.__name__}>" == part]
            models = chosen or models
        elif isinstance(part, str) and any(
            part in _fields_of(one) for one in models
        ):  # else a name in a mapping
            fields = [_fields_of(one).get(part) for one in models]
            models = [found for annotation in fields for found in models_in(annotation)]
    return models


def _keys_at(location: tuple[str | int, ...], model: type[Model]) -> list[str]:
    """Return the keys that are allowed at a location."""
    return [name for one in _models_at(location, model) for name in _fields_of(one)]


def key_paths(name: str, model: type[Model]) -> list[str]:
    """Return the dotted keys, of the fewest parts, that end in a name: ``refinement.tolerance``."""
    level: list[tuple[str, type]] = [("", model)]
    for _ in range(_DEEPEST):
        found = [f"{path}{name}" for path, one in level if name in _fields_of(one)]
        if found:
            return list(dict.fromkeys(found))
        inside = (
            (f"{path}{key}.", kind)
            for path, one in level
            for key, kind in _fields_of(one).items()
        )
        level = [
            (path, each)
            for path, annotation in inside
            for each in models_in(annotation)
        ]
    return []


def _description_at(location: tuple[str | int, ...], model: type[Model]) -> str | None:
    """Return what is said of the key at a location."""
    names = [part for part in location if isinstance(part, str) and not _is_tag(part)]
    if not names:
        return None
    last = names[-1]
    models = _models_at(location[: location.index(last)], model)
    fields = [one.model_fields.get(last) for one in models if issubclass(one, Model)]
    found = [field.description for field in fields if field and field.description]
    return f"{last}: {found[0].removesuffix('.')}" if len(found) == 1 else None


def _is_echo(detail: ErrorDetails) -> bool:
    """Whether a list is called too short only because pydantic does not count its wrong items."""
    return (
        detail["type"] == "too_short"
        and len(detail["input"]) >= detail["ctx"]["min_length"]
    )


def _missing(detail: ErrorDetails, model: type[Model]) -> _Complaint:
    if isinstance(detail["loc"][-1], int):
        return _Complaint(
            "the list is too short: this item is missing", show(detail["input"])
        )
    hint = (_description_at(detail["loc"], model) or "").partition("; ")[0]
    return _Complaint("this key is required, and missing", hint=hint or None)


def _unknown(detail: ErrorDetails, model: type[Model]) -> _Complaint:
    name = str(detail["loc"][-1])
    keys = _keys_at(detail["loc"][:-1], model)
    elsewhere = key_paths(name, model)
    near = nearest(name, keys)
    return _Complaint(
        "unknown key",
        name,
        ", ".join(keys),
        f"It is a key of its own: {' or '.join(elsewhere)}"
        if elsewhere
        else near and f"Did you mean {near!r}?",
    )


def _describe_refusal(detail: ErrorDetails, _model: type[Model]) -> _Complaint:
    facts = detail["ctx"]
    shown = (
        None
        if facts["absent"]
        else show(detail["input"] if facts["found"] is None else facts["found"])
    )
    return _Complaint(
        facts["problem"], shown, facts["allowed"] or None, key=facts["key"]
    )


def _wrong_form(detail: ErrorDetails, _model: type[Model]) -> _Complaint:
    return _Complaint("wrong form", show(detail["input"]), detail["ctx"]["allowed"])


def _wrong_keys(detail: ErrorDetails, _model: type[Model]) -> _Complaint:
    facts = detail["ctx"]
    found = detail["input"]
    known = facts["known"].split()
    near = None
    if isinstance(found, Mapping) and not any(key in found for key in known):
        near = next(filter(None, (nearest(str(key), known) for key in found)), None)
    return _Complaint(
        facts["problem"],
        show(found),
        facts["allowed"],
        f"Did you mean {near!r}?" if near else None,
    )


def _unforeseen(detail: ErrorDetails, _model: type[Model]) -> _Complaint:
    return _Complaint(detail["msg"], show(detail["input"]))


def _plain(
    problem: str, allowed: str | None = None
) -> Callable[[ErrorDetails, type[Model]], _Complaint]:
    """Return a description whose texts may name pydantic's facts in braces, such as ``{gt}``."""

    def describe(detail: ErrorDetails, _model: type[Model]) -> _Complaint:
        facts: dict[str, Any] = detail.get("ctx", {})
        if detail["loc"] and detail["loc"][-1] == "[key]":
            return _Complaint(
                "a name must be a string",
                show(detail["input"]),
                "a string, in quotes if need be",
            )
        return _Complaint(
            problem.format(**facts),
            show(detail["input"]),
            allowed and allowed.format(**facts),
        )

    return describe


def _wrong_type(form: str) -> Callable[[ErrorDetails, type[Model]], _Complaint]:
    """Return a description that names the form, the keys of a mapping, and what the key is for."""
    plainly = _plain("wrong type", form)

    def describe(detail: ErrorDetails, model: type[Model]) -> _Complaint:
        complaint = plainly(detail, model)
        keys = _keys_at(detail["loc"], model) if form == _MAPPING else []
        return replace(
            complaint,
            allowed=f"{form} with keys out of {', '.join(keys)}"
            if keys
            else complaint.allowed,
            hint=_description_at(detail["loc"], model),
        )

    return describe


_DESCRIPTIONS: Final[dict[str, Callable[[ErrorDetails, type[Model]], _Complaint]]] = {
    REFUSED: _describe_refusal,
    WRONG_FORM: _wrong_form,
    WRONG_KEYS: _wrong_keys,
    "missing": _missing,
    "extra_forbidden": _unknown,
    "unexpected_keyword_argument": _unknown,
    "float_type": _wrong_type("a number"),
    "int_type": _wrong_type("a whole number"),
    "bool_type": _wrong_type("true or false"),
    "string_type": _wrong_type("a string"),
    "tuple_type": _wrong_type("a list"),
    "dict_type": _wrong_type(_MAPPING),
    "model_type": _wrong_type(_MAPPING),
    "dataclass_type": _wrong_type(_MAPPING),
    "none_required": _wrong_type("null"),
    "finite_number": _plain("not a finite number", "a finite number"),
    "greater_than": _plain("out of range", "> {gt:g}"),
    "greater_than_equal": _plain("out of range", ">= {ge:g}"),
    "less_than": _plain("out of range", "< {lt:g}"),
    "less_than_equal": _plain("out of range", "<= {le:g}"),
    "literal_error": _plain("not one of the allowed values", "{expected}"),
    "too_short": _plain("too few items", "at least {min_length}"),
    "too_long": _plain("too many items", "at most {max_length}"),
    "string_too_short": _plain(
        "the string is empty", "a string of at least one character"
    ),
}
