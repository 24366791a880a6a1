"""Figures that are hardly meant, on the command line: one message each on standard error, an error with --strict."""

import json
import re
from pathlib import Path

import pytest

from support.effort import QUICK

SCARA = Path(__file__).parents[3] / "robots/scara3/robot.urdf"
WARNING = "brachis: warning: robot.limits.scale.velocity: the factor raises limits far above the stated values"


@pytest.fixture
def percent(task, write):
    task["robot"]["limits"] = {"torque": 10, "scale": {"velocity": 80}}
    task |= {"search": QUICK, "spline": {"intervals": 10}}
    return write(task)


@pytest.mark.parametrize("command", ["plan", "bottleneck"])
def test_warned_once_and_in_the_json(command, run, percent, tmp_path):
    out = tmp_path / "out"
    outcome = run(f"{command} {percent} --json --out {out}")
    assert outcome.err.count("warning: robot.limits") == 1
    assert outcome.err.count("warning: spline.intervals") == 1
    assert outcome.err.startswith(WARNING)
    warning, slow = outcome.data["warnings"]
    assert slow["where"] == "spline.intervals"
    assert warning["where"] == "robot.limits.scale.velocity"
    (written,) = out.glob("*.json")
    assert json.loads(written.read_text())["warnings"] == [warning, slow]


@pytest.mark.parametrize("command", ["plan", "bottleneck"])
def test_strict_is_wrong_input(command, run, percent):
    outcome = run(f"{command} {percent} --strict", code=2)
    assert outcome.out == ""
    assert "not plausible" in outcome.err
    assert "robot.limits.scale.velocity" in outcome.err
    assert "warning:" not in outcome.err


def test_a_start_posture_in_degrees_is_refused_and_the_way_out_works(run, task, write):
    task["start"] = {"joints": [30, -120, 120]}
    task |= {"search": QUICK, "spline": {"intervals": 10}}
    path = write(task)
    refused = run(f"plan {path}", code=2)
    assert (
        "start.joints: the position looks like degrees; found j1 30 rad, j2 -120 rad, j3 120 rad"
        in refused.err
    )
    assert "30 degrees are 0.523599 rad; in a task file: !degrees 30" in refused.err
    assert (
        "degrees"
        not in run(
            f"plan {path} --set 'start.joints=[!degrees 30, !degrees -120, !degrees 120]'"
        ).err
    )
    assert "--no-strict" in " ".join(refused.err.split())
    for option in ("--no-strict", "--set strict=false"):
        assert run(f"plan {path} {option}").err.count("looks like degrees") == 1
    run(f"bottleneck {path}", code=2)


def test_inspect_refuses_what_a_plan_refuses(run, task, write):
    task["start"] = {"joints": [30, -120, 120]}
    path = write(task)
    refused = run(f"inspect {path}", code=2)
    assert refused == run(f"plan {path}", code=2)
    assert refused.err.count("degrees are") == 1
    shown = run(f"inspect {path} --set strict=false --json")
    (remark,) = shown.data["remarks"]
    assert remark.startswith(
        "warning: start.joints: the position looks like degrees; found j1 30 rad, j2"
    )


def test_inspect_says_once_that_limits_look_like_degrees(run, task, write):
    task["robot"]["limits"]["velocity"] = 180
    (line,) = re.findall("warning: .*", run(f"inspect {write(task)}").out)
    assert line.startswith(
        "warning: robot.limits.velocity: the velocity limit looks like degrees per second; found j1 180 rad/s, j2"
    )


def test_a_failed_plan_shows_its_warnings(run, task, write):
    task["robot"]["limits"] = {"torque": 10, "scale": {"velocity": 80}}
    task["path"] = [{"line": {"length": 5.0, "angle_deg": 0}}]
    outcome = run(f"plan {write(task)}", code=2)
    assert outcome.err.startswith(WARNING)
    assert "out of reach" in outcome.err
