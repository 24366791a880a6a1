"""Curves of SciPy's and functions as segments: exact or within the tolerance, and refused where they are not smooth."""

import numpy as np
import pytest
from numpy.testing import assert_allclose
from scipy.interpolate import BSpline, CubicSpline, PPoly, make_interp_spline

from brachis import InputError, bspline_segment
from brachis.path import build_path
from brachis.robot.task_map.protocol import joint_rows
from brachis.task import task_with
from support.arrays import assert_near

RNG = np.random.default_rng(0)
TIMES, WAYPOINTS = (
    np.array([0.0, 0.3, 0.7, 1.5, 2.0, 2.2]),
    RNG.uniform(-1.0, 1.0, (6, 3)),
)
QUINTIC = make_interp_spline(TIMES, WAYPOINTS, k=5)
U = np.linspace(0.0, 1.0, 101)


def along(segment, start):
    """The path that a task with this segment alone describes, at U."""
    path = task_with(start=start, task_space="joints", path=[segment]).path
    return build_path(path, start, joint_rows(["a", "b", "c"])).derivatives(U)


@pytest.mark.parametrize(
    "knots",
    [None, np.sort(np.append(RNG.uniform(-1.0, 3.0, 10), np.arange(-6.0, 10.0)))],
)
def test_splines_are_taken_exactly(knots):
    """Clamped or not."""
    curve = (
        QUINTIC
        if knots is None
        else BSpline(knots, RNG.uniform(-1.0, 1.0, (len(knots) - 6, 3)), 5)
    )
    first, last = curve.t[5], curve.t[-6]
    found = along(bspline_segment(curve), curve(first))
    for order in range(4):
        expected = curve(first + U * (last - first), nu=order) * (last - first) ** order
        assert_near(found[order], expected, 1e-9, least=1.0)


def test_piecewise_polynomials_and_parts_of_them():
    cubic = PPoly(
        np.array(
            [[[1.0, 0.0, 2.0]], [[0.0, 1.0, 0.0]], [[0.0, 0.0, 1.0]], [[0.1, 0.2, 0.3]]]
        ),
        [0.0, 2.0],
    )
    found = along(bspline_segment(cubic, (0.5, 1.0)), cubic(0.5))
    assert_allclose(found[0], cubic(0.5 + 0.5 * U), atol=1e-13)


def test_functions_are_met_within_the_tolerance():
    def curve(u):
        return np.sin(3.0 * u), np.exp(-u), u**2

    for tolerance in (1e-6, 1e-10):
        segment = bspline_segment(curve, (0.0, 2.0), tolerance=tolerance)
        found = along(segment, curve(0.0))[0]
        assert_allclose(found, np.transpose(curve(2.0 * U)), atol=2.0 * tolerance)
    assert len(segment["bspline"]["knots"]) < 300


@pytest.mark.parametrize(
    "curve, more, words",
    [
        (CubicSpline(TIMES, WAYPOINTS), (), "derivative 3 at .*make_interp_spline"),
        (lambda u: (abs(u - 0.4), u, u), ((0.0, 1.0),), "not smooth enough"),
        (lambda u: (u, u, u), (), "interval"),
        (lambda u: (u, u, u), ((1.0, 0.0),), "is not an interval"),
        (lambda u: (u, u, np.nan), ((0.0, 1.0),), "m finite numbers"),
        (lambda u: u, ((0.0, 1.0),), "m finite numbers"),
    ],
)
def test_curves_that_are_not_smooth_are_errors(curve, more, words):
    with pytest.raises(InputError, match=words):
        bspline_segment(curve, *more)
