"""Wrong input: exit code 2, one clear message on standard error, nothing written."""

import math
import re
from pathlib import Path

import pytest
import yaml

from brachis.errors import PlanningError

from .conftest import SCARA


def set_key(task, dotted, value):
    *parents, last = dotted.split(".")
    for key in parents:
        task = task[int(key)] if key.isdigit() else task[key]
    task[last] = value


WRONG_TASKS = [
    ("spline.degree: three", "spline.degree.*three"),
    ("redundant_joints: [j9]", "'j9'.*j1, j2, j3"),
    ("redundant_joints: [j1, j2]", "found 2.*allowed: 1.*3 joints less 2 rows"),
    (
        "path: [{line: {length: 5.0, angle_deg: 0}}]",
        "out of reach from s = 0.2.* m of 5 m.*Shorten or move the path",
    ),
    ("robot.limits.position: {j2: [-1.0, 1.0]}", "'j2'.*-2.0944 rad.*-1 rad to 1 rad"),
    ("end: {joints: [0.0, 0.0, 0.0]}", "end.joints.*off the path.*m off in"),
    ("branch: elbow_up", "'elbow_up'.*elbow_positive, elbow_negative"),
    ("branch: elbow_positive", "a different branch.*elbow_negative"),
    ("solver.name: slsqp", "'slsqp'.*uno.*ipopt.*uno_interior"),
    (
        "robot.urdf: scara4",
        r"robot.urdf: the file does not exist.*iiwa14.*Did you mean 'scara3'\?",
    ),
    ("start.joints: [0.3, 0.0, 0.0]", "start.joints.*branches of the closed form meet"),
]


@pytest.mark.parametrize("change, message", WRONG_TASKS)
def test_a_wrong_task_is_an_error_and_nothing_is_written(
    change, message, run, task, write, tmp_path
):
    for key, value in yaml.safe_load(change).items():
        set_key(task, key, value)
    out = tmp_path / "out"
    path = write(task)
    outcome = run(f"plan {path} --out {out}", code=2)
    assert outcome.out == ""
    assert outcome.err.startswith(f"brachis: {path}: ")
    assert re.search(message, outcome.err), outcome.err
    assert "Traceback" not in outcome.err
    assert not out.exists() or not list(out.iterdir())


def test_the_task_file_is_not_blamed_for_other_inputs(error_of, task, write, tmp_path):
    path = write(task)
    broken = tmp_path / "broken.urdf"
    broken.write_text("<robot name='x'><link")
    changes = "--set 'redundant_joints=[j9]' --strict"
    changed = f"{path} with redundant_joints, strict set: redundant_joints"
    for command, where in (
        (f"plan {path} --urdf {broken}", broken),
        (f"inspect {path} --task-space foo", "task_space"),
        (f"plan {path} {changes}", changed),
        (f"bottleneck {path} {changes}", changed),
        (f"inspect {path} --set robot.urdf={broken}", broken),
    ):
        assert error_of(command).startswith(f"brachis: {where}: ")


def test_torque_cannot_hold_the_arm_further_along(error_of, task, write):
    # Hanging down costs no torque; the path leads to where no posture can be held.
    task["robot"]["gravity"] = [0.0, -9.81, 0.0]
    task["robot"]["limits"]["torque"] = [120, 60, 20]
    task["start"] = {"joints": [-math.pi / 2 - 0.2, 0.2, 0.2]}
    task["path"] = [{"line": {"to": [2.4, -1.0]}}]
    assert "cannot hold the arm against gravity from s = " in error_of(
        f"plan {write(task)}"
    )


def test_no_closed_form(run, task, write, tmp_path):
    # The second joint's axis lies across the plane of the others.
    origin = '<origin xyz="1 0 0"/>\n    <axis xyz='
    urdf = tmp_path / "crooked.urdf"
    text = SCARA.read_text()
    urdf.write_text(text.replace(f'{origin}"0 0 1"/>', f'{origin}"0 1 0"/>', 1))
    task["robot"]["urdf"] = str(urdf)
    task["start"] = {"joints": [0.1, 0.4, 0.3]}
    outcome = run(f"plan {write(task)}", code=2)
    assert "no closed form for redundant joints [j3]" in outcome.err
    assert (
        "planar: not planar: j2 moves out of the plane in which j1 turns" in outcome.err
    )
    assert (
        "prismatic: all joints except the redundant ones must be prismatic; revolute: j1, j2"
        in outcome.err
    )


@pytest.mark.parametrize("name", ["file", "motion.npz"])
def test_a_file_cannot_be_the_output_folder(name, run, task, write, tmp_path):
    (tmp_path / "file").write_text("mine")
    outcome = run(f"plan {write(task)} --out {tmp_path / name}", code=2)
    assert "a folder, but this is the name of a file" in outcome.err
    if name == "motion.npz":
        assert f"Write --out {tmp_path / 'motion'}" in outcome.err
    assert (tmp_path / "file").read_text() == "mine"
    assert not (tmp_path / "motion.npz").exists()


def test_json_has_the_error_and_its_exit_code(run, task, write, tmp_path, monkeypatch):
    for arguments in (("verify", tmp_path / "gone.npz"), ("inspect", "gone.urdf")):
        outcome = run(*arguments, "--json", code=2)
        data = outcome.data
        error = data.pop("error")
        assert outcome.err == f"brachis: {error}\n"
        expected = {"verified": False, "status": "error", "t_end": None, "exit_code": 2}
        assert data == expected

    def fail(*_arguments, **_options):
        raise PlanningError("no motion")

    monkeypatch.setattr("brachis.planner.plan", fail)
    data = run(f"plan {write(task)} --json", code=1).data
    assert (data["exit_code"], data["error"]) == (1, "no motion")


@pytest.mark.parametrize(
    "command, message",
    [
        ("plan scara3", "scara3: this is the name of a robot, not of a task file"),
        ("plan scara4", "there is no robot named 'scara4'"),
        (
            "plan sweep.yaml",
            "found a sweep file; allowed: a task file. brachis sweep sweep.yaml plans it",
        ),
        (
            "plan README.md",
            "README.md: the file is not a task; found README.md: line 1, column 1: not valid YAML",
        ),
        (
            "inspect p.csv",
            r"p.csv: the file is not a URDF; found 't,j1\n0,1\n' at its beginning",
        ),
        ("verify README.md", "not a brachis result"),
        ("sweep task.yaml", "found a task file; allowed: a sweep file"),
        (
            "import task.yaml --robot scara3 --out x.npz",
            "found a task file; allowed: a CSV file",
        ),
    ],
)
def test_the_error_says_what_the_command_takes(
    error_of, tmp_path, monkeypatch, command, message
):
    (tmp_path / "task.yaml").write_text("brachis: 1\n")
    (tmp_path / "sweep.yaml").write_text("sweep: 1\ntask: task.yaml\n")
    (tmp_path / "README.md").write_text("`a` page\n\n```yaml\nbrachis: 1\n```\n")
    (tmp_path / "p.csv").write_text("t,j1\n0,1\n")
    monkeypatch.chdir(tmp_path)
    assert message in error_of(command)


@pytest.mark.skipif(
    not Path("/proc/self/status").exists(), reason="no such files of the kernel"
)
@pytest.mark.parametrize("command", ["verify", "export", "plot", "report", "view"])
@pytest.mark.parametrize("name", ["/proc/self/status", "/proc/self/mem", "/dev/zero"])
def test_files_of_the_kernel_are_no_results(name, command, error_of, tmp_path):
    suffixes = {"export": "csv", "plot": "png"}
    out = f"--out {tmp_path / 'a'}.{suffixes[command]}" if command in suffixes else ""
    assert "the file is not a brachis result" in error_of(f"{command} {name} {out}")
