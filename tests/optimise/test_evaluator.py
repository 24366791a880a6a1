"""The evaluator against joint map and limits; its slopes are in the Jacobians of programs."""

import numpy as np
import pytest
from numpy.testing import assert_allclose, assert_array_equal

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
    assert_array_equal(evaluation.values, np.hstack(expected))
    chain = phase.joint_map.robot.chain
    quick = {limit.kind for limit in phase.limits if limit.kernel_quantity(chain)}
    assert quick >= {"torque", "velocity", "acceleration", "position", "jerk"}
    is_mean = phase.evaluator.is_mean
    assert evaluation.values.shape == (len(phase.t_norm), len(is_mean))
    assert 0 < np.count_nonzero(is_mean) < len(is_mean)
    beyond = evaluation.violation(lambda limit: limit.kind == "torque")
    assert beyond.shape[1] == phase.joint_map.robot.n
    assert evaluation.violation(lambda _limit: False).shape[1] == 0


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
    assert all(limit.kernel_quantity(robot.chain) for limit in phase.limits)
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
        assert_allclose(values, limit.values(evaluation.motion), atol=1e-12)
    light, with_load, doubled = np.split(evaluation.differentiate()[0], 3, axis=2)
    assert_allclose(doubled, 2.0 * light, atol=1e-10)
    assert np.abs(with_load - light).max() > 0.1
