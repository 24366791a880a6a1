"""Torque limits that fall with speed, power and root-mean-square torque: from the task to the robot's limits."""

import numpy as np
import pytest
import yaml
from numpy.testing import assert_allclose, assert_array_equal

from brachis.errors import InputError, LimitError, UnknownNameError
from brachis.robot.from_task import robot_for
from brachis.task import LimitSpec, RobotSettings
from brachis.task.limit_kinds import LimitScale
from support.chains import planar_robot

CURVE = [[0.0, 50.0], [1.0, 50.0], [2.0, 20.0]]


def robot(**limits):
    return planar_robot("RRP", limits=LimitSpec(**limits))


def test_the_torque_at_rest_is_a_plain_limit_and_scales_apply_to_all():
    scale = LimitScale(torque=0.5, power=0.1, rms_torque=0.2)
    limits = robot(
        torque_speed={"j2": CURVE},
        power=[20.0, None, 30.0],
        total_power=40.0,
        rms_torque=5.0,
        scale=scale,
    ).limits
    assert limits.torque_speed == ((), ((0.0, 25.0), (1.0, 25.0), (2.0, 10.0)), ())
    assert_allclose(limits.torque, [40.0, 25.0, 65.0])
    assert_allclose(limits.power, [2.0, np.inf, 3.0])
    assert_allclose(limits.rms_torque, 1.0)
    assert limits.total_power == pytest.approx(4.0)


def test_a_curve_is_torque_limit_enough():
    curves = dict.fromkeys(("j1", "j2", "j3"), CURVE)
    assert_array_equal(robot(torque=None, torque_speed=curves).limits.torque, 50.0)
    with pytest.raises(LimitError, match="neither a torque nor an acceleration limit"):
        robot(torque=None, torque_speed={"j1": CURVE})


@pytest.mark.parametrize(
    "curve, where, said",
    [
        ("[[0.0, 50.0]]", "robot: limits.torque_speed.j1", "at least 2"),
        ("[[0.5, 50.0], [1.0, 20.0]]", "robot.limits.torque_speed.j1", "begin at 0"),
        (
            "[[0.0, 50.0], [2.0, 40.0], [1.0, 20.0]]",
            "robot.limits.torque_speed.j1",
            "ascend",
        ),
        (
            "[[0.0, 50.0], [1.0, 60.0]]",
            "robot.limits.torque_speed.j1[1]",
            "rises with the speed",
        ),
        (
            "[[0.0, 50.0], [1.0, 20.0], [2.0, 21.0]]",
            "robot.limits.torque_speed.j1[2]",
            "stay or fall",
        ),
        (
            "[[0.0, 50.0], [1.0, -1.0]]",
            "robot: limits.torque_speed.j1[1][1]",
            "out of range",
        ),
        (
            "[[0.0, 50.0], [1.0, much]]",
            "robot: limits.torque_speed.j1[1][1]",
            "a number",
        ),
        (
            "[[0.0, 1.0e-09], [1.0, 0.0]]",
            "robot.limits.torque_speed.j1",
            "the torque at speed 0 is too small",
        ),
    ],
)
def test_the_error_names_the_key_of_a_wrong_curve(curve, where, said):
    with pytest.raises(InputError) as caught:
        robot(torque_speed={"j1": yaml.safe_load(curve)})
    assert where in str(caught.value)
    assert said in str(caught.value)


def test_other_mistakes_are_refused_with_their_key():
    with pytest.raises(UnknownNameError, match=r"torque_speed.*elbow"):
        robot(torque_speed={"elbow": CURVE})
    with pytest.raises(InputError, match=r"limits.torque_speed: .* a mapping"):
        robot(torque_speed=[CURVE])
    for wrong in (0.0, -3.0, "much"):
        with pytest.raises(InputError, match=r"robot: limits.total_power"):
            robot(total_power=wrong)
    with pytest.raises(
        InputError, match=r"robot.limits.total_power: the total power is too small"
    ):
        robot(total_power=1e-9)
    with pytest.raises(InputError, match=r"limits.power: out of range"):
        robot(power=-1.0)


def test_a_robot_keeps_them_beside_what_a_task_sets():
    given = robot(
        torque_speed={"j1": np.array(CURVE)},
        power=30.0,
        total_power=70.0,
        rms_torque=12.0,
    )
    both = robot_for(given, RobotSettings(limits=LimitSpec(velocity=1.5)))
    for name in ("power", "rms_torque", "torque"):
        assert_array_equal(getattr(both.limits, name), getattr(given.limits, name))
    assert both.limits.torque_speed == given.limits.torque_speed
    assert both.limits.total_power == 70.0
    assert_array_equal(both.limits.velocity, 1.5)
