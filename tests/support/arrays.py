"""Comparison of arrays in proportion to their size."""

from __future__ import annotations

from typing import Any

import numpy as np


def assert_near(
    actual: Any, expected: Any, tolerance: float, *, least: float = 0.0
) -> None:
    """Compare arrays to a tolerance times the largest size of what is expected, and at least times `least`."""
    size = max(least, np.abs(expected).max())
    np.testing.assert_allclose(actual, expected, rtol=0.0, atol=tolerance * size)
