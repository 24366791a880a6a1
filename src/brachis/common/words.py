"""Numbers and names in sentences."""

from __future__ import annotations

from collections.abc import Sequence


def write_apart(value: float, *others: float, digits: int = 4) -> tuple[str, ...]:
    """Write a number and others with as many significant digits as tell it from them, at least `digits`."""
    for count in range(digits, 18):
        text, *texts = (f"{each:.{count}g}" for each in (value, *others))
        if all(
            text != other or value == each
            for other, each in zip(texts, others, strict=True)
        ):
            break
    return (text, *texts)


def write_count(count: int, noun: str) -> str:
    """Write how many there are of something, as ``1 row`` or ``2 rows``."""
    return f"{count} {noun}" if count == 1 else f"{count} {noun}s"


def name_first(names: Sequence[str], separator: str, most: int = 3) -> str:
    """Join the first names, and say how many more there are."""
    others = f" and {len(names) - most} more" if len(names) > most else ""
    return separator.join(names[:most]) + others
