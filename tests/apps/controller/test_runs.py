"""Motions as controllers run them, checked by formulas of the tests' own."""

import dataclasses
from itertools import pairwise

import numpy as np
import pinocchio as pin
import pytest
from scipy.interpolate import BPoly, CubicHermiteSpline

import brachis
from brachis.apps.controller.run import slow_down


def profile_with(name="kuka_rsi_4ms", **changes):
    """Return an included profile with some keys changed."""
    return brachis.load_profile(name).model_copy(update=changes)


def value_of(report, name):
    """Return the worst value of a check."""
    return next(check.value for check in report.checks if check.name == name)


def torques(trajectory, q, qdot, qddot):
    """Torques by Pinocchio's RNEA, with the viscous and Coulomb friction of the robot."""
    robot = trajectory.robot
    data = robot.model.createData()
    rows = zip(q, qdot, qddot, strict=True)
    tau = np.array([pin.rnea(robot.model, data, *row) for row in rows])
    friction = robot.friction
    return (
        tau
        + friction.armature * qddot
        + friction.viscous * qdot
        + friction.coulomb * np.tanh(qdot / friction.v_eps)
    )


POLYNOMIALS = {
    "cubic": lambda samples: CubicHermiteSpline(samples.t, samples.q, samples.qdot),
    "quintic": lambda samples: BPoly.from_derivatives(
        samples.t, np.stack([samples.q, samples.qdot, samples.qddot], axis=1)
    ),
}


@pytest.mark.parametrize("interpolation", POLYNOMIALS)
@pytest.mark.parametrize("period", [0.004, 0.012])
def test_polynomials_are_verified_as_they_run(interpolation, period, seam):
    profile = profile_with("ros2_control", interpolation=interpolation)
    report = brachis.verify_run(seam, profile, period=period)
    samples = seam.sample(period)
    motion = POLYNOMIALS[interpolation](samples)
    times = np.unique(np.concatenate([np.linspace(0, seam.t_end, 40_001), samples.t]))
    times = np.concatenate([times - 1e-12, times + 1e-12]).clip(
        1e-12, seam.t_end - 1e-12
    )
    states = (motion(times), motion(times, 1), motion(times, 2))
    ratios = np.abs(torques(seam, *states)) / seam.robot.limits.torque
    assert value_of(report, "torque ratio") == pytest.approx(ratios.max(), rel=1e-4)
    speeds = np.abs(states[1]) / seam.robot.limits.velocity
    assert value_of(report, "velocity ratio") == pytest.approx(speeds.max(), rel=1e-4)


def test_samples_are_verified_by_their_differences(seven):
    report = brachis.verify_run(seven, "franka_1khz")
    samples = seven.sample(0.001, last="hold")
    profile = brachis.load_profile("franka_1khz")
    q = np.vstack([samples.q[:1]] * 3 + [samples.q] + [samples.q[-1:]] * 3)
    for order, kind in enumerate(("velocity", "acceleration", "jerk"), start=1):
        rates = np.abs(np.diff(q, order, axis=0)) / 0.001**order
        limit = np.minimum(
            getattr(profile.limits, kind), seven.robot.limits.both_ways(kind)[1]
        )
        expected = (rates / limit).max()
        assert value_of(report, f"{kind} by differences") == pytest.approx(
            expected, rel=1e-9
        )


def test_the_path_error_is_that_of_straight_joint_lines(seam):
    """A straight path of the tool: the distance from it is that from a line."""
    profile = profile_with(period=0.02, fixed_period=False)
    report = brachis.verify_run(seam, profile)
    samples = seam.sample(0.02, last="hold")
    u = np.linspace(0.0, 1.0, 5)[1:-1, None]
    chords = np.concatenate([a + u * (b - a) for a, b in pairwise(samples.q)])
    places, rotations = seam.robot.tool_placements(chords)
    start, first = seam.robot.tool_placements(seam.q[:1])
    along = np.array([0.0, 1.0, 0.0])
    away = np.linalg.norm(np.cross(places - start, along), axis=1).max()
    turned = first[0].T @ rotations
    angle = np.arccos(
        ((np.trace(turned, axis1=1, axis2=2) - 1.0) / 2.0).clip(-1, 1)
    ).max()
    assert value_of(report, "path error") == pytest.approx(max(away, angle), rel=0.02)


def test_rounding_to_few_decimals_breaks_limits_and_more_decimals_mend_it(turn):
    report = brachis.verify_run(turn, profile_with(decimals=2))
    assert not report.passed
    remedy = next(text for text in report.remedies if "decimals" in text)
    decimals = int(remedy.split()[-2])
    assert brachis.verify_run(turn, profile_with(decimals=decimals)).passed
    assert not brachis.verify_run(turn, profile_with(decimals=decimals - 1)).passed


def test_remedies_are_true(turn):
    report = brachis.verify_run(turn, "ros2_control")
    assert not report.passed
    assert "torque ratio" in report.failures[0]
    period, speed, _ = report.remedies
    period = 1e-3 * float(period.split()[-2])
    assert brachis.verify_run(turn, "ros2_control", period=period).passed
    slower = slow_down(turn, 100.0 / float(speed.split()[-5]))
    assert brachis.verify_run(slower, "ros2_control").passed


def test_a_plan_for_a_controller_passes_and_loses_little(turn, tmp_path):
    result, run = brachis.plan_for_controller("ros2_control", turn.task)
    assert result.verified
    assert run.passed
    assert turn.t_end < result.t_end < 1.02 * turn.t_end
    result.save(tmp_path / "result.npz")
    assert brachis.verify_run(tmp_path / "result.npz", "ros2_control").passed


def test_a_plan_takes_the_limits_and_ends_of_the_profile(seven):
    result, run = brachis.plan_for_controller(
        "franka_1khz", seven.task, rest="velocity"
    )
    assert run.passed
    profile = brachis.load_profile("franka_1khz")
    times = np.linspace(0.0, result.t_end, 5000)
    for kind in ("velocity", "acceleration", "jerk"):
        rates = np.abs(getattr(result.trajectory, kind)(times)).max(axis=0)
        ratio = (rates / getattr(profile.limits, kind)).max()
        assert ratio <= 1.0001
        assert ratio > 0.5 or kind != "acceleration"
    np.testing.assert_allclose(result.trajectory.qddot[[0, -1]], 0.0, atol=1e-9)
    hasty = brachis.plan(seven.task, rest="velocity")
    failures = " ".join(brachis.verify_run(hasty, profile).failures)
    assert "acceleration at the ends" in failures


def test_factors_on_limits_are_margins_for_the_run(turn):
    """A plan within 95 % of its torques passes as it is run; the run is checked against 100 %."""
    robot = turn.robot.with_limits(scale={"torque": 0.5})
    scaled = dataclasses.replace(turn, robot=robot)
    ratio = value_of(brachis.verify_run(turn, "kuka_rsi_4ms"), "torque ratio")
    assert value_of(
        brachis.verify_run(scaled, "kuka_rsi_4ms"), "torque ratio"
    ) == pytest.approx(ratio)


def test_the_last_period_waits_at_the_end(turn):
    """t_end is no multiple of the period: the end posture is held until the next sample."""
    report = brachis.verify_run(
        turn, profile_with(period=0.05, fixed_period=False, path_tolerance=1.0)
    )
    assert value_of(report, "velocity by differences") < 1.0001


def test_heat_is_that_of_all_samples(turn):
    limits = {"rms_torque": 0.3 * turn.robot.limits.torque}
    warm = dataclasses.replace(turn, robot=turn.robot.with_limits(**limits))
    ratio = value_of(
        brachis.verify_run(warm, "kuka_rsi_4ms"), "rms torque by differences"
    )
    times = np.linspace(0.0, turn.t_end, 4001)
    mean = np.sqrt(np.mean(turn.torque(times) ** 2, axis=0))
    assert ratio == pytest.approx((mean / limits["rms_torque"]).max(), rel=0.02)


def test_rates_of_torques_are_differences_too(seven):
    report = brachis.verify_run(seven, "franka_1khz")
    samples = seven.sample(0.001, last="hold")
    qdot = np.gradient(samples.q, 0.001, axis=0)
    qddot = np.zeros_like(qdot)
    qddot[1:-1] = np.diff(samples.q, 2, axis=0) / 1e-6
    tau = torques(seven, samples.q, qdot, qddot)[1:-1]
    expected = np.abs(np.diff(tau, axis=0)).max() / 0.001 / 1000.0
    assert value_of(report, "torque rate by differences") == pytest.approx(
        expected, rel=1e-3
    )


def test_the_speed_of_the_tool_is_that_between_its_places(seam):
    for profile in ("kuka_rsi_4ms", "fanuc_stream_8ms"):
        report = brachis.verify_run(seam, profile)
        assert value_of(report, "tool speed by differences") == pytest.approx(
            1.0, abs=1e-4
        )


def test_limits_of_ones_own_are_checked_as_the_controller_runs(turn):
    class Half(brachis.limits.Limit):
        """Half of the largest velocity of the first turning joint."""

        name = "half speed"
        lower = np.array([-1.0])
        upper = np.array([1.0])
        labels = (brachis.limits.Label("velocity", "joint_1", "rad/s"),)

        def values(self, motion):
            """Return the velocity over half of its limit."""
            return 2.0 * motion.qdot[:, 1:2] / self.robot.limits.velocity[1]

        def partials(self, motion):
            """Return the slope."""
            slope = np.zeros((len(motion.q), 1, motion.q.shape[1]))
            slope[:, 0, 1] = 2.0 / self.robot.limits.velocity[1]
            return brachis.limits.Partials(qdot=slope)

    report = brachis.verify_run(turn, "kuka_rsi_4ms", own_limits=[Half()])
    speed = np.abs(turn.velocity(np.linspace(0.0, turn.t_end, 2001))[:, 1]).max()
    expected = 2.0 * speed / turn.robot.limits.velocity[1]
    assert value_of(report, "half speed ratio") == pytest.approx(expected, rel=0.01)
