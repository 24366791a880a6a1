"""``brachis sweep``, with plans that cost nothing."""

from __future__ import annotations

import json

import pytest
import yaml

from brachis.apps.sweeps import run as sweeps_run
from brachis.apps.sweeps.plans import PlanOutcome


@pytest.fixture
def sweep_file(tmp_path, write, task, monkeypatch):
    """A file of four plans, of which the fourth fails; end times are made up."""

    def pool(plans):
        for plan in plans:
            length = plan.task.path[0].line.length
            if length > 3.0:
                yield (
                    plan,
                    PlanOutcome(
                        {
                            "status": "failed",
                            "error": "PathError",
                            "message": "out of reach",
                        }
                    ),
                )
            else:
                yield (
                    plan,
                    PlanOutcome(
                        {
                            "status": "verified",
                            "t_end_s": length / 2.0,
                            "wall_time_s": 40.0,
                        }
                    ),
                )

    monkeypatch.setattr(sweeps_run, "pool_for", lambda *_settings: pool)
    content = {
        "sweep": 1,
        "task": str(write(task)),
        "grid": {"path.0.line.length": [1.0, 2.0, 3.0, 4.0]},
    }
    path = tmp_path / "lengths.yaml"
    path.write_text(yaml.safe_dump(content))
    return path


def test_a_sweep_is_shown(run, sweep_file, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    done = run("sweep", sweep_file, "--verbose")
    assert done.code == 0
    lines = done.out.splitlines()
    cells = [
        [cell.strip() for cell in line.strip("│").split("│")]
        for line in lines
        if line.startswith("│")
    ]
    assert cells == [
        ["plans", "4"],
        ["verified", "3"],
        ["unverified", "0"],
        ["failed", "1"],
        ["best", "plan: 0, path.0.line.length: 1, t_end_s: 0.5"],
        ["median", "plan: 1, path.0.line.length: 2, t_end_s: 1"],
        ["worst", "plan: 2, path.0.line.length: 3, t_end_s: 1.5"],
        ["wall_time_s", "120"],
    ]
    assert "1 failed with PathError, for example: out of reach" in lines
    assert [line for line in lines if line.startswith("wrote")] == [
        f"wrote lengths/{name}" for name in ("table.parquet", "table.csv", "sweep.png")
    ]
    assert (tmp_path / "lengths/sweep.png").read_bytes().startswith(b"\x89PNG")
    assert " s: 0 of 4 plans\n" in done.err
    assert "4 of 4 plans, 1 failed; 0:00:00 left" in done.err


def test_a_sweep_as_json(run, sweep_file, tmp_path):
    done = run("sweep", sweep_file, "--out", tmp_path / "out", "--json")
    told = json.loads(done.out)
    assert (told["plans"], told["verified"], told["failed"]) == (4, 3, 1)
    assert told["best"] == {"plan": 0, "path.0.line.length": 1.0, "t_end_s": 0.5}
    assert told["failures"] == {"PathError": {"plans": 1, "message": "out of reach"}}
    assert [name.rsplit("/")[-1] for name in told["files"]] == [
        "table.parquet",
        "table.csv",
        "sweep.png",
    ]


def test_no_verified_plan_is_exit_code_1(run, sweep_file, tmp_path):
    content = yaml.safe_load(sweep_file.read_text())
    content["grid"]["path.0.line.length"] = [4.0, 5.0]
    sweep_file.write_text(yaml.safe_dump(content))
    done = run("sweep", sweep_file, "--out", tmp_path / "out")
    assert done.code == 1
    assert "2 failed with PathError" in done.out
    assert not (tmp_path / "out/sweep.png").exists()


def test_a_wrong_key_is_exit_code_2(run, sweep_file, tmp_path):
    sweep_file.write_text(sweep_file.read_text().replace("length", "lenght"))
    done = run("sweep", sweep_file, "--out", tmp_path / "out")
    assert done.code == 2
    assert "Did you mean 'length'?" in done.err
    assert not (tmp_path / "out").exists()


def test_parts_are_planned_by_themselves_and_merged(run, sweep_file, tmp_path):
    out = ("--out", tmp_path / "out")
    first = run("sweep", sweep_file, "--part", "1/2", *out)
    assert first.code == 0
    assert "│ plans       │ 2 " in first.out
    assert f"wrote {tmp_path / 'out/table-1-of-2.csv'}" in "".join(
        first.out.split("\n")
    )
    missing = run("sweep", sweep_file, "--merge", *out)
    assert missing.code == 2
    assert "found no result of 2 plans: 1, 3" in missing.err
    assert run("sweep", sweep_file, "--part", "2/2", *out).code == 0
    assert not (tmp_path / "out/sweep.png").exists()
    merged = run("sweep", sweep_file, "--merge", *out, "--json")
    assert merged.code == 0
    assert json.loads(merged.out)["plans"] == 4
