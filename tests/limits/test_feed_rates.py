"""Feed rates of a path's points are largest speeds of the tool, in the plan and in its verification."""

import dataclasses

import numpy as np
import pytest

import brachis
from brachis import LimitSpec
from brachis.limits import Moments, limits_of
from brachis.task import SpeedTable, task_with
from support.arrays import assert_near
from support.chains import gantry_robot
from support.checks import check_of

SLOW, FAST = 0.2, 0.6
FREE = range(120, 180)
"""Rows of the 300 on whose way no speed is prescribed."""


def line(speed):
    """A gantry's task along 1 m."""
    points = np.column_stack([np.linspace(0.0, 1.0, 300), np.zeros(300)])
    path = brachis.fit_path(
        points, tolerance={"position": "0.01 mm"}, speed=speed, relative=True
    )
    return task_with(
        start=[0.0, 0.0],
        task_space=["x", "y"],
        path=path,
        intervals=24,
        least_motion=False,
    )


@pytest.fixture(scope="module")
def robot():
    limits = LimitSpec(torque=None, acceleration=5.0, velocity=2.0, position=None)
    return gantry_robot([[1.0, 0.0, 0.0], [0.0, 1.0, 0.0]], limits=limits)


@pytest.fixture(scope="module")
def rates():
    speed = np.full(300, FAST)
    speed[: FREE[0]] = SLOW
    speed[FREE] = np.nan
    return speed


def test_speeds_are_held_where_they_are_prescribed_and_nowhere_else(robot, rates):
    free, held = (brachis.plan(robot, line(speed)) for speed in (None, rates))
    assert free.verified
    assert held.verified
    assert held.t_end > 1.2 * free.t_end
    t = np.linspace(0.0, held.t_end, 2001)
    sample = held.trajectory.at(t)
    speed = np.linalg.norm(sample.qdot, axis=1)
    first, second = held.task.tool_limits.feed
    for table, figure in ((first, SLOW), (second, FAST)):
        inside = (sample.s >= table.s[0]) & (sample.s <= table.s[-1])
        assert 0.98 * figure < speed[inside].max() < (1.0 + 1e-4) * figure
    between = (sample.s > first.s[-1]) & (sample.s < second.s[0])
    assert speed[between].max() > 1.1 * FAST
    # The plan without feed rates is no motion for the task with them.
    verification = brachis.verify_trajectory(
        dataclasses.replace(free.trajectory, task=held.task)
    )
    assert check_of(verification, "tool speed ratio").value > 2.0


def test_partials_of_tables_over_parts_of_the_path(robot):
    feed = (
        SpeedTable(s=[0.2, 0.4], speed=[0.3, 0.5]),
        SpeedTable(s=[0.6, 0.9], speed=[0.7, 0.2]),
    )
    task = task_with(line(None), tool_limits={"speed": 0.5, "feed": feed})
    (limit,) = (each for each in limits_of(robot, task) if each.kind == "tool_speed")
    s, h = np.array([0.197, 0.3, 0.403, 0.5, 0.7, 0.902]), 1e-6
    q, qdot = np.random.default_rng(2).normal(size=(2, 6, 2))

    def at(places):
        return Moments(q, qdot, 0.0 * q, 0.0 * q, places)

    expected = (limit.values(at(s + h)) - limit.values(at(s - h))) / (2.0 * h)
    assert_near(limit.partials(at(s)).s, expected, 1e-6)
    assert np.count_nonzero(np.abs(expected) > 1e-3) == 5
