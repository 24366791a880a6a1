"""What the commands print and write."""

from __future__ import annotations

import csv
import json
import sys

import numpy as np
import pytest

from brachis import attempts, planner
from brachis.verify import VerifyOptions

from .conftest import SCARA


@pytest.fixture
def planned(run, task, write, tmp_path):
    outcome = run("plan", write(task), "--out", tmp_path / "out", "--json")
    assert outcome.code == 0, outcome.err
    return json.loads(outcome.out), tmp_path / "out"


def test_plan_json(planned):
    data, _ = planned
    required = {
        "t_end",
        "redundant_joints",
        "branch",
        "status",
        "solver",
        "iterations",
        "wall_time_s",
        "verified",
        "worst_ratio",
        "path_error",
    }
    assert required <= data.keys()
    assert data["verified"] is True
    assert 2.0 < data["t_end"] <= 2.478
    assert data["redundant_joints"] == ["j3"]
    assert data["worst_ratio"] <= 1 + 1e-4
    assert data["path_error"] <= 1e-9


def test_plan_writes_what_it_says(planned):
    data, out = planned
    assert sorted(path.name for path in out.iterdir()) == ["overview.png", "result.json", "result.npz"]
    assert sorted(data["files"]) == sorted(str(path) for path in out.iterdir())
    assert json.loads((out / "result.json").read_text())["t_end"] == data["t_end"]


def test_plan_for_people(run, task, write):
    outcome = run("plan", write(task))
    assert outcome.code == 0
    for part in ("end time t_E", "2.47", "verification: passed", "torque ratio", "torque jump"):
        assert part in outcome.out
    assert outcome.err == ""  # no progress display in a pipe


def test_unverified_plan_says_so(run, task, write, tmp_path, monkeypatch):
    honest = planner.verify_trajectory
    strict = VerifyOptions(ratio_tolerance=-0.5)
    monkeypatch.setattr(planner, "verify_trajectory", lambda trajectory, _options: honest(trajectory, strict))
    outcome = run("plan", write(task), "--out", tmp_path / "out", "--json")
    assert outcome.code == 1
    assert json.loads(outcome.out)["verified"] is False
    assert "unverified" in outcome.err
    assert (tmp_path / "out/unverified.npz").exists()
    assert not (tmp_path / "out/result.npz").exists()


def test_interrupt(run, task, write, tmp_path, monkeypatch):
    def interrupt(*_arguments, **_options):
        raise KeyboardInterrupt

    monkeypatch.setattr(attempts, "guesses", interrupt)
    outcome = run("plan", write(task), "--out", tmp_path / "out")
    assert outcome.code == 130
    assert "interrupted" in outcome.err
    assert not list((tmp_path / "out").iterdir())


def test_verify(run, planned):
    _, out = planned
    outcome = run("verify", out / "result.npz")
    assert outcome.code == 0
    assert "verification: passed" in outcome.out
    data = json.loads(run("verify", out / "result.npz", "--json").out)
    assert data["passed"] is True


def test_verify_against_a_weaker_robot_fails(run, task, write, tmp_path):
    task["robot"]["limits"] = {"velocity": None}  # torque limits from the URDF
    assert run("plan", write(task), "--out", tmp_path / "out").code == 0
    weaker = tmp_path / "weaker.urdf"
    weaker.write_text(SCARA.read_text().replace('effort="10"', 'effort="9"'))
    outcome = run("verify", tmp_path / "out/result.npz", "--urdf", weaker, "--json")
    assert outcome.code == 1
    assert json.loads(outcome.out)["worst_ratio"] == pytest.approx(10 / 9, rel=1e-3)


def test_export(run, planned, tmp_path):
    data, out = planned
    table = tmp_path / "motion.csv"
    assert run("export", out / "result.npz", "--csv", table, "--dt", 0.01).code == 0
    with table.open() as stream:
        rows = list(csv.reader(stream))
    names = ["j1", "j2", "j3"]
    assert rows[0] == ["t", *(f"{kind}_{name}" for kind in ("q", "qd", "qdd", "tau") for name in names)]
    times = np.array([float(row[0]) for row in rows[1:]])
    assert times[-1] == data["t_end"]
    np.testing.assert_allclose(np.diff(times)[:-1], 0.01)


@pytest.mark.parametrize("kind", ["torques", "postures", "motion", "overview"])
def test_plot(kind, run, planned, tmp_path):
    _, out = planned
    figure = tmp_path / f"{kind}.svg"
    assert run("plot", out / "result.npz", "--kind", kind, "--out", figure).code == 0
    assert b"<svg" in figure.read_bytes()


def test_plot_of_unknown_kind(run, planned, tmp_path):
    outcome = run("plot", planned[1] / "result.npz", "--kind", "torque", "--out", tmp_path / "x.png")
    assert outcome.code == 2
    assert "Did you mean 'torques'?" in outcome.err


def test_inspect(run):
    outcome = run("inspect", SCARA, "--task-space", "x,y")
    assert outcome.code == 0
    assert outcome.out.count("closed_form") == 3
    data = json.loads(run("inspect", SCARA, "--task-space", "x,y", "--json").out)
    assert data["degree_of_redundancy"] == 1
    assert [row["redundant joints"] for row in data["decompositions"]] == ["j1", "j2", "j3"]
    assert {row["branches"] for row in data["decompositions"]} == {2}
    assert data["joints"][0]["effort"] == "10 Nm"


def test_inspect_says_why_not(run):
    outcome = run("inspect", SCARA, "--task-space", "x,z", "--json")
    assert outcome.code == 0
    for row in json.loads(outcome.out)["decompositions"]:
        assert row["solver"] == "-"
        assert "do not fit the plane" in row["why not"]


def test_inspect_with_locked_joint(run):
    data = json.loads(run("inspect", SCARA, "--task-space", "x,y", "--lock", "j3=0.5", "--json").out)
    assert data["degree_of_redundancy"] == 0
    assert run("inspect", SCARA, "--lock", "j3").code == 2


def test_schema(run, tmp_path):
    printed = json.loads(run("schema").out)
    assert "redundant_joints" in printed["properties"]
    assert run("schema", "--out", tmp_path / "schema.json").code == 0
    assert json.loads((tmp_path / "schema.json").read_text()) == printed


def test_module_runs(capfd, monkeypatch):
    import runpy  # noqa: PLC0415

    monkeypatch.setattr(sys, "argv", ["brachis", "--help"])
    with pytest.raises(SystemExit):
        runpy.run_module("brachis", run_name="__main__")
    assert "inspect" in capfd.readouterr().out
