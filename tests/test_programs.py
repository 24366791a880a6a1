"""What applies to a single path only says so when it is asked for with a program."""

import pytest

import brachis
from brachis.errors import InputError, TaskError
from brachis.task import task_with
from support.cycle import CYCLE, NAMES


def test_keys_of_a_program_can_be_changed(cycle):
    changed = task_with(cycle.task, effort="fast")
    assert changed.search.effort == "fast"
    assert changed.program == cycle.task.program


def test_keywords_state_a_program():
    keywords = {
        key: value for key, value in CYCLE.items() if key not in ("brachis", "search")
    }
    assert task_with(**keywords).program == task_with(CYCLE).program


def test_a_known_motion_is_a_start(cycle):
    again = brachis.plan(cycle.task, start_from=cycle)
    assert [part.name for part in again.trajectory.parts] == NAMES
    assert again.not_completed == ()
    assert again.t_end == pytest.approx(cycle.t_end, rel=5e-3)


def test_a_program_is_not_one_nonlinear_program(cycle):
    with pytest.raises(TaskError, match="program: a program is not one NLP"):
        brachis.transcribe(cycle.task)


def test_only_recordings_are_compared(cycle):
    with pytest.raises(InputError, match="this motion is not a recording"):
        brachis.compare(cycle.trajectory)


def test_parts_of_a_sweep_are_varied(tmp_path):
    sweep = {
        "sweep": 1,
        "task": CYCLE,
        "grid": {"program.2.dwell": [0.1, 0.2]},
    }
    rows = brachis.sweep(sweep, tmp_path / "out", jobs=1).to_dataframe()
    assert list(rows["status"]) == ["verified", "verified"]
    fast, slow = rows["t_end_s"]
    assert slow - fast == pytest.approx(0.1, abs=1e-6)
