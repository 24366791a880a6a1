"""Curves rounded from below: beside the piecewise linear curve, and derivatives against differences."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from numpy.testing import assert_allclose, assert_array_equal

from brachis.limits.drives import WIDTH, RoundedCurve

PIECES = st.lists(
    st.tuples(st.floats(1e-3, 10.0), st.floats(0.0, 1.0)), min_size=1, max_size=7
)
"""Lengths of pieces, and the part of the torque that is left behind each of them."""


def curve_of(pieces):
    speed = np.cumsum([0.0, *(length for length, _ in pieces)])
    torque = 50.0 * np.cumprod([1.0, *(part for _, part in pieces)])
    return tuple(zip(speed.tolist(), torque.tolist(), strict=True))


def true_torque(curve, speeds):
    """The curve, its last slope going on to zero torque."""
    speed, torque = np.transpose(curve)
    slope = (torque[-1] - torque[-2]) / (speed[-1] - speed[-2])
    return np.maximum(
        np.interp(speeds, speed, torque) + slope * np.maximum(speeds - speed[-1], 0.0),
        0.0,
    )


@given(PIECES)
def test_it_lies_below_the_curve_by_little_and_falls_to_zero_at_most(pieces):
    curve = curve_of(pieces)
    rounded = RoundedCurve.below(curve)
    if rounded is None:
        assert curve[0][1] == curve[-1][1]
        return
    speed = np.array(curve)[:, 0]
    near = (speed[:, None] + speed[-1] * np.linspace(-0.01, 0.01, 41)).ravel()
    speeds = np.unique(
        np.concatenate([np.linspace(0.0, 2.0 * speed[-1], 2001), near.clip(0.0)])
    )
    values, true = rounded.values(speeds), true_torque(curve, speeds)
    eps = 1e-7 + 1e-9 * rounded.stall_torque
    within = np.minimum(
        values, 50.0
    )  # what lies above the torque at rest is cut by the plain limit
    assert np.all(within <= true + eps)
    assert np.all(within >= true - WIDTH * 50.0 - eps)
    assert np.all(values >= -eps)
    assert np.all(np.diff(values) <= eps)
    assert_array_equal(values, rounded.values(-speeds))


@pytest.mark.parametrize(
    "curve",
    [
        ((0.0, 50.0), (1.0, 50.0), (2.0, 10.0)),
        ((0.0, 50.0), (1.0, 30.0), (2.0, 20.0), (3.0, 14.0)),
        ((0.0, 50.0), (0.5, 20.0), (1.5, 20.0), (1.6, 0.0)),
    ],
)
def test_its_slope_equals_differences_inside_corners_and_off_them(curve):
    rounded = RoundedCurve.below(curve)
    h = 1e-3 * rounded.widths.min()
    corners = (
        rounded.corners[:, None] + rounded.widths[:, None] * np.linspace(-1.3, 1.3, 12)
    ).ravel()
    speeds = np.concatenate([corners, -corners, np.linspace(-4.0, 4.0, 23)])
    differences = (rounded.values(speeds + h) - rounded.values(speeds - h)) / (2.0 * h)
    assert_allclose(
        rounded.slopes(speeds), differences, atol=1e-6 * np.abs(rounded.bends).max()
    )


def test_a_level_beginning_is_left_to_the_plain_limit():
    rounded = RoundedCurve.below(((0.0, 50.0), (1.0, 50.0), (2.0, 10.0)))
    assert rounded.stall_torque == pytest.approx(90.0)
    assert_allclose(rounded.values(np.array([1.0, 1.5])), [50.0, 30.0])
    assert RoundedCurve.below(((0.0, 50.0), (1.0, 50.0))) is None
