import numpy as np
import pytest
from numpy.testing import assert_allclose

import brachis
from brachis.apps.view.panel import shown_panels
from support.motions import with_limits, with_tool_speed
from support.shown import ROBOTS


def curves_of(motion, **options):
    samples = motion.at(np.linspace(0.0, motion.t_end, 50))
    return {panel.heading: panel for panel in shown_panels(motion, samples, **options)}


def levels(panel):
    """Limits that are drawn, each by its first value."""
    return [line[0] for line, _ in panel.near_limits()]


def test_a_planned_motion_reaches_its_torque_limits_and_keeps_them(line_result):
    motion = line_result.trajectory
    panel = curves_of(motion)["torque / limit"]
    assert 0.9 < np.abs(panel.values).max() < 1.0001
    assert levels(panel) == [-1.0, 1.0]


def test_joints_without_limits_are_plotted_in_their_units(bare_robot, motion_of):
    motion = with_limits(
        motion_of(bare_robot),
        torque_upper=np.full(2, np.inf),
        torque_lower=np.full(2, -np.inf),
    )
    panels = curves_of(motion)
    assert not {"torque / limit", "force / limit"} & panels.keys()
    force, torque = panels["force (N, no limit)"], panels["torque (Nm, no limit)"]
    assert [curve.name for curve in force.curves] == ["rail"]
    assert [(curve.name, curve.style) for curve in torque.curves] == [("turn", 1)]
    assert_allclose(force.values[:, 0], motion.torque(force.t)[:, 0])
    low, high = torque.view()
    assert low < torque.values.min() <= torque.values.max() < high


@pytest.mark.parametrize("urdf", ROBOTS, ids=lambda path: path.parent.name)
def test_every_robot_has_curves(urdf, motion_of):
    motion = motion_of(getattr(brachis.robots, urdf.parent.name))
    panels = curves_of(motion)
    assert len(panels) >= 4
    assert "tool speed (m/s)" in panels
    for curves in panels.values():
        assert np.isfinite(curves.values).all()
        assert (curves.t[0], curves.t[-1]) == (0.0, motion.t_end)
        assert (np.diff(curves.t) > 0.0).all()
        assert curves.values.shape == (len(curves.t), len(curves.curves))


def test_the_tools_speed_is_in_metres_per_second_beside_what_the_task_allows(
    line_result,
):
    motion = line_result.trajectory
    free = curves_of(motion)["tool speed (m/s)"]
    assert_allclose(free.values[:, 0], motion.at(free.t).tool_speed)
    assert levels(free) == []
    limit = 1.1 * free.values.max()
    capped = curves_of(with_tool_speed(motion, limit))["tool speed (m/s)"]
    assert levels(capped) == [pytest.approx(limit)]
    assert levels(capped)[0] < capped.view()[1]


def test_angles_without_limits_may_be_in_degrees(bare_robot, motion_of):
    motion = motion_of(bare_robot)
    motion = with_limits(
        motion, velocity_upper=np.full(2, np.inf), velocity_lower=np.full(2, -np.inf)
    )
    samples = motion.at(np.linspace(0.0, motion.t_end, 50))
    panels = curves_of(motion, degrees=True)
    turning = panels["velocity (deg/s, no limit)"]
    sliding = panels["velocity (m/s, no limit)"]
    assert_allclose(turning.values[:, 0], np.rad2deg(samples.qdot[:, 1]))
    assert_allclose(sliding.values[:, 0], samples.qdot[:, 0])
