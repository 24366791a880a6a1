"""Commands with the task of a program: plan, inspect, verify, bottleneck, plot; and what they refuse."""

import json

import pytest
import yaml

from support.cycle import CYCLE, KINDS, NAMES


@pytest.fixture
def task(tmp_path):
    path = tmp_path / "cycle.yaml"
    path.write_text(yaml.safe_dump(CYCLE))
    return path


@pytest.fixture
def saved(cycle, tmp_path):
    cycle.save(tmp_path / "cycle.npz")
    return tmp_path / "cycle.npz"


def test_a_plan_prints_its_parts_and_has_them_in_its_json(run, task, tmp_path):
    outcome = run(f"plan {task} --out {tmp_path / 'out'} --no-figures --verbose")
    assert (
        "planning for 2 joints a program of 5 parts: move 1, bead, dwell 1, payload 1, move 2"
        in outcome.err
    )
    table = outcome.out.split("parts\n")[1].split("verification")[0]
    rows = [line for line in table.splitlines() if " s (" in line]
    assert len(rows) == 4
    for row, name, kind in zip(rows, NAMES, KINDS, strict=True):
        assert name in row
        assert f" {kind} " in row
        assert row.count("%") == 1
    assert "process_on at " in outcome.out
    assert "the fastest motion is kept" in outcome.out
    data = json.loads((tmp_path / "out/result.json").read_text())
    assert [part["name"] for part in data["parts"]] == NAMES
    assert [event["name"] for event in data["events"]] == ["process_on", "process_off"]
    assert data["parts"][-1]["end"] == data["t_end"]
    assert data["candidates"][0]["redundant_joints"] == []


def test_inspect_shows_the_parts_and_the_choices_for_the_first_path(run, task):
    text = run(f"inspect {task}").out
    assert "program: move 1, bead, dwell 1, payload 1, move 2" in text
    assert "task space [x, y]: degree of redundancy 0" in text
    assert run(f"inspect {task} --json").data["parts"] == [
        "move 1",
        "bead",
        "dwell 1",
        "payload 1",
        "move 2",
    ]


def test_inspect_shows_a_move(run, tmp_path):
    move = {**CYCLE, "end": {"joints": [0.2, 0.2]}, "task_space": "free"}
    del move["program"]
    path = tmp_path / "move.yaml"
    path.write_text(yaml.safe_dump(move))
    assert "end posture: x_axis 0.2000 m" in run(f"inspect {path}").out


def test_saved_programs_can_be_verified_and_plotted_and_explained(run, saved, tmp_path):
    assert "bead" in run(f"verify {saved}").out
    assert "part bead (path), " in run(f"bottleneck {saved} --no-figures").out
    assert run(f"bottleneck {saved} --no-figures --json").data["bottleneck"]["parts"]
    run(f"plot {saved} --out {tmp_path / 'overview.png'}")
    run(f"report {saved} --out {tmp_path / 'cycle.html'}")


def test_recordings_are_not_compared_with_programs(
    error_of, run, saved, task, tmp_path
):
    run(f"export {saved} --out {tmp_path / 'cycle.csv'} --dt 0.01")
    error = error_of(f"compare {tmp_path / 'cycle.csv'} --robot {task}")
    assert (
        "a recorded motion is compared with a path; found a task with a program"
        in error
    )


def test_costs_by_solving_again_need_the_task(error_of, saved):
    assert "check: the motion of a program cannot" in error_of(
        f"bottleneck {saved} --check"
    )


def test_inspect_warns_of_figures_of_parts_in_other_units(error_of, write):
    path = {
        "path": [{"line": {"by": [0.1, 0.0, 0.0]}, "stop": True, "dwell": 400}],
        "path_start": {"position": [0.5, 0, 0.4], "rpy_deg": [3.1416, 0, 0]},
        "tool_limits": {"speed": 80},
    }
    task = {
        "brachis": 1,
        "robot": {"urdf": "iiwa14"},
        "start": {"joints": [0, 0.5, 0, -1.2, 0, 1.0, 0.3]},
        "task_space": "pose",
        "program": [
            {"move": "next"},
            {"approach": 50},
            path,
            {"dwell": 500},
            {"retract": 40},
        ],
    }
    message = " ".join(error_of(f"inspect {write(task)}").split())
    for where, hint in (
        ("program[1].approach", "50 mm are 0.05 m"),
        ("program[2].path[0].dwell", "looks like ms"),
        ("program[2].path_start.rpy_deg[0]", "looks like rad"),
        ("program[2].tool_limits.speed", "looks like mm/s"),
        ("program[3].dwell", "looks like ms"),
        ("program[4].retract", "40 mm are 0.04 m"),
    ):
        assert hint in message.partition(where)[2].partition("program[")[0]
