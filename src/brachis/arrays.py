"""Arrays that cannot be written to."""

from __future__ import annotations

from typing import Any

import numpy as np


def freeze(owner: Any, *names: str) -> None:  # noqa: ANN401  (any frozen dataclass)
    """Replace arrays of a frozen dataclass by read-only copies of its own."""
    for name in names:
        own = np.array(getattr(owner, name), dtype=float)
        own.setflags(write=False)
        object.__setattr__(owner, name, own)
