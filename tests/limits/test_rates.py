"""Jerk and torque rate through all of it: refusals, plan, dense grid, verification, sensitivity, timeline."""

from dataclasses import replace

import numpy as np
import pytest

import brachis
from brachis.apps.bottleneck import check_sensitivities
from brachis.errors import InputError
from brachis.robot.from_task import robot_for
from brachis.task import task_with
from brachis.verify import verify_trajectory
from brachis.verify.mechanics import torque_rates, torques
from support.arrays import assert_near
from support.checks import check_of
from support.effort import QUICK

FIGURES = {"jerk": 12.0, "torque_rate": 25.0}  # rad/s^3 and Nm/s


LINE = task_with(
    brachis.examples.scara_line, path=brachis.Line(length=1.0, angle_deg=45.0), **QUICK
)


@pytest.fixture(scope="module")
def free():
    return brachis.plan(LINE)


@pytest.fixture(scope="module", params=FIGURES)
def kind(request):
    return request.param


@pytest.fixture(scope="module")
def result(kind):
    return brachis.plan(LINE, limits={kind: FIGURES[kind]})


def rates(trajectory, kind, count=5_000):
    """Differences of accelerations or torques over the saved motion, per second."""
    t = np.linspace(0.0, trajectory.t_end, count)
    values = trajectory.acceleration(t) if kind == "jerk" else trajectory.torque(t)
    return np.abs(np.diff(values, axis=0)) / np.diff(t)[:, None]


def test_the_limit_holds_everywhere_and_is_active(kind, free, result):
    before, after = (
        rates(motion.trajectory, kind).max() / FIGURES[kind]
        for motion in (free, result)
    )
    assert before > 2.0, "without the limit it is exceeded"
    assert result.verified
    assert 1.0 - 5e-4 < after < 1.0002
    assert result.t_end > 1.01 * free.t_end


@pytest.mark.parametrize("follows, factor", [(True, 1.0), (False, 9.0)])
def test_verification_finds_a_rate_within_a_microsecond(kind, result, follows, factor):
    """A jerk that is constant over so short a piece, and that of a quintic whose acceleration alone has changed.

    The latter's jerk ends at nine times the mean, as `brachis.trajectory.trajectory` states it: m + a + b is 1 + 3 + 5.
    """
    trajectory, change, h = result.trajectory, np.array([0.1, 0.0, 0.0]), 1e-6
    at = trajectory.at(0.4321 * trajectory.t_end + np.array([0.0, h]))
    place = int(np.searchsorted(trajectory.times, at.t[0]))
    assert trajectory.times[place] > at.t[1]
    later = np.array([[0.0], [1.0]]) * change
    q = at.q + follows * h**2 / 6.0 * later
    qdot = at.qdot + follows * h / 2.0 * later
    qddot = at.qddot + later
    nodes = {"times": at.t, "q": q, "qdot": qdot, "qddot": qddot, "qddot_before": qddot}
    arrays = {
        name: np.insert(getattr(trajectory, name), place, values, axis=0)
        for name, values in nodes.items()
    }
    verification = verify_trajectory(replace(trajectory, **arrays))
    check = check_of(verification, f"{kind.replace('_', ' ')} ratio")
    jump = 0.1
    if kind == "torque_rate":
        tau = torques(trajectory.robot, at.q, at.qdot, at.qddot + change)
        jump = np.abs(tau - at.tau)[0].max()
    # Positions are known to 2e-16 |q|: a jerk of 60 * 2e-16 |q| / h^3, near 1e4 rad/s^3 beside 9e5.
    assert check.value == pytest.approx(factor * jump / h / FIGURES[kind], rel=2e-2)
    assert check.time == pytest.approx(at.t[0], abs=2e-6)


@pytest.mark.parametrize("step, above", [(0.01, 1e-4), (0.0005, 5e-6)])
def test_prediction_is_what_solving_again_gives(kind, result, step, above):
    """Within 1 % other limits take over, here and there; within small steps none do."""
    found = check_sensitivities(
        result.candidate.refined, result.sensitivities, step=step
    )
    large = found.larger(above)
    assert {entry.sensitivity.label.kind for entry in large} >= {kind.replace("_", " ")}
    assert all(entry.optimal for entry in large)
    if step < 0.01:
        assert found.worst_deviation(above) < 0.005


@pytest.mark.parametrize(
    "degree, key, ends",
    [
        (2, "degree", "found 2, .*; allowed: >= 3"),
        (3, "rest", "found velocity, .*; allowed: full or jerk"),
    ],
)
def test_the_limits_of_rates_are_for_splines_that_can_hold_them(
    kind, degree, key, ends
):
    words = f"the {kind.replace('_', ' ')} limit needs a continuous acceleration"
    with pytest.raises(InputError, match=rf"spline\.{key}: {words}; {ends}"):
        brachis.plan(LINE, limits={kind: FIGURES[kind]}, degree=degree, rest="velocity")


def test_rates_of_the_verification_are_differences_of_its_torques(free):
    trajectory, t, h = free.trajectory, np.linspace(0.1, 2.0, 9) + 0.0123, 1e-4
    friction = {"viscous": 2.0, "coulomb": 1.5, "coulomb_velocity": 1.0}
    robot = robot_for(None, task_with(trajectory.task, friction=friction).robot)
    state, qdddot = trajectory.at(t), trajectory.jerk(t)
    q, qdot, qddot = state.q, state.qdot, state.qddot

    def torques_after(step):
        positions = q + step * qdot + step**2 / 2 * qddot + step**3 / 6 * qdddot
        velocities = qdot + step * qddot + step**2 / 2 * qdddot
        return torques(robot, positions, velocities, qddot + step * qdddot)

    expected = (torques_after(h) - torques_after(-h)) / (2.0 * h)
    assert_near(torque_rates(robot, q, qdot, qddot, qdddot), expected, 1e-6)
