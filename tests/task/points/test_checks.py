"""What is wrong with points is named, with its row."""

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from brachis.common.arrays import with_like_signs
from brachis.errors import TaskError
from brachis.task.point_data import FitTolerance
from brachis.task.points.checks import (
    decimals_of,
    plausibility_note,
    refuse_spikes,
    scatter_of,
    without_repetitions,
)
from brachis.task.points.curves import cut_at_corners, fit_curves
from support.seams import bent, points, wave

MM = 1e-3


def spikes(position):
    seam = points(position)
    refuse_spikes(seam, scatter_of(seam), 0.05 * MM)


@pytest.mark.parametrize("scatter", [0.0, 0.02])
def test_the_error_names_the_row_of_a_spike(scatter):
    position = wave(2_000, scatter * MM)
    spikes(position)
    position[1_234] += [0.0, 5.0 * MM, 0.0]
    with pytest.raises(
        TaskError,
        match=r"row 1234: the point is an outlier, .* 4.78\d* mm off .*remove the row",
    ):
        spikes(position)


@pytest.mark.parametrize("count, scatter", [(300, 0.0), (10_000, 0.05 * MM)])
def test_corners_are_no_spikes_and_spikes_beside_them_are(count, scatter):
    position = bent(count, scatter)[0]
    spikes(position)
    position[count // 5] += [0.0, 0.0, 50.0 * MM]
    with pytest.raises(TaskError, match=f"row {count // 5}: the point is an outlier"):
        spikes(position)


def test_the_error_names_a_factor_of_a_thousand():
    away = np.array([0.5, 0.2, 0.1])
    position = wave(100) + away
    position[60] *= 1e3
    with pytest.raises(
        TaskError,
        match=r"row 60: the coordinates are a thousand times larger than in row 59.*mm and m",
    ):
        spikes(position)
    position[60:] = (wave(100) + away)[60:] / 1e3
    with pytest.raises(
        TaskError,
        match=r"row 60: the coordinates are a thousand times smaller than in row 59",
    ):
        spikes(position)


def test_a_note_doubts_a_file_in_other_units():
    assert plausibility_note(points(wave(100))) is None
    assert "is it in mm? Set units: {length: mm}" in str(
        plausibility_note(points(1e3 * wave(100)))
    )
    assert "is it in m? Set units: {length: m}" in str(
        plausibility_note(points(1e-5 * wave(100)))
    )


def test_notes_list_rows_that_repeat():
    position = np.repeat(wave(10), [1, 2, 1, 1, 1, 3, 1, 1, 1, 1], axis=0)
    kept = without_repetitions(points(position))
    np.testing.assert_array_equal(kept.position, wave(10))
    assert kept.notes == (
        "left out 3 rows at the position of the previous row: rows 2, 7, 8",
    )
    assert without_repetitions(points(wave(10))).notes == ()


def test_a_turn_on_the_spot_is_an_error():
    position, yaw = np.repeat(wave(4)[:, :2], 2, axis=0), np.arange(8.0)[:, None] / 10.0
    with pytest.raises(
        TaskError,
        match=r"row 1: the position is constant from row 0 on while the tool turns",
    ):
        without_repetitions(points(position, yaw))
    with pytest.raises(TaskError, match="all rows have the same position"):
        without_repetitions(points(np.zeros((5, 2))))


@pytest.mark.parametrize("scatter", [0.001, 0.02])
@pytest.mark.parametrize("count", [200, 5_000])
def test_the_estimate_of_scatter_is_close(scatter, count):
    found = scatter_of(points(wave(count, scatter * MM))).deviation
    assert 0.6 * scatter * MM < found < 1.3 * scatter * MM


@pytest.mark.parametrize(
    "position", [wave(200), bent(60)[0], wave(12, 1.0), wave(3_000)[:, :1]]
)
def test_smooth_and_few_points_do_not_scatter(position):
    assert scatter_of(points(position)).deviation < 1e-12


def test_unevenly_spaced_smooth_points_do_not_scatter():
    t = np.sort(np.random.default_rng(3).uniform(0.0, 1.0, 500))
    curve = np.column_stack([np.cos(3.0 * t), np.sin(3.0 * t)])
    assert scatter_of(points(curve)).deviation < 1e-6


def test_rounding_is_told_from_scatter():
    rounded = np.round(wave(2_000), 6)
    assert decimals_of(rounded) == 6
    assert decimals_of(wave(100)) is None
    with pytest.raises(TaskError) as caught:
        cut_at_corners(points(rounded))
    message = str(caught.value)
    for text in (
        "too rough",
        "the curvature would be noise",
        "rounded to 1e-06 m at 0.",
        "tolerance: {position:",
    ):
        assert text in message
    cut_at_corners(points(np.round(wave(2_000), 12)))
    cut_at_corners(points(wave(2_000)))
    with pytest.raises(
        TaskError,
        match=r"scatter by 0.02\d* mm \(standard deviation\) at 0.5\d* mm spacing",
    ):
        cut_at_corners(points(wave(2_000, 0.02 * MM)))


def test_orientations_that_scatter_are_told_from_smooth_ones():
    position, t = wave(1_000), np.linspace(0.0, 1.0, 1_000)
    noise = np.random.default_rng(6).normal(size=(1_000, 3)) * 1e-3
    turns = Rotation.from_rotvec(np.column_stack([np.sin(t), t, 3.0 * t]))
    for turned, least, most in (
        (turns, 0.0, 1e-12),
        (turns * Rotation.from_rotvec(noise), 0.8e-3, 1.2e-3),
    ):
        given = points(position, with_like_signs(np.roll(turned.as_quat(), 1, axis=1)))
        assert least <= scatter_of(given).turning <= most
    with pytest.raises(
        TaskError,
        match=r"tolerance of orientation; .*orientations that scatter by 0.05\d* deg",
    ):
        fit_curves(given, FitTolerance(position=0.05 * MM, orientation=1e-3))
