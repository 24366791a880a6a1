"""Partial derivatives of a user's limit are compared with its values before anything is planned."""

import numpy as np
import pytest

import brachis
from brachis.errors import InputError
from brachis.limits import Label, Limit, Partials
from brachis.limits.checks import sample_moments
from brachis.problem.problem import Problem
from brachis.task import task_with
from support.checks import check_of
from support.effort import QUICK

ROBOT = brachis.robots.scara3
TASK = task_with(brachis.examples.scara_line, redundant_joints=["j1"])


def rows(motion, *weights):
    return np.broadcast_to(np.array([weights]), (len(motion.q), 1, len(weights)))


class Sum(Limit):
    """q2^2 + 0.1 q3, and 0.5 qdot1; the functions are replaced one by one below."""

    kind = "sum"
    labels = (Label("arm", "sum", "rad"),)

    def __init__(self, values, partials, **members):
        self.lower = -np.ones(1)
        self.upper = np.ones(1)
        self.given = values, partials
        for name, member in members.items():
            setattr(self, name, member)

    def bind(self, _robot):
        return self

    def values(self, motion):
        return self.given[0](motion)

    def partials(self, motion):
        return self.given[1](motion)


def right_values(motion):
    q = motion.q
    return q[:, 1:2] ** 2 + 0.1 * q[:, 2:] + 0.5 * motion.qdot[:, :1]


def right_partials(motion):
    by_q = np.zeros((len(motion.q), 1, 3))
    by_q[:, 0, 1] = 2.0 * motion.q[:, 1]
    by_q[:, 0, 2] = 0.1
    return Partials(q=by_q, qdot=rows(motion, 0.5, 0.0, 0.0))


def partials_with(motion, **parts):
    return Partials(**{**vars(right_partials(motion)), **parts})


def bind(limit):
    return Problem.of(ROBOT, TASK, [limit])


@pytest.mark.parametrize(
    "partials, where, joint",
    [
        (lambda m: partials_with(m, q=1.1 * right_partials(m).q), "q", "j2"),
        (lambda m: partials_with(m, q=right_partials(m).q[:, :, [0, 2, 1]]), "q", "j2"),
        (lambda m: Partials(qdot=right_partials(m).q), "q", "j2"),
        (
            lambda m: partials_with(m, q=right_partials(m).q * [1.0, 1.0, 0.0]),
            "q",
            "j3",
        ),
        (lambda m: partials_with(m, qdot=None), "qdot", "j1"),
        (lambda m: partials_with(m, qddot=rows(m, 0.0, 0.1, 0.0)), "qddot", "j2"),
        (lambda m: partials_with(m, s=np.ones((len(m.q), 1))), "s", ""),
    ],
)
def test_a_wrong_partial_derivative_is_in_the_message(partials, where, joint):
    with pytest.raises(InputError, match="contradicts the values") as caught:
        bind(Sum(right_values, partials))
    assert caught.value.where == f"own_limits[0].partials.{where}"
    assert "arm sum" in str(caught.value)
    if joint:
        assert f"with respect to {where} of joint '{joint}'" in str(caught.value)


def test_the_numbers_are_those_of_the_joint():
    wrong = Sum(right_values, lambda m: partials_with(m, qdot=rows(m, -0.5, 0.0, 0.0)))
    with pytest.raises(
        InputError, match=r"found -0.5 at q.*allowed: 0.5, by differences"
    ):
        bind(wrong)


def test_values_that_use_the_jerk_need_order_3_and_limit_it():
    def values(motion):
        return motion.qdddot[:, :1] / 10.0

    def partials(motion):
        return Partials(qdddot=rows(motion, 0.1, 0.0, 0.0))

    with pytest.raises(InputError, match="depends on qdddot") as caught:
        bind(Sum(values, partials))
    assert caught.value.where == "own_limits[0].order"
    limit = Sum(values, partials, order=3)
    result = brachis.plan(ROBOT, TASK, own_limits=[limit], **QUICK)
    assert result.verified
    jerk = result.trajectory.jerk(np.linspace(0.0, result.t_end, 2001))[:, 0]
    assert np.abs(jerk).max() == pytest.approx(10.0, rel=1e-3)
    check = check_of(result.verification, "sum ratio")
    assert check.value == pytest.approx(1.0, rel=1e-3)


def torque_partials(motion):
    exact = motion.torque_derivatives(ROBOT)
    parts = (exact.q, exact.qdot, exact.qddot)
    return Partials(*(0.01 * part[:, :1] for part in parts))


def speed_in_steps(motion):
    return motion.qdot[:, :1] / np.where(motion.s > 0.5, 0.7, 1.0)[:, None]


@pytest.mark.parametrize(
    "values, partials",
    [
        (right_values, right_partials),
        (
            lambda m: np.abs(m.qdot[:, :1]),
            lambda m: Partials(qdot=np.sign(m.qdot[:, :1, None]) * [1.0, 0.0, 0.0]),
        ),
        (
            lambda m: right_values(m).astype(np.float32),
            right_partials,
        ),
        (
            lambda m: 1e6 * right_values(m),
            lambda m: right_partials(m).map(lambda part: 1e6 * part),
        ),
        (
            speed_in_steps,
            lambda m: Partials(
                qdot=np.where(m.s > 0.5, 1.0 / 0.7, 1.0)[:, None, None] * [1.0, 0, 0]
            ),
        ),
        (
            lambda m: np.tanh(m.qdot[:, :1] / 1e-3) + m.q[:, 1:2],
            lambda m: Partials(
                q=rows(m, 0.0, 1.0, 0.0),
                qdot=1e3
                * (1.0 - np.tanh(m.qdot[:, :1, None] / 1e-3) ** 2)
                * [1.0, 0.0, 0.0],
            ),
        ),
        (
            lambda m: right_values(m) + 1e-6 * np.sin(1e9 * m.q[:, :1]),
            right_partials,
        ),
        (lambda m: 0.01 * m.torque(ROBOT)[:, :1], torque_partials),
    ],
    ids=[
        "smooth",
        "kink",
        "float32",
        "large",
        "s step",
        "steep",
        "noisy",
        "torques, which a motion keeps",
    ],
)
def test_right_derivatives_pass(values, partials):
    limit = Sum(values, partials)
    assert any(own is limit for own in bind(limit).limits)


def test_built_in_limits_pass():
    from brachis.limits import limits_of
    from brachis.limits.checks import check_partials, sample_moments

    task = task_with(
        brachis.examples.scara_line,
        limits={"torque": 10, "velocity": 2, "acceleration": 9, "power": 30},
        tool_limits={"speed": 0.5, "acceleration": 2.0},
    )
    robot = ROBOT.with_limits(velocity=2.0, acceleration=9.0, power=30.0)
    limits = limits_of(robot, task)
    assert len(limits) >= 6
    for limit in limits:
        check_partials(limit, sample_moments(robot), robot)


@pytest.mark.parametrize("left_out, is_refused", [(2, False), (4, True)])
def test_values_may_be_undefined_in_some_postures_and_not_in_most(left_out, is_refused):
    angles = np.sort(sample_moments(ROBOT).q[:, 0])
    least = 0.5 * (angles[left_out - 1] + angles[left_out])

    def values(motion):
        return np.where(motion.q[:, :1] < least, np.nan, right_values(motion))

    if not is_refused:
        bind(Sum(values, right_partials))
        return
    with pytest.raises(InputError, match=r"not finite; found nan for arm sum at q = "):
        bind(Sum(values, right_partials))


def test_values_for_another_number_of_moments_are_errors():
    def values(motion):
        return right_values(motion)[:12]

    with pytest.raises(InputError, match=r"found \(12, 1\) for 72 moments"):
        bind(Sum(values, right_partials))
