"""What lattices compute for every step; see `brachis.search.lattice`."""

from __future__ import annotations

import numpy as np

from brachis.kernel.library import compute


def largest_parts(rows: np.ndarray, step: np.ndarray, origin: np.ndarray) -> np.ndarray:
    """Find the largest size, (E,), of the parts A step of steps, (E, n), with rows A, (K, c, n), where each begins."""
    if len(origin) and not 0 <= origin.min() <= origin.max() < len(rows):
        raise ValueError("a step begins nowhere")
    largest: np.ndarray = compute("brachis_largest_products", rows, origin, step)
    return largest
