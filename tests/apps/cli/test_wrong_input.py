"""Wrong input: exit code 2, one clear message on standard error, nothing written."""

from __future__ import annotations

import json
import math
from pathlib import Path

import pytest

from brachis.errors import PlanningError, nearest


def set_key(task: dict, dotted: str, value: object) -> None:
    *parents, last = dotted.split(".")
    for key in parents:
        task = task[int(key)] if key.isdigit() else task[key]
    task[last] = value


WRONG_TASKS = {
    "unknown key": ("robot.limits.torqe", 10, ["robot.limits.torqe", "torque"]),
    "wrong type": ("spline.degree", "three", ["spline.degree", "three"]),
    "NaN": ("start.joints", [0.1, math.nan, 0.2], ["start.joints", "nan"]),
    "infinity": (
        "path",
        [{"line": {"length": math.inf, "angle_deg": 0}}],
        ["path[0].line", "inf"],
    ),
    "number of joints": (
        "start.joints",
        [0.1, 0.2],
        ["start.joints", "found 2", "j1, j2, j3"],
    ),
    "unknown redundant joint": ("redundant_joints", ["j9"], ["'j9'", "j1, j2, j3"]),
    "too many redundant joints": (
        "redundant_joints",
        ["j1", "j2"],
        ["found 2", "allowed: 1", "3 joints less 2 rows"],
    ),
    "too few redundant joints": ("redundant_joints", [], ["found 0", "allowed: 1"]),
    "zero-length path": (
        "path",
        [{"line": {"length": 0.0, "angle_deg": 0}}],
        ["path[0].line", "zero"],
    ),
    "out of reach": (
        "path",
        [{"line": {"length": 5.0, "angle_deg": 0}}],
        ["out of reach from s = 0.2", " m of 5 m", "Shorten or move the path"],
    ),
    "out of limits": (
        "robot.limits.position",
        {"j2": [-1.0, 1.0]},
        ["'j2'", "-2.0944 rad", "-1 rad to 1 rad"],
    ),
    "end off the path": (
        "end",
        {"joints": [0.0, 0.0, 0.0]},
        ["end.joints", "off the path", "m off in"],
    ),
    "unknown branch": (
        "branch",
        "elbow_up",
        ["'elbow_up'", "elbow_positive, elbow_negative"],
    ),
    "other branch": ("branch", "elbow_positive", ["another branch", "elbow_negative"]),
    "unknown solver": (
        "solver.name",
        "slsqp",
        ["'slsqp'", "uno", "ipopt", "uno_interior"],
    ),
    "unknown tool frame": ("robot.tool_frame", "tol", ["'tol'", "Did you mean 'tool'"]),
    "missing URDF": (
        "robot.urdf",
        "nowhere.urdf",
        ["nowhere.urdf", "the file does not exist"],
    ),
    "robot that is not included": (
        "robot.urdf",
        "scara4",
        ["robot.urdf: the file does not exist", "iiwa14", "Did you mean 'scara3'?"],
    ),
    "no limit at all": (
        "robot.limits.torque",
        None,
        ["'j1'", "robot.limits.acceleration or robot.limits.torque"],
    ),
    "torque limit not positive": (
        "robot.limits.torque",
        -1,
        ["robot.limits.torque", "-1"],
    ),
    "singular start": (
        "start.joints",
        [0.3, 0.0, 0.0],
        ["start.joints", "branches of the closed form meet"],
    ),
}


@pytest.mark.parametrize("case", WRONG_TASKS)
def test_wrong_task(case, run, task, write, tmp_path):
    key, value, expected = WRONG_TASKS[case]
    set_key(task, key, value)
    out = tmp_path / "out"
    path = write(task)
    outcome = run("plan", path, "--out", out)
    assert outcome.code == 2, outcome.err
    assert outcome.out == ""
    assert outcome.err.startswith(f"brachis: {path}: ")
    for part in expected:
        assert part in outcome.err
    assert "Traceback" not in outcome.err
    assert not out.exists() or not list(out.iterdir())


def test_the_task_file_is_not_blamed_for_other_inputs(run, task, write, tmp_path):
    path = write(task)
    broken = tmp_path / "broken.urdf"
    broken.write_text("<robot name='x'><link")
    outcome = run("plan", path, "--urdf", broken)
    assert outcome.code == 2
    assert outcome.err.startswith(f"brachis: {broken}: ")
    outcome = run("inspect", path, "--task-space", "foo")
    assert outcome.code == 2
    assert outcome.err.startswith("brachis: task_space: ")
    for command in ("plan", "bottleneck"):
        outcome = run(command, path, "--set", "redundant_joints=[j9]", "--strict")
        assert outcome.code == 2
        where = f"{path} with redundant_joints, strict set: redundant_joints: "
        assert outcome.err.startswith(f"brachis: {where}")
    task["robot"]["urdf"] = str(broken)
    outcome = run("inspect", write(task))
    assert outcome.code == 2
    assert outcome.err.startswith(f"brachis: {broken}: ")


def test_torque_cannot_hold_the_arm(run, task, write):
    # In the vertical plane the first joint alone carries 10 kg at 0.5 m, 1.5 m and 2.5 m from its axis.
    task["robot"]["gravity"] = [0.0, -9.81, 0.0]
    task["start"] = {"joints": [0.0, 0.3, 0.3]}
    outcome = run("plan", write(task))
    assert outcome.code == 2
    for part in (
        "the torque limit of 'j1' cannot hold the arm against gravity",
        "Nm at rest",
        "10 Nm",
        "robot.limits.torque.j1",
    ):
        assert part in outcome.err


def test_torque_cannot_hold_the_arm_further_along(run, task, write):
    # Hanging down costs no torque; the path leads to where no posture can be held.
    task["robot"]["gravity"] = [0.0, -9.81, 0.0]
    task["robot"]["limits"]["torque"] = [120, 60, 20]
    task["start"] = {"joints": [-math.pi / 2 - 0.2, 0.2, 0.2]}
    task["path"] = [{"line": {"to": [2.4, -1.0]}}]
    outcome = run("plan", write(task))
    assert outcome.code == 2, outcome.err
    assert "cannot hold the arm against gravity from s = " in outcome.err


def test_no_closed_form(run, task, write, tmp_path):
    # The second joint's axis lies across the plane of the others.
    text = (write.__globals__["SCARA"]).read_text()
    urdf = tmp_path / "crooked.urdf"
    urdf.write_text(
        text.replace(
            '<origin xyz="1 0 0"/>\n    <axis xyz="0 0 1"/>',
            '<origin xyz="1 0 0"/>\n    <axis xyz="0 1 0"/>',
            1,
        )
    )
    task["robot"]["urdf"] = str(urdf)
    task["start"] = {"joints": [0.1, 0.4, 0.3]}
    outcome = run("plan", write(task))
    assert outcome.code == 2
    assert "no closed form for redundant joints [j3]" in outcome.err
    assert (
        "planar: not planar: j2 moves out of the plane in which j1 turns" in outcome.err
    )
    assert (
        "prismatic: all joints must be prismatic besides the redundant ones; revolute: j1, j2"
        in outcome.err
    )


URDFS = {
    "broken XML": ("<robot name='x'><link", "not well-formed XML"),
    "not a URDF": ("<sdf version='1.6'/>", "root element <sdf>"),
    "no links": ("<robot name='x'/>", "no links"),
    "not text": ("", "not a URDF"),
}


@pytest.mark.parametrize("case", URDFS)
def test_wrong_urdf(case, run, task, write, tmp_path):
    text, expected = URDFS[case]
    urdf = tmp_path / "robot.urdf"
    urdf.write_text(text)
    task["robot"]["urdf"] = str(urdf)
    for arguments in (("plan", write(task)), ("inspect", urdf)):
        outcome = run(*arguments)
        assert outcome.code == 2
        assert expected in outcome.err
        assert str(urdf) in outcome.err


def test_missing_task_file(run, tmp_path):
    outcome = run("plan", tmp_path / "nothing.yaml")
    assert outcome.code == 2
    assert "nothing.yaml" in outcome.err


@pytest.mark.parametrize(
    "command", [("verify",), ("export", "--out", "x.csv"), ("plot", "--out", "x.png")]
)
def test_result_that_is_none(command, run, tmp_path):
    broken = tmp_path / "result.npz"
    broken.write_bytes(b"PK no archive")
    for path, expected in (
        (broken, "not a brachis result"),
        (tmp_path / "gone.npz", "the file does not exist"),
    ):
        outcome = run(command[0], path, *command[1:])
        assert outcome.code == 2
        assert expected in outcome.err


def test_unusable_output_folder(run, task, write, tmp_path):
    occupied = tmp_path / "file"
    occupied.write_text("")
    outcome = run("plan", write(task), "--out", occupied)
    assert outcome.code == 2
    assert "a folder, and this is the name of a file" in outcome.err
    assert occupied.read_text() == ""


def test_a_file_in_the_place_of_an_output_folder(run, task, write, tmp_path):
    outcome = run("plan", write(task), "--out", tmp_path / "motion.npz")
    assert outcome.code == 2
    assert "this is the name of a file" in outcome.err
    assert f"Write --out {tmp_path / 'motion'}" in outcome.err
    assert not (tmp_path / "motion.npz").exists()


def test_error_as_json(run, task, write, tmp_path, monkeypatch):
    task["robot"]["limits"]["torque"] = -1
    cases = [
        ("plan", write(task)),
        ("verify", tmp_path / "gone.npz"),
        ("inspect", tmp_path / "gone.urdf"),
    ]
    for arguments in cases:
        outcome = run(*arguments, "--json")
        assert outcome.code == 2
        data = json.loads(outcome.out)
        assert outcome.err == f"brachis: {data['error']}\n"
        del data["error"]
        assert data == {
            "verified": False,
            "status": "error",
            "t_end": None,
            "exit_code": 2,
        }

    def no_plan(*_arguments, **_options):
        raise PlanningError("no motion")

    monkeypatch.setattr("brachis.planner.plan", no_plan)
    task["robot"]["limits"]["torque"] = 10
    outcome = run("plan", write(task), "--json")
    assert (
        outcome.code,
        json.loads(outcome.out)["exit_code"],
        json.loads(outcome.out)["error"],
    ) == (1, 1, "no motion")


def test_fault_of_our_own_is_not_a_traceback(run, task, write, monkeypatch):
    monkeypatch.setattr("brachis.planner.Search", lambda *_args, **_kwargs: 1 / 0)
    outcome = run("plan", write(task))
    assert outcome.code == 1
    assert "internal error: ZeroDivisionError" in outcome.err
    assert "Traceback" not in outcome.err


def test_suggestions_come_from_the_valid_names():
    assert nearest("torqe", ["torque", "velocity"]) == "torque"
    assert nearest("xyz", ["torque", "velocity"]) is None


@pytest.mark.parametrize(
    ("command", "told"),
    [
        (
            ("plan", "scara3"),
            (
                "scara3: this is the name of a robot, not of a task file; allowed: a task file. "
                "brachis new scara3 writes a first task for it"
            ),
        ),
        (("plan", "scara4"), "there is no robot named 'scara4'"),
        (
            ("plan", "sweep.yaml"),
            "found a sweep file; allowed: a task file. brachis sweep sweep.yaml plans it",
        ),
        (
            ("plan", "README.md"),
            "README.md: the file is not a task; found README.md: line 1, column 1: not valid YAML",
        ),
        (
            ("inspect", "p.csv"),
            "p.csv: the file is not a URDF; found 't,j1\\n0,1\\n' at its beginning",
        ),
        (("sweep", "task.yaml"), "found a task file; allowed: a sweep file"),
        (
            ("import", "task.yaml", "--robot", "scara3", "--out", "x.npz"),
            "found a task file; allowed: a CSV file",
        ),
    ],
)
def test_other_things_than_are_asked_for(run, tmp_path, monkeypatch, command, told):
    (tmp_path / "task.yaml").write_text("brachis: 1\n")
    (tmp_path / "sweep.yaml").write_text("sweep: 1\ntask: task.yaml\n")
    (tmp_path / "README.md").write_text("`a` page")
    (tmp_path / "p.csv").write_text("t,j1\n0,1\n")
    monkeypatch.chdir(tmp_path)
    outcome = run(*command)
    assert outcome.code == 2
    assert told in outcome.err


@pytest.mark.skipif(
    not Path("/proc/self/status").exists(), reason="no such files of the kernel"
)
@pytest.mark.parametrize("command", ["verify", "export", "plot", "report", "view"])
@pytest.mark.parametrize("name", ["/proc/self/status", "/proc/self/mem", "/dev/zero"])
def test_files_of_the_kernel_are_no_results(name, command, run, tmp_path):
    out = {
        "export": ["--out", tmp_path / "a.csv"],
        "plot": ["--out", tmp_path / "a.png"],
    }.get(command, [])
    ended = run(command, name, *out)
    assert ended.code == 2
    assert "the file is not a brachis result" in ended.err


def test_a_text_that_shows_a_task_is_no_task_file(run, tmp_path):
    text = tmp_path / "notes.md"
    text.write_text("# A task\n\n```yaml\nbrachis: 1\n```\n")
    outcome = run("verify", text)
    assert outcome.code == 2
    assert "not a brachis result" in outcome.err
