"""Phases over finer, free and frozen knots: x keeps its meaning from one to the other."""

from __future__ import annotations

import numpy as np
import pytest

from brachis.common.arrays import spread
from brachis.optimise.bspline import clamped_knots
from support.phases import phase_of, reachable_points

SHORTEST = 0.1


def finer(phase):
    """Halve the first interval, the last one and one within, and put collocation points in all."""
    breaks = phase.breaks
    some = np.array([0, 2, len(breaks) - 2])
    breaks = np.union1d(breaks, 0.5 * (breaks[some] + breaks[some + 1]))
    return phase.with_knots(clamped_knots(phase.degree, breaks), spread(breaks, 3))


def with_other_lengths(phase, x, seed=0):
    """Free knots, and a point with other lengths than even ones."""
    free = phase.with_free_knots(SHORTEST)
    rng = np.random.default_rng(seed)
    lengths = rng.uniform(0.8, 1.2, len(phase.breaks) - 1)
    return free, np.concatenate([x, lengths / lengths.sum()])


def assert_same_motion(one, other, tolerance=1e-12):
    assert one.t_end == pytest.approx(other.t_end, rel=1e-15)
    t = np.linspace(0.0, one.t_end, 173)
    for mine, theirs in zip(one.at(t), other.at(t), strict=True):
        np.testing.assert_allclose(
            mine, theirs, atol=tolerance * max(1.0, np.abs(theirs).max())
        )


@pytest.mark.parametrize(
    ("degree", "rest"),
    [(2, "velocity"), (3, "full"), (3, "velocity"), (4, "full"), (5, "full")],
)
@pytest.mark.parametrize("case", ["r0", "r1", "r2"])
def test_insertion_keeps_the_motion_and_rest(case, degree, rest):
    phase = phase_of(case, degree=degree, rest=rest, intervals=6)
    fine = finer(phase)
    assert fine.variables == phase.variables + 3 * (1 + phase.joint_map.r)
    for x in reachable_points(phase, 3):
        inserted = phase.motion(x).with_knots(fine.knots)
        there = fine.variables_from(inserted)
        assert_same_motion(fine.motion(there), phase.motion(x))
        # Ties and fixed control points of the finer phase hold exactly: nothing was averaged away.
        np.testing.assert_allclose(
            fine.motion(there).control_points, inserted.control_points, atol=1e-14
        )
        assert there[0] == x[0]
        between = 0.5 * (
            fine.t_norm[1:] + fine.t_norm[:-1]
        )  # at knots a spline of degree 2 has two accelerations
        np.testing.assert_allclose(
            fine.violation_at(there, between), phase.violation_at(x, between), atol=1e-9
        )


@pytest.mark.parametrize("degree", [2, 3, 5])
def test_free_knots_where_they_are_given_change_nothing(degree):
    phase = phase_of("r1", degree=degree, rest="velocity")
    free = phase.with_free_knots(SHORTEST)
    (x,) = reachable_points(phase, 1)
    there = free.variables_from(phase.motion(x))
    np.testing.assert_allclose(there[-5:], 0.2, atol=1e-15)
    np.testing.assert_allclose(free.x_lower[-5:], SHORTEST / 5.0)
    rows = free.rows(there)
    np.testing.assert_allclose(rows[:-1], phase.rows(x), atol=1e-9)
    assert rows[-1] == pytest.approx(1.0)
    assert free.lower[-1] == free.upper[-1] == 1.0


def test_points_move_with_the_knots():
    phase = phase_of("r2")
    (x,) = reachable_points(phase, 1)
    free, there = with_other_lengths(phase, x)
    ends = np.concatenate([[0.0], np.cumsum(there[-5:])])
    motion = free.motion(there)
    np.testing.assert_allclose(motion.breaks / motion.t_end, ends, atol=1e-14)
    t_norm = spread(ends, 2)
    state = free.state(there)
    for mine, theirs in zip(
        (state.y, state.ydot, state.yddot, state.ydddot),
        motion.at(t_norm * motion.t_end),
        strict=True,
    ):
        np.testing.assert_allclose(
            mine, theirs, atol=1e-11 * max(1.0, np.abs(theirs).max())
        )
    np.testing.assert_allclose(
        free.violation_at(there, t_norm), free.violation(there), atol=1e-9
    )


def test_curves_at_knots_are_those_behind_them_whatever_the_rounding():
    phase = phase_of("r1", degree=2, rest="velocity", intervals=11)
    (x,) = reachable_points(phase, 1)
    x[0] = 2.0 / 3.0
    motion = phase.motion(x)
    knots = motion.breaks[1:-1]
    behind = motion.at(knots + 1e-9)[2]
    before = motion.at(knots - 1e-9)[2]
    assert np.abs(behind - before).min(axis=1).max() > 1e-3, (
        "the acceleration should jump"
    )
    for rounded in (knots, np.nextafter(knots, 0.0), np.nextafter(knots, 1.0)):
        np.testing.assert_allclose(
            motion.at(rounded)[2], behind, atol=1e-12 * np.abs(behind).max()
        )
