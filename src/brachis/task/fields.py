"""Building blocks of the task models: the base class, strict scalar types, and unions chosen by form or by key.

A plain pydantic union answers a wrong value with one complaint per member. Here a function looks at the value first and
picks the member that was meant, so that a wrong value gets one complaint, about what the user had in mind. Tags are
written ``<like this>`` because they appear in pydantic's error locations; `brachis.task.messages` removes them there.
"""

from __future__ import annotations

import os
import re
from collections.abc import Callable, Mapping
from typing import TYPE_CHECKING, Annotated, Any

from pydantic import (
    BaseModel,
    BeforeValidator,
    ConfigDict,
    Discriminator,
    Field,
    Strict,
    WithJsonSchema,
)
from pydantic_core import PydanticCustomError

from brachis.common.summary import show_value
from brachis.errors import MissingAttributeError

REFUSED = "brachis_refused"
"""Error type of a value that a validator of ours refuses; see `refuse`."""
WRONG_FORM = "brachis_form"
"""Error type of a value that has none of a union's forms; see `by_form`."""
WRONG_KEYS = "brachis_keys"
"""Error type of a mapping whose keys do not select one member of a union; see `by_key`."""

LARGEST = 1e12
"""Of a coordinate or angle: beyond it squares and differences lose their meaning or overflow."""


class Model(BaseModel):
    """Base class of all parts of a task: frozen, without unknown keys, without NaN or infinity."""

    # Instances are checked again, because a program can make limits that nobody has checked.
    model_config = ConfigDict(
        frozen=True, extra="forbid", allow_inf_nan=False, revalidate_instances="always"
    )

    if not TYPE_CHECKING:

        def __getattr__(self, name: str) -> Any:
            """Refuse a name that is not there, and name the one that may be meant."""
            try:
                return super().__getattr__(name)
            except AttributeError:
                raise MissingAttributeError(self, name) from None

    def __repr_args__(self) -> list[tuple[str | None, Any]]:
        """Leave out what is as by default; `__repr__` is pydantic's and shows these."""
        fields = type(self).model_fields
        given = [
            (name, getattr(self, name))
            for name in fields
            if name in self.model_fields_set
        ]
        return [
            (name, _Shown(value))
            for name, value in given
            if value != fields[name].default
        ]

    def __str__(self) -> str:
        """Show it as `repr` does."""
        return repr(self)


class _Shown:
    """A value that is shown as in summaries."""

    def __init__(self, value: object) -> None:
        self._value = value

    def __repr__(self) -> str:
        return (
            repr(self._value)
            if isinstance(self._value, str | Model)
            else show_value(self._value)
        )


_PERCENT = re.compile(r"^(100(\.0*)?|[0-9]{1,2}(\.[0-9]*)?) ?%$")


def _from_percent(value: object) -> object:
    """Read ``1 %`` as 0.01."""
    if not isinstance(value, str):
        return value
    percent = _PERCENT.match(value)
    if percent is None:
        raise refuse(
            "no share", found=value, allowed="from 0 to 100 %, or a number from 0 to 1"
        )
    return float(percent[1]) / 100.0


# Strict: the string "3" or the boolean true where a number belongs is a slip of the user's, not a number. Whole numbers
# are accepted as real ones.
Number = Annotated[float, Strict(), Field(ge=-LARGEST, le=LARGEST)]
Positive = Annotated[float, Strict(), Field(gt=0)]
NonNegative = Annotated[float, Strict(), Field(ge=0)]
Count = Annotated[int, Strict()]
Share = Annotated[
    float,
    BeforeValidator(_from_percent),
    Strict(),
    Field(ge=0, le=1),
    WithJsonSchema(
        {
            "anyOf": [
                {"type": "number", "minimum": 0, "maximum": 1},
                {"type": "string", "pattern": _PERCENT.pattern},
            ]
        }
    ),
]
Flag = Annotated[bool, Strict()]
Name = Annotated[str, Strict(), Field(min_length=1)]
Vector = Annotated[tuple[Number, ...], Field(min_length=1)]


def plain(
    value: object, sequence: type[list[object] | tuple[object, ...]] = list
) -> object:
    """Return `value` with arrays and sequences as `sequence`, array scalars as numbers, and path objects as strings."""
    # An array is known by its method and not by its class: this stage has no need for NumPy.
    to_list = getattr(value, "tolist", None)
    value = to_list() if callable(to_list) else value
    if isinstance(value, Mapping):
        return {key: plain(one, sequence) for key, one in value.items()}
    if isinstance(value, list | tuple):
        return sequence(plain(one, sequence) for one in value)
    return os.fspath(value) if isinstance(value, os.PathLike) else value


def refuse(
    problem: str,
    *,
    key: str = "",
    found: object = None,
    allowed: str = "",
    absent: bool = False,
) -> PydanticCustomError:
    """Return the error that a validator raises to refuse a value.

    Parameters
    ----------
    problem : str
        What is wrong.
    key : str, optional
        Where, below the validated value, for example ``"[2].blend"`` or ``".degree"``.
    found : object, optional
        What was found; the validated value itself where it is None.
    allowed : str, optional
        What would have been accepted.
    absent : bool, optional
        Whether the fault is that nothing was given, so that there is nothing to show.
    """
    # Pydantic fills braces of the template from the context; the facts travel in the context, not in the text.
    return PydanticCustomError(
        REFUSED,
        "{problem}",
        {
            "problem": problem,
            "key": key,
            "found": found,
            "allowed": allowed,
            "absent": absent,
        },
    )


def or_form(form: dict[str, Any]) -> Callable[[dict[str, Any]], None]:
    """Return what adds a form of a field's value to its JSON schema, and of a list one item; for json_schema_extra."""

    def add(schema: dict[str, Any]) -> None:
        kept = {
            key: schema.pop(key)
            for key in ("$ref", "type", "items", "minItems")
            if key in schema
        }
        schema["anyOf"] = [kept, *([kept["items"]] if "items" in kept else []), form]

    return add


class _Chooser(Discriminator):
    """A discriminator that can be hashed, so that the union which it serves can be part of another union."""

    def __hash__(self) -> int:
        return hash(self.discriminator)


def by_form(allowed: str, *words: str) -> Discriminator:
    """Choose a union's member by the form of the value: a word, a number, a list, a mapping or null.

    Parameters
    ----------
    allowed : str
        The accepted forms, in words, for the error message.
    *words : str
        The strings that select the member tagged ``<word>``; any other string is refused.
    """

    def form(value: object) -> str | None:
        if isinstance(value, str):
            return "<word>" if value in words else None
        if value is None:
            return "<null>"
        if isinstance(value, int | float) and not isinstance(value, bool):
            return "<number>"
        if isinstance(value, list | tuple):
            return "<list>"
        return "<mapping>" if isinstance(value, Mapping | BaseModel) else None

    return _Chooser(
        form,
        custom_error_type=WRONG_FORM,
        custom_error_message="must be {allowed}",
        custom_error_context={"allowed": allowed},
    )


def by_key(problem: str, members: Mapping[str, tuple[str, ...]]) -> Discriminator:
    """Choose a union's member by the keys of the mapping.

    Parameters
    ----------
    problem : str
        What to say where the keys select no member, or more than one.
    members : mapping of str to tuple of str
        For every member's class name, the keys that select it. Its tag is ``<class name>``.
    """
    allowed = " | ".join("{" + ", ".join(keys) + "}" for keys in members.values())
    known = [key for keys in members.values() for key in keys]

    def member(value: object) -> str | None:
        if isinstance(value, BaseModel):
            return f"<{type(value).__name__}>"
        if not isinstance(value, Mapping):
            return None
        chosen = [
            name for name, keys in members.items() if any(key in value for key in keys)
        ]
        return f"<{chosen[0]}>" if len(chosen) == 1 else None

    return _Chooser(
        member,
        custom_error_type=WRONG_KEYS,
        custom_error_message="{problem}",
        custom_error_context={
            "problem": problem,
            "allowed": allowed,
            "known": " ".join(known),
        },
    )
