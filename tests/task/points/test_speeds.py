"""Speeds of points become tables along the curve that are nowhere above what was prescribed."""

import numpy as np

from brachis.task.points.curves import speed_runs

NAN = float("nan")


def test_constant_speeds_need_two_entries():
    assert speed_runs(np.arange(5.0), np.full(5, 0.1)) == (((0.0, 0.1), (4.0, 0.1)),)
    assert speed_runs(np.arange(5.0), None) == ()


def test_a_point_takes_the_lower_speed_of_its_ways():
    sigma, speed = np.arange(6.0), np.array([NAN, 0.2, 0.2, 0.1, 0.1, 0.3])
    (run,) = speed_runs(sigma, speed)
    assert run == ((0.0, 0.2), (1.0, 0.2), (2.0, 0.1), (4.0, 0.1), (5.0, 0.3))
    middle = (sigma[1:] + sigma[:-1]) / 2.0
    assert np.all(np.interp(middle, *np.transpose(run)) <= speed[1:])


def test_rapid_moves_have_none():
    runs = speed_runs(np.arange(7.0), np.array([NAN, 0.1, 0.1, NAN, 0.2, 0.2, NAN]))
    assert runs == (((0.0, 0.1), (2.0, 0.1)), ((3.0, 0.2), (5.0, 0.2)))
