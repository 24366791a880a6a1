"""What the commands print and write."""

from __future__ import annotations

import csv
import json
import math
import re
import subprocess
import sys
from dataclasses import replace
from functools import partial

import numpy as np
import pytest
import yaml

import brachis
from brachis import __version__, planner
from brachis.apps import plots
from brachis.apps.cli import folder, main
from brachis.apps.plots.style import figure_class
from brachis.errors import InputError
from brachis.search import pipeline, verified
from brachis.search.stages import describe_coordinates
from brachis.trajectory import Trajectory

from .conftest import ROOT, SCARA


def test_plan_json(planned):
    data = planned.data
    required = {
        "t_end",
        "redundant_joints",
        "branch",
        "status",
        "solver",
        "iterations",
        "wall_time_s",
        "verified",
        "worst_ratio",
        "path_error",
    }
    assert required <= data.keys()
    assert data["verified"] is True
    assert 2.0 < data["t_end"] <= 2.478
    assert data["redundant_joints"] == ["j3"]
    assert data["worst_ratio"] <= 1 + 1e-4
    assert data["path_error"] <= 1e-9


def test_plan_writes_what_it_says(planned):
    data, out = planned.data, planned.out
    names = ["candidates.png", "overview.png", "result.json", "result.npz"]
    assert sorted(path.name for path in out.iterdir()) == names
    assert sorted(data["files"]) == sorted(str(path) for path in out.iterdir())
    assert json.loads((out / "result.json").read_text())["t_end"] == data["t_end"]


def test_plan_for_people(run, task, write):
    task["spline"]["intervals"] = 20
    outcome = run("plan", write(task))
    assert outcome.code == 0
    for part in (
        "end time",
        "2.47",
        "verification: passed",
        "torque ratio",
        "torque jump",
    ):
        assert part in outcome.out
    last = outcome.out.splitlines()[-1]
    assert last == "nothing was saved; --out FOLDER saves the motion"
    # No progress display in a pipe.
    assert outcome.err.startswith(
        "brachis: warning: spline.intervals: the same joint path"
    )
    assert outcome.err.count("\n") == 1


@pytest.mark.usefixtures("too_strict")
def test_unverified_plan_says_so(run, task, write, tmp_path):
    outcome = run("plan", write(task), "--out", tmp_path / "out", "--json")
    assert outcome.code == 1
    assert json.loads(outcome.out)["verified"] is False
    assert "unverified" in outcome.err
    assert "verification (" in outcome.err
    assert "FAILED, allowed" in outcome.err
    names = [
        "unverified.json",
        "unverified.npz",
        "unverified.png",
        "unverified_candidates.png",
    ]
    assert sorted(path.name for path in (tmp_path / "out").iterdir()) == names


def test_two_motions_do_not_mix_in_one_folder(
    run, task, write, planned, tmp_path, request
):
    out = planned.copied(tmp_path / "out")
    (out / "notes.txt").write_text("mine")
    request.getfixturevalue("too_strict")
    assert run("plan", write(task), "--out", out).code == 1
    names = {path.name for path in out.iterdir()}
    assert names == {
        "unverified.npz",
        "unverified.json",
        "unverified.png",
        "unverified_candidates.png",
        "notes.txt",
    }
    request.getfixturevalue("monkeypatch").undo()
    assert run("plan", write(task), "--out", out).code == 0
    names = {path.name for path in out.iterdir()}
    assert names == {
        "result.npz",
        "result.json",
        "overview.png",
        "candidates.png",
        "notes.txt",
    }


def no_space(path):
    return InputError(
        "the file cannot be written", where=str(path), found="No space left on device"
    )


def test_without_figures_none_is_drawn_and_older_ones_go(
    run, task, write, planned, tmp_path, monkeypatch
):
    out = planned.copied(tmp_path / "out")
    assert list(out.glob("*.png"))
    monkeypatch.delattr(plots, "save_figure")
    task["spline"]["intervals"] = 10
    outcome = run("plan", write(task), "--out", out, "--no-figures", "--json")
    assert outcome.code == 0
    assert sorted(path.name for path in out.iterdir()) == ["result.json", "result.npz"]
    assert len(json.loads(outcome.out)["files"]) == 2


def test_without_matplotlib_the_result_is_written_and_the_figures_are_not(
    run, task, write, tmp_path, monkeypatch
):
    figure_class.cache_clear()
    monkeypatch.setitem(sys.modules, "matplotlib.figure", None)
    task["spline"]["intervals"] = 10
    outcome = run("plan", write(task), "--out", tmp_path / "out")
    assert outcome.code == 0
    assert "its figures are not: a figure needs Matplotlib" in outcome.err
    names = {path.name for path in (tmp_path / "out").iterdir()}
    assert names == {"result.npz", "result.json"}


def test_a_result_survives_a_full_disk_while_figures_are_written(
    run, task, write, planned, tmp_path, monkeypatch
):
    out = planned.copied(tmp_path / "out")
    before = {path.name: path.read_bytes() for path in out.iterdir()}
    honest = plots.save_figure

    def full(figure, path):
        if path.name == "overview.png":
            raise no_space(path)
        honest(figure, path)

    monkeypatch.setattr(plots, "save_figure", full)
    task["spline"]["intervals"] = 10
    outcome = run("plan", write(task), "--out", out, "--json")
    assert outcome.code == 3
    assert "the result is written, its figures are not: " in outcome.err
    assert (
        f"{out / 'overview.png'}: the file cannot be written; found No space left"
        in outcome.err
    )
    data = json.loads(outcome.out)
    assert data["verified"] is True
    assert {path.name for path in out.iterdir()} == {
        "result.npz",
        "result.json",
        "candidates.png",
    }
    assert sorted(data["files"]) == sorted(str(path) for path in out.iterdir())
    for path in out.iterdir():
        assert path.read_bytes() != before[path.name], path.name
    assert Trajectory.load(out / "result.npz").t_end == data["t_end"]


def test_failure_while_writing_the_result_leaves_the_earlier_one(
    run, task, write, planned, tmp_path, monkeypatch
):
    out = planned.copied(tmp_path / "out")
    before = {path.name: path.read_bytes() for path in out.iterdir()}

    def full(_text, path):
        raise no_space(path)

    monkeypatch.setattr(folder, "write_text", full)
    outcome = run("plan", write(task), "--out", out)
    assert outcome.code == 2
    assert (
        f"{out / 'result.json'}: the file cannot be written; found No space left on device"
        in outcome.err
    )
    assert {path.name: path.read_bytes() for path in out.iterdir()} == before


def test_a_failed_plan_says_which_files_are_of_an_earlier_one(
    run, task, write, planned, tmp_path
):
    out = planned.copied(tmp_path / "out")
    (out / "notes.txt").write_text("mine")
    before = {path.name: path.read_bytes() for path in out.iterdir()}
    path = write(task)
    far = ("--set", "path.0.line.length=5", "--json")
    outcome = run("plan", path, *far, "--out", out)
    assert outcome.code == 2
    said, error = outcome.err.splitlines()
    assert said == (
        f"brachis: files of an earlier run stay in {out}: result.npz, result.json, overview.png, candidates.png"
    )
    assert "out of reach" in error
    assert "earlier" not in outcome.out
    assert {path.name: path.read_bytes() for path in out.iterdir()} == before
    assert "earlier" not in run("plan", path, *far, "--out", tmp_path / "new").err


def test_folder_in_the_place_of_a_result(run, task, write, tmp_path):
    (tmp_path / "out/result.json").mkdir(parents=True)
    outcome = run("plan", write(task), "--out", tmp_path / "out")
    assert outcome.code == 2
    assert "result.json: the file cannot be written; found a folder" in outcome.err
    assert [path.name for path in (tmp_path / "out").iterdir()] == ["result.json"]


def test_json_knows_no_nan(run, task, write, tmp_path, monkeypatch):
    honest = verified.verify_trajectory

    def endless(trajectory, **more):
        return replace(
            honest(trajectory, **more), worst_ratio=math.inf, path_error=math.nan
        )

    monkeypatch.setattr(verified, "verify_trajectory", endless)
    outcome = run("plan", write(task), "--out", tmp_path / "out", "--json")
    for text in (outcome.out, (tmp_path / "out/result.json").read_text()):
        data = json.loads(text, parse_constant=pytest.fail)
        assert data["worst_ratio"] is None
        assert data["verification"]["path_error"] is None


def test_lengthened_end_time_is_said(run, task, write, monkeypatch):
    honest = planner.plan

    def lengthened(*arguments, time_scaled, **options):
        result = honest(*arguments, **options)
        refined = replace(result.candidate.refined, time_scaled=time_scaled)
        return replace(result, candidate=replace(result.candidate, refined=refined))

    for time_scaled, expected in ((1.0, False), (1.00004, True)):
        monkeypatch.setattr(
            planner, "plan", partial(lengthened, time_scaled=time_scaled)
        )
        text = run("plan", write(task)).out
        assert ("end time lengthened by" in text) is expected
        assert (
            "0.004 % to meet the limits between collocation points" in text
        ) is expected


CHOICES = {
    "in charts": ({"search": {"effort": "fast"}}, {()}, "chart"),
    "of every choice": (
        {"search": {"guesses": "numeric", "least_motion": False}},
        {("j1",), ("j2",), ("j3",)},
        "j2",
    ),
}


@pytest.mark.parametrize("case", CHOICES)
def test_candidates_are_listed(run, task, write, case):
    more, choices, name = CHOICES[case]
    outcome = run("plan", write({**task, "redundant_joints": "auto", **more}))
    data = json.loads(
        run("plan", write({**task, "redundant_joints": "auto", **more}), "--json").out
    )
    assert f"candidates ({len(data['candidates'])}" in outcome.out
    found = {tuple(candidate["redundant_joints"]) for candidate in data["candidates"]}
    assert choices <= found <= choices | {tuple(data["redundant_joints"])}, (
        "the fastest one in its last coordinates"
    )
    rows = outcome.out[outcome.out.index("candidates (") :]
    assert f"│ {name} " in rows
    assert "none" not in rows
    first = data["candidates"][0]
    assert first["verified"]
    assert first["t_end"] == data["t_end"]
    assert f"{first['t_end']:.4f}" in outcome.out


def test_coordinates_are_described_without_the_name_of_a_chart_alone(planned):
    trajectory = Trajectory.load(planned.out / "result.npz")
    assert describe_coordinates(trajectory) == "j3"
    in_chart = replace(trajectory, redundant_joints=(), branch="chart")
    assert describe_coordinates(in_chart) == (
        "no joint is chosen; a chart measures the self-motion of all joints by 1 coordinate"
    )
    only_s = replace(in_chart, control_points=trajectory.control_points[:1])
    assert describe_coordinates(only_s) == "none"


def test_interrupt(run, task, write, tmp_path, monkeypatch):
    def interrupt(*_arguments, **_options):
        raise KeyboardInterrupt

    monkeypatch.setattr(pipeline, "rank_candidate", interrupt)
    outcome = run("plan", write(task), "--out", tmp_path / "out")
    assert outcome.code == 130
    assert "interrupted" in outcome.err
    assert not list((tmp_path / "out").iterdir())


def test_what_a_time_limit_left_undone_is_told(run, task, write, tmp_path, monkeypatch):
    honest, now = pipeline.rank_candidate, [0.0]

    def slow(*arguments):
        made = honest(*arguments)
        now[0] += 90.0
        return made

    solve = pipeline.solve_over_time

    def hurry(*arguments):
        solved = solve(*arguments)
        x = solved.program.scale_time(solved.x, 0.6)
        return replace(solved, reports=(replace(solved.report, x=x),))

    monkeypatch.setattr(pipeline, "solve_over_time", hurry)
    monkeypatch.setattr(pipeline, "rank_candidate", slow)
    monkeypatch.setattr("brachis.common.deadline.time.monotonic", lambda: now[0])
    task |= {
        "spline": {"intervals": 10, "points_per_interval": 1},
        "search": {"effort": "fast"},
    }
    monkeypatch.setattr("brachis.optimise.refine._LONGEST_IF_LATE", 0.0)
    outcome = run("plan", write(task), "--out", tmp_path / "out", "--json")
    assert outcome.code == 1
    assert (tmp_path / "out/unverified.npz").exists()
    data = json.loads(outcome.out)
    assert data["interrupted"]
    assert (
        data["undone"][-1] == "the search that search.effort requires was not completed"
    )
    assert (
        "brachis: the search was ended early; this is the best motion so far\n"
        in outcome.err
    )
    assert all(
        f"brachis: not completed: {each}\n" in outcome.err for each in data["undone"]
    )


@pytest.mark.parametrize(
    "command", [("verify", "gone.npz"), ("plan", "gone.yaml"), ("inspect", "gone.urdf")]
)
def test_interrupt_while_importing(command, run, monkeypatch):
    def interrupt(_name):
        raise KeyboardInterrupt

    monkeypatch.setattr(main, "import_module", interrupt)
    outcome = run(*command)
    assert outcome.code == 130
    assert outcome.err == "brachis: interrupted\n"


def test_help_loads_neither_pinocchio_nor_numpy():
    code = "import sys, brachis.apps.cli.main\nprint(sorted({'pinocchio', 'numpy', 'scipy'} & set(sys.modules)))"
    done = subprocess.run(
        [sys.executable, "-c", code], capture_output=True, text=True, check=True
    )
    assert done.stdout.strip() == "[]"


def test_the_folder_of_a_motion_stands_for_it(run, planned, tmp_path):
    for words in (
        ["verify"],
        ["plot", "--out", tmp_path / "x.png"],
        ["export", "--out", tmp_path / "x.csv"],
    ):
        assert run(words[0], planned.out, *words[1:]).code == 0
    (tmp_path / "empty").mkdir()
    outcome = run("verify", tmp_path / "empty")
    assert outcome.code == 2
    assert (
        "this folder contains no motion; allowed: result.npz or unverified.npz"
        in outcome.err
    )


def test_verify(run, planned):
    outcome = run("verify", planned.out / "result.npz")
    assert outcome.code == 0
    assert "verification: passed" in outcome.out
    data = json.loads(run("verify", planned.out / "result.npz", "--json").out)
    assert data["passed"] is True


def test_verify_against_a_weaker_robot_fails(run, task, write, tmp_path):
    task["robot"]["limits"] = {"velocity": None}  # torque limits from the URDF
    (tmp_path / "out").mkdir()
    brachis.plan(write(task)).trajectory.save(tmp_path / "out/result.npz")
    weaker = tmp_path / "weaker.urdf"
    weaker.write_text(SCARA.read_text().replace('effort="10"', 'effort="9"'))
    outcome = run("verify", tmp_path / "out/result.npz", "--urdf", weaker, "--json")
    assert outcome.code == 1
    assert json.loads(outcome.out)["worst_ratio"] == pytest.approx(10 / 9, rel=1e-3)


def test_export(run, planned, tmp_path):
    table = tmp_path / "motion.csv"
    assert (
        run("export", planned.out / "result.npz", "--out", table, "--dt", 0.01).code
        == 0
    )
    with table.open() as stream:
        rows = list(csv.reader(stream))
    names = ["j1", "j2", "j3"]
    assert rows[0] == [
        "t",
        *(f"{kind}_{name}" for kind in ("q", "qd", "qdd", "tau") for name in names),
    ]
    times = np.array([float(row[0]) for row in rows[1:]])
    assert times[-1] == planned.data["t_end"]
    np.testing.assert_allclose(np.diff(times)[:-1], 0.01)


@pytest.mark.parametrize(
    "kind", ["torques", "postures", "motion", "overview", "timeline", "limits"]
)
def test_plot(kind, run, planned, tmp_path):
    figure = tmp_path / f"{kind}.svg"
    assert (
        run("plot", planned.out / "result.npz", "--kind", kind, "--out", figure).code
        == 0
    )
    assert b"<svg" in figure.read_bytes()


def test_plot_of_unknown_kind(run, planned, tmp_path):
    outcome = run(
        "plot",
        planned.out / "result.npz",
        "--kind",
        "torque",
        "--out",
        tmp_path / "x.png",
    )
    assert outcome.code == 2
    assert "Did you mean 'torques'?" in outcome.err


def test_the_saved_motion_is_not_written_over(run, planned):
    saved = planned.out / "result.npz"
    before = saved.read_bytes()
    assert run("export", saved, "--out", saved).code == 2
    outcome = run("export", saved, "--out", saved, "--format", "csv")
    assert outcome.code == 2
    assert "the output would overwrite an input file" in outcome.err
    assert run("plot", saved, "--out", saved).code == 2
    assert saved.read_bytes() == before


def test_version(run):
    outcome = run("--version")
    assert (outcome.code, outcome.out) == (0, f"brachis {__version__}\n")


def test_version_alone_is_printed_without_typer():
    """In a process of its own, where a message tells of every import."""
    command = [sys.executable, "-v", "-m", "brachis", "--version"]
    done = subprocess.run(command, capture_output=True, text=True, check=True)
    assert done.stdout == f"brachis {__version__}\n"
    assert "import 'brachis'" in done.stderr
    assert "import 'typer'" not in done.stderr


def test_inspect(run):
    outcome = run("inspect", SCARA, "--task-space", "x,y")
    assert outcome.code == 0
    assert outcome.out.count(" planar ") == 3
    data = json.loads(run("inspect", SCARA, "--task-space", "x,y", "--json").out)
    assert data["degree_of_redundancy"] == 1
    assert [row["redundant joints"] for row in data["decompositions"]] == [
        "j1",
        "j2",
        "j3",
    ]
    assert {row["branches"] for row in data["decompositions"]} == {2}
    assert data["joints"][0]["torque"] == "10 Nm"


def test_inspect_says_where_every_limit_holds(run, tmp_path):
    everywhere = "at all instants of a verified motion."
    data = json.loads(run("inspect", SCARA, "--task-space", "x,y", "--json").out)
    assert data["guarantees"]["torque"] == f"It holds {everywhere}"
    task = yaml.safe_load(
        (SCARA.parents[2] / "examples/01_scara_line.yaml").read_text()
    )
    task["robot"] |= {"urdf": str(SCARA), "limits": {"rms_torque": 9}}
    task["tool_limits"] = {"speed": 2}
    path = tmp_path / "task.yaml"
    path.write_text(yaml.safe_dump(task))
    text = " ".join(run("inspect", path).out.split())
    assert f"tool speed limit: It holds {everywhere}" in text
    assert "rms torque limit: It holds as a mean over the whole motion." in text


def test_inspect_of_a_task_shows_what_is_in_use(run, tmp_path):
    task = yaml.safe_load(
        (SCARA.parents[2] / "examples/01_scara_line.yaml").read_text()
    )
    task["robot"] |= {
        "urdf": str(SCARA),
        "limits": {
            "torque": {"j1": [-5, 7]},
            "velocity": 4,
            "acceleration": {"j2": 30},
        },
        "friction": {"viscous": {"j3": 0.25}, "rotor_inertia": 1e-4, "gear_ratio": 100},
        "payload": {"mass": 2.5},
        "mounting": "ceiling",
        "speed_override": "50 %",
    }
    path = tmp_path / "task.yaml"
    path.write_text(yaml.safe_dump(task))
    data = json.loads(run("inspect", path, "--json").out)
    keys = (
        "velocity",
        "acceleration",
        "torque",
        "mass",
        "viscous",
        "coulomb",
        "armature",
    )
    assert [[row[key] for key in keys] for row in data["joints"]] == [
        ["2 rad/s", "none", "-5 to 7 Nm", "10 kg", "none", "none", "1 kg m^2"],
        ["2 rad/s", "30 rad/s^2", "10 Nm", "10 kg", "none", "none", "1 kg m^2"],
        ["2 rad/s", "none", "10 Nm", "12.5 kg", "0.25 Nm s/rad", "none", "1 kg m^2"],
    ]
    assert (
        data["in_use"]["payload"]
        == "2.5 kg at [0, 0, 0] m in the tool frame, a point mass"
    )
    assert data["in_use"]["speed override"] == "50 % of the joint velocity limits"
    assert (
        "mounting: at [0, 0, 0] m, roll, pitch, yaw [180, 0, 0] deg"
        in run("inspect", path).out
    )
    outcome = run("inspect", path, "--lock", "j3=0.5")
    assert outcome.code == 2
    assert "--lock" in outcome.err


WELD = ROOT / "examples/13_weld_seams.yaml"


def test_inspect_of_a_task_shows_gravity_postures_and_path(run):
    shown = run("inspect", WELD).out
    assert "gravity: [0, 0, -9.81] m/s^2\n" in shown
    assert "start posture: rail 0.0000 m, shoulder_pan_joint 0.4000 rad, " in shown
    assert "end posture: free\n" in shown
    assert "path: 2 segments (line), 0.7651 m long\n" in shown
    assert "shoulder_pan_joint 22.9183 deg" in run("inspect", WELD, "--degrees").out
    data = json.loads(run("inspect", WELD, "--json").out)
    assert data["start_posture"][:2] == [0.0, 0.4]
    assert data["end_posture"] is None
    assert data["path"]["segments"] == ["line", "line"]
    joints = json.loads(
        run("inspect", ROOT / "examples/11_from_toppra.yaml", "--json").out
    )
    assert joints["path"] == {"segments": ["spline"], "length": None}


@pytest.mark.parametrize(
    ("change", "words"),
    [
        ("start.joints.1=9", "'shoulder_pan_joint' is out of its range; found 9 rad"),
        ("end={joints: [0, 1, -1.3, 1.9, -2.1, -1.4, 0]}", "end posture is off the"),
        (
            "path_start={position: [0, 0, 1], rpy_deg: [0, 0, 0]}",
            "start posture is off",
        ),
    ],
)
def test_inspect_refuses_postures_as_plan_does(run, change, words):
    refused = run("inspect", WELD, "--set", change)
    assert refused.code == 2
    assert words in refused.err
    assert refused == run("plan", WELD, "--set", change)


def test_inspect_says_why_not(run):
    outcome = run("inspect", SCARA, "--task-space", "x,z", "--json")
    assert outcome.code == 0
    for row in json.loads(outcome.out)["decompositions"]:
        assert row["solver"] == "-"
        assert "do not fit the plane" in row["why not"]


def test_inspect_with_locked_joint(run):
    data = json.loads(
        run("inspect", SCARA, "--task-space", "x,y", "--lock", "j3=0.5", "--json").out
    )
    assert data["degree_of_redundancy"] == 0
    assert run("inspect", SCARA, "--lock", "j3").code == 2


def test_schema(run, tmp_path):
    printed = json.loads(run("schema").out)
    assert "redundant_joints" in printed["properties"]
    assert run("schema", "--out", tmp_path / "schema.json").code == 0
    assert json.loads((tmp_path / "schema.json").read_text()) == printed


def test_module_runs(capfd, monkeypatch):
    import runpy

    monkeypatch.setattr(sys, "argv", ["brachis", "--help"])
    with pytest.raises(SystemExit):
        runpy.run_module("brachis", run_name="__main__")
    assert "inspect" in capfd.readouterr().out


def test_every_command_shows_angles_in_degrees_and_json_stays_in_rad(run, task, write):
    task["robot"]["limits"] = {"torque": None, "acceleration": 20.0, "velocity": 0.5}
    planned = run("plan", file := write(task), "--out", file.parent, "--degrees")
    assert planned.code == 0, planned.err
    assert "j1 30.0000 deg, j2 -120.0000 deg" in planned.out
    result = file.parent / "result.npz"
    verified, plain = run("verify", result, "--degrees").out, run("verify", result).out
    assert (" deg/s " in verified, " rad/s " in verified) == (True, False)
    assert (" deg/s " in plain, " rad/s " in plain) == (False, True)
    found = re.findall(
        r"\((.*?) deg/s\) saves", run("bottleneck", result, "--degrees").out
    )
    assert found[0] == f"{np.rad2deg(0.05):.3g}"
    assert (
        run("verify", result, "--degrees", "--json").out
        == run("verify", result, "--json").out
    )
