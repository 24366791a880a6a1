"""What is particular to Uno."""

from __future__ import annotations

import numpy as np

from brachis.optimise.backends import uno


def test_bounds_are_widened_by_a_little_and_never_alike():
    rest = 7
    lower = np.concatenate([[-np.inf, 2.0, 0.0], np.full(rest, -1.0)])
    upper = np.concatenate([[0.0, 2.0, np.inf], np.full(rest, 1.0)])
    upper[5] = 100.0
    wide_lower, wide_upper = uno._spread_bounds(lower, upper, 1e-6)
    np.testing.assert_array_equal(wide_lower[:3], [-np.inf, 2.0, 0.0])
    np.testing.assert_array_equal(wide_upper[:3], [0.0, 2.0, np.inf])
    widened = wide_upper[3:] - upper[3:]
    assert np.all((widened > 1e-8) & (widened <= 1e-6))
    assert np.all(np.abs(np.diff(widened)) > 1e-8)
    np.testing.assert_allclose(lower[3:] - wide_lower[3:], widened, atol=1e-9)
