"""What commands may not write over, standard output that cannot be written, and inputs that never end."""

import csv
import json
import os
import re
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
import yaml

import brachis
from brachis.apps.cli.output import show_progress

from .conftest import SCARA

FULL = Path("/dev/full")
COMMAND = (sys.executable, "-m", "brachis")


@pytest.fixture(scope="module")
def saved(tmp_path_factory):
    """A saved motion with the task and the URDF that it was planned for, in one folder."""
    folder = tmp_path_factory.mktemp("saved")
    (folder / "robot.urdf").write_text(SCARA.read_text())
    (folder / "points.csv").write_text("x,y\n0,0\n0,0.1\n0,0.3\n")
    (folder / "task.yaml").write_text("""
    brachis: 1
    robot: {urdf: robot.urdf, gravity: [0, 0, 0]}
    start: {joints: [0.5236, -2.0944, 2.0944]}
    task_space: [x, y]
    path: [{csv: {file: points.csv, relative: true}}]
    redundant_joints: [j3]
    spline: {intervals: 6}
    search: {effort: single, least_motion: false}
    """)
    brachis.plan(folder / "task.yaml").trajectory.save(folder / "result.npz")
    return folder


def contents(folder):
    return {path: path.read_bytes() for path in folder.rglob("*") if path.is_file()}


OVER = [
    "export result.npz --out task.yaml",
    "export result.npz --out points.csv",
    "export result.npz --out link.csv",
    "export result.npz --out result.npz",
    "export result.npz --out result.npz --format csv",
    "plot result.npz --out task.yaml",
    "plot result.npz --out notes.png",
    "schema --out data.json",
    "schema --out result.json",
    "compose robot.urdf --out robot.urdf --range -1 1 --velocity 1 --force 100 --mass 5",
    "plan result.json --out .",
    "bottleneck bottleneck.json --out .",
]
RAIL = ("--range", "-1", "1", "--velocity", "1", "--force", "100", "--mass", "5")


@pytest.mark.parametrize("command", OVER)
def test_nothing_is_written_over_other_files(command, run, saved, monkeypatch):
    (saved / "notes.png").write_text("no figure")
    (saved / "data.json").write_text('{"a": 1}')
    (saved / "link.csv").unlink(missing_ok=True)
    (saved / "link.csv").symlink_to(saved / "points.csv")
    task = yaml.safe_load((saved / "task.yaml").read_text())
    for name in ("result.json", "bottleneck.json"):
        (saved / name).write_text(json.dumps(task))
    monkeypatch.chdir(saved)
    before = contents(saved)
    outcome = run(command, code=2)
    reasons = "overwrite an input|of a different kind|a known format"
    assert re.search(reasons, outcome.err)
    assert contents(saved) == before


@pytest.mark.parametrize("name", ["overview.png", "result.npz", "result.json"])
def test_a_folder_with_the_name_of_an_output_is_refused_before_planning(
    name, error_of, saved, tmp_path, monkeypatch
):
    (tmp_path / name).mkdir()
    monkeypatch.setattr(brachis, "plan", lambda *_, **__: pytest.fail("it planned"))
    assert f"{name}: the file cannot be written; found a folder" in error_of(
        f"plan {saved / 'task.yaml'} --out {tmp_path}"
    )


REFUSED_AT_ONCE = [
    ("report MOTION --out x.png", "suffix"),
    ("plot MOTION --out gone/x.png", "no folder gone"),
    ("report MOTION --out gone/x.html", "no folder gone"),
    ("bottleneck MOTION --out mine", "need a folder"),
    ("plot MOTION --out x.png --kind torque", "Did you mean 'torques'?"),
    ("export MOTION --out x.csv --joints j1,j1", "'j1' is given twice"),
    ("plot MOTION --out x.png --kind fit", "the path was not fitted"),
]


@pytest.mark.parametrize("command, message", REFUSED_AT_ONCE)
def test_a_wrong_output_is_an_error_before_any_work(
    command, message, error_of, saved, tmp_path, monkeypatch
):
    monkeypatch.chdir(tmp_path)
    Path("mine").write_text("a file")
    for heavy in (brachis.report, brachis.bottleneck):
        for name in {"make_report", "report"} & {*vars(heavy)}:
            monkeypatch.setattr(heavy, name, lambda *_, **__: pytest.fail("it worked"))
    assert message in error_of(command.replace("MOTION", str(saved / "result.npz")))
    assert [path.name for path in tmp_path.iterdir()] == ["mine"]


def test_a_motion_is_verified_against_an_included_robot(run, error_of, saved):
    command = f"verify {saved / 'result.npz'} --urdf"
    run(f"{command} scara3")
    assert "Did you mean 'scara3'?" in error_of(f"{command} scara4")


def test_older_files_of_the_same_kind_are_written_over(run, saved, tmp_path):
    (tmp_path / "empty.csv").touch()  # as mktemp makes it
    for words, name in (
        (("export", saved / "result.npz", "--dt", 0.1), "motion.csv"),
        (("export", saved / "result.npz", "--dt", 0.1), "empty.csv"),
        (("plot", saved / "result.npz", "--kind", "torques"), "figure.svg"),
        (("schema",), "schema.json"),
        (("compose", saved / "robot.urdf", *RAIL), "cell.urdf"),
    ):
        file = tmp_path / name
        run(*words, "--out", file)
        written = file.read_bytes()
        assert written
        file.write_bytes(written + b"older")
        run(*words, "--out", file)
        assert not file.read_bytes().endswith(b"older")


def run_writing_to(stream, *arguments):
    command = [*COMMAND, *arguments]
    return subprocess.run(
        command, stdout=stream, stderr=subprocess.PIPE, text=True, check=False
    )


@pytest.mark.skipif(not FULL.exists(), reason="only Linux has /dev/full")
@pytest.mark.parametrize(
    "arguments", [("schema",), ("--help",), ("verify", "gone", "--json")]
)
def test_a_full_disk_behind_standard_output_is_no_fault(arguments):
    with FULL.open("w") as full:
        done = run_writing_to(full, *arguments)
    assert done.returncode == 1
    assert (
        "brachis: standard output cannot be written: No space left on device\n"
        in done.stderr
    )
    assert "bug in brachis" not in done.stderr
    assert "Exception ignored" not in done.stderr


def test_a_closed_pipe_is_quiet():
    reading, writing = os.pipe()
    os.close(reading)
    done = run_writing_to(writing, "schema")
    os.close(writing)
    assert (done.returncode, done.stderr) == (1, "")


def test_closed_standard_output_is_no_fault():
    done = subprocess.run(
        ["/bin/sh", "-c", 'exec "$0" "$@" >&-', *COMMAND, "schema"],
        stderr=subprocess.PIPE,
        text=True,
        check=False,
    )
    assert (done.returncode, done.stderr) == (0, "")


@pytest.mark.parametrize("end", ["exact", "hold"])
def test_the_last_row(end, run, error_of, saved, tmp_path):
    table = tmp_path / "motion.csv"
    trajectory = brachis.Trajectory.load(saved / "result.npz")
    dt = trajectory.t_end / 7.5
    command = f"export {saved / 'result.npz'} --out {table}"
    run(f"{command} --dt {dt} --last {end}")
    with table.open() as stream:
        rows = [[float(cell) for cell in row] for row in list(csv.reader(stream))[1:]]
    assert len(rows) == 9
    assert rows[-1][0] == (trajectory.t_end if end == "exact" else 8 * dt)
    np.testing.assert_allclose(
        rows[-1][1:4], trajectory.position(trajectory.t_end), atol=1e-14
    )
    if end == "hold":
        np.testing.assert_array_equal(
            rows[-1][4:], np.zeros(9)
        )  # no gravity: nothing holds the posture
    assert "Did you mean 'hold'?" in error_of(f"{command} --last held")


def test_a_period_longer_than_the_motion_is_warned_of(run, saved, tmp_path):
    assert (
        "the period of 4 s is longer than the motion, which takes"
        in run(
            f"export {saved / 'result.npz'} --out {tmp_path / 'motion.csv'} --dt 4"
        ).err
    )
    assert len((tmp_path / "motion.csv").read_text().splitlines()) == 3


@pytest.fixture(params=["pipe", "folder", "/dev/zero", "huge"])
def endless(request, tmp_path):
    path = tmp_path / request.param.strip("/")
    if request.param == "pipe":
        os.mkfifo(path)
    elif request.param == "folder":
        path.mkdir()
    elif request.param == "huge":
        with path.open("wb") as stream:
            stream.truncate(10**12)  # takes no room
    else:
        path = Path(request.param)
    return path


@pytest.mark.parametrize("name", ["circle", "circle/out", "result.npz/out", "a" * 5000])
def test_outputs_that_the_system_refuses(name, run, saved, tmp_path):
    (tmp_path / "circle").symlink_to("circle")
    out = saved / name if name.startswith("result") else tmp_path / name
    for command in (
        ("export", saved / "result.npz", "--format", "csv"),
        ("report", saved / "result.npz"),
        ("compose", saved / "robot.urdf", *RAIL),
        ("new", "scara3"),
        ("schema",),
        ("plan", saved / "task.yaml"),
    ):
        outcome = run(*command, "--out", out, code=2)
        assert "cannot be" in outcome.err or "no folder" in outcome.err, command
        assert len(outcome.err.splitlines()) == 1, command


@pytest.mark.parametrize(
    "name", ["a" * 5000, "circle", "[/red]:x:[bold]", "result.npz/x"]
)
def test_inputs_that_the_system_refuses(name, run, saved, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    Path("circle").symlink_to("circle")
    path = saved / name if name.startswith("result") else name
    commands = "plan inspect verify view report bottleneck new sweep"
    for command in commands.split():
        outcome = run(f"{command} {path}", code=2)
        assert name in outcome.err, command
        assert "internal" not in outcome.err, command


def test_progress_takes_names_with_brackets(monkeypatch, capfd):
    monkeypatch.setenv("FORCE_COLOR", "1")
    monkeypatch.setenv("TERM", "xterm")
    with show_progress() as listener:
        listener("looking at [/red]:x:")
    assert "[/red]:x:" in capfd.readouterr().err


def test_endless_inputs_are_errors(endless, run, saved, tmp_path):
    task = yaml.safe_load((saved / "task.yaml").read_text())
    task["robot"]["urdf"] = str(saved / "robot.urdf")
    by_csv = {**task, "path": [{"csv": {"file": str(endless), "relative": True}}]}
    by_urdf = {**task, "robot": {"urdf": str(endless)}}
    (tmp_path / "csv.yaml").write_text(yaml.safe_dump(by_csv))
    (tmp_path / "urdf.yaml").write_text(
        yaml.safe_dump({**by_urdf, "path": [{"line": {"by": [0.1, 0.0]}}]})
    )
    for command in (
        ("plan", endless),
        ("plan", tmp_path / "csv.yaml"),
        ("plan", tmp_path / "urdf.yaml"),
        ("inspect", endless),
        ("verify", endless),
        ("compose", endless, *RAIL, "--out", tmp_path / "new.urdf"),
    ):
        outcome = run(*command, code=2)
        assert str(endless) in outcome.err
        assert re.search("a pipe|a folder|this folder|a device|MB", outcome.err)
