"""Phases with a given s(t), pauses between phases, and ends with any given derivatives."""

from dataclasses import replace

import numpy as np
import pytest
from numpy.testing import assert_allclose, assert_array_equal
from scipy.integrate import simpson
from scipy.interpolate import make_interp_spline

from brachis.errors import UnreachableError
from brachis.optimise.backends import SolverOptions, SolveStatus, solvers_for
from brachis.optimise.boundary import EndCondition
from brachis.optimise.bspline import clamped_knots
from brachis.optimise.links import CurveLink
from brachis.optimise.motion import Motion
from brachis.optimise.phase import Phase
from brachis.optimise.program import Program
from brachis.path.time_law import TimeLaw
from brachis.robot import dynamics
from support.arrays import assert_near
from support.jacobians import comparable_rows, dense, differences, differences_of
from support.phases import phase_of, reachable_points

DURATION = 0.6
PAUSE = 0.4


def bent_law():
    """s = u + sin(2 pi u) / 9 with u = t / DURATION, by a spline of degree 5."""
    u = np.linspace(0.0, 1.0, 41)
    s = u + np.sin(2.0 * np.pi * u) / 9.0
    spline = make_interp_spline(u * DURATION, s, k=5)
    ends = [[spline(t, nu=order) for order in range(4)] for t in (0.0, DURATION)]
    return TimeLaw(DURATION, spline, np.array(ends))


def at_given_speed(case):
    """A phase with every kind of limit whose s(t) is given."""
    phase = phase_of(case)
    boundary = replace(phase.boundary, time_law=bent_law())
    return phase.with_grid(phase.grid, boundary)


def points_at_given_speed(phase, count):
    points = reachable_points(phase, count)
    return [np.append(DURATION, x[1:]) for x in points]


@pytest.mark.parametrize("case", ["r0", "r1", "r2"])
def test_jacobian_with_a_given_speed(case):
    phase = at_given_speed(case)
    assert len(phase.splines) == phase.joint_map.r
    assert phase.x_lower[0] == phase.x_upper[0] == DURATION
    for x in points_at_given_speed(phase, 2):
        exact = dense(phase, x)
        expected = differences(phase, x, 1e-5)
        assert np.count_nonzero(exact) > 0
        for limit, limit_rows in zip(phase.limits, phase.value_rows, strict=True):
            if not limit.guarantee.is_mean:
                rows = limit_rows.ravel()[comparable_rows(phase, limit, x)]
                assert len(rows) > 0
                assert_near(exact[rows], expected[rows], 1e-6, least=1e-3)
        state = phase.state(x)
        y = np.array([state.y, state.ydot, state.yddot, state.ydddot])
        law = phase.time_law.at(phase.t_norm * DURATION)
        assert_allclose(y[:, :, 0], law, atol=1e-12)


@pytest.mark.parametrize("case", ["r1", "r2"])
def test_gradient_of_the_end_time_with_a_given_speed(case):
    phase = at_given_speed(case)
    program = Program([phase])
    (x,) = points_at_given_speed(phase, 1)
    assert program.end_time(x) == DURATION
    assert program.objective(x) > DURATION
    exact = program.gradient(x)
    assert exact[0] == 1.0
    # The objective is quadratic in the control points, so that long steps are exact.
    expected = differences_of(program.objective, x, 5e-3)
    assert np.count_nonzero(exact[1:]) > 0
    assert_near(exact[1:], expected[1:], 1e-6)
    slower = program.scale_time(x, 2.0)
    assert_array_equal(slower, x)


def in_two_phases(knots, *, orders=(0,), points=None):
    """Two phases, the first at a given speed, and a pause in between; the redundant joint is linked there."""
    moves = phase_of("r1")
    timed = at_given_speed("r1")
    free = EndCondition(np.nan, np.empty(0))
    start = (moves.boundary.start[0], free)
    moves = moves.with_grid(moves.grid, replace(moves.boundary, start=start))
    end = (timed.boundary.end[0], free)
    boundary = replace(timed.boundary, end=end)
    parts = timed.joint_map, timed.limits, timed.grid, boundary
    phases = [Phase(*parts, margin=None, pause=PAUSE), moves]
    if points is not None:
        phases = [phase.with_points(np.linspace(0.0, 1.0, points)) for phase in phases]
    if knots == "free":
        phases = [phase.with_free_knots(0.1) for phase in phases]
    return Program(phases, [CurveLink(0, 1, orders, (1,))])


def point_in_two_phases(program):
    first, second = program.phases
    (x,) = points_at_given_speed(first, 1)
    return np.concatenate([x, reachable_points(second, 1)[0]])


@pytest.mark.parametrize("orders", [(0,), (0, 1, 2)])
@pytest.mark.parametrize("knots", ["uniform", "free"])
def test_jacobian_of_phases_with_a_pause(knots, orders):
    program = in_two_phases(knots, orders=orders)
    x = point_in_two_phases(program)
    assert program.end_time(x) == pytest.approx(
        DURATION + PAUSE + x[program.phases[0].variables], rel=1e-14
    )
    exact = dense(program, x)
    expected = differences(program, x, 1e-5)
    (mean,) = program.means.limits
    mean_rows = program.rows_of(mean).ravel()
    slopes = exact[mean_rows]
    assert np.count_nonzero(slopes) > 0.9 * slopes.size
    assert_near(slopes, expected[mean_rows], 1e-6)
    linked = np.arange(len(exact) - len(mean_rows))[-program.links[0].size :]
    assert len(linked) == len(orders)
    assert not exact[linked, 0].any(), "the given duration is no variable of links"
    expected[linked, 0] = 0.0
    assert np.count_nonzero(expected[linked], axis=1).min() >= 2
    assert_near(exact[linked], expected[linked], 1e-8)
    # A row is the difference of a derivative, in units of the last interval.
    first, second = (
        phase.motion(phase_x).at(np.array([place * phase_x[0]]))
        for (phase, phase_x), place in zip(program.split(x), (1.0, 0.0), strict=True)
    )
    interval = DURATION * np.diff(program.phases[0].breaks)[-1]
    gaps = [interval**k * (first[k][0, 1] - second[k][0, 1]) for k in orders]
    assert_allclose(program.rows(x)[linked], gaps, rtol=1e-9)
    for phase, free in zip(program.phases, (False, knots == "free"), strict=True):
        assert (len(phase.grid.lower) > 0) == free, "a given s(t) keeps its knots"


def test_mean_over_phases_and_pause_is_the_integral():
    program = in_two_phases("uniform", points=1001)
    x = point_in_two_phases(program)
    (mean,) = program.means.limits
    sums = 0.0
    for phase, phase_x in program.split(x):
        t_norm = np.linspace(0.0, 1.0, 4001)
        state = phase.with_points(t_norm).state(phase_x)
        values = mean.values(state)
        sums = sums + simpson(values, x=t_norm * phase_x[0], axis=0)
        if phase.pause:
            still = np.zeros_like(state.q[-1:])
            robot = phase.joint_map.robot
            load = dynamics.torque(robot, state.q[-1:], still, still)[0]
            sums = sums + PAUSE * (load / 70.0) ** 2
    means = program.means.values(program.split(x))
    assert_allclose(means, sums / program.end_time(x), rtol=1e-6)


def torque_ratios(program, x):
    """Torques over the limit whose mean is held, at all collocation points."""
    states = [phase.state(part) for phase, part in program.split(x)]
    robot = program.phases[0].joint_map.robot
    return np.concatenate([state.torque(robot) / 70.0 for state in states]).ravel()


@pytest.mark.parametrize("knots", ["uniform", "free"])
def test_the_curvature_of_a_mean_is_that_of_its_squares(knots):
    program = in_two_phases(knots)
    x = point_in_two_phases(program)
    known = program.curvature(x)
    assert known is not None
    weights = np.linspace(0.5, 2.0, len(program.means))
    multipliers = np.zeros(len(program.lower))
    multipliers[program.rows_of(program.means.limits[0])[0]] = -weights
    steps = 1e-6 * np.eye(len(x))
    steps[0] = 0.0  # the first duration is given
    ends = [
        torque_ratios(program, x + h) - torque_ratios(program, x - h) for h in steps
    ]
    slopes = np.array(ends).T / 2e-6
    parts = program.split(x)
    shares = np.hstack([part[0] * phase.mean_weights(part) for phase, part in parts])
    factors = np.outer(shares / program.end_time(x), weights).ravel()
    expected = 2.0 * slopes.T @ (factors[:, None] * slopes)
    hessian = known.hessian(x, 0.0, multipliers)
    # As above: the first duration is given.
    hessian[0] = 0.0
    hessian[:, 0] = 0.0
    assert_near(hessian, expected, 1e-6)
    assert not known.hessian(x, 0.0, np.zeros(len(program.lower))).any()
    assert known.hessian(x, 0.0, known.multipliers).any()


@pytest.mark.parametrize("case", ["r1", "r2"])
def test_the_hessian_at_a_given_speed_is_that_of_the_objective(case):
    phase = at_given_speed(case)
    program = Program([phase])
    (x,) = points_at_given_speed(phase, 1)
    known = program.curvature(x)
    assert known is not None
    no_rows = np.zeros(len(program.lower))
    hessian = known.hessian(x, 2.0, no_rows)
    steps = 1e-4 * np.eye(len(x))[1:]  # the duration is given
    ends = [program.gradient(x + h) - program.gradient(x - h) for h in steps]
    expected = 2.0 * np.array(ends)[:, 1:] / 2e-4
    assert_near(hessian[1:, 1:], expected, 1e-6)
    assert not hessian[0].any()
    assert not known.hessian(x, 0.0, no_rows).any()


def without_means(phase):
    limits = [limit for limit in phase.limits if not limit.guarantee.is_mean]
    return Program([phase.with_limits(limits)])


@pytest.mark.parametrize(
    "make",
    [lambda: phase_of("r2"), lambda: at_given_speed("r0")],
    ids=["a free end time", "a given speed without redundant joints"],
)
def test_no_curvature_is_known_of_what_has_no_squares(make):
    program = without_means(make())
    assert program.curvature(program.x_lower) is None


def test_a_solve_at_a_given_speed_from_out_of_reach_reports_it():
    phase = at_given_speed("r2")
    program = without_means(phase)
    (x,) = points_at_given_speed(phase, 1)
    x[1:] += 50.0
    with pytest.raises(UnreachableError):
        program.rows(x)
    (uno,) = solvers_for("uno")
    report = uno.solve(program, x, SolverOptions(), None)
    assert report.status is SolveStatus.EVALUATION_ERROR


@pytest.mark.parametrize("orders", [1, 3])
def test_a_motion_with_another_start(orders):
    phase = phase_of("r2", degree=5)
    (x,) = reachable_points(phase, 1)
    motion = phase.motion(x)
    values = np.random.default_rng(2).normal(size=(orders, 2))
    moved = motion.with_end(0, values, [1, 2])
    curves = np.array(moved.at(np.zeros(1)))[:orders, 0, 1:]
    assert_allclose(curves, values, atol=1e-10)
    before, after = motion.control_points, moved.control_points
    assert_array_equal(after[0], before[0])
    assert_array_equal(after[:, orders:], before[:, orders:])
    assert np.abs(after - before).max() > 0.01


def test_a_start_at_rest_has_equal_points_to_the_last_digit():
    rng = np.random.default_rng(0)
    for values in rng.uniform(-3.0, 3.0, (50, 2)):
        breaks = np.union1d([0.0, 5e-5, 1.0], rng.uniform(1e-4, 1.0, 6))
        knots = clamped_knots(3, breaks)
        points = rng.uniform(-1.0, 1.0, (2, len(knots) - 4))
        motion = Motion(0.25, knots, 3, points)
        started = motion.with_end(0, np.array([values, [0.0, 0.0], [0.0, 0.0]]), [0, 1])
        first = started.control_points[:, :3]
        assert_array_equal(first, np.repeat(values[:, None], 3, axis=1))
