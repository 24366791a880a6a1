"""Sweeps in processes of this machine: outcomes, folders, and going on."""

import json
import os
import shutil
import signal
import subprocess
import sys
import time
from types import SimpleNamespace

import pytest
import yaml

import brachis
from brachis.apps.sweeps import run
from brachis.apps.sweeps.plans import run_plan
from brachis.errors import InputError, TaskError

WAIT = 120.0


@pytest.fixture
def nothing_runs(monkeypatch):
    """Planning anything is an error."""

    def pool_for(*_settings):
        def pool(plans):
            assert plans == []
            yield from ()

        return pool

    monkeypatch.setattr(run, "pool_for", pool_for)


@pytest.fixture
def folder(undisturbed, tmp_path):
    """A copy of the undisturbed sweep."""
    return shutil.copytree(undisturbed.folder, tmp_path / "copy")


@pytest.fixture
def here(monkeypatch):
    """Plans are made in this process; returns those that were, and whether the pool has ended."""
    calls = SimpleNamespace(plans=[], ended=False)

    def pool(plans):
        try:
            for plan in plans:
                calls.plans.append(plan)
                yield plan, run_plan(plan)
        finally:
            calls.ended = True

    monkeypatch.setattr(run, "pool_for", lambda *_settings: pool)
    return calls


def test_every_plan_is_a_row_and_equal_ones_come_once(undisturbed):
    rows = undisturbed.rows()
    assert [
        (row["path.0.line.angle_deg"], row["path.0.line.length"]) for row in rows
    ] == [(angle, length) for angle in (80, 90) for length in (0.9, 9.0, 0.9)]
    assert [row["status"] for row in rows] == ["verified", "failed", "failed"] * 2
    assert all(
        1.0 < row["t_end_s"] < 5.0 and row["worst_ratio"] < 1.001 for row in rows[::3]
    )


def test_no_worker_outlives_a_full_disk(content, here, tmp_path, monkeypatch):
    def full(*_arguments):
        raise InputError("cannot be written", found="No space left on device")

    monkeypatch.setattr(run.Store, "write", full)
    with pytest.raises(InputError, match="No space left"):
        brachis.sweep(content, tmp_path / "out")
    assert here.ended


def test_failures_say_why(undisturbed):
    rows = undisturbed.rows()
    assert rows[2]["error"] == "TaskError"
    assert "spline.degree: out of range; found 9" in rows[2]["message"]
    assert rows[1]["error"] != "TaskError"
    assert "reach" in rows[1]["message"]
    assert [count for count, _ in undisturbed.failures().values()] == [2, 2]


def test_motions_are_those_of_the_plans(undisturbed, content):
    trajectory = undisturbed.trajectory(3)
    assert trajectory.t_end == undisturbed.rows()[3]["t_end_s"]
    assert trajectory.task.path[0].line.angle_deg == 90.0
    assert brachis.verify_trajectory(trajectory).passed
    assert trajectory.task.spline.intervals == content["fixed"]["spline.intervals"]
    with pytest.raises(InputError, match=r"plan 1 failed; found \w+: "):
        undisturbed.trajectory(1)
    with pytest.raises(InputError, match="0 to 5"):
        undisturbed.trajectory(6)


def test_a_sweep_is_summed_up(undisturbed):
    summary = undisturbed.summary()
    assert (summary["plans"], summary["verified"], summary["failed"]) == (6, 2, 4)
    times = sorted(row["t_end_s"] for row in undisturbed.rows() if row["t_end_s"])
    assert [summary[name]["t_end_s"] for name in ("best", "worst")] == times
    assert repr(undisturbed).startswith(
        "SweepResult\n  plans        6\n  verified     2\n"
    )


def test_tables_are_read_back(undisturbed):
    again = brachis.SweepResult.load(undisturbed.folder)
    assert again.keys == undisturbed.keys
    assert again.table.equals(undisturbed.table)
    frame = undisturbed.to_dataframe()
    assert frame["t_end_s"].notna().sum() == 2
    header, *rows = (undisturbed.folder / "table.csv").read_text().splitlines()
    assert header.startswith('"plan","path.0.line.angle_deg","path.0.line.length",')
    assert len(rows) == 6


@pytest.mark.usefixtures("nothing_runs")
def test_a_finished_sweep_is_not_run_again(undisturbed, content, same_as_undisturbed):
    assert same_as_undisturbed(brachis.sweep(content, undisturbed.folder).table)


def test_another_sweep_of_the_folder_adds_its_plans(undisturbed, content, here, folder):
    content |= {
        "grid": {"path.0.line.length": [9.0, 0.9], "path.0.line.angle_deg": [95, 90]},
        "rows": [],
    }
    result = brachis.sweep(content, folder)
    assert [plan.task.path[0].line.angle_deg for plan in here.plans] == [95.0, 95.0]
    statuses = [row["status"] for row in result.rows()]
    assert statuses == ["failed"] * 2 + ["verified"] * 2
    assert result.rows()[3]["t_end_s"] == undisturbed.rows()[3]["t_end_s"]


def test_retry_plans_failures_again(content, here, folder, same_as_undisturbed):
    assert same_as_undisturbed(brachis.sweep(content, folder, retry=True).table)
    assert [plan.task.path[0].line.length for plan in here.plans] == [9.0] * 2


@pytest.mark.parametrize("damage", ["row", "motion", "cut"])
def test_what_is_not_stored_whole_is_planned_again(
    undisturbed, content, here, folder, damage, same_as_undisturbed
):
    motion = folder / undisturbed.rows()[0]["motion"]
    row = motion.with_suffix(".parquet")
    if damage == "cut":
        row.write_bytes(row.read_bytes()[:-20])
    else:
        (row if damage == "row" else motion).unlink()
    assert same_as_undisturbed(brachis.sweep(content, folder).table)
    assert [plan.digest for plan in here.plans] == [motion.stem]
    assert brachis.Trajectory.load(motion).t_end == pytest.approx(
        undisturbed.rows()[0]["t_end_s"], rel=1e-6
    )


@pytest.mark.usefixtures("nothing_runs")
def test_folders_of_others_are_left_alone(content, tmp_path):
    (tmp_path / "thesis.tex").write_text("...")
    for use in (
        lambda: brachis.sweep(content, tmp_path),
        lambda: brachis.SweepResult.load(tmp_path),
    ):
        with pytest.raises(
            InputError,
            match=r"contains (other files|no sweep); allowed: (a new folder, or one|a folder) with",
        ):
            use()
    assert [path.name for path in tmp_path.iterdir()] == ["thesis.tex"]


@pytest.mark.usefixtures("nothing_runs")
@pytest.mark.parametrize(
    "change, message",
    [
        (
            "grid: {path.0.line.lenght: [1, 2]}",
            r"sweep: path.0.line.lenght.*\(6\).*Did you mean 'length'",
        ),
        ("grid: {path.1.line.length: [1, 2]}", "path is a list of 1.*path.1"),
        (
            "grid: {robot.limits.torque.scale: [1, 2]}",
            "robot.limits.torque is a value without keys.*found 10",
        ),
        (
            "grid: {robot.limits.acceleration.j9: [1.0, 2.0]}",
            "joint named 'j9'.*j1, j2, j3",
        ),
        ("grid: {spline.degree: []}", "grid.spline.degree.*too few items"),
        ("grid: {spline.degree: {linera: [1, 2, 3]}}", "Did you mean 'linear'"),
        (
            "random: {count: 2, keys: {start.joints.0: {uniform: [1, 0]}}}",
            r"found \[1.*low < high",
        ),
        (
            "rows: [{path.0.line.angle_deg: 1.0}]",
            "path.0.line.angle_deg is varied twice.*in grid and in rows",
        ),
        ("task: 3", "this is not a task.*found 3"),
        ("task: nothing.yaml", "nothing.yaml.*the file does not exist"),
    ],
)
def test_a_mistake_is_an_error_before_anything_runs(content, tmp_path, change, message):
    with pytest.raises(TaskError, match=message):
        brachis.sweep({**content, **yaml.safe_load(change)}, tmp_path / "out")
    assert not (tmp_path / "out").exists()


@pytest.mark.usefixtures("here")
def test_the_listener_hears_the_time_to_go(undisturbed, content, folder):
    messages = []
    (folder / undisturbed.rows()[0]["motion"]).unlink()
    brachis.sweep(content, folder, listener=messages.append)
    assert messages[1] == "3 of 4 plans are stored already"
    assert messages[2] == "4 of 4 plans, 2 failed; 0:00:00 left"


def test_a_sweep_that_is_killed_goes_on(content, here, tmp_path, same_as_undisturbed):
    source, folder = tmp_path / "sweep.yaml", tmp_path / "sweep"
    source.write_text(yaml.safe_dump(content))
    command = [sys.executable, "-m", "brachis", "sweep", str(source), "--jobs", "1"]
    with subprocess.Popen(
        command, cwd=tmp_path, stderr=subprocess.DEVNULL, start_new_session=True
    ) as process:
        try:
            until = time.monotonic() + WAIT
            while len(list(folder.glob("plans/*/*.parquet"))) < 2:
                assert process.poll() is None
                assert time.monotonic() < until
                time.sleep(0.01)
        finally:
            os.killpg(process.pid, signal.SIGKILL)
    finished = {
        path: path.stat().st_mtime_ns for path in folder.glob("plans/*/*.parquet")
    }
    assert 2 <= len(finished) < 4
    result = brachis.sweep(source, folder)
    assert same_as_undisturbed(result.table)
    assert len(here.plans) == 4 - len(finished)
    assert {path: path.stat().st_mtime_ns for path in finished} == finished
    settings = json.loads((folder / "sweep.json").read_text())["settings"]
    assert settings["grid"] == content["grid"]


def test_parts_of_a_sweep_give_one_table_by_merge(
    content, tmp_path, here, same_as_undisturbed
):
    out = tmp_path / "out"
    lines = {}
    for share in ("1/4", "2/4", "3/4"):
        result = brachis.sweep(content, out, part=share)
        lines[share] = result.table.column("plan").to_pylist()
        names = [path.name for path in result.files if path.exists()]
        name = f"table-{share.replace('/', '-of-')}"
        assert names == [f"{name}.parquet", f"{name}.csv"]
    assert lines == {"1/4": [0, 4], "2/4": [1, 5], "3/4": [2]}
    assert len(here.plans) == 3
    with pytest.raises(
        InputError,
        match=r"merge: parts of the sweep are missing; found no result for 1 plan: 3\. Run the missing parts",
    ):
        brachis.sweep(content, out, merge=True)
    assert not (out / "table.parquet").exists()
    brachis.sweep(content, out, part="4/4")
    merged = brachis.sweep(content, out, merge=True)
    assert len(here.plans) == 4
    assert brachis.SweepResult.load(out).table.equals(merged.table)
    assert same_as_undisturbed(merged.table)


@pytest.mark.usefixtures("nothing_runs")
@pytest.mark.parametrize("part", ["0/2", "3/2", "7/7", "1/", "a/b"])
def test_wrong_parts_are_errors(content, tmp_path, part):
    with pytest.raises(
        InputError,
        match=f"part: this is not a part of the sweep; found {part}; allowed: i/n.* n <= 6",
    ):
        brachis.sweep(content, tmp_path / "out", part=part)
    assert not (tmp_path / "out").exists()
