"""Strict reading of YAML: no duplicate keys, numbers as in YAML 1.2, limited size, errors with line and column."""

from __future__ import annotations

import math
import re
import reprlib
from contextlib import suppress
from typing import TYPE_CHECKING, Any

import yaml

from brachis.errors import TaskError, UnknownNameError

if TYPE_CHECKING:
    from collections.abc import Hashable
    from typing import NoReturn

_LARGEST = 1_000_000
"""Maximum number of nodes of a document after its aliases are expanded."""
_UNITS = {
    "!radians": 1.0,
    "!degrees": math.pi / 180.0,
    "!meters": 1.0,
    "!millimeters": 1e-3,
    "!foot": 0.3048,
    "!inches": 0.0254,
}
"""Tags of units, the same as in xacro, with their conversion factors to SI units."""
_BROKEN = (
    yaml.YAMLError,
    ValueError,
    RecursionError,
    # PyYAML raises these for values that do not fit an explicit tag, such as ``!!int ""`` and ``!!bool x``.
    ArithmeticError,
    AttributeError,
    LookupError,
    TypeError,
)


class _Loader(yaml.SafeLoader):
    """A YAML loader that builds only plain data and refuses duplicate keys."""

    def construct_mapping(
        self,
        node: yaml.MappingNode,
        deep: bool = False,  # noqa: FBT002
    ) -> dict[Hashable, Any]:
        """Build the mapping of a node as PyYAML does; if a key occurs twice, raise MarkedYAMLError."""
        # The check precedes the expansion of merge keys (<<), because the keys that these add may be overridden.
        keys: set[str] = set()
        for key, _ in node.value:
            if isinstance(key, yaml.ScalarNode):
                if key.value in keys:
                    raise yaml.MarkedYAMLError(
                        problem=f"the key {key.value!r} occurs twice",
                        problem_mark=key.start_mark,
                    )
                keys.add(key.value)
        return super().construct_mapping(node, deep=deep)

    def get_single_node(self) -> yaml.Node | None:
        """Parse the document; if its aliases make it infinite or far too long, raise MarkedYAMLError."""
        node = super().get_single_node()
        if node is not None and (size := _size(node, {})) > _LARGEST:
            problem = f"{size:.3g} values with all aliases expanded, more than the {_LARGEST} allowed"
            if size == math.inf:
                problem = "the task contains itself (an alias inside its own anchor)"
            raise yaml.MarkedYAMLError(problem=problem, problem_mark=node.start_mark)
        return node


def _size(node: yaml.Node, known: dict[int, float]) -> float:
    """Return the number of nodes with all aliases expanded; infinite if the document contains itself."""
    if isinstance(node, yaml.ScalarNode):
        return 1.0
    if id(node) not in known:
        known[id(node)] = math.inf  # while its children are counted
        children = (
            node.value
            if isinstance(node, yaml.SequenceNode)
            else [child for pair in node.value for child in pair]
        )
        known[id(node)] = 1.0 + sum(_size(child, known) for child in children)
    return known[id(node)]


def _with_unit(_loader: _Loader, node: yaml.Node) -> float:
    """Return a number with a unit, such as ``!degrees 90``, in SI units; raise MarkedYAMLError for anything else.

    A list is refused, because `!degrees` before the positions of all joints would also convert those in m.
    """
    value = math.nan
    if isinstance(node, yaml.ScalarNode) and node.style is None:
        with suppress(ValueError):
            value = float(node.value) * _UNITS[node.tag]
    if math.isfinite(value):
        return value
    raise yaml.MarkedYAMLError(
        problem=f"{node.tag} needs a number, not {_describe(node)}",
        problem_mark=node.start_mark,
    )


def _describe(node: yaml.Node) -> str:
    """Describe, for a message, a node that is in the place of a number with a unit."""
    if isinstance(node, yaml.ScalarNode):
        return reprlib.repr(node.value)
    kind = "mapping" if isinstance(node, yaml.MappingNode) else "list"
    return f"a {kind}: put the tag before each number that has this unit"


def _refuse_tag(_loader: _Loader, node: yaml.Node) -> NoReturn:
    """Refuse a tag that is neither a unit nor a standard YAML tag, by MarkedYAMLError."""
    raise yaml.MarkedYAMLError(
        problem=str(UnknownNameError("tag", node.tag, _UNITS)),
        problem_mark=node.start_mark,
    )


for _tag in _UNITS:
    _Loader.add_constructor(_tag, _with_unit)
_Loader.add_constructor(None, _refuse_tag)

# PyYAML reads YAML 1.1, in which 1e-6 (no point, or no sign of the exponent) is a string. Users always mean the number.
_Loader.add_implicit_resolver(
    "tag:yaml.org,2002:float",
    re.compile(r"^[-+]?(?:[0-9]+\.?[0-9]*|\.[0-9]+)[eE][-+]?[0-9]+$"),
    list("-+.0123456789"),
)


def read_yaml(text: str, source: str) -> object:
    """Return the content of a YAML text.

    Raises
    ------
    TaskError
        The text is not YAML, or repeats a key; the message states line and column.
    """
    try:
        return _Loader(text).get_single_data()
    except yaml.MarkedYAMLError as error:
        mark = error.problem_mark or error.context_mark
        where = (
            f"{source}: line {mark.line + 1}, column {mark.column + 1}"
            if mark
            else source
        )
        message = error.problem or "not valid YAML"
    except _BROKEN as error:
        where = source
        message = (str(error) or type(error).__name__).splitlines()[0]
    raise TaskError(f"not valid YAML: {message}", where=where)
