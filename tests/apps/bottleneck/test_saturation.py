"""Which limit is active when, on motions made by hand."""

import dataclasses

import numpy as np
import pytest

from brachis.apps.bottleneck import limit_ratios, saturations

from .conftest import FORCE, MASS

T = 2.0


@pytest.fixture(scope="module")
def motion_with(slide):
    """A trajectory of the two slides whose first one has a given piecewise linear acceleration in m/s^2."""
    base = slide(degree=2, intervals=4).trajectory

    def make(times, after, before):
        times, after, before = np.array([times, after, before], dtype=float)
        h = np.diff(times)
        first, last = after[:-1], before[1:]
        qdot = np.concatenate([[0.0], np.cumsum(h * 0.5 * (first + last))])
        q = np.concatenate(
            [[0.0], np.cumsum(h * qdot[:-1] + h**2 * (first / 3.0 + last / 6.0))]
        )
        still = np.zeros_like(q)
        columns = {"q": q, "qdot": qdot, "qddot": after, "qddot_before": before}
        stacked = {
            name: np.stack([column, still], axis=1) for name, column in columns.items()
        }
        return dataclasses.replace(base, times=times, **stacked)

    return make


LIMIT = FORCE / (2.0 * MASS)


def force_of(trajectory):
    (entry,) = [e for e in saturations(trajectory) if str(e.label) == "j1 force"]
    return entry


def test_full_force_for_a_part_of_the_time(motion_with):
    trajectory = motion_with([0.0, 0.3 * T, T], [LIMIT, 0.0, 0.0], [LIMIT, LIMIT, 0.0])
    entry = force_of(trajectory)
    assert entry.share == pytest.approx(0.3, abs=1e-12)
    (interval,) = entry.active
    assert (interval.begin, interval.side) == (0.0, "upper")
    assert interval.end == pytest.approx(0.3 * T)
    assert entry.peak == pytest.approx(1.0)


def test_both_directions_count(motion_with):
    turn = [0.0, 0.25 * T, 0.75 * T, T]
    entry = force_of(
        motion_with(turn, [0.0, LIMIT, -LIMIT, 0.0], [0.0, 0.0, LIMIT, -LIMIT])
    )
    assert entry.share == pytest.approx(0.75, abs=1e-12)
    assert [stretch.side for stretch in entry.active] == ["upper", "lower"]
    assert entry.active[1].begin == entry.active[0].end == pytest.approx(0.75 * T)


def test_the_threshold_is_met_between_grid_points(motion_with):
    ramp = motion_with([0.0, T], [0.0, LIMIT], [0.0, LIMIT])
    assert force_of(ramp).share == pytest.approx(1e-2, rel=1e-6)
    steep = motion_with([0.0, T], [0.0, 1.7 * LIMIT], [0.0, 1.7 * LIMIT])
    entry = force_of(steep)
    assert entry.share == pytest.approx(1.0 - 0.99 / 1.7, rel=1e-9)
    assert entry.active[0].begin == pytest.approx(0.99 / 1.7 * T)


def rippling(motion_with, lowest):
    """A force at its limit with one dip in the middle of the motion."""
    times = [0.0, 0.4 * T, 0.5 * T, 0.6 * T, T]
    forces = np.array([1.0, 1.0, lowest, 1.0, 1.0]) * LIMIT
    return force_of(motion_with(times, forces, forces))


def test_ripple_interrupts_no_stretch(motion_with):
    entry = rippling(motion_with, 0.955)
    assert [(stretch.begin, stretch.end) for stretch in entry.active] == [(0.0, T)]
    assert entry.share == 1.0


def test_a_deeper_dip_does(motion_with):
    entry = rippling(motion_with, 0.9)
    assert len(entry.active) == 2
    below = (
        2.0 * 0.1 * 0.9
    )  # each flank is 0.1 of the time long and below the threshold for nine tenths of it
    assert entry.share == pytest.approx(1.0 - below)


def test_a_motion_near_its_limit_that_never_reaches_it_does_not_count(motion_with):
    times, forces = [0.0, 0.5 * T, T], np.array([0.96, 0.985, 0.96]) * LIMIT
    assert force_of(motion_with(times, forces, forces)).active == ()


def test_positions_are_measured_by_their_place_in_the_range(motion_with):
    trajectory = motion_with([0.0, T], [1.0, 1.0], [1.0, 1.0])  # from 0 to 2 m
    limits = dataclasses.replace(
        trajectory.robot.limits,
        position_lower=np.array([-4.0, -np.inf]),
        position_upper=np.array([2.0, 0.25]),
    )
    trajectory = dataclasses.replace(
        trajectory, robot=dataclasses.replace(trajectory.robot, limits=limits)
    )
    ratios = limit_ratios(trajectory)
    column = dict(zip(map(str, ratios.labels), ratios.values.T, strict=True))
    q = 0.5 * ratios.t**2
    np.testing.assert_allclose(
        column["j1 position"], (q + 1.0) / 3.0, atol=1e-12
    )  # 0 in the middle, at -1 m
    np.testing.assert_allclose(column["j2 position"], 0.75)  # one end: 0.25 m away


def test_a_knot_at_which_the_jerk_jumps_occurs_twice(slide):
    limits = {"jerk": 100.0}
    motion = slide(intervals=6, degree=3, rest="full", robot={"limits": limits})
    t = limit_ratios(motion.trajectory).t
    knots = np.unique(motion.trajectory.knots)[1:-1] * motion.t_end
    assert (np.sum(np.abs(t - knots[:, None]) < 1e-9, axis=1) == 2).all()
