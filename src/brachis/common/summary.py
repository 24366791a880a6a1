"""How objects show themselves: on a few lines in a terminal, as a table in a notebook; never more than a screen."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import fields
from html import escape
from typing import TYPE_CHECKING, Any

from brachis.errors import MissingAttributeError

COLUMNS = 100
LINES = 22
_ROOM = 104
"""Characters of one value."""
_ITEMS = 8


class Summary:
    """Base class of what shows a summary of itself: what `summary` says, a dataclass's fields unless overridden."""

    def summary(self) -> Mapping[str, object]:
        """Return what is shown, by name."""
        names = [each.name for each in fields(self) if each.repr]  # type: ignore[arg-type]
        return {name: getattr(self, name) for name in names}

    if not TYPE_CHECKING:

        def __getattr__(self, name: str) -> Any:
            """Refuse a name that is not there, and name the one that may be meant."""
            if hasattr(type(self), name):  # a property that failed
                return object.__getattribute__(self, name)
            raise MissingAttributeError(self, name)

    def __repr__(self) -> str:
        """Show it on one line, or on one line for each entry."""
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
        """Show it as a table in a notebook."""
        rows = "".join(
            f'<tr><td style="text-align:left"><b>{escape(key)}</b></td>'
            f'<td style="text-align:left">{escape(value)}</td></tr>'
            for key, value in self._entries()
        )
        return f"<table><caption>{type(self).__name__}</caption>{rows}</table>"

    def _entries(self) -> list[tuple[str, str]]:
        given = list(self.summary().items())
        entries = [(key, show_value(value)) for key, value in given[:LINES]]
        return entries + (
            [("...", f"{len(given) - LINES} more")] if len(given) > LINES else []
        )


def show_value(value: Any, room: int = _ROOM) -> str:
    """Show a value in at most `room` characters: arrays by their shape, long sequences by their length."""
    shape = getattr(value, "shape", None)
    if isinstance(shape, tuple) and shape:
        return (
            _list_items(value.tolist(), room)
            if len(shape) == 1 and shape[0] <= _ITEMS
            else f"array {shape}"
        )
    if isinstance(value, float):
        return f"{value:.6g}"
    if isinstance(value, str):
        return _shorten(value, room)
    if type(value) in {list, tuple}:  # not those with names
        return _list_items(value, room)
    if isinstance(value, Mapping):
        items = ", ".join(
            f"{key}: {show_value(each, room)}"
            for key, each in list(value.items())[:_ITEMS]
        )
        return (
            items
            if len(items) <= room and len(value) <= _ITEMS
            else f"{len(value)} entries"
        )
    text = repr(value)
    return text if len(text) <= room and "\n" not in text else type(value).__name__


def _shorten(text: str, room: int) -> str:
    if len(text) <= room and "\n" not in text:
        return text
    count = f"... ({len(text)} characters)"
    return text.partition("\n")[0][: room - len(count)] + count


def _list_items(values: list[Any] | tuple[Any, ...], room: int) -> str:
    text = f"[{', '.join(show_value(each, room) for each in values[:_ITEMS])}]"
    return (
        text if len(text) <= room and len(values) <= _ITEMS else f"{len(values)} items"
    )
