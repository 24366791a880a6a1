"""The evaluator against joint map and limits, and its slopes against differences."""

from __future__ import annotations

import numpy as np
import pytest

import brachis
from brachis.limits import joint
from support.phases import phase_of, reachable_points
from support.starts import starting_points


@pytest.mark.parametrize("case", ["r0", "r1", "r2"])
def test_values_are_those_of_the_limits(case):
    phase = phase_of(case)
    (x,) = reachable_points(phase, 1)
    evaluation = phase.evaluate(x)
    expected = [limit.values(evaluation.motion) for limit in phase.limits]
    np.testing.assert_array_equal(evaluation.values, np.hstack(expected))
    is_mean = phase.evaluator.is_mean
    assert evaluation.values.shape == (len(phase.t_norm), len(is_mean))
    assert 0 < np.count_nonzero(is_mean) < len(is_mean)
    beyond = evaluation.violation(lambda limit: limit.kind == "torque")
    assert beyond.shape[1] == phase.joint_map.robot.n
    assert evaluation.violation(lambda _limit: False).shape[1] == 0


@pytest.mark.parametrize("case", ["r0", "r1", "r2"])
def test_slopes_are_differences(case):
    phase = phase_of(case)
    (x,) = reachable_points(phase, 1)
    state = phase.state(x)
    curves = [state.y, state.ydot, state.yddot, state.ydddot]
    slopes, _ = phase.evaluate(x).differentiate()
    assert len(slopes) == 4
    smooth = [
        own
        for limit in phase.limits
        for own in [limit.kind in ("torque", "velocity", "acceleration", "jerk")]
        * len(limit.lower)
    ]
    h = 1e-6
    for order, slope in enumerate(slopes):
        for column in range(state.y.shape[1]):
            sides = []
            for step in (h, -h):
                moved = [own.copy() for own in curves]
                moved[order][:, column] += step
                found = phase.evaluator.evaluate(*moved, near=state.q)
                sides.append(found.values)
            expected = (sides[0] - sides[1])[:, smooth] / (2.0 * h)
            exact = slope[:, smooth, column]
            np.testing.assert_allclose(
                exact, expected, atol=2e-6 * (1.0 + np.abs(expected).max())
            )


class DoubledTorque(joint.TorqueLimit):
    """A subclass with another quantity."""

    def quantity(self, motion):
        return 2.0 * super().quantity(motion)

    def quantity_partials(self, motion):
        return super().quantity_partials(motion).map(lambda part: 2.0 * part)


def test_limits_of_another_robot_and_subclasses_have_values_of_their_own():
    program, _ = brachis.transcribe(
        brachis.examples.scara_line, redundant_joints=["j1"]
    )
    (phase,) = program.phases
    robot = phase.joint_map.robot
    heavy = robot.with_payload(3.0)
    joints = np.arange(robot.n)
    limits = (
        joint.TorqueLimit(robot, joints),
        joint.TorqueLimit(heavy, joints),
        DoubledTorque(robot, joints),
    )
    x = next(starting_points(program))
    evaluation = phase.with_limits(limits).evaluate(x)
    for limit, values in zip(limits, evaluation.by_limit, strict=True):
        np.testing.assert_allclose(values, limit.values(evaluation.motion), atol=1e-12)
    light, with_load, doubled = np.split(evaluation.differentiate()[0], 3, axis=2)
    np.testing.assert_allclose(doubled, 2.0 * light, atol=1e-10)
    assert np.abs(with_load - light).max() > 0.1
