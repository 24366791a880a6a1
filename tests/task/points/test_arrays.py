"""Points from arrays: what is wrong with them is said."""

from __future__ import annotations

import numpy as np
import pytest

import brachis
from brachis.errors import TaskError
from brachis.task.point_data import FileUnits
from brachis.task.points.points import points_from

POINTS = np.linspace([0.0, 0.0, 0.0], [0.1, 0.2, 0.3], 20)
WRONG = [
    (np.full(20, np.inf), r"row 0: a speed must be positive and finite"),
    (np.full(20, -0.1), r"row 0: a speed must be positive and finite"),
    (np.ones((20, 3)), r"the speeds have the wrong shape; found \(20, 3\)"),
    (["a"] * 20, r"not an array of numbers"),
    (np.ones(19), r"the numbers of points and of rows of speed differ"),
]


@pytest.mark.parametrize(("speed", "message"), WRONG)
def test_wrong_speeds_are_named(speed, message):
    with pytest.raises(TaskError, match=message):
        points_from(POINTS, None, speed, FileUnits(), "points")


def test_no_speed_may_be_prescribed_in_places():
    speed = np.where(np.arange(20) < 5, np.nan, 0.1)
    np.testing.assert_array_equal(
        points_from(POINTS, None, speed, FileUnits(), "points").speed, speed
    )


def test_empty_arrays_are_refused():
    with pytest.raises(TaskError, match=r"wrong shape; found \(0, 3\)"):
        points_from(np.empty((0, 3)), None, None, FileUnits(), "points")


def test_feed_rates_without_a_tolerance_are_refused_not_lost():
    with pytest.raises(TaskError, match="feed rates need a fitted path"):
        brachis.fit_path(POINTS, speed=np.full(20, 0.01))
