"""The computation that is repeated for every step of a lattice; see `brachis.search.lattice`."""

from __future__ import annotations

import numpy as np

from brachis.kernel.library import call_checked


def find_largest_products(
    rows: np.ndarray, step: np.ndarray, origin: np.ndarray
) -> np.ndarray:
    """Find the largest entry, (E,), of ``|A step|`` for E steps, (E, n), with A, (K, c, n), at the origin of each."""
    if len(origin) and not 0 <= origin.min() <= origin.max() < len(rows):
        raise ValueError("a step begins at a point that does not exist")
    largest: np.ndarray = call_checked("brachis_largest_products", rows, origin, step)
    return largest
