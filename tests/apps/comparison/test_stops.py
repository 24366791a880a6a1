"""A recorded motion that waits at a corner is compared with a plan that waits as long."""

import pytest

import brachis
from support.effort import QUICK
from support.gantry import TASK, gantry_motion, gantry_urdf


def test_the_plan_waits_as_long(tmp_path):
    (tmp_path / "robot.urdf").write_text(gantry_urdf())
    brachis.export.write(gantry_motion(), tmp_path / "recorded.csv", dt=0.01)
    task = {key: part for key, part in TASK.items() if key != "tool_limits"}
    task["robot"] = {"urdf": str(tmp_path / "robot.urdf")}
    task |= {"search": QUICK, "spline": {"degree": 3, "intervals": 8}}
    found = brachis.compare(tmp_path / "recorded.csv", task=task)
    plan = found.result.trajectory
    assert found.result.verified
    assert [phase.kind for phase in plan.phases] == ["move", "dwell", "move"]
    recorded = found.recorded.phases[1]
    assert plan.phases[1].duration == pytest.approx(recorded.duration, abs=1e-9)
    assert 0.0 < found.saved < 1.0
