"""Functions that write numbers and names in sentences."""

from __future__ import annotations

from collections.abc import Sequence


def write_apart(value: float, *references: float, digits: int = 4) -> tuple[str, ...]:
    """Write numbers with enough significant digits, at least `digits`, to tell the first one from the others."""
    for count in range(digits, 18):
        text, *texts = (f"{number:.{count}g}" for number in (value, *references))
        if all(
            text != written or value == number
            for written, number in zip(texts, references, strict=True)
        ):
            break
    return (text, *texts)


def write_count(count: int, noun: str) -> str:
    """Write a count with its noun, such as ``1 row`` or ``2 rows``."""
    return f"{count} {noun}" if count == 1 else f"{count} {noun}s"


def name_first(names: Sequence[str], separator: str, count: int = 3) -> str:
    """Join the first `count` names, followed by the number of further names."""
    ending = f" and {len(names) - count} more" if len(names) > count else ""
    return separator.join(names[:count]) + ending
