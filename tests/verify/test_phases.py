"""Stops, dwells and given speeds are verified: the motion by hand passes, and each check finds its fault."""

from dataclasses import replace

import numpy as np
import pytest

from brachis.verify import verify_trajectory
from support.checks import check_of, failing_checks, with_entry
from support.gantry import DEGREE, DWELL, SPEED, SPLINES, TASK, gantry_motion, quintic


def value_of(trajectory, name):
    return check_of(verify_trajectory(trajectory), name).value


def with_curve(phase, place, by):
    """The splines of the motion, with a control point of one phase's s(t) moved."""
    spline = SPLINES[phase]
    points = spline.control_points.copy()
    points[0, place] += by
    return (
        *SPLINES[:phase],
        replace(spline, control_points=points),
        *SPLINES[phase + 1 :],
    )


def with_acceleration(spline, at_begin):
    """The spline with an acceleration at its beginning or its end, where it rests."""
    points = spline.control_points.copy()
    place = 2 if at_begin else 3
    points[:, place] += np.array([0.01, 0.002]) * (1.0 if at_begin else -1.0)
    return replace(spline, control_points=points)


def test_the_motion_passes():
    assert failing_checks(gantry_motion()) == set()


@pytest.mark.parametrize("duration", [0.9 * DWELL, DWELL + 1e-6])
def test_a_dwell_of_another_length(duration):
    splines = (SPLINES[0], replace(SPLINES[1], t_end=duration), *SPLINES[2:])
    motion = gantry_motion(splines)
    assert failing_checks(motion) == {"duration of dwells"}
    off = value_of(motion, "duration of dwells")
    assert off == pytest.approx(abs(duration - DWELL), rel=1e-6)


def test_a_dwell_that_is_missing():
    """It is missed, and one that nobody asked for is found."""
    without = SPLINES[0], *SPLINES[2:]
    assert failing_checks(gantry_motion(without)) == {"duration of dwells"}
    (line, *rest) = TASK["path"]
    path = [{"line": line["line"], "stop": True}, *rest]
    assert failing_checks(gantry_motion(path=path)) == {"duration of dwells"}
    assert failing_checks(gantry_motion(without, path=path)) == set()


def test_a_stop_without_rest():
    """The tool passes the corner at a speed."""
    before = quintic(1.0, (0.0, 0.0), (0.4, 0.1))
    behind = quintic(1.0, (0.4, 0.1), (0.55, SPEED))
    found = failing_checks(gantry_motion((before, behind, *SPLINES[3:])))
    assert "velocity at stops" in found


def test_a_stop_at_another_place():
    before = quintic(1.0, (0.0, 0.0), (0.39, 0.0))
    dwell = quintic(DWELL, (0.39, 0.0), (0.39, 0.0))
    behind = quintic(1.0, (0.39, 0.0), (0.55, SPEED))
    motion = gantry_motion((before, dwell, behind, *SPLINES[3:]))
    assert {"s at stops", "velocity at stops"} <= failing_checks(motion)
    assert value_of(motion, "s at stops") == pytest.approx(0.01)


def test_an_acceleration_at_a_stop_is_for_rest_in_velocity_alone():
    splines = (
        with_acceleration(SPLINES[0], at_begin=False),
        SPLINES[1],
        with_acceleration(SPLINES[2], at_begin=True),
        *SPLINES[3:],
    )
    spline = {"degree": DEGREE, "rest": "velocity"}
    assert failing_checks(gantry_motion(splines, spline=spline)) == set()
    found = failing_checks(gantry_motion(splines))
    assert found == {"acceleration at stops", "acceleration jump", "torque jump"}


def test_a_jump_at_a_flying_link_is_refused_in_any_case():
    """The acceleration at a link between a free and a given speed jumps."""
    splines = (*SPLINES[:4], with_acceleration(SPLINES[4], at_begin=True))
    motion = gantry_motion(splines, spline={"degree": DEGREE, "rest": "velocity"})
    assert failing_checks(motion) == {"acceleration jump", "torque jump"}


def test_a_motion_in_a_dwell():
    motion = gantry_motion(spline={"degree": DEGREE, "rest": "velocity"})
    rates = [0.1, -0.1, 0.0]  # the tool stays
    failed = failing_checks(with_entry(motion, "qddot_before", 2, rates))
    assert "velocity in dwells" in failed
    assert not failed & {"velocity at stops", "path error"}


@pytest.mark.parametrize("factor, passes", [(1.0 + 5e-7, True), (1.0 + 2e-6, False)])
def test_another_speed_than_the_given_one(factor, passes):
    limits = {"process_speed": {"speed": factor * SPEED, "s": [0.55, 0.85]}}
    motion = gantry_motion(tool_limits=limits)
    assert failing_checks(motion) == (set() if passes else {"process speed"})
    assert value_of(motion, "process speed") == pytest.approx(factor - 1.0, rel=1e-3)


def test_a_given_speed_that_begins_elsewhere():
    limits = {"process_speed": {"speed": SPEED, "s": [0.56, 0.85]}}
    found = failing_checks(gantry_motion(tool_limits=limits))
    assert found == {"s where process speeds begin and end"}


@pytest.mark.parametrize(
    "phase, place, by, check",
    [
        (3, 2, 1e-5, "process speed"),  # at both ends it is as given, as is its mean
        (2, 1, -1e-6, "ds/dt below zero"),
        (2, 0, 1e-6, "s where phases meet"),
    ],
)
def test_a_control_point_that_is_off(phase, place, by, check):
    assert check in failing_checks(gantry_motion(with_curve(phase, place, by)))


def test_holding_torque_in_a_dwell_counts():
    motion = gantry_motion(robot={"limits": {"rms_torque": 50.0}})
    t = np.linspace(0.0, motion.t_end, 5_001)
    mean = np.sqrt(np.trapezoid(motion.torque(t) ** 2, t, axis=0) / motion.t_end)
    assert motion.torque(1.25)[2] == pytest.approx(2.0 * 9.81, rel=1e-3)
    assert value_of(motion, "rms torque ratio") == pytest.approx(
        mean.max() / 50.0, rel=1e-4
    )


def test_a_part_with_a_given_speed_is_checked_to_its_ends():
    """The ends of the phases are rounded."""
    limits = {"process_speed": {"speed": 1.5 * SPEED, "s": [0.55, 0.85]}}
    motion = gantry_motion(tool_limits=limits)
    for rounding in (1.0 - 1e-15, 1.0 + 1e-15):
        ends = motion.phase_ends * rounding
        ends[-1] = motion.t_end
        moved = replace(motion, phase_ends=ends)
        assert value_of(moved, "process speed") == pytest.approx(1.0 / 3.0)
        assert "velocity at stops" not in failing_checks(moved)


def test_a_stop_between_nodes_is_looked_at_where_it_is_said_to_be():
    """The phase ends 0.1 s late: s is where it should be, and the arm is in motion."""
    late = with_entry(gantry_motion(), "phase_ends", 1, 0.1)
    assert "velocity at stops" in failing_checks(late)
