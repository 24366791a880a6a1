"""Ranges of joints: far, open, closed and very narrow ones hold a motion alike."""

from __future__ import annotations

import numpy as np
import pytest
import yaml

import brachis

NEAR = 2.0944 - 0.05  # rad; without a range joint 3 goes further


@pytest.fixture(scope="module")
def plan(scara_urdf):
    task = yaml.safe_load(
        (scara_urdf.parents[2] / "examples/01_scara_line.yaml").read_text()
    )
    task["robot"]["urdf"] = str(scara_urdf)
    task |= {"redundant_joints": ["j1"], "search": {"effort": "single"}}

    def plan(ends):
        robot = task["robot"] | {
            "limits": task["robot"]["limits"] | {"position": {"j3": ends}}
        }
        return brachis.plan(task | {"robot": robot})

    return plan


@pytest.mark.filterwarnings(
    "ignore::brachis.PlausibilityWarning"
)  # the far ends look like degrees
def test_a_far_end_changes_nothing(plan):
    """The near end is held to 1e-4 rad, whether the other one is 6 rad away, 1e4, 1e6 or nowhere."""
    found = [plan([NEAR, end]) for end in (None, 8.0, 1e4, 1e6)]
    assert all(result.verified for result in found)
    np.testing.assert_allclose(
        [result.t_end for result in found], found[0].t_end, rtol=1e-5
    )
    lowest = [
        result.trajectory.position(np.linspace(0.0, result.t_end, 5000))[:, 2].min()
        for result in found
    ]
    np.testing.assert_allclose(
        lowest, NEAR, atol=1e-4
    )  # the end of the range is active


@pytest.mark.parametrize("half", [1e-3, 1e-6])
def test_a_range_of_a_micrometre(scara_urdf, half):
    """The bridge drives along while the trolley, whose range is as narrow as that, stands still."""
    task = {
        "brachis": 1,
        "robot": {
            "urdf": str(scara_urdf.parents[1] / "gantry2/robot.urdf"),
            "gravity": [0, 0, 0],
            "limits": {"position": {"y_axis": [-half, half]}},
        },
        "start": {"joints": [0.0, 0.0]},
        "task_space": ["x", "y"],
        "path": [{"line": {"by": [0.5, 0.0]}}],
        "redundant_joints": [],
        "spline": {"intervals": 20},
    }
    assert brachis.plan(task).verified
