"""Reading YAML strictly: no duplicate keys, numbers as in YAML 1.2, errors with line and column."""

from __future__ import annotations

import re
from typing import TYPE_CHECKING, Any

import yaml

from brachis.errors import TaskError

if TYPE_CHECKING:
    from collections.abc import Hashable


class _Loader(yaml.SafeLoader):
    """A safe loader that refuses duplicate keys."""

    def construct_mapping(self, node: yaml.MappingNode, deep: bool = False) -> dict[Hashable, Any]:  # noqa: FBT001, FBT002 - PyYAML's signature
        """Make a mapping of a node, as PyYAML does, unless a key occurs twice (ConstructorError)."""
        # Before merge keys (<<) are expanded: what they bring in may be overridden.
        seen: set[str] = set()
        for key, _ in node.value:
            if isinstance(key, yaml.ScalarNode):
                if key.value in seen:
                    raise yaml.constructor.ConstructorError(
                        None, None, f"the key {key.value!r} occurs twice", key.start_mark
                    )
                seen.add(key.value)
        return super().construct_mapping(node, deep=deep)


# PyYAML reads YAML 1.1, where 1e-6, without a point or without the exponent's sign, is a string; everybody means the
# number.
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
        The text is not YAML, or repeats a key; with line and column.
    """
    try:
        # The loader derives from SafeLoader, so that no object of the user's choice can be built.
        return yaml.load(text, Loader=_Loader)  # noqa: S506
    except yaml.MarkedYAMLError as error:
        mark = error.problem_mark or error.context_mark
        where = f"{source}: line {mark.line + 1}, column {mark.column + 1}" if mark else source
        message = error.problem or "not valid YAML"
    except (yaml.YAMLError, ValueError, RecursionError) as error:
        where, message = source, str(error).splitlines()[0]
    problem = f"not valid YAML: {message}"
    raise TaskError(problem, where=where)
