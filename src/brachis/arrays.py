"""Arrays that cannot be written to, and products of arrays of vectors."""

from __future__ import annotations

from typing import Any

import numpy as np


def freeze(owner: Any, *names: str) -> None:  # noqa: ANN401  (any frozen dataclass)
    """Replace arrays of a frozen dataclass by read-only copies of its own."""
    for name in names:
        own = np.array(getattr(owner, name), dtype=float)
        own.setflags(write=False)
        object.__setattr__(owner, name, own)


def cross(a: np.ndarray, b: np.ndarray) -> np.ndarray:
    """Vector product, (3, ...), of vectors with their three components along the FIRST axis; others broadcast."""
    first = a[1] * b[2]
    product = np.empty((3, *first.shape), dtype=first.dtype)
    np.subtract(first, a[2] * b[1], out=product[0, ...])
    np.subtract(a[2] * b[0], a[0] * b[2], out=product[1, ...])
    np.subtract(a[0] * b[1], a[1] * b[0], out=product[2, ...])
    return product
