"""What a rail does to an arm: where its tool is, what moves, what gravity asks, by Pinocchio."""

import doctest
import subprocess
import sys
from math import pi

import numpy as np
import pinocchio as pin
import pytest
from lxml import etree
from numpy.testing import assert_allclose, assert_array_equal

import brachis
from brachis import Robot
from brachis.apps.compose import Rail, on_rail, rail
from brachis.robot import dynamics

from .conftest import RAIL, ROOT

ARM_MASS = 7.0 + 3 * 2.0
MOUNTS = {
    "upright": ((0.0, 0.0, 0.0), (0.0, 0.0, 0.0)),
    "inverted": ((0.1, 0.2, -0.3), (pi, 0.0, 0.0)),
    "anyhow": ((0.3, -0.1, 0.2), (0.4, -0.7, 2.1)),
}
AXES = {
    "against x": (-1, 0, 0),
    "vertical": (0, 0, 2),
    "tilted": (0.5, -1.0, 0.3),
}


def robots(path, **options):
    """The arm, and the arm on the rail."""
    text = on_rail(path, Rail(**(RAIL | options)))
    return Robot.from_urdf(path), Robot.from_urdf("composed", urdf_text=text)


def rotation(rpy):
    """Roll, pitch and yaw about fixed axes, by the exponential map."""
    turns = [pin.exp3(angle * axis) for angle, axis in zip(rpy, np.eye(3), strict=True)]
    return turns[2] @ turns[1] @ turns[0]


@pytest.mark.parametrize("mount", MOUNTS)
@pytest.mark.parametrize("axis", AXES.values(), ids=AXES)
def test_tool_is_shifted_along_the_rail(arm, axis, mount):
    xyz, rpy = MOUNTS[mount]
    alone, composed = robots(arm, axis=axis, mount_xyz=xyz, mount_rpy=rpy)
    assert composed.joint_names == ("rail", *alone.joint_names)
    direction = np.array(axis) / np.linalg.norm(axis)
    for q in np.random.default_rng(0).uniform(-2.0, 2.0, (5, 4)):
        mounted = pin.SE3(rotation(rpy), np.array(xyz) + q[0] * direction)
        expected = mounted * alone.tool_placement(q[1:])
        assert composed.tool_placement(q).isApprox(expected, 1e-14)


def test_limits_are_those_of_the_rail_and_of_the_arm(arm):
    lonely, composed = robots(arm)
    assert composed.position_units == ("m", "rad", "rad", "rad")
    for name, figure in (
        ("position_lower", -2.0),
        ("position_upper", 1.5),
        ("velocity", 2.0),
        ("torque", 1500.0),
    ):
        expected = [figure, *getattr(lonely.limits, name)]
        assert_array_equal(getattr(composed.limits, name), expected)


@pytest.mark.parametrize("axis", AXES)
def test_rail_carries_its_share_of_the_weight(arm, axis):
    _, composed = robots(arm, axis=AXES[axis])
    still = np.zeros((1, 4))
    share = np.array(AXES[axis])[2] / np.linalg.norm(AXES[axis])
    assert dynamics.torque(composed, still, still, still)[0, 0] == pytest.approx(
        (80.0 + ARM_MASS) * 9.81 * share
    )


def test_carriage_is_a_solid_box_below_the_arm(arm):
    text = on_rail(
        arm,
        Rail(
            **RAIL,
            mount_xyz=(1.0, 0.0, 0.5),
            mount_rpy=(pi, 0.0, 0.0),
            carriage_size=(0.6, 0.2, 0.1),
        ),
    )
    model = pin.buildModelFromXML(text)
    # Pinocchio joins the base to the carriage; taken away, the box is left.
    base = pin.Inertia(7.0, np.array([0.01, 0.02, 0.1]), np.diag([0.1, 0.1, 0.05]))
    placed = pin.SE3(rotation((pi, 0.0, 0.0)), np.array([1.0, 0.0, 0.5])).act(base)
    box = model.inertias[1] - placed
    assert box.mass == pytest.approx(80.0)
    assert_allclose(box.lever, [1.0, 0.0, 0.55], atol=1e-12)
    expected = (
        np.diag([0.2**2 + 0.1**2, 0.6**2 + 0.1**2, 0.6**2 + 0.2**2]) * 80.0 / 12.0
    )
    assert_allclose(box.inertia, expected, atol=1e-10)


@pytest.mark.parametrize("length", [5.0, 5e-200, 5e200])
def test_axis_may_have_any_length(arm, length):
    text = on_rail(arm, Rail(**RAIL, axis=(0.0, 0.6 * length, -0.8 * length)))
    axis = etree.fromstring(text.encode()).find("joint[@name='rail']/axis").get("xyz")
    assert_allclose(
        [float(word) for word in axis.split()], [0.0, 0.6, -0.8], rtol=1e-15
    )


def test_example_of_the_docstring(monkeypatch):
    monkeypatch.chdir(ROOT)
    (example,) = doctest.DocTestFinder(recurse=False).find(rail.on_rail, globs={})
    assert len(example.examples) == 4
    assert doctest.DocTestRunner().run(example).failed == 0


def test_compose_is_public_and_imports_late():
    assert brachis.compose.on_rail is on_rail
    code = (
        "import sys, brachis; assert 'brachis.apps.compose' not in sys.modules; "
        "brachis.compose.on_rail; assert 'yourdfpy' not in sys.modules"
    )
    subprocess.run([sys.executable, "-c", code], check=True)
