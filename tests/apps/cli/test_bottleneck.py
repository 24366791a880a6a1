"""``brachis bottleneck``: what it prints and writes."""

import dataclasses
import json
import re

import pytest

import brachis
from brachis import planner

from .conftest import SCARA


def test_in_plain_words(run, task, write):
    task["spline"]["intervals"] = 20
    outcome = run(f"bottleneck {write(task)}")
    assert "end time t_E: 2.47" in outcome.out
    savings = re.findall(
        r"10 % more torque at (j\d) \(1 Nm\) saves (\S+) % \((\S+) ms\)", outcome.out
    )
    assert [joint for joint, *_ in savings] == ["j1", "j2"]
    percent, milliseconds = float(savings[0][1]), float(savings[0][2])
    assert percent == pytest.approx(3.8, abs=0.2)
    assert milliseconds == pytest.approx(10.0 * percent * 2.475, rel=0.05)
    assert "no other limit costs time" in outcome.out
    assert re.search(
        r"j2 is at its torque limit for \d+\.\d % of the time", outcome.out
    )
    assert "reference" not in outcome.out
    assert "checked" not in outcome.out


def test_check_and_reference(run, task, write):
    task["spline"]["intervals"] = 10
    outcome = run(f"bottleneck {write(task)} --check --reference")
    checked = re.findall(
        r"checked, (\S+) torque \+1 %: predicted (\S+) ms, solved again (\S+) ms",
        outcome.out,
    )
    assert {joint for joint, *_ in checked} >= {"j1", "j2"}
    for _, predicted, solved_again in checked:
        assert float(predicted) == pytest.approx(float(solved_again), rel=0.05)
    assert re.search(
        r"reference 2\.\d+ s \(.*not a proven bound.*\): the motion takes \d+\.\d+ % \(.* ms\) longer",
        outcome.out,
    )


def test_json(run, task, write):
    outcome = run(f"bottleneck {write(task)} --json")
    data = json.loads(outcome.out, parse_constant=pytest.fail)
    assert data["verified"] is True
    report = data["bottleneck"]
    assert report["t_end_s"] == data["t_end"]
    assert report["sensitivities"]["multipliers"] == "solver"
    first = report["sensitivities"]["limits"][0]
    assert (first["subject"], first["kind"], first["unit"]) == ("j1", "torque", "Nm")
    per_percent = 0.01 * first["derivative_s_per_unit"] * first["limit"]
    assert first["change_for_1_percent_s"] == pytest.approx(per_percent)
    assert {entry["subject"] for entry in report["saturations"]} == {"j1", "j2", "j3"}
    assert (report["check"], report["reference"]) == (None, None)


def test_files(run, task, write, tmp_path):
    out = tmp_path / "out"
    outcome = run(f"bottleneck {write(task)} --out {out} --verbose")
    assert outcome.err.endswith(" s: drawing timeline.png\n")
    assert f"wrote {out / 'timeline.png'}" in outcome.out
    assert {path.name for path in out.iterdir()} == {"bottleneck.json", "timeline.png"}
    data = json.loads((out / "bottleneck.json").read_text())
    assert data["bottleneck"]["sensitivities"]["reliable"] is True
    assert (out / "timeline.png").read_bytes().startswith(b"\x89PNG")


def test_unverified_motion(run, task, write, tmp_path, request):
    out = tmp_path / "out"
    run(f"bottleneck {write(task)} --out {out}")
    request.getfixturevalue("too_strict")
    assert (
        "did not pass the verification"
        in run(f"bottleneck {write(task)} --out {out}", code=1).err
    )
    names = {path.name for path in out.iterdir()}
    assert names == {"unverified_bottleneck.json", "unverified_timeline.png"}


def test_the_command_says_that_the_search_ended_early(run, task, write, monkeypatch):
    honest = planner.plan

    def plan(*arguments, **options):
        return dataclasses.replace(honest(*arguments, **options), interrupted=True)

    monkeypatch.setattr(planner, "plan", plan)
    assert "ended early" in run(f"bottleneck {write(task)}").err


def test_a_saved_motion_is_explained_without_solving_again(run, task, write, tmp_path):
    out = tmp_path / "out"
    task["spline"]["intervals"] = 10
    run(f"plan {write(task)} --out {out} --no-figures")
    motion = out / "result.npz"
    t_end = brachis.Trajectory.load(motion).t_end
    outcome = run(f"bottleneck {motion} --verbose --out {out}")
    assert outcome.out.startswith(f"end time t_E: {t_end:.4f} s")
    assert "more torque at j1" in outcome.out
    assert "solving the problem" not in outcome.err
    data = json.loads((out / "bottleneck.json").read_text())
    assert data["verified"] is True
    assert data["t_end"] == pytest.approx(t_end, rel=1e-6)
    assert {path.name for path in out.iterdir()} >= {"result.npz", "timeline.png"}


def test_a_saved_motion_keeps_its_urdf(error_of, tmp_path):
    assert "this option cannot be used with a saved motion" in error_of(
        f"bottleneck {tmp_path / 'result.npz'} --urdf {SCARA}"
    )
