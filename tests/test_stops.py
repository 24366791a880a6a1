"""Stops and dwells, planned: known optima of a gantry; a tool that turns on the spot; corners of a file."""

import numpy as np
import pytest
from numpy.testing import assert_allclose

import brachis
from support.effort import QUICK

ACCELERATION = 200.0 / 25.0
"""Of the gantry's bridge and tool, m/s^2."""
DWELL = 0.5


def right(distance, **keys):
    return brachis.Line(by=[distance, 0.0], **keys)


def up(distance, **keys):
    return brachis.Line(by=[0.0, distance], **keys)


def plan(path, **keys):
    return brachis.plan(
        "gantry2",
        limits={"velocity": None},
        start=[-0.6, 0.0],
        task_space=["x", "y"],
        path=path,
        intervals=20,
        rest="velocity",
        **QUICK,
        **keys,
    )


def from_rest(distance):
    """Least time from rest to rest over a way in x, by full force either way."""
    return float(2.0 * np.sqrt(distance / ACCELERATION))


def test_legs_between_stops_take_the_least_time():
    result = plan(right(0.5, stop=True) + right(0.2, dwell=DWELL) + right(0.5))
    assert result.verified
    ways = [from_rest(0.5), from_rest(0.2), DWELL, from_rest(0.5)]
    assert_allclose(np.diff(result.trajectory.phase_ends, prepend=0.0), ways, rtol=2e-3)
    states = result.trajectory.at(result.trajectory.phase_ends)
    assert_allclose(states.s, [5 / 12, 7 / 12, 7 / 12, 1.0], atol=1e-12)
    assert np.abs(states.qdot).max() < 1e-9
    at_once = plan(right(1.2))
    assert at_once.t_end < 0.7 * (result.t_end - DWELL)


def test_the_tool_passes_a_corner_exactly():
    result = plan(right(0.5, stop=True) + up(0.3))
    assert result.verified
    trajectory = result.trajectory
    t = np.linspace(0.0, trajectory.t_end, 4001)
    positions, _ = trajectory.robot.tool_placements(trajectory.at(t).q)
    x, y = (positions - positions[0])[:, :2].T
    assert np.minimum(np.abs(x - 0.5), np.abs(y)).max() < 1e-9
    assert x.max() == pytest.approx(0.5, abs=1e-9)


def test_a_periodic_motion_may_stop():
    """It starts in motion: half of the side before the first stop is left for the end."""
    there = right(0.2, stop=True) + up(0.2, stop=True)
    back = right(-0.4, stop=True) + up(-0.2, stop=True)
    result = plan(there + back + right(0.2), periodic=True)
    assert result.verified
    first, *_, last = np.diff(result.trajectory.phase_ends, prepend=0.0)
    assert first + last == pytest.approx(from_rest(0.4), rel=2e-3)


def test_a_tool_turns_on_the_spot_between_lines():
    line = {"line": {"by": [0.0, 0.4, 0.0]}}
    turn = {"turn": {"rotate": {"axis": [0, 0, 1], "angle_deg": 60}}, "dwell": 0.2}
    path = [{**line, "stop": True}, turn, line]
    result = brachis.plan(brachis.examples.tx90l_rail_line, path=path, **QUICK)
    assert result.verified
    before, turned, waited, _ = result.trajectory.phase_ends
    assert waited - turned == pytest.approx(0.2, abs=1e-12)
    q = result.trajectory.position([before, turned])
    positions, rotations = result.trajectory.robot.tool_placements(q)
    np.testing.assert_allclose(positions[0], positions[1], atol=1e-9)
    cosine = 0.5 * (np.trace(rotations[0].T @ rotations[1]) - 1.0)
    assert np.degrees(np.arccos(cosine)) == pytest.approx(60.0, abs=1e-6)
