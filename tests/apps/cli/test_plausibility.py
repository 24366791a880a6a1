"""Figures that are hardly meant, on the command line: one message each on standard error, an error with --strict."""

import json
import re
from pathlib import Path

import pytest

from support.effort import QUICK

SCARA = Path(__file__).parents[3] / "robots/scara3/robot.urdf"
WARNING = "brachis: warning: robot.limits.scale.velocity: the factor raises limits far beyond what was stated"


@pytest.fixture
def percent(task, write):
    task["robot"]["limits"] = {"torque": 10, "scale": {"velocity": 80}}
    task |= {"search": QUICK, "spline": {"intervals": 10}}
    return write(task)


@pytest.mark.parametrize("command", ["plan", "bottleneck"])
def test_warned_once_and_in_the_json(command, run, percent, tmp_path):
    out = tmp_path / "out"
    outcome = run(f"{command} {percent} --json --out {out}")
    assert outcome.code == 0, outcome.err
    assert outcome.err.count("warning: robot.limits") == 1
    assert outcome.err.count("warning: spline.intervals") == 1
    assert outcome.err.startswith(WARNING)
    warning, slow = json.loads(outcome.out)["warnings"]
    assert slow["where"] == "spline.intervals"
    assert warning["where"] == "robot.limits.scale.velocity"
    (written,) = out.glob("*.json")
    assert json.loads(written.read_text())["warnings"] == [warning, slow]


@pytest.mark.parametrize("command", ["plan", "bottleneck"])
def test_strict_is_wrong_input(command, run, percent):
    outcome = run(f"{command} {percent} --strict")
    assert outcome.code == 2
    assert outcome.out == ""
    assert "not plausible" in outcome.err
    assert "robot.limits.scale.velocity" in outcome.err
    assert "warning:" not in outcome.err


def test_a_start_posture_in_degrees_is_refused_and_the_way_out_works(run, task, write):
    task["start"] = {"joints": [30, -120, 120]}
    task |= {"search": QUICK, "spline": {"intervals": 10}}
    path = write(task)
    refused = run(f"plan {path}")
    assert refused.code == 2
    assert (
        "start.joints: the position looks like degrees; found j1 30 rad, j2 -120 rad, j3 120 rad"
        in refused.err
    )
    assert "30 degrees are 0.523599 rad; in a task file: !degrees 30" in refused.err
    meant = run(
        f"plan {path} --set 'start.joints=[!degrees 30, !degrees -120, !degrees 120]'"
    )
    assert meant.code == 0
    assert "degrees" not in meant.err
    assert "--no-strict" in " ".join(refused.err.split())
    for option in ("--no-strict", "--set strict=false"):
        outcome = run(f"plan {path} {option}")
        assert outcome.code == 0, outcome.err
        assert outcome.err.count("looks like degrees") == 1
    assert run(f"bottleneck {path}").code == 2


def test_inspect_refuses_what_a_plan_refuses(run, task, write):
    task["start"] = {"joints": [30, -120, 120]}
    path = write(task)
    refused = run(f"inspect {path}")
    assert refused == run(f"plan {path}")
    assert refused.code == 2
    assert refused.err.count("degrees are") == 1
    shown = run(f"inspect {path} --set strict=false --json")
    assert shown.code == 0
    (remark,) = json.loads(shown.out)["remarks"]
    assert remark.startswith(
        "warning: start.joints: the position looks like degrees; found j1 30 rad, j2"
    )


def test_inspect_says_of_a_path_out_of_reach_that_the_robot_is_in_mm(
    run, task, write, tmp_path
):
    text = SCARA.read_text()
    (tmp_path / "mm.urdf").write_text(text.replace('xyz="1 0 0"', 'xyz="1000 0 0"'))
    task["robot"]["urdf"] = str(tmp_path / "mm.urdf")
    task["path"] = [{"line": {"by": [0.0, 1e5]}}]
    path = write(task)
    refused = run(f"inspect {path}")
    assert refused == run(f"plan {path}")
    assert refused.code == 2
    assert "the distance from the joint before looks like mm" in refused.err


def test_inspect_says_once_that_limits_look_like_degrees(run, task, write):
    task["robot"]["limits"]["velocity"] = 180
    (line,) = re.findall("warning: .*", run(f"inspect {write(task)}").out)
    assert line.startswith(
        "warning: robot.limits.velocity: the velocity limit looks like degrees per second; found j1 180 rad/s, j2"
    )


def test_a_failed_plan_shows_its_warnings(run, task, write):
    task["robot"]["limits"] = {"torque": 10, "scale": {"velocity": 80}}
    task["path"] = [{"line": {"length": 5.0, "angle_deg": 0}}]
    outcome = run(f"plan {write(task)}")
    assert outcome.code == 2
    assert outcome.err.startswith(WARNING)
    assert "out of reach" in outcome.err


def test_a_posture_in_degrees_is_warned_of(run):
    outcome = run("inspect scara3 --posture '30, -120, 120'")
    assert outcome.code == 0
    assert (
        "--posture: the position looks like degrees; found j1 30 rad, j2 -120 rad, j3 120 rad"
        in outcome.out
    )
