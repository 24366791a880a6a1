"""Paths in a program that state where they begin, and paths of joints."""

import numpy as np
import pytest

import brachis
from brachis.errors import TaskError
from support.effort import QUICK

POINTS = [[0.3, 0.2], [0.35, 0.3], [0.4, 0.4]]
HOME = [0.0, 0.5, 0.0, -1.2, 0.0, 1.0, 0.3]
THERE = {"path": [{"line": {"by": [0.3, 0.0, 0.0, 0.0, 0.0, 0.2, 0.0]}}]}
BACK = {"path": [{"line": {"by": [-0.3, 0.0, 0.0, 0.0, 0.0, 0.2, 0.0]}}]}


@pytest.mark.parametrize("form", ["points", "spline", "csv", "alone"])
def test_a_path_begins_with_its_waypoint(form, tmp_path):
    np.savetxt(
        tmp_path / "points.csv", POINTS, delimiter=",", header="x,y", comments=""
    )
    path = {
        "spline": [{"spline": {"through": POINTS}}],
        "csv": [{"csv": {"file": str(tmp_path / "points.csv")}}],
    }.get(form, POINTS)
    before = [] if form == "alone" else [{"move": "next"}]
    result = brachis.plan(
        "gantry2",
        start="free" if form == "alone" else [0.1, 0.1],
        task_space=["x", "y"],
        program=[*before, {"path": path, "name": "bead"}],
        **QUICK,
    )
    assert result.verified
    _, motion = result.trajectory.components[-1]
    place = brachis.robots.gantry2.tool_placement(motion.q[0]).translation
    np.testing.assert_allclose(place[:2], POINTS[0], atol=1e-6)


@pytest.mark.parametrize(
    "program, end",
    [
        ([THERE, {"dwell": 0.1}, BACK], "free"),
        ([{"move": "next"}, {"path": [HOME, [0.1] * 7]}, {"move": "next"}], "start"),
    ],
)
def test_paths_of_joints_are_parts(program, end):
    keys = {"start": HOME, "end": end, "task_space": "joints"}
    if end == "start":
        keys["start"] = [0.2, *HOME[1:]]
    assert brachis.plan("iiwa14", program=program, **keys, **QUICK).verified


def test_a_path_of_joints_that_begins_nowhere_is_named():
    with pytest.raises(TaskError, match=r"program\[1\].path\[0\]: a joint path that"):
        brachis.plan(
            "iiwa14", start=HOME, task_space="joints", program=[{"move": "next"}, THERE]
        )
