"""The fastest timing of joint paths, against formulas, and against the same path by another parameter."""

from pathlib import Path

import numpy as np
import pytest

import brachis
from brachis.limits.joint import (
    AccelerationLimit,
    PowerLimit,
    TorqueLimit,
    VelocityLimit,
)
from brachis.timing import JointPath, PhasePlane, divide_turns

GANTRY = Path(__file__).parents[2] / "robots/gantry2/robot.urdf"
LENGTH = 0.4  # m
P = np.linspace(0.0, 1.0, 2001)


def gantry(friction=None, **limits):
    spec = {"torque": None, "velocity": None, "acceleration": None} | limits
    return brachis.Robot.from_urdf(
        GANTRY, gravity=[0, 0, 0], limits=brachis.LimitSpec(**spec), friction=friction
    )


def limits_of(robot):
    kinds = (TorqueLimit, VelocityLimit, AccelerationLimit, PowerLimit)
    built = (kind.build(robot, None) for kind in kinds)
    return [limit for limit in built if limit is not None]


def least_time(robot, path=None):
    if path is None:
        path = JointPath.through(P, np.outer(P, [LENGTH, 0.0]))
    return PhasePlane(limits_of(robot), path).solve().t_end


def mass_of(robot):
    return float(robot.chain.mass_matrices(np.zeros((1, 2)))[0, 0, 0])


def test_trapezoid_to_five_digits():
    found = least_time(gantry(acceleration=3.0, velocity=0.5))
    assert found == pytest.approx(LENGTH / 0.5 + 0.5 / 3.0, rel=1e-5)


@pytest.mark.parametrize("friction", [None, {"coulomb": 5.0, "coulomb_velocity": 0.05}])
@pytest.mark.parametrize("end", [0, -1])
def test_a_free_end_is_passed_at_the_best_rate(end, friction):
    robot = gantry(torque=20.0, velocity=1.0, friction=friction)
    path = JointPath.through(P, np.outer(P, [LENGTH, 0.0]))

    def time_with(rate, estimate=None):
        rates = [0.0, 0.0]
        rates[end] = rate
        return PhasePlane(limits_of(robot), path, estimate).solve(tuple(rates))

    free = time_with(np.inf)
    best = free.rate[end]
    assert best > 0.0
    nearly = time_with(0.999 * best, free.rate).t_end
    assert free.t_end < nearly < 1.002 * free.t_end
    assert time_with(0.9 * best, free.rate).t_end > nearly
    assert time_with(1.1 * best, free.rate) is None


@pytest.mark.parametrize("size", [1e-3, 1.0, 100.0])
@pytest.mark.parametrize("shape", [np.ones_like, lambda p: 1.0 - (2.0 * p - 1.0) ** 2])
def test_an_estimate_of_the_rate_leaves_the_time(size, shape):
    friction = {"coulomb": 5.0, "coulomb_velocity": 0.05, "viscous": 10.0}
    robot = gantry(torque=20.0, velocity=1.0, friction=friction)
    path = JointPath.through(P, np.outer(P, [LENGTH, 0.0]))
    plane = PhasePlane(limits_of(robot), path, size * shape(P))
    known = least_time(robot)
    assert plane.solve().t_end == pytest.approx(known, rel=1e-5)
    roughly = PhasePlane(limits_of(robot), path).solve(agreement=1e-3)
    assert roughly.t_end == pytest.approx(known, rel=5e-3)


def test_coulomb_friction_helps_to_brake():
    robot = gantry(torque=20.0, friction={"coulomb": 5.0, "coulomb_velocity": 1e-4})
    ways = mass_of(robot) / np.array([20.0 - 5.0, 20.0 + 5.0])
    speed = np.sqrt(2.0 * LENGTH / ways.sum())
    assert least_time(robot) == pytest.approx(speed * ways.sum(), rel=1e-3)
    assert least_time(gantry(torque=20.0)) < 0.999 * least_time(robot)


def test_viscous_friction_by_its_differential_equation():
    force, drag = 20.0, 30.0
    robot = gantry(torque=force, friction={"viscous": drag, "coulomb": 0.0})
    mass = mass_of(robot)
    # dx/dp = 2 L (+-F - d v) / m with v = L sqrt(x): both sides by fine steps until they meet.
    way = np.linspace(0.0, LENGTH, 200_001)
    speeds = []
    for sign in (-1.0, 1.0):
        v = np.zeros_like(way)
        v[1] = np.sqrt(2.0 * (force / mass) * way[1])
        for i in range(1, len(way) - 1):
            v[i + 1] = v[i] + (force + sign * drag * v[i]) / mass / v[i] * way[1]
        speeds.append(v)
    speed = np.minimum(speeds[0], speeds[1][::-1])
    inner = 0.5 * (speed[1:] + speed[:-1])
    known = float((way[1] / inner).sum())
    assert least_time(robot) == pytest.approx(known, rel=2e-3)


def test_power_by_its_formula():
    """At constant power v = sqrt(2 P t / m) after the force's own part, and the same backwards."""
    robot = gantry(power=5.0, torque=50.0)
    mass = mass_of(robot)
    force, power = 50.0, 5.0
    switch = power / force  # m/s, at which the power takes over
    time = np.linspace(mass * switch / force, 10.0, 400_001)
    speed = np.sqrt(switch**2 + 2.0 * power / mass * (time - time[0]))
    way = 0.5 * mass * switch**2 / force + np.append(
        0.0, np.cumsum(0.5 * (speed[1:] + speed[:-1]) * np.diff(time))
    )
    half = float(np.interp(0.5 * LENGTH, way, time))
    assert least_time(robot) == pytest.approx(2.0 * half, rel=1e-3)


def curve_with_derivatives(p):
    """A joint path with its derivatives."""
    q = np.column_stack([np.sin(2.0 * p), 0.3 * p**2])
    q_dp = np.column_stack([2.0 * np.cos(2.0 * p), 0.6 * p])
    q_ddp = np.column_stack([-4.0 * np.sin(2.0 * p), np.full_like(p, 0.6)])
    return q, q_dp, q_ddp


def test_the_parameter_does_not_matter():
    robot = gantry(acceleration=[3.0, 2.0], velocity=[1.0, 0.4])
    q, q_dp, q_ddp = curve_with_derivatives(P)
    exact = JointPath(P, P, q, q_dp, q_ddp)
    by_length, places = exact.by_length()
    np.testing.assert_array_equal(places, P)
    np.testing.assert_allclose(np.linalg.norm(by_length.q_dp, axis=1), 1.0, rtol=1e-12)
    times = [
        least_time(robot, path) for path in (exact, by_length, JointPath.through(P, q))
    ]
    assert times == pytest.approx([times[0]] * 3, rel=2e-5)


def test_a_path_in_time_is_regular_by_its_length_where_it_rests():
    t = np.linspace(0.0, 1.0, 1001)
    part = 3.0 * t**2 - 2.0 * t**3
    rate = 6.0 * t * (1.0 - t)
    q, q_dp, q_ddp = curve_with_derivatives(part)
    qddot = q_dp * (6.0 - 12.0 * t)[:, None] + q_ddp * rate[:, None] ** 2
    path, _ = JointPath(t, part, q, q_dp * rate[:, None], qddot).by_length()
    robot = gantry(acceleration=[3.0, 2.0])
    exact = JointPath(P, P, *curve_with_derivatives(P))
    assert least_time(robot, path) == pytest.approx(least_time(robot, exact), rel=1e-4)


def there_and_back(p, *, bend=0.0, aside=0.0):
    """A joint path that turns round at p = 0: in a cusp, p^2 (1, bend p), or in a hairpin if `aside` is not 0."""
    q = np.column_stack([p**2, bend * p**3 + aside * p])
    q_dp = np.column_stack([2.0 * p, 3.0 * bend * p**2 + aside])
    q_ddp = np.column_stack([np.full_like(p, 2.0), 6.0 * bend * p])
    return q, q_dp, q_ddp


def time_there_and_back(first, last, **shape):
    """Least time on stations that step over p = 0, finer where the path turns, as for plans."""
    p = np.linspace(first, last, 1802)
    p = divide_turns(p, there_and_back(p, **shape)[1])
    path = JointPath(p, p, *there_and_back(p, **shape)).by_length()[0]
    return least_time(gantry(acceleration=3.0, velocity=2.0), path), path


@pytest.mark.parametrize("first", [-1.0, -0.37, -0.011])
def test_the_arm_stands_at_a_straight_cusp(first):
    found, path = time_there_and_back(first, 1.0)
    assert len(path.stops) == 2
    assert found == pytest.approx(2.0 * sum(np.sqrt([first**2 / 3.0, 1 / 3.0])), 1e-4)


@pytest.mark.parametrize("first", [-1.0, -0.37])
@pytest.mark.parametrize("bend", [0.3, -1.0, 4.0])
def test_the_arm_stands_at_a_bent_cusp(first, bend):
    found, _ = time_there_and_back(first, 1.0, bend=bend)
    halves = (time_there_and_back(*half, bend=bend)[0] for half in ((first, 0), (0, 1)))
    assert found == pytest.approx(sum(halves), rel=1e-4)


def test_a_hairpin_is_passed_and_becomes_a_cusp():
    """The first axis turns round in either case, and decides how long it takes."""
    found = [time_there_and_back(-1.0, 1.0, aside=aside) for aside in (0.1, 1e-3, 1e-9)]
    assert [len(path.stops) for _, path in found] == [0, 0, 2]
    times = [time for time, _ in found]
    assert times == pytest.approx([4.0 / np.sqrt(3.0)] * 3, rel=1e-4)
