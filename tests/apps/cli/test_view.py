import json
import os
import signal
import subprocess
import sys
import urllib.request

import pytest

from brachis.apps.cli.motions import _read_candidates
from brachis.apps.view import Viewer
from brachis.trajectory import Trajectory

pytest.importorskip("viser", reason="viser is not installed")


@pytest.fixture
def looked_at(monkeypatch):
    """Do not wait for Ctrl-C: look at the page once, and keep what was shown."""
    seen = []

    def look(viewer):
        with urllib.request.urlopen(viewer.url, timeout=10) as answer:  # noqa: S310  (our own page)
            assert answer.status == 200
        seen.append(viewer.url)

    monkeypatch.setattr(Viewer, "wait", look)
    return seen


def test_a_plan_opens_the_viewer(run, write, task, looked_at):
    task["search"] = {"effort": "single"}
    planned = run(f"plan {write(task)} --view")
    assert f"look at {looked_at.pop()}" in planned.out
    assert "Ctrl-C stops the viewer" in planned.err


@pytest.mark.parametrize("folder", [False, True])
def test_a_saved_motion_is_shown_by_its_file_or_its_folder(
    run, result, looked_at, folder
):
    shown = run(f"view {result.parent if folder else result} --port 0").out
    assert f"look at {looked_at.pop()}" in shown


def test_the_candidates_are_those_of_the_json_beside_the_motion(result, tmp_path):
    trajectory = Trajectory.load(result)
    beside = result.with_suffix(".json")
    data = json.loads(beside.read_text())
    assert _read_candidates(result, trajectory) == data["candidates"] != []
    for text in (
        "nonsense",
        json.dumps({**data, "t_end": 9.0}),
        json.dumps({"t_end": trajectory.t_end}),
        "[1]",
    ):
        (tmp_path / "result.json").write_text(text)
        assert _read_candidates(tmp_path / "result.npz", trajectory) == []


def test_other_machines_are_let_in_with_a_warning(run, result, looked_at):
    assert (
        "warning: anyone who can reach 0.0.0.0 can watch"
        in run(f"view {result} --port 0 --host 0.0.0.0").err
    )
    assert looked_at.pop().startswith("http://127.0.0.1:")


def test_ctrl_c_stops_the_viewer(result):
    command = [sys.executable, "-m", "brachis", "view", str(result), "--port", "0"]
    with subprocess.Popen(
        command, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True
    ) as viewer:
        assert "look at http://127.0.0.1:" in viewer.stdout.readline()
        os.kill(viewer.pid, signal.SIGINT)
        _, told = viewer.communicate(timeout=60)
    assert viewer.returncode == 0
    assert told == "brachis: Ctrl-C stops the viewer\n"
