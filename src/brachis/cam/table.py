"""Tables of numbers as text: delimiters, decimal commas, byte order marks."""

from __future__ import annotations

import csv
import math
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from typing import Final, NoReturn

import numpy as np

from brachis.cam.points import Array, Indices
from brachis.errors import TaskError

LARGEST = 1e12
"""Of a number in a table: beyond it squares and differences lose their meaning."""
_DELIMITERS: Final = {";": "semicolons", "\t": "tabs", ",": "commas", " ": "spaces"}


@dataclass(frozen=True, eq=False)
class Table:
    """Numbers under column names.

    Attributes
    ----------
    header : tuple of str
    header_line : int
    values : (n, c) ndarray
        As written: in the file's units.
    lines : (n,) int ndarray
        Where in the file they stand, from 1 on.
    told : tuple of str
        What was found out about the form of the file.
    """

    header: tuple[str, ...]
    header_line: int
    values: Array
    lines: Indices
    told: tuple[str, ...]


def read_table(text: str, source: str, allowed: str, check: Callable[[tuple[str, ...], str], object]) -> Table:
    """Read a table whose first line names the columns; lines that are empty or begin with ``#`` are skipped.

    Parameters
    ----------
    text : str
        Content of a file.
    source : str
        The file, for messages.
    allowed : str
        The columns that it may have, for messages.
    check : callable
        Refuses a header that is not understood, given its file and line.

    Raises
    ------
    TaskError
        A line has the wrong number of values, or one that is no finite number; the message names line and column.
    """
    told = ["a byte order mark"] if text.startswith("\ufeff") else []
    lines = [
        (number, line)
        for number, line in enumerate(text.removeprefix("\ufeff").split("\n"), 1)
        if line.strip(" \t;,\r") and not line.lstrip().startswith("#")
    ]
    if not lines:
        raise TaskError("the file is empty", allowed=allowed, where=source)
    delimiter = next((one for one in _DELIMITERS if one in lines[0][1].strip()), ",")
    commas = delimiter != "," and any("," in line for _, line in lines[1:])
    if commas:
        _refuse_points_and_commas(lines[1:], source)
        lines = [lines[0], *((number, line.replace(",", ".")) for number, line in lines[1:])]
    told += [f"columns separated by {_DELIMITERS[delimiter]}"] * (delimiter != ",") + ["decimal commas"] * commas
    (_, header), *rows = _cells(lines, delimiter, source)
    check(tuple(header), f"{source}: line {lines[0][0]}")
    numbers = np.array([number for number, _ in rows], dtype=int)
    return Table(tuple(header), lines[0][0], _numbers(rows, header, source), numbers, tuple(told))


def _cells(lines: list[tuple[int, str]], delimiter: str, source: str) -> Iterator[tuple[int, list[str]]]:
    reader = csv.reader((line.strip(" \r") for _, line in lines), delimiter=delimiter, skipinitialspace=True)
    try:
        for (number, _), cells in zip(lines, reader, strict=False):
            yield number, [cell.strip() for cell in cells]
    except csv.Error as error:
        where = f"{source}: line {lines[reader.line_num - 1][0]}"
        raise TaskError(f"not a CSV file: {error}", where=where) from None


def _numbers(rows: list[tuple[int, list[str]]], header: list[str], source: str) -> Array:
    width = len(header)
    try:
        values = np.array([[float(cell) for cell in cells] for _, cells in rows]).reshape(len(rows), -1)
    except ValueError:  # no number, or rows of different lengths
        values = np.empty((0, 0))
    if values.shape != (len(rows), width) or not np.all(np.abs(values) <= LARGEST):
        _refuse(rows, header, source)
    return values


def _refuse(rows: list[tuple[int, list[str]]], header: list[str], source: str) -> NoReturn:
    """Raise the error for the first row that is wrong."""
    for number, cells in rows:
        where = f"{source}: line {number}"
        if len(cells) != len(header):
            problem = "wrong number of values"
            hint = "Decimal commas need columns separated by semicolons or tabs" if len(cells) > len(header) else None
            allowed = f"{len(header)}: {', '.join(header)}"
            raise TaskError(problem, found=len(cells), allowed=allowed, where=where, hint=hint)
        for column, cell in zip(header, cells, strict=True):
            value = _number(cell)
            if not math.isfinite(value):
                problem = f"the value of column {column} is not a finite number"
                raise TaskError(problem, found=repr(cell), allowed="a number", where=where)
            if abs(value) > LARGEST:
                problem = f"the value of column {column} is out of range"
                raise TaskError(problem, found=repr(cell), allowed=f"{-LARGEST:g} to {LARGEST:g}", where=where)
    raise TaskError("no rows of numbers", where=source)


def _number(cell: str) -> float:
    try:
        return float(cell)
    except ValueError:
        return math.nan


def _refuse_points_and_commas(lines: list[tuple[int, str]], source: str) -> None:
    """Refuse numbers with both: one of them would separate thousands, and nobody knows which."""
    for number, line in lines:
        if "," in line and "." in line:
            problem = "decimal points and commas in one line"
            hint = "Write numbers without separators of thousands"
            raise TaskError(problem, found=repr(line.strip()[:60]), where=f"{source}: line {number}", hint=hint)
