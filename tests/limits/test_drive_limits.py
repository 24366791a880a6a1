"""What drives bear, and the tool's motion: known optima of slides, and what the free motion of an arm violates."""

import dataclasses

import numpy as np
import pytest
from scipy.integrate import solve_ivp
from scipy.optimize import brentq

import brachis
from brachis.task import task_with
from brachis.verify import verify_trajectory
from support.checks import check_of, failed_checks
from support.effort import QUICK
from support.slides import X, plan_slides, slides

MASS, FORCE, LENGTH = 2.0, 50.0, 1.2
NEAR = 1e-3
"""Optima are met to 0.1 %."""


def slide(*forces, limits=None, tool=None, intervals=40, **spline):
    """Plan a slide, or one slide that carries another along the same line, over LENGTH from rest to rest."""
    result = plan_slides(
        slides([X] * len(forces), forces, MASS),
        ["x"],
        [LENGTH],
        settings={"limits": limits or {}},
        spline={"intervals": intervals, **spline},
        redundant_joints=["j1"] if len(forces) > 1 else [],
        tool_limits=tool or {},
        search=QUICK,
    )
    assert result.verified, result.verification
    return result


def ratio(result, kind):
    return check_of(result.verification, f"{kind} ratio").value


def test_power_limited_slide():
    """Full force up to the speed at which it takes the whole power, then m v^2 dv = P dx; braking is the mirror."""
    power = 100.0
    v = power / FORCE
    way = MASS * v**2 / (2.0 * FORCE)
    top = np.cbrt(3.0 * power / MASS * (LENGTH / 2.0 - way) + v**3)
    expected = 2.0 * (MASS * v / FORCE + MASS / (2.0 * power) * (top**2 - v**2))
    for limits in ({"power": power}, {"total_power": power}):
        result = slide(FORCE, limits=limits)
        assert result.t_end == pytest.approx(expected, rel=NEAR)


CURVES = {
    "concave": [[0.0, FORCE], [1.5, FORCE], [5.0, 10.0]],
    "constant power": [
        [0.0, FORCE],
        *([v, FORCE / v] for v in np.geomspace(1.0, 5.0, 8).tolist()),
    ],
    "to no torque": [[0.0, FORCE], [1.0, 30.0], [2.4, 6.0]],
}


@pytest.mark.parametrize("curve", CURVES.values(), ids=CURVES)
def test_torque_that_falls_with_speed(curve):
    """The slide's equation of motion under full force, up to the middle; braking is the mirror."""
    speed, force = np.transpose(curve)

    def largest_force(v):
        last = (force[-1] - force[-2]) / (speed[-1] - speed[-2])
        beyond = last * np.maximum(v - speed[-1], 0.0)
        return np.maximum(np.interp(v, speed, force) + beyond, 0.0)

    def motion(_t, state):
        return [state[1], largest_force(state[1]) / MASS]

    found = solve_ivp(
        motion,
        (0.0, 1.0),
        [0.0, 0.0],
        dense_output=True,
        rtol=1e-10,
        atol=1e-12,
        max_step=1e-3,
    )
    expected = 2.0 * brentq(lambda t: found.sol(t)[0] - LENGTH / 2.0, 0.0, 1.0)
    result = slide(FORCE, limits={"torque_speed": {"j1": curve}}, intervals=80)
    assert result.t_end == pytest.approx(expected, rel=NEAR)
    free = 2.0 * np.sqrt(LENGTH * MASS / FORCE)
    assert expected > 1.05 * free

    def excess(planned):
        dense = planned.trajectory.at(np.linspace(0.0, planned.t_end, 5_001))
        return (
            np.abs(dense.tau[:, 0]) - largest_force(np.abs(dense.qdot[:, 0]))
        ).max() / FORCE

    assert excess(result) <= 1e-4
    assert excess(slide(FORCE)) > 0.2


def test_rms_force_makes_a_parabola_of_the_speed():
    """The least mean square of the force over a time T is that of F = F0 (1 - 2 t / T): F0^2 / 3."""
    rms = 20.0
    result = slide(FORCE, limits={"rms_torque": rms}, intervals=12)
    expected = np.sqrt(6.0 * MASS * LENGTH / (np.sqrt(3.0) * rms))
    assert result.t_end == pytest.approx(expected, rel=NEAR)
    assert ratio(result, "rms torque") == pytest.approx(1.0, abs=1e-5)
    check = brachis.bottleneck.report(result, check=True).check
    (entry,) = check.larger()
    assert str(entry.sensitivity.label) == "j1 rms force"
    assert entry.deviation < 0.05


def test_tool_acceleration_is_bang_bang():
    result = slide(FORCE, tool={"acceleration": 10.0})
    assert result.t_end == pytest.approx(2.0 * np.sqrt(LENGTH / 10.0), rel=NEAR)


def test_a_macro_slide_spares_the_power_of_the_mini_slide():
    """The mini slide's force moves the tool; a strong macro slide takes all the speed, so that no power is needed."""
    expected = 2.0 * np.sqrt(LENGTH * MASS / FORCE)
    pair = slide(5.0 * FORCE, FORCE, limits={"power": {"j2": 40.0}})
    assert pair.t_end == pytest.approx(expected, rel=NEAR)
    assert slide(FORCE, limits={"power": 40.0}).t_end > 1.3 * expected


def test_a_speed_table_is_a_staircase_of_cruises():
    a, fast, slow, step = FORCE / MASS, 1.5, 0.5, 0.6
    table = {"s": [0.0, step, step, 1.0], "speed": [fast, fast, slow, slow]}
    way = step * LENGTH - (fast**2 + fast**2 - slow**2) / (2.0 * a)
    slow_length = (1.0 - step) * LENGTH - slow**2 / (2.0 * a)
    expected = 2.0 * fast / a + way / fast + slow_length / slow
    result = slide(FORCE, tool={"speed": table}, intervals=60, degree=2)
    assert result.t_end == pytest.approx(
        expected, rel=5e-3
    )  # the speed changes at three places, off the knots
    motion = result.trajectory.at(np.linspace(0.0, result.t_end, 5_001))
    speed, s = np.abs(motion.qdot[:, 0]), motion.s
    assert speed[s >= step].max() <= slow * (1.0 + 1e-4)
    assert speed[s < step].max() == pytest.approx(fast, rel=1e-3)


@pytest.fixture(scope="module")
def arm():
    """The planar arm's task without any of these limits, and its motion."""
    free = brachis.plan(brachis.examples.scara_line, **QUICK)
    return free.task, free


def peaks(trajectory):
    """Figures of a motion by numpy alone, from samples of the saved motion."""
    motion = trajectory.at(np.linspace(0.0, trajectory.t_end, 4001))
    positions, _ = trajectory.robot.tool_placements(motion.q)
    velocity = np.gradient(positions, motion.t, axis=0)
    acceleration = np.gradient(velocity, motion.t, axis=0)[5:-5]
    powers = motion.tau * motion.qdot
    return {
        "speed": np.linalg.norm(velocity, axis=1).max(),
        "acceleration": np.linalg.norm(acceleration, axis=1).max(),
        "angular_speed": np.abs(motion.qdot.sum(axis=1)).max(),
        "power": np.abs(powers).max(axis=0),
        "total_power": np.abs(powers.sum(axis=1)).max(),
        "qdot": np.abs(motion.qdot).max(axis=0),
        "tau": np.abs(motion.tau).max(axis=0),
    }


def task_with_limit(task, kind, free):
    """The task with a limit that the free motion exceeds."""
    if kind == "speed":
        speeds = free["speed"] * np.array([1.0, 0.5, 0.6, 1.0])
        table = {"s": [0.0, 0.4, 0.6, 1.0], "speed": speeds}
        return task_with(task, tool_limits={"speed": table})
    if kind in ("acceleration", "angular_speed"):
        return task_with(task, tool_limits={kind: 0.7 * free[kind]})
    limit = 0.7 * free.get(kind, 0.0)
    if kind == "torque_speed":
        parts = np.array([[0.0, 1.0], [0.3, 1.0], [0.5, 0.6], [1.0, 0.3]])
        scales = np.column_stack([free["qdot"], free["tau"]])
        limit = {f"j{i}": parts * scale for i, scale in enumerate(scales, 1)}
    return task_with(task, limits={kind: limit})


@pytest.mark.parametrize(
    "kind, check, label",
    [
        ("speed", "tool speed", "tool speed"),
        ("acceleration", "tool acceleration", "tool acceleration"),
        ("angular_speed", "tool angular speed", "tool angular speed"),
        ("power", "power", "j1 power"),
        ("total_power", "total power", "all joints total power"),
        ("torque_speed", "torque speed", "j1 positive"),
    ],
)
def test_an_arm_without_it_violates_it_and_with_it_meets_it_and_is_slower(
    arm, kind, check, label
):
    task, free = arm
    result = brachis.plan(task_with_limit(task, kind, peaks(free.trajectory)))
    assert result.verified, result.verification
    assert result.t_end > free.t_end * 1.001
    assert 1.0 - 1e-3 <= ratio(result, check) <= 1.0 + 1e-4
    unaware = dataclasses.replace(free.trajectory, task=result.task)
    verification = verify_trajectory(unaware, robot=result.trajectory.robot)
    assert failed_checks(verification) == [f"{check} ratio"]
    assert check_of(verification, f"{check} ratio").value > 1.2
    report = brachis.bottleneck.report(result, check=True)
    entries = report.check.entries
    entry = next(e for e in entries if str(e.sensitivity.label).startswith(label))
    assert entry.re_solved < -1e-4
    assert entry.deviation < 0.05
    subject = label.split()[0]
    shares = [line.share for line in report.saturations if subject in str(line.label)]
    assert max(shares) > 0.01
