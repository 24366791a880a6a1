"""Building blocks of the task models: the base class, strict scalar types, and unions chosen by form or by key.

For a wrong value, a plain pydantic union reports one error per member. Here a function first selects the member that
the user probably meant, so that a wrong value causes a single error. Tags are written ``<like this>``, because they
appear in pydantic's error locations, from which `brachis.task.messages` removes them.
"""

from __future__ import annotations

import ast
import inspect
import itertools
import os
import re
import sys
from collections.abc import Callable, Collection, Iterator, Mapping
from dataclasses import dataclass
from functools import cache
from types import NoneType
from typing import (
    TYPE_CHECKING,
    Annotated,
    Any,
    Final,
    Literal,
    Self,
    TypeVar,
    Union,
    get_args,
    get_origin,
)

from pydantic import (
    AfterValidator,
    BaseModel,
    BeforeValidator,
    ConfigDict,
    Discriminator,
    Field,
    GetCoreSchemaHandler,
    GetJsonSchemaHandler,
    Strict,
    Tag,
    model_validator,
)
from pydantic_core import CoreSchema, PydanticCustomError
from pydantic_core.core_schema import no_info_before_validator_function

from brachis.common.summary import show_value
from brachis.errors import MissingAttributeError

REFUSED = "brachis_refused"
"""Error type of a value that one of the validators of brachis refuses; see `refuse`."""
WRONG_FORM = "brachis_form"
"""Error type of a value that does not have any form of a union; see `ByForm`."""
WRONG_KEYS = "brachis_keys"
"""Error type of a mapping whose keys do not select exactly one member of a union; see `ByKey`."""

POSITION: Final = ("x", "y", "z")
"""Task-space rows of the tool position."""
LEAST = 1e-6
"""Smallest allowed limit of torque, velocity, acceleration or their rates, in SI units."""
LARGEST = 1e12
"""Largest allowed coordinate, angle or limit, in SI units. Products of larger numbers might overflow."""


class Model(BaseModel):
    """Base class of all parts of a task: frozen, and without unknown keys, NaN or infinity.

    The docstring below a field is its description in the documentation, the JSON schema and messages; see
    `describe_fields`. Pydantic could read these docstrings itself, but only when classes are created, which takes
    longer than a plan.
    """

    # Instances are checked again, because a program can create limits that were never checked.
    model_config = ConfigDict(
        frozen=True,
        extra="forbid",
        allow_inf_nan=False,
        revalidate_instances="always",
        defer_build=True,
    )

    if not TYPE_CHECKING:

        def __getattr__(self, name: str) -> Any:
            """Raise an error that suggests the attribute that may be meant."""
            try:
                return super().__getattr__(name)
            except AttributeError:
                raise MissingAttributeError(self, name) from None

    def __repr__(self) -> str:
        """Return the call that creates the model in a program."""
        return f"{type(self).__name__}({', '.join(show_arguments(self))})"

    def __str__(self) -> str:
        """Return the same text as `repr`."""
        return repr(self)


def show_arguments(model: Model, without: str = "") -> list[str]:
    """Return the keys that differ from their defaults, as arguments of a call: ``to=[1, 2]``."""
    arguments = []
    for name, field in type(model).model_fields.items():
        value = getattr(model, name)
        is_stated = name in model.model_fields_set and value != field.default
        if is_stated and name != without:
            is_plain = not isinstance(value, str | Model)
            text = show_value(value) if is_plain else repr(value)
            arguments.append(f"{name}={text}")
    return arguments


Mistake = tuple[str, str, str]
"""The wrong key, such as ``spline.knots`` or ``path[2].blend``, the problem, and the allowed values."""


class CheckedModel(Model):
    """A model that is checked for contradictions between its keys."""

    def _mistakes(self) -> Iterator[Mistake]:
        """Yield the contradictions between keys; only the first one is reported."""
        yield from ()

    @model_validator(mode="after")
    def _refuse_mistakes(self) -> Self:
        for key, problem, allowed in self._mistakes():
            value: Any = self
            for step in re.findall(r"\w+", key):
                value = value[int(step)] if step.isdecimal() else getattr(value, step)
            raise refuse(problem, key=key, found=value, allowed=allowed)
        return self


def describe_fields(model: type) -> dict[str, str]:
    """Return the descriptions of the fields of a model or dataclass, from `Field` or from docstrings below them."""
    descriptions: dict[str, str] = {}
    for base in model.__mro__[::-1]:
        descriptions |= _docstrings_in(base.__module__).get(base.__name__, {})
    fields = getattr(model, "model_fields", {}).items()
    return descriptions | {
        name: field.description for name, field in fields if field.description
    }


@cache
def _docstrings_in(module: str) -> dict[str, dict[str, str]]:
    """Return the docstrings below the fields in a module of brachis, by class and by field."""
    if not module.startswith("brachis."):
        return {}
    try:
        source = inspect.getsource(sys.modules[module])
    except OSError:  # the source is not installed
        return {}
    tree = ast.parse(source)
    classes = (node for node in ast.walk(tree) if isinstance(node, ast.ClassDef))
    return {definition.name: dict(_docstrings_of(definition)) for definition in classes}


def _docstrings_of(node: ast.ClassDef) -> Iterator[tuple[str, str]]:
    for statement, following in itertools.pairwise(node.body):
        match statement, following:
            case (
                ast.AnnAssign(target=ast.Name(id=name)),
                ast.Expr(value=ast.Constant(value=str(text))),
            ):
                yield name, inspect.cleandoc(text)


_NUMBER_AND_UNIT = re.compile(
    r"^\s*([+-]?(?:[0-9]+\.?[0-9]*|\.[0-9]+)(?:[eE][+-]?[0-9]+)?)\s*([a-z/%]+)\s*$"
)


@dataclass(frozen=True, eq=False)
class WithUnit:
    """Annotation that allows a number with a unit, such as ``0.05 mm``, in a task and in its JSON schema.

    Attributes
    ----------
    units : mapping of str to float
        Factors that convert each unit to that of a number without a unit.
    example : str
        Example of a value, for messages.
    pattern : str
        Regular expression of allowed strings, for the JSON schema.
    """

    units: Mapping[str, float]
    example: str
    pattern: str = "^[0-9.eE+-]+ *[a-z/]+$"

    def __get_pydantic_core_schema__(
        self, number: Any, handler: GetCoreSchemaHandler
    ) -> CoreSchema:
        """Convert a number with a unit before it is checked."""
        return no_info_before_validator_function(self._read, handler(number))

    def __get_pydantic_json_schema__(
        self, schema: CoreSchema, handler: GetJsonSchemaHandler
    ) -> dict[str, Any]:
        """Allow a string as an alternative to a number."""
        text = {"type": "string", "pattern": self.pattern}
        return {"anyOf": [handler(schema), text]}

    def _read(self, value: object) -> object:
        if not isinstance(value, str):
            return value
        match = _NUMBER_AND_UNIT.match(value)
        if match is None or match[2] not in self.units:
            raise refuse(
                "this is not a number with a unit",
                found=value,
                allowed=f"a number with a unit ({', '.join(self.units)}), such as {self.example}, or a number",
            )
        # Division gives 0.07 for 7 %, but multiplication would give 0.07000000000000001.
        return float(match[1]) / (1.0 / self.units[match[2]])


def _check_version(version: object) -> object:
    # In Python true == 1, so a literal alone would accept `brachis: true`.
    if type(version) is not int:
        raise refuse(
            "the version of the format must be a whole number",
            found=version,
            allowed="1",
        )
    return version


Version = Annotated[Literal[1], BeforeValidator(_check_version)]
# Strict: the string "3" or the boolean true in place of a number is a mistake of the user. Whole numbers are accepted
# as real ones.
Number = Annotated[float, Strict(), Field(ge=-LARGEST, le=LARGEST)]
AnyPositive = Annotated[float, Strict(), Field(gt=0)]
AnyNonNegative = Annotated[float, Strict(), Field(ge=0)]
# Figures of drives have no upper limit here, because the robot checks them and names the joints.
Positive = Annotated[AnyPositive, Field(le=LARGEST)]
NonNegative = Annotated[AnyNonNegative, Field(le=LARGEST)]
Count = Annotated[int, Strict()]
_PERCENT = r"^(100(\.0*)?|[0-9]{1,2}(\.[0-9]*)?) ?%$"
Share = Annotated[float, Strict(), WithUnit({"%": 0.01}, "50 %", _PERCENT)]
Flag = Annotated[bool, Strict()]
Name = Annotated[str, Strict(), Field(min_length=1)]
_T = TypeVar("_T")
NonEmpty = Annotated[tuple[_T, ...], Field(min_length=1)]
Vector = NonEmpty[Number]


def plain(
    value: Any, sequence: type[list[object] | tuple[object, ...]] = list
) -> object:
    """Return `value` with arrays and sequences converted to `sequence`, array scalars to numbers, and paths to strings.

    Named numbers, such as a row of a pandas table, become a mapping, because their order may be arbitrary.
    """
    # An array is recognised by its method, so that this module does not need NumPy.
    if hasattr(value, "tolist"):
        names = list(value.keys()) if hasattr(value, "keys") else []
        value = value.tolist()
        if names and all(isinstance(name, str) for name in names):
            value = dict(zip(names, value, strict=True))
    if isinstance(value, Mapping):
        return {key: plain(item, sequence) for key, item in value.items()}
    if isinstance(value, list | tuple):
        return sequence(plain(item, sequence) for item in value)
    return os.fspath(value) if isinstance(value, os.PathLike) else value


def merge(content: Mapping[str, Any], changes: Mapping[str, Any]) -> dict[str, Any]:
    """Merge mappings key by key. All other values of `changes` replace those of `content`.

    ``path_start`` is replaced as a whole, because its orientation may be in a different convention.
    """
    both = {
        key: merge(content[key], value)
        for key, value in changes.items()
        if isinstance(value, Mapping)
        and isinstance(content.get(key), Mapping)
        and key != "path_start"
    }
    return {**content, **changes, **both}


def refuse(
    problem: str,
    *,
    key: str = "",
    found: object = None,
    allowed: str = "",
) -> PydanticCustomError:
    """Return the error that a validator raises to refuse a value.

    Parameters
    ----------
    problem : str
        Description of the mistake.
    key : str, optional
        Key below the validated value, for example ``"[2].blend"`` or ``"degree"``.
    found : object, optional
        The wrong value; None if a value is missing.
    allowed : str, optional
        Values that would have been accepted.
    """
    # Pydantic fills the braces of the template from the context, which also carries these facts to the messages.
    facts = {"problem": problem, "key": key, "found": found, "allowed": allowed}
    return PydanticCustomError(REFUSED, "{problem}", facts)


def check_defined(kind: str, uses: Mapping[str, Any], known: Collection[str]) -> None:
    """Refuse undefined names; `uses` contains the names by key, and values that are not names are accepted."""
    for key, name in uses.items():
        if isinstance(name, str) and name not in known:
            raise refuse(
                f"this {kind} is not defined in {kind}s",
                key=key,
                found=name,
                allowed=", ".join(known) or f"{kind}s: {{{name}: ...}} in the task",
            )


def must(holds: Callable[[Any], object], problem: str, allowed: str) -> AfterValidator:
    """Return a validator that refuses values for which `holds` is false; its error states the allowed values."""

    def check(value: Any) -> Any:
        if not holds(value):
            raise refuse(problem, found=value, allowed=allowed)
        return value

    return AfterValidator(check)


@dataclass(frozen=True)
class ByForm:
    """Annotation that selects the member of a union by the form of the value: word, number, list, mapping or null.

    Attributes
    ----------
    allowed : str
        The accepted forms, in words, for the error message.
    """

    allowed: str

    def __get_pydantic_core_schema__(
        self, union: Any, handler: GetCoreSchemaHandler
    ) -> CoreSchema:
        """Tag each member of the union with its form."""
        members = {_form_of_type(member): member for member in get_args(union)}
        word = members.get("<word>")
        words = get_args(word) if get_origin(word) is Literal else ()

        def choose(value: object) -> str | None:
            """Return the tag of the member that fits a value; None if no member does."""
            if hasattr(value, "homogeneous"):  # a transform, such as Pinocchio's SE3
                return "<mapping>"
            form = _form_of_class(type(value))
            return None if form == "<word>" and words and value not in words else form

        by_tag = Discriminator(
            choose,
            custom_error_type=WRONG_FORM,
            custom_error_message="must be {allowed}",
            custom_error_context={"allowed": self.allowed, "expected": str(words)},
        )
        return _tagged_union(members, by_tag, handler)


@dataclass(frozen=True)
class ByKey:
    """Annotation that selects the member of a union of models by the keys that each model requires.

    Attributes
    ----------
    problem : str
        Message if the keys select no member, or more than one.
    """

    problem: str

    def __get_pydantic_core_schema__(
        self, union: Any, handler: GetCoreSchemaHandler
    ) -> CoreSchema:
        """Tag each model of the union with its name."""
        members = {f"<{model.__name__}>": model for model in get_args(union)}
        required = {tag: required_keys(model) for tag, model in members.items()}

        def choose(value: object) -> str | None:
            """Return the tag of the member that fits a value; None if no member does."""
            if isinstance(value, BaseModel):
                return f"<{type(value).__name__}>"
            if not isinstance(value, Mapping):
                return None
            chosen = [tag for tag, keys in required.items() if set(keys) & set(value)]
            return chosen[0] if len(chosen) == 1 else None

        forms = (f"{{{', '.join(keys)}}}" for keys in required.values())
        by_tag = Discriminator(
            choose,
            custom_error_type=WRONG_KEYS,
            custom_error_message="{problem}",
            custom_error_context={
                "problem": self.problem,
                "allowed": " | ".join(forms),
            },
        )
        return _tagged_union(members, by_tag, handler)


def required_keys(model: type[BaseModel]) -> tuple[str, ...]:
    """Return the required keys of a model, in order."""
    fields = model.model_fields.items()
    return tuple(name for name, field in fields if field.is_required())


def _tagged_union(
    members: Mapping[str, Any], by_tag: Discriminator, handler: GetCoreSchemaHandler
) -> CoreSchema:
    tagged = tuple(Annotated[member, Tag(tag)] for tag, member in members.items())
    return handler.generate_schema(Annotated[Union[tagged], by_tag])  # noqa: UP007


def _form_of_type(member: Any) -> str:
    if get_origin(member) is Annotated:
        return _form_of_type(get_args(member)[0])
    kind = get_origin(member) or member
    if kind is Literal:
        return "<word>"
    return _form_of_class(kind) or "<mapping>"  # a union of models


def _form_of_class(kind: type) -> str | None:
    forms = (form for kinds, form in _FORMS.items() if issubclass(kind, kinds))
    return next(forms, None)


_FORMS: Final[dict[Any, str | None]] = {
    bool: None,
    str: "<word>",
    NoneType: "<null>",
    (int, float): "<number>",
    (list, tuple): "<list>",
    (Mapping, BaseModel): "<mapping>",
}
"""Tags for the forms of values, by type."""
