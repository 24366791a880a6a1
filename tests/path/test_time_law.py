"""The time law of a given speed: s(t) by hand on lines, the speed at all times elsewhere, its derivatives and ends."""

import numpy as np
import pytest
from numpy.testing import assert_allclose

import brachis
from brachis.errors import PathError
from brachis.path import Leg, path_of, time_law_of
from brachis.robot import bind, task_map_of
from brachis.task import task_with

LINE = {"line": {"by": [0.2, 0.0, 0.0]}}
UP = {"line": {"by": [0.0, 0.0, 0.2]}}
WAVE = [[0.05, 0.05, 0.0], [0.15, -0.05, 0.05], [0.2, 0.1, 0.0], [0.3, 0.1, 0.1]]
SPLINE = {"spline": {"through": WAVE, "relative": True}}
CIRCLE = {"circle": {"center": [0.5, 0.0, 0.5], "normal": [0, 0, 1], "turns": 3}}
POSE = {"position": [0.4, 0.0, 0.5], "rpy_deg": [180, 0, 0]}


def path_and_map(segments, space="position"):
    keys = {
        "start": "free",
        "path_start": POSE if space == "pose" else POSE["position"],
    }
    if space == "joints":
        keys = {"start": [0.0, 0.5, 0.0, -1.0, 0.0, 0.5, 0.0]}
    task = task_with(**keys, task_space=space, path=segments)
    _, task_map = bind(brachis.robots.iiwa14, task.task_space)
    return task_map, path_of(task_map, task)


def law_of(leg, task_map, path):
    law = time_law_of(leg, task_map, path)
    assert law is not None
    return law


@pytest.mark.parametrize("segment, length", [(LINE, 0.2), (CIRCLE, 0.6 * np.pi)])
def test_it_is_linear_on_lines_and_circles(segment, length):
    task_map, path = path_and_map([segment])
    law = law_of(Leg(0.2, 0.7, speed=0.1), task_map, path)
    assert law.spline.k == 1
    assert law.duration == pytest.approx(0.5 * length / 0.1, rel=1e-12)
    s, *rates = law.at(np.linspace(0.0, law.duration, 5))
    assert_allclose(s, np.linspace(0.2, 0.7, 5), atol=1e-14)
    assert_allclose(rates[0], 0.1 / length, rtol=1e-12)
    assert np.abs(rates[1:]).max() == 0.0
    assert_allclose(law.ends[-1], [0.7, 0.1 / length, 0, 0], rtol=1e-12)


def test_a_free_leg_has_none():
    assert time_law_of(Leg(0.0, 1.0), *path_and_map([LINE])) is None


WINDING = [[0.3, 0.7, 0.1, -1.2, 0.2, 0.7, 0.1], [0.6, 0.6, 0.3, -1.0, 0.4, 0.5, 0.5]]
CASES = {
    "blend": ([{**LINE, "blend": 0.05}, UP], "position"),
    "spline": ([SPLINE], "position"),
    "turning": ([{**SPLINE, "orientation": "tangent"}], "pose"),
    "joints": ([{"spline": {"through": WINDING}}], "joints"),
}


@pytest.fixture(scope="module", params=CASES)
def case(request):
    task_map, path = path_and_map(*CASES[request.param])
    return task_map, path, law_of(Leg(0.1, 0.9, speed=0.3), task_map, path)


def speeds(task_map, path, s, rate):
    """Speed of the tool, (K,), m/s; of a path of joints by Jacobians."""
    sample = path.sample(s)
    velocity = sample.xi[:, :3]
    if not task_map.axes:
        tool = task_map_of(task_map.robot, "position")
        jacobian = tool.jacobian(tool.twists(sample.target))
        velocity = np.einsum("kij,kj->ki", jacobian, sample.xi)
    return np.linalg.norm(velocity, axis=1) * rate


def test_the_speed_is_met_at_all_times(case):
    task_map, path, law = case
    s, rate, *_ = law.at(np.linspace(0.0, law.duration, 5_001))
    steady = np.full(len(s), rate.mean())
    off = np.abs(speeds(task_map, path, s, steady) / 0.3 - 1.0).max()
    assert off > 0.02, "a linear law would not meet it"
    assert np.abs(speeds(task_map, path, s, rate) / 0.3 - 1.0).max() < 1e-9
    assert s[[0, -1]] == pytest.approx([0.1, 0.9], abs=1e-14)


def test_derivatives_equal_differences_and_continue(case):
    *_, law = case
    t = np.linspace(0.01, 0.99, 301) * law.duration
    h = 1e-5 * law.duration
    before, now, after = (law.at(t + step) for step in (-h, 0.0, h))
    slopes = (after - before)[:3] / (2.0 * h)
    for order in range(3):
        size = np.abs(now[order + 1]).max()
        assert_allclose(slopes[order], now[order + 1], atol=2e-4 * size)
    knots = np.unique(law.spline.t)[1:-1]
    tiny = 1e-12 * law.duration
    jump = np.abs(law.at(knots + tiny) - law.at(knots - tiny)).max(axis=1)
    assert np.all(jump < 1e-6 * np.abs(now).max(axis=1))


def turning_back(width):
    """A spline that turns back within a few widths, m."""
    through = [[0.1, 0.0, 0.0], [0.0, width, 0.0], [0.1, 2.0 * width, 0.0]]
    return path_and_map([{"spline": {"through": through, "relative": True}}])


def test_a_narrow_turn_is_passed_to_the_rounding_of_times():
    task_map, path = turning_back(1e-4)
    law = law_of(Leg(0.1, 0.9, speed=0.1), task_map, path)
    s, rate, *_ = law.at(np.linspace(0.0, law.duration, 5_001))
    off = np.abs(speeds(task_map, path, s, rate) / 0.1 - 1.0)
    assert off.max() < 1e-7
    assert np.quantile(off, 0.9) < 1e-9


def test_a_cusp_has_no_constant_speed(monkeypatch):
    monkeypatch.setattr("brachis.path.time_law._MOST_INTERVALS", 1000)  # for time
    task_map, path = turning_back(0.0)
    with pytest.raises(PathError, match="bends too abruptly") as caught:
        time_law_of(Leg(0.1, 0.9, speed=0.1), task_map, path)
    assert caught.value.s_interval is not None
    assert min(abs(caught.value.s_interval[0] - at) for at in (0.264, 0.736)) < 1e-2


def test_its_ends_are_those_of_the_spline(case):
    *_, law = case
    ends = law.at(np.array([0.0, law.duration])).T
    assert_allclose(law.ends, ends, rtol=1e-5, atol=1e-6)
