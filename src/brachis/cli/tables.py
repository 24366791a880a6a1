"""Tables that fit the terminal: text wraps, numbers are neither cut nor wrapped, and what does not fit goes below."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass

from rich import box
from rich.cells import cell_len
from rich.console import Console
from rich.table import Table

_LONGEST_WORD = 24
"""Longer words of text may be broken."""
_LINED = (3, 1)
"""Characters that lines and padding take, for each column and besides."""
_PLAIN = (2, -2)


@dataclass(frozen=True)
class Column:
    """A column of a table.

    Attributes
    ----------
    name : str
        Its heading, with the unit of its numbers.
    number : bool
        Whether its cells are numbers.
    """

    name: str
    number: bool = False


def print_table(
    console: Console,
    title: str,
    columns: Sequence[Column | str],
    rows: Iterable[Sequence[object]],
    *,
    header: bool = True,
) -> None:
    """Print a table as wide as the console at most.

    A table that is too wide loses its lines first; then its columns are printed in parts, each beginning with the
    first column.

    Parameters
    ----------
    console : Console
    title : str
    columns : sequence of Column or str
        Of text, where only the name is given. The first one says what a row is about.
    rows : iterable of sequences
        A cell for each column.
    header : bool, optional
        Whether the names of the columns are shown.
    """
    named = [Column(each) if isinstance(each, str) else each for each in columns]
    cells = [[str(cell) for cell in row] for row in rows]
    texts = [([named[i].name] if header else []) + [row[i] for row in cells] for i in range(len(named))]
    least = [_least(each, text, header=header) for each, text in zip(named, texts, strict=True)]
    most = [max(map(cell_len, text), default=0) for text in texts]
    lined = sum(least) + _LINED[0] * len(named) + _LINED[1] <= console.width
    parts = [list(range(len(named)))] if lined else _parts(least, console.width)
    for number, part in enumerate(parts, start=1):
        free = console.width - _around(len(part), lined=lined)
        widths = _widths([named[i] for i in part], [least[i] for i in part], [most[i] for i in part], free)
        told = f"{title} ({number} of {len(parts)})" if len(parts) > 1 else title
        look = box.HEAVY_HEAD if lined else None
        table = Table(title=told, title_justify="left", show_header=header, box=look, padding=(0, 1), pad_edge=lined)
        for i, width in zip(part, widths, strict=True):
            table.add_column(
                named[i].name, justify="right" if named[i].number else "left", overflow="fold", width=width
            )
        for row in cells:
            table.add_row(*(row[i] for i in part))
        console.print(table)


def _least(column: Column, texts: Sequence[str], *, header: bool) -> int:
    """Count the characters that a column needs: whole numbers, whole words unless they are very long."""
    name, body = (texts[:1], texts[1:]) if header else ([], texts)
    words = [cell_len(word) for text in (*name, *([] if column.number else body)) for word in text.split()]
    numbers = [cell_len(text) for text in body] if column.number else []
    return max((*numbers, *(min(word, _LONGEST_WORD) for word in words)), default=1)


def _around(columns: int, *, lined: bool) -> int:
    """Count the characters of a row that are not its cells'."""
    each, besides = _LINED if lined else _PLAIN
    return each * columns + besides


def _parts(least: Sequence[int], width: int) -> list[list[int]]:
    """Share the columns out to tables that fit without lines; the first column is in each."""
    parts = [[0]]
    for i in range(1, len(least)):
        taken = [*parts[-1], i]
        if len(taken) > 2 and sum(least[k] for k in taken) + _around(len(taken), lined=False) > width:  # noqa: PLR2004 (the first column and this one)
            parts.append([0, i])
        else:
            parts[-1] = taken
    return parts


def _widths(columns: Sequence[Column], least: Sequence[int], most: Sequence[int], free: int) -> list[int]:
    """Give every column what it needs, and while there is room widen those that wish for more, the narrowest first.

    Where there is no room for what they need, the widest column of text is narrowed.
    """
    widths = list(least)
    texts = [i for i, column in enumerate(columns) if not column.number]
    while sum(widths) > free and max(widths[i] for i in texts) > 1:
        widths[max(texts, key=lambda i: widths[i])] -= 1
    while sum(widths) < free and any(width < wish for width, wish in zip(widths, most, strict=True)):
        wishing = [i for i, width in enumerate(widths) if width < most[i]]
        widths[min(wishing, key=lambda i: widths[i])] += 1
    return widths
