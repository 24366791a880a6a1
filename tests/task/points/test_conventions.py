"""Conventions of orientations, against matrices that are worked out by hand and against products about single axes."""

import numpy as np
import pytest
from numpy.testing import assert_allclose
from scipy.spatial.transform import Rotation

from brachis.task.orientation import Attitude
from brachis.task.points.units import CONVENTIONS, rotation_by

X, Y, Z = (
    lambda angle, axis=axis: Rotation.from_rotvec(angle * axis) for axis in np.eye(3)
)
ANGLES = np.radians([20.0, -35.0, 110.0])
A, B, C = ANGLES
EXPECTED = {
    "rpy": Z(C) * Y(B) * X(A),
    "kuka_abc": Z(A) * Y(B) * X(C),
    "staubli_xyz": X(A) * Y(B) * Z(C),
    "fanuc_wpr": Z(C) * Y(B) * X(A),
    "euler_zyz": Z(A) * Y(B) * Z(C),
}


@pytest.mark.parametrize("name", EXPECTED)
def test_angles_are_turns_about_single_axes(name):
    assert (rotation_by(name, ANGLES).inv() * EXPECTED[name]).magnitude() < 1e-15
    attitude = Attitude.model_validate({f"{name}_deg": np.degrees(ANGLES).tolist()})
    assert (attitude.rotation.inv() * EXPECTED[name]).magnitude() < 1e-14


def test_quaternions_and_rotation_vectors():
    quarter = [
        np.sqrt(0.5),
        0.0,
        0.0,
        np.sqrt(0.5),
    ]  # read with w first a quarter about z, with w last one about x
    assert_allclose(
        rotation_by("quaternion_wxyz", np.array(quarter)).as_rotvec(), [0, 0, np.pi / 2]
    )
    assert_allclose(
        rotation_by("quaternion_xyzw", np.array(quarter)).as_rotvec(), [np.pi / 2, 0, 0]
    )
    assert_allclose(
        rotation_by("rotation_vector", np.array([0.0, 0.3, 0.0])).as_matrix(),
        Y(0.3).as_matrix(),
    )


def test_every_convention_is_a_key_of_an_orientation():
    assert [
        name + "_deg" * bool(each.euler) for name, each in CONVENTIONS.items()
    ] == list(Attitude.model_fields)
