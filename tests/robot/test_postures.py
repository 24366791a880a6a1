"""Postures that a user gives to a robot, and robots as keys."""

import copy
import pickle

import numpy as np
import pytest

import brachis
from brachis.errors import InputError, UnknownNameError

SCARA = brachis.robots.scara3


@pytest.mark.parametrize(
    "posture",
    [
        [0.1, 0.2, 0.3],
        np.array([0.1, 0.2, 0.3]),
        {"j3": 0.3, "j1": 0.1, "j2": 0.2},
    ],
    ids=lambda posture: type(posture).__name__,
)
def test_the_tool_of_a_posture(posture):
    theta = np.cumsum([0.1, 0.2, 0.3])
    placement = SCARA.tool_placement(posture)
    expected = [np.cos(theta).sum(), np.sin(theta).sum(), 0.0]
    np.testing.assert_allclose(placement.translation, expected, atol=1e-14)
    tool = [np.cos(theta[2]), np.sin(theta[2]), 0.0]
    np.testing.assert_allclose(placement.rotation[:, 0], tool, atol=1e-14)


@pytest.mark.parametrize(
    "posture, said",
    [
        ([0.0, 0.0], "found 2; allowed: 3"),
        ([0.0, 0.0, np.nan], "a joint position is out of range"),
        ({"j1": 0.0}, "no position for j2, j3"),
        ([0.0, 0.0, None], "no position for j3"),
        (["a", 0.0, 0.0], "a joint position is not a number"),
        ("abc", "wrong type"),
        ({0.1}, "wrong type"),
        (1.0, "wrong type; found 1.0"),
        ([[0.0, 0.0, 0.0]], "found 1; allowed: 3"),
        ([0.0, 0.0, [0.0, 1.0]], "a joint position is not a number"),
        (np.array(1.0), "wrong type"),
    ],
    ids=str,
)
def test_what_is_no_posture_is_an_error(posture, said):
    with pytest.raises(InputError, match=said) as caught:
        SCARA.tool_placement(posture)
    assert caught.value.where == "tool_placement"


def test_the_error_names_an_unknown_joint():
    with pytest.raises(UnknownNameError, match="elbow"):
        SCARA.tool_placement({"j1": 0.0, "j2": 0.0, "j3": 0.0, "elbow": 0.0})


def test_robots_and_their_limits_are_compared_as_objects():
    other = brachis.Robot.from_urdf(SCARA.source)
    assert SCARA == SCARA  # noqa: PLR0124
    assert other != SCARA
    assert {SCARA: 1, other: 2}[other] == 2
    for part in (SCARA.limits, SCARA.friction):
        assert part != copy.copy(part)
        assert hash(part) == hash(part)
    sent = pickle.loads(pickle.dumps(SCARA))  # noqa: S301
    np.testing.assert_array_equal(sent.limits.torque, SCARA.limits.torque)
