"""Phases over finer, free and frozen knots: x keeps its meaning from one to the other."""

import numpy as np
import pytest
from numpy.testing import assert_allclose

from brachis.common.arrays import spread
from brachis.optimise.bspline import clamped_knots
from support.arrays import assert_near
from support.phases import phase_of, reachable_points

SHORTEST = 0.1


def finer(phase):
    """Halve the first interval, the last one and one within, and put collocation points in all."""
    breaks = phase.breaks
    some = np.array([0, 2, len(breaks) - 2])
    breaks = np.union1d(breaks, 0.5 * (breaks[some] + breaks[some + 1]))
    return phase.with_knots(clamped_knots(phase.degree, breaks), spread(breaks, 3))


@pytest.mark.parametrize(
    "degree, rest",
    [(2, "velocity"), (3, "full"), (3, "velocity"), (4, "full"), (5, "full")],
)
@pytest.mark.parametrize("case", ["r0", "r1", "r2"])
def test_insertion_keeps_the_motion_and_rest(case, degree, rest):
    phase = phase_of(case, degree=degree, rest=rest, intervals=6)
    fine = finer(phase)
    assert fine.variables == phase.variables + 3 * (1 + phase.joint_map.r)
    for x in reachable_points(phase, 3):
        inserted = phase.motion(x).with_knots(fine.knots)
        moved_x = fine.variables_from(inserted)
        after, before = fine.motion(moved_x), phase.motion(x)
        t = np.linspace(0.0, before.t_end, 173)
        for mine, theirs in zip(after.at(t), before.at(t), strict=True):
            assert_near(mine, theirs, 1e-12, least=1.0)
        # Ties and fixed control points of the finer phase hold exactly: nothing was averaged away.
        assert_allclose(after.control_points, inserted.control_points, atol=1e-14)
        assert after.t_end == before.t_end == x[0]
        between = 0.5 * (
            fine.t_norm[1:] + fine.t_norm[:-1]
        )  # at knots a spline of degree 2 has two accelerations
        assert_allclose(
            fine.violation_at(moved_x, between),
            phase.violation_at(x, between),
            atol=1e-9,
        )


@pytest.mark.parametrize("degree", [2, 3, 5])
def test_free_knots_where_they_are_given_change_nothing(degree):
    phase = phase_of("r1", degree=degree, rest="velocity")
    free = phase.with_free_knots(SHORTEST)
    (x,) = reachable_points(phase, 1)
    moved_x = free.variables_from(phase.motion(x))
    assert_allclose(moved_x[-5:], 0.2, atol=1e-15)
    assert_allclose(free.x_lower[-5:], SHORTEST / 5.0)
    rows = free.rows(moved_x)
    assert_allclose(rows[:-1], phase.rows(x), atol=1e-9)
    assert rows[-1] == pytest.approx(1.0)
    assert free.lower[-1] == free.upper[-1] == 1.0


def test_points_move_with_the_knots_and_the_end_with_their_lengths():
    phase = phase_of("r2")
    (x,) = reachable_points(phase, 1)
    free = phase.with_free_knots(SHORTEST)
    lengths = np.random.default_rng(0).uniform(0.8, 1.2, len(phase.breaks) - 1)
    # They need not add up to 1 while a solver moves them.
    moved_x = np.concatenate([x, 1.01 * lengths / lengths.sum()])
    ends = np.concatenate([[0.0], np.cumsum(moved_x[-5:])])
    motion = free.motion(moved_x)
    assert_allclose(motion.breaks / x[0], ends, atol=1e-14)
    t_norm = spread(ends, 2)
    state = free.state(moved_x)
    for mine, theirs in zip(
        (state.y, state.ydot, state.yddot, state.ydddot),
        motion.at(t_norm * x[0]),
        strict=True,
    ):
        assert_near(mine, theirs, 1e-11, least=1.0)
    assert_allclose(
        free.violation_at(moved_x, t_norm / ends[-1]),
        free.violation(moved_x),
        atol=1e-9,
    )
    fixed = free.fix_knots(moved_x)
    assert_allclose(
        fixed.violation(fixed.variables_from(motion)),
        free.violation(moved_x),
        atol=1e-9,
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
        assert_near(motion.at(rounded)[2], behind, 1e-12)
