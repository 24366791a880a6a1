"""Ranges of joints: far, open, closed and very narrow ones hold a motion alike."""

import numpy as np
import pytest

import brachis

NEAR = 2.0944 - 0.05  # rad; without a range joint 3 goes further


def plan(ends):
    limits = {"torque": 10.0, "velocity": None, "position": {"j3": ends}}
    line = brachis.examples.scara_line
    return brachis.plan(line, limits=limits, redundant_joints=["j1"], effort="single")


@pytest.mark.filterwarnings(
    "ignore::brachis.PlausibilityWarning"
)  # the far ends look like degrees
def test_a_far_end_changes_nothing():
    """The near end is held to 1e-4 rad, whether the other one is 6 rad away, 1e4, 1e6 or nowhere."""
    results = [plan([NEAR, end]) for end in (None, 8.0, 1e4, 1e6)]
    assert all(result.verified for result in results)
    np.testing.assert_allclose(
        [result.t_end for result in results], results[0].t_end, rtol=1e-5
    )
    lowest = [
        result.trajectory.position(np.linspace(0.0, result.t_end, 5000))[:, 2].min()
        for result in results
    ]
    np.testing.assert_allclose(
        lowest, NEAR, atol=1e-4
    )  # the end of the range is active


@pytest.mark.parametrize("half", [1e-3, 1e-6])
def test_a_range_of_a_micrometre(half):
    """The bridge drives along while the trolley, whose range is as narrow as that, stands still."""
    result = brachis.plan(
        "gantry2",
        gravity=[0, 0, 0],
        limits={"position": {"y_axis": [-half, half]}},
        start=[0.0, 0.0],
        task_space=["x", "y"],
        path=brachis.Line(by=[0.5, 0.0]),
        redundant_joints=[],
        intervals=20,
    )
    assert result.verified
