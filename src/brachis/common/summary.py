"""Summaries of objects: a few lines in a terminal, a table in a notebook, never more than a screen."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import fields
from html import escape
from typing import TYPE_CHECKING, Any

from brachis.errors import MissingAttributeError

COLUMNS = 100
"""Maximum length of a summary that is shown on one line, characters."""
LINES = 22
"""Maximum number of entries in a summary: with the name and the prompt, they fit into a terminal of 24 lines."""


class Summary:
    """Base class of objects that show a summary: the entries of `summary`, by default the fields of a dataclass."""

    def summary(self) -> Mapping[str, object]:
        """Return the entries shown in the summary, by name."""
        names = [entry.name for entry in fields(self) if entry.repr]  # type: ignore[arg-type]
        return {name: getattr(self, name) for name in names}

    if not TYPE_CHECKING:

        def __getattr__(self, name: str) -> Any:
            """Raise an error for an attribute that does not exist, and suggest a similar one."""
            if hasattr(type(self), name):  # the attribute is a property that failed
                return object.__getattribute__(self, name)
            raise MissingAttributeError(self, name)

    def __repr__(self) -> str:
        """Return the summary on one line, or with one line for each entry."""
        entries = self._entries()
        name = type(self).__name__
        line = f"{name}({', '.join(f'{key}={value}' for key, value in entries)})"
        if len(line) <= COLUMNS:
            return line
        width = max(len(key) for key, _ in entries)
        return "\n".join(
            [name, *(f"  {key:<{width}}  {value}" for key, value in entries)]
        )

    def _repr_html_(self) -> str:
        """Return the summary as a table for a notebook."""
        rows = "".join(
            f'<tr><td style="text-align:left"><b>{escape(key)}</b></td>'
            f'<td style="text-align:left">{escape(value)}</td></tr>'
            for key, value in self._entries()
        )
        return f"<table><caption>{type(self).__name__}</caption>{rows}</table>"

    def _entries(self) -> list[tuple[str, str]]:
        items = list(self.summary().items())
        entries = [(key, show_value(value)) for key, value in items[:LINES]]
        if len(items) > LINES:
            entries.append(("...", f"{len(items) - LINES} more"))
        return entries


def show_value(value: Any) -> str:
    """Write a value in at most 104 characters and 8 items: arrays by their shape, long sequences by their length."""
    room = 104
    items = 8
    shape = getattr(value, "shape", None)
    if isinstance(shape, tuple) and shape:
        if len(shape) > 1 or shape[0] > items:
            return f"array {shape}"
        value = value.tolist()
    if isinstance(value, float):
        return f"{value:.6g}"
    count = 0
    if isinstance(value, str):
        text = value
        ending = f"... ({len(text)} characters)"
        instead = text.partition("\n")[0][: room - len(ending)] + ending
    elif type(value) in {list, tuple}:  # not named tuples
        count = len(value)
        text = f"[{', '.join(show_value(item) for item in value[:items])}]"
        instead = f"{count} items"
    elif isinstance(value, Mapping):
        count = len(value)
        pairs = list(value.items())[:items]
        text = ", ".join(f"{key}: {show_value(item)}" for key, item in pairs)
        instead = f"{count} entries"
    else:
        text = repr(value)
        instead = type(value).__name__
    fits = len(text) <= room and count <= items and "\n" not in text
    return text if fits else instead
