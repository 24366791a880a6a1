"""What all commands have in common: help with examples that work, completion, how much is said, changes of a task."""

import os
import re
import shlex
import subprocess
import sys

import pytest

from brachis import planner, plots
from brachis.apps.cli.app import app
from support.command_line import make_group
from support.effort import QUICK

from .conftest import ROOT, SCARA

COMMAND = [sys.executable, "-m", "brachis"]
COMMANDS = [each.name or each.callback.__name__ for each in app.registered_commands]
GROUP = make_group(app)
EXAMPLES = {
    name: [line.strip() for line in command.epilog.splitlines()[2:]]
    for name, command in GROUP.commands.items()
}


@pytest.mark.parametrize("command", COMMANDS)
@pytest.mark.parametrize("option", ["-h", "--help"])
def test_help_of_every_command_has_an_example(command, option, run):
    outcome = run(f"{command} {option}", columns=60)
    assert f"Usage: brachis {command} " in outcome.out
    examples = outcome.out.split("Examples:\n")[1].splitlines()
    assert [line.strip() for line in examples if line] == EXAMPLES[command]
    assert EXAMPLES[command]
    assert all(line.startswith(f"brachis {command}") for line in EXAMPLES[command])
    assert "--quiet" in outcome.out
    assert "--verbose" in outcome.out
    assert all(parameter.help for parameter in GROUP.commands[command].params)


def test_examples_work_in_this_order(run, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr(
        "brachis.apps.view.Viewer.wait", lambda _viewer: None
    )  # for Ctrl-C
    (tmp_path / "out").mkdir()
    fixed = "fixed: {search.effort: single, spline.intervals: 6}"
    (tmp_path / "lines.yaml").write_text(
        f"sweep: 1\ntask: task.yaml\n{fixed}\ngrid: {{spline.degree: [3, 4]}}\n"
    )
    (tmp_path / "cell.yaml").write_text(
        "brachis: 1\nrobot: {urdf: scara3}\nstart: free\npath_start: [1.5, -0.3]\ntask_space: [x, y]\n"
        "path: [{line: {by: [0, 0.6]}}]\nspline: {intervals: 8}\nsearch: {effort: single}\n"
    )
    assert set(EXAMPLES) == set(COMMANDS)
    general = re.findall(r"^  (brachis .*?) +#", GROUP.epilog, re.MULTILINE)
    assert len(general) == 2
    assert {*general} <= {*EXAMPLES["new"], *EXAMPLES["plan"]}
    for command, lines in EXAMPLES.items():
        for line in lines:
            run(*shlex.split(line, comments=True)[1:])
        if (
            command == "new"
        ):  # what follows is about commands: with a plan that takes less time
            content = (tmp_path / "task.yaml").read_text()
            content = content.replace("{effort: fast}", str(QUICK)).replace(
                "# spline: {intervals: 20}", "spline: {intervals: 8}"
            )
            assert str(QUICK) in content
            assert "\nspline: {intervals: 8}" in content
            (tmp_path / "task.yaml").write_text(content.replace("False", "false"))


def test_help_of_the_program(run):
    outcome = run("-h", columns=80)
    assert all(f"\n  {command} " in outcome.out for command in COMMANDS)
    assert "..." not in outcome.out.split("Commands:")[1]
    assert "130  interrupted" in outcome.out
    nothing = run(code=2, columns=80)
    assert (nothing.out, nothing.err) == ("", outcome.out)


def test_help_of_plot_lists_every_figure(run):
    text = run("plot --help", columns=80).out
    assert all(kind in text.split("--kind")[1] for kind in plots.PLOTS)


@pytest.mark.parametrize(
    "words, expected",
    [
        ("brachis pl", ["plan", "plot", "place"]),
        ("brachis plan --s", ["--set", "--strict"]),
    ],
)
def test_completion(words, expected):
    last = str(len(words.split()) - 1)
    completion = {"COMP_WORDS": words, "COMP_CWORD": last}
    environment = {**os.environ, "_BRACHIS_COMPLETE": "complete_bash", **completion}
    done = subprocess.run(
        COMMAND, env=environment, capture_output=True, text=True, check=True
    )
    assert done.stdout.split() == expected


TASK = ROOT / "examples/01_scara_line.yaml"
WRONG = [
    (
        "plna task.yaml",
        r"no such command 'plna'.*Did you mean 'plan', 'place'\?.*see brachis --help",
    ),
    (f"{TASK}", "a command comes before a file: brachis plan "),
    (f"{SCARA}", "a command comes before a file: brachis inspect "),
    ("plan task.yaml --outt", "--outt.*--out.*see brachis plan --help"),
    ("plan", "missing argument 'TASK'"),
    ("new scara4", r"'scara4'.*Did you mean 'scara3'\?"),
    ("inspect gone.urdf", "gone.urdf: the file does not exist"),
    (f"plan {SCARA}", "found a URDF; allowed: a task file.*brachis new"),
    (f"verify {SCARA}", "found a URDF; allowed: a result.*brachis new"),
    (f"new {TASK}", "a task file; allowed: a URDF"),
    (f"verify {TASK}", "found a task file.*brachis plan "),
    (
        f"inspect {SCARA} --set robot.limits.torque=8",
        r"--set: this option cannot be used with a URDF.*allowed: this option with a",
    ),
    (f"plan {TASK} --set spline", "key=value.*'spline'"),
]


@pytest.mark.parametrize("command, message", WRONG)
@pytest.mark.parametrize("option", ["", " --json"])
def test_a_wrong_command_line_is_one_error(
    command, message, option, run, tmp_path, monkeypatch
):
    monkeypatch.chdir(tmp_path)
    outcome = run(command + option, code=2)
    assert outcome.err.startswith("brachis: ")
    assert outcome.err.count("\n") == 1
    assert re.search(message, outcome.err), outcome.err
    if option:
        assert f"brachis: {outcome.data['error']}\n" == outcome.err
    assert not list(tmp_path.iterdir())


def test_results_are_told_from_tasks(error_of, tmp_path):
    for content, expected in (
        (b"PK\x03\x04", "found a result"),
        (b'{\n  "t_end": 1.0\n}', "the figures of a plan"),
    ):
        (tmp_path / "file").write_bytes(content)
        assert expected in error_of(f"plan {tmp_path / 'file'}")


SMALL = "--set spline.intervals=6 --set 'search={effort: single, least_motion: false}'"


def test_set_changes_the_task(run, error_of, task, write, tmp_path):
    path = write(task)
    outcome = run(
        f"plan {path} {SMALL} --set path.0.line.length=0.3 --set robot.limits.torque=8 "
        "--json",
    )
    data = outcome.data
    assert 1.0 < data["t_end"] < 2.4
    shown = run(f"inspect {path} --set robot.limits.torque=8 --json").data
    assert [joint["torque"] for joint in shown["joints"]] == ["8 Nm"] * 3
    assert "torque" in run(f"bottleneck {path} {SMALL}").out
    assert "--set: this option cannot be used with a saved motion" in error_of(
        f"bottleneck {tmp_path / 'result.npz'} --set spline.intervals=6"
    )


def test_quiet_and_verbose_set_how_much_a_command_says(run, error_of, task, write):
    path = write(task)
    assert run(f"plan {path} {SMALL} --quiet") == run(f"-q plan {path} {SMALL}")
    quiet = run(f"plan {path} {SMALL} --set robot.limits.velocity=1e9 -q")
    assert (quiet.out, quiet.err) == ("", "")
    verbose = run(f"plan {path} {SMALL} -v")
    assert "verification: passed" in verbose.out
    steps = verbose.err.splitlines()
    assert len(steps) > 3
    slow = [line for line in steps if "warning: spline.intervals: " in line]
    assert len(slow) == 1
    steps.remove(slow[0])
    assert all(" s: " in line and line.startswith("brachis: ") for line in steps)
    assert run(f"plan {path} {SMALL}").err == f"{slow[0]}\n", (
        "what one command is told does not hold for the next one"
    )
    assert run(f"plan {path} {SMALL} --json --quiet").data["verified"]
    assert "gone.yaml" in error_of("plan gone.yaml --quiet")


def test_tracebacks_are_for_those_who_ask(run, task, write, monkeypatch):
    def broken(*_arguments, **_options):
        raise ZeroDivisionError

    monkeypatch.setattr(planner, "plan", broken)
    outcome = run(f"plan {write(task)}", code=1)
    assert "Traceback" not in outcome.err
    assert "internal error: ZeroDivisionError" in outcome.err
    assert "bug in brachis; run again with --verbose" in outcome.err
    assert "Traceback" in run(f"plan {write(task)} --verbose", code=1).err


def test_new_and_robots(run, error_of, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    listed = run("robots --json").data["robots"]
    gantry = {"name": "gantry2", "what": "two linear axes"}
    assert listed[1] == {**listed[1], **gantry, "joints": ["x_axis", "y_axis"]}
    data = run(f"new {listed[1]['urdf']} --json").data
    assert data["verified"]
    assert data["file"] == "task.yaml"
    before = (tmp_path / "task.yaml").read_text()
    assert "task.yaml: the file exists" in error_of("new scara3")
    assert (tmp_path / "task.yaml").read_text() == before
    run(f"plan task.yaml {SMALL}")


def test_new_tells_how_long_the_motion_lasts(run, tmp_path):
    outcome = run(f"new gantry2 --out {tmp_path / 'task.yaml'}")
    assert re.search(r"verified: the motion takes \d+\.\d{4} s", outcome.out)
