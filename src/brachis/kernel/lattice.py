"""What lattices compute for every step; see `brachis.search.lattice`."""

from __future__ import annotations

import numpy as np

from brachis.kernel.library import as_doubles, call


def largest_parts(rows: np.ndarray, step: np.ndarray, origin: np.ndarray) -> np.ndarray:
    """Find the largest size, (E,), of the parts A step of steps, (E, n), with rows A, (K, c, n), where each begins."""
    count, values, n = rows.shape
    steps = len(step)
    if origin.shape != (steps,):
        raise ValueError(f"origin has the shape {origin.shape}; needed: {(steps,)}")
    if steps and not 0 <= origin.min() <= origin.max() < count:
        raise ValueError("a step begins nowhere")
    given = (as_doubles(rows, rows.shape), np.ascontiguousarray(origin, dtype="l"))
    own = as_doubles(step, (steps, n))
    found = np.empty(steps)
    call("brachis_largest_parts", steps, values, n, *given, own, found)
    return found
