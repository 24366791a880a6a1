"""Progress: a line on standard error, the log, and nothing for those who ask for nothing."""

import logging
import subprocess
import sys

import pytest

import brachis

LINE = brachis.examples.scara_line
QUICK = {"redundant_joints": ["j1"], "intervals": 8, "effort": "single"}
SCRIPT = """
import brachis
outcomes = brachis.plan_many([brachis.examples.scara_line] * 2, jobs=2, intervals=4, effort="single")
print([outcome.verified for outcome in outcomes])
"""


def test_nothing_is_said_unless_asked_for(capfd):
    brachis.plan(LINE, **QUICK)
    assert capfd.readouterr() == ("", "")


def test_the_log_has_stages_at_info_and_iterations_at_debug(caplog):
    with caplog.at_level(logging.DEBUG, logger="brachis"):
        result = brachis.plan(LINE, **QUICK)
    stages, details = (
        [record.message for record in caplog.records if record.levelno == level]
        for level in (logging.INFO, logging.DEBUG)
    )
    first = "planning for 3 joints along a path of 1 segment, task space [x, y]"
    assert stages[0] == first
    assert stages[-1].startswith(f"planned: t_E = {result.t_end:.4f} s, verified")
    assert details
    assert all("iteration" in text for text in details)
    assert not any("iteration" in text for text in stages)
    assert {record.name for record in caplog.records} == {"brachis"}


def test_progress_is_a_line_for_every_stage_where_there_is_no_terminal(capsys):
    heard = []
    brachis.plan(
        brachis.examples.scara_line, **QUICK, progress=True, listener=heard.append
    )
    lines = capsys.readouterr().err.splitlines()
    assert lines == [text for text in heard if "iteration" not in text]
    assert len(heard) > len(lines) > 2


def test_on_a_terminal_the_line_is_blank_at_last(monkeypatch, capsys):
    monkeypatch.setattr("sys.stderr.isatty", lambda: True, raising=False)
    with pytest.raises(brachis.PlanningError):
        brachis.plan(
            brachis.examples.scara_line, **QUICK, time_limit=1e-3, progress=True
        )
    text = capsys.readouterr().err
    assert "\n" not in text
    assert text.startswith("\rplanning for 3 joints")
    assert text.rpartition("\r")[0].rpartition("\r")[2].strip() == ""


def test_in_a_notebook_progress_is_shown_and_leaves_nothing():
    nbformat, nbclient = (
        pytest.importorskip("nbformat"),
        pytest.importorskip("nbclient"),
    )
    pytest.importorskip("ipykernel")
    plan = f"brachis.plan(brachis.examples.scara_line, **{QUICK!r}"
    cells = ["import brachis", f"{plan}).verified", f"{plan}, progress=False).verified"]
    notebook = nbformat.v4.new_notebook(
        cells=[nbformat.v4.new_code_cell(cell) for cell in cells]
    )
    shown = []

    class Client(nbclient.NotebookClient):
        def process_message(self, message, cell, index):
            if message["msg_type"].endswith("display_data"):
                shown.append((index, message["content"]["data"]["text/plain"]))
            return super().process_message(message, cell, index)

    Client(notebook, kernel_name="python3", timeout=120).execute()
    assert {index for index, _ in shown} == {1}
    assert shown[0][1].startswith("planning for 3 joints")
    assert shown[-1][1] == ""
    outputs = [output.get("data") for output in notebook.cells[2].outputs]
    assert [*filter(None, outputs)] == [{"text/plain": "True"}]


def test_processes_need_no_main_guard(tmp_path):
    (tmp_path / "script.py").write_text(SCRIPT)
    command = [sys.executable, str(tmp_path / "script.py")]
    run = subprocess.run(
        command, capture_output=True, text=True, timeout=120, check=False
    )
    assert run.stdout.strip() == "[True, True]", run.stderr
