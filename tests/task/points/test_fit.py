"""Fits stay within their tolerances, with few knots, through both ends; errors are those of an independent formula."""

import numpy as np
import pytest
from numpy.testing import assert_allclose
from scipy.spatial.transform import Rotation

from brachis.common.arrays import with_like_signs
from brachis.errors import TaskError
from brachis.task.point_data import FitTolerance
from brachis.task.points.curves import fit_curves
from support.seams import bent, brute_distances, points, wave

MM = 1e-3


def tolerance(position, orientation=1e-3, corner=None):
    return FitTolerance(position=position, orientation=orientation, corner=corner)


CASES = [
    (12, 0.0, 0.05),
    (300, 0.0, 0.05),
    (2_000, 0.0, 0.001),
    (5_000, 0.05, 0.3),
    (50, 0.01, 0.05),
]


@pytest.mark.parametrize("count, scatter, allowed", CASES)
def test_all_points_are_within_the_tolerance(count, scatter, allowed):
    position = wave(count, scatter * MM)
    (curve,), report = fit_curves(points(position), tolerance(allowed * MM))
    drawn = curve.spline(np.linspace(0.0, curve.spline.t[-1], 3_000))
    chosen = np.arange(0, count, max(1, count // 300))
    distances = brute_distances(position[chosen], drawn)
    assert distances.max() <= allowed * MM
    assert report.position_error <= allowed * MM
    assert report.position_error >= distances.max() - 1e-7
    assert_allclose(drawn[[0, -1]], position[[0, -1]], rtol=1e-15, atol=1e-15)
    assert curve.spline.k == 5
    assert np.diff(np.unique(curve.spline.t)).min() > 0.0
    assert report.intervals == len(np.unique(curve.spline.t)) - 1
    speed = np.linalg.norm(
        curve.spline(np.linspace(0.0, report.length, 500), nu=1), axis=1
    )
    assert np.abs(speed - 1.0).max() < 0.1


def test_few_knots_are_taken():
    """A straight line needs one interval, whatever the number of points; a wave no more than evenly spaced knots."""
    line = np.linspace([0.0, 0.0], [1.0, 0.5], 5_000)
    assert fit_curves(points(line), tolerance(0.01 * MM))[1].intervals == 1
    scattered = line + np.random.default_rng(1).normal(size=line.shape) * 0.02 * MM
    assert fit_curves(points(scattered), tolerance(0.15 * MM))[1].intervals == 1
    looser, tighter = (
        fit_curves(points(wave(3_000)), tolerance(allowed * MM))[1].intervals
        for allowed in (0.5, 0.005)
    )
    assert looser < tighter <= 30


def test_orientations_are_fitted_too():
    position, t = wave(800, 0.01 * MM), np.linspace(0.0, 1.0, 800)
    smooth = np.column_stack([np.sin(2.0 * t), 0.5 * t, 3.0 + 0.0 * t])
    scatter = np.random.default_rng(2).normal(size=(800, 3)) * 2e-4
    turned = Rotation.from_rotvec(smooth) * Rotation.from_rotvec(scatter)
    quaternions = with_like_signs(np.roll(turned.as_quat(canonical=True), 1, axis=1))
    seam = points(position, quaternions)
    (curve,), report = fit_curves(seam, tolerance(0.1 * MM, 2e-3))
    assert 1e-4 < report.orientation_error <= 2e-3
    drawn = curve.spline(np.linspace(0.0, report.length, 5_000))
    gaps = np.linalg.norm(drawn[:, None, :3] - position[::20], axis=2)
    nearest = drawn[np.argmin(gaps, axis=0), 3:]
    fitted = Rotation.from_quat(np.roll(nearest, -1, axis=1))
    assert (fitted.inv() * turned[::20]).magnitude().max() <= 2.1e-3


@pytest.mark.parametrize(
    "count, scatter, allowed",
    [(31, 0.0, 0.05), (300, 0.0, 0.05), (2_000, 0.005, 0.05), (10_000, 0.05, 0.3)],
)
def test_corners_are_found_where_they_are(count, scatter, allowed):
    position, places = bent(count, scatter * MM)
    curves, report = fit_curves(points(position), tolerance(allowed * MM))
    assert len(curves) == 3
    assert_allclose(
        np.rad2deg([corner.angle for corner in report.corners]), [90.0, 40.0], atol=7.0
    )
    for corner, place, curve, following in zip(
        report.corners, places, curves, curves[1:], strict=False
    ):
        end = curve.spline(curve.spline.t[-1])
        assert np.linalg.norm(end - place) < max(4.0 * scatter, 1e-6) * MM
        assert_allclose(end, following.spline(0.0), rtol=1e-14)
        assert corner.blend == curve.blend
        assert np.linalg.norm(position[corner.row] - place) < 1.5e-3
    assert curves[-1].blend is None


def test_corners_between_bends_stay_corners_with_a_wide_tolerance():
    """Lines as long as the tolerance of corners would meet beside the corner, by ten times the scatter."""
    t = np.linspace(0.0, 1.0, 8_001)
    heading = np.where(t > 0.5, 0.9, 0.0) + 0.6 * np.sin(9.0 * t)
    steps = 0.5 / 8_000 * np.column_stack([np.cos(heading), np.sin(heading)])
    position = np.cumsum(steps[:-1], axis=0)
    place = position[4_000]
    position += np.random.default_rng(0).normal(size=position.shape) * 0.01 * MM
    curves, _ = fit_curves(points(position), tolerance(0.06 * MM, corner=5.0 * MM))
    assert len(curves) == 2
    end = curves[0].spline(curves[0].spline.t[-1])
    assert np.linalg.norm(end - place) < 0.08 * MM


def test_smooth_points_have_no_corners():
    angle = np.linspace(0.0, 2.0 * np.pi, 13)
    circle = 0.3 * np.column_stack([np.cos(angle), np.sin(angle)])
    assert fit_curves(points(circle), tolerance(0.05 * MM))[1].corners == ()
    assert (
        fit_curves(points(wave(20_000, 0.05 * MM)), tolerance(0.3 * MM))[1].corners
        == ()
    )


def test_long_straight_ways_are_straight():
    """As CAM writes them: two points for a line, many for an arc."""
    angle = np.linspace(0.0, np.pi, 60)
    arc = np.column_stack([0.5 + 0.1 * np.sin(angle), 0.1 - 0.1 * np.cos(angle)])
    position = np.concatenate([[[0.0, 0.0]], arc, [[0.0, 0.2]]])
    (curve,), report = fit_curves(points(position), tolerance(0.2 * MM))
    assert any(
        "treated as straight: 2 gaps longer than 5 times the usual spacing" in told
        for told in report.told
    )
    on_line = curve.spline(np.linspace(0.02, 0.48, 100))
    assert np.abs(on_line[:, 1]).max() < 0.3 * MM


def test_the_error_says_that_points_scatter_more_than_the_tolerance():
    with pytest.raises(
        TaskError,
        match=r"row \d+: no smooth curve .*scatter by 0.05\d* mm .*tolerance of 0.3 mm or more",
    ):
        fit_curves(points(wave(2_000, 0.05 * MM)), tolerance(0.02 * MM))


def test_the_error_names_a_corner_without_room():
    position, _ = bent(2_000, 0.05 * MM)
    with pytest.raises(
        TaskError,
        match=r"row \d+: the corner of .* cannot be rounded .*larger tolerance.corner",
    ):
        fit_curves(points(position), tolerance(0.3 * MM, corner=0.1 * MM))


@pytest.mark.parametrize("radius", [0.7, 2.0, 7.0, 60.0])
@pytest.mark.parametrize("scatter", [0.0, 0.003])
def test_arcs_have_no_corners_up_to_their_ends(radius, scatter):
    """However small they are beside the tolerance of corners."""
    angle = np.linspace(0.0, 1.7 * np.pi, 400)
    arc = np.column_stack([np.cos(angle), np.sin(angle)])
    arc += np.random.default_rng(3).normal(size=arc.shape) * scatter / 60.0
    assert corners_with_stops(radius * MM * arc) == ()


def test_an_arc_between_lines_is_no_corner_and_where_arcs_meet_is_one():
    angle = np.linspace(0.0, np.pi, 200)
    arc = 7.0 * MM * np.column_stack([np.cos(angle), np.sin(angle)])
    line = np.linspace([7.0 * MM, -20.0 * MM], [7.0 * MM, 0.0], 200)[:-1]
    arcs = np.concatenate([line, arc, arc[1:] - [14.0 * MM, 0.0]])
    assert corners_with_stops(arcs[:399]) == ()
    (corner,) = corners_with_stops(arcs)
    assert corner.row == 398
    assert np.rad2deg(corner.angle) == pytest.approx(180.0, abs=20.0)


def corners_with_stops(position):
    near = tolerance(0.02 * MM, corner=1.0 * MM)
    return fit_curves(points(position), near, stops=True)[1].corners


@pytest.mark.parametrize("count", [1, 2, 20])
def test_every_round_is_compared_with_its_own(count):
    """A circle of 0.2 m that is gone round several times, with a yaw that goes on over all rounds."""
    angle = 2.0 * np.pi * np.linspace(0.0, count, 4_000)
    circle = 0.2 * np.column_stack([np.cos(angle), np.sin(angle)])
    yaw = np.linspace(0.0, np.pi / 2.0, 4_000)[:, None]
    _, report = fit_curves(points(circle, yaw), tolerance(0.1 * MM, np.deg2rad(1.0)))
    assert report.orientation_error < np.deg2rad(0.1)
    assert report.position_error <= 0.1 * MM


@pytest.mark.parametrize("tolerance_mm", [0.02, 0.2])
def test_few_points_that_nearly_repeat_count_once(tolerance_mm):
    """A curve through both would swing into the direction from one to the other."""
    three = np.array([[0.0, 0.0], [0.5, 0.02], [1.0, 0.0]])
    four = np.insert(three, 2, three[1] + [0.0, 1e-9], axis=0)
    (one,), _ = fit_curves(points(three), tolerance(tolerance_mm * MM))
    (other,), report = fit_curves(points(four), tolerance(tolerance_mm * MM))
    assert_allclose(other.spline.c, one.spline.c, atol=1e-12)
    assert "left out 1 row" in report.told[0]
