"""What the commands print and write."""

import json
import math
import subprocess
import sys
from dataclasses import replace

import numpy as np
import pytest
import yaml

import brachis
from brachis import __version__, planner
from brachis.apps import plots
from brachis.apps.cli import folder
from brachis.apps.plots.style import figure_class
from brachis.errors import InputError
from brachis.search import pipeline, verified
from brachis.trajectory import Trajectory
from support.scripts import output_of

from .conftest import ROOT, SCARA


def test_a_plan_prints_the_figures_that_it_writes(planned):
    data, out = planned.data, planned.out
    required = "branch status solver iterations wall_time_s path_error worst_ratio"
    assert {*required.split()} <= data.keys()
    assert data["verified"] is True
    assert 2.0 < data["t_end"] <= 2.478
    assert data["redundant_joints"] == ["j3"]
    assert names_in(out) == RESULT | FIGURES
    assert {*data["files"]} == {str(path) for path in out.iterdir()}
    assert json.loads((out / "result.json").read_text())["t_end"] == data["t_end"]


def test_plan_for_people(run, task, write):
    task["spline"]["intervals"] = 20
    outcome = run(f"plan {write(task)}")
    for words in ("end time", "2.47", "verification: passed", "torque ratio"):
        assert words in outcome.out
    assert outcome.out.endswith(
        "nothing was saved; use --out FOLDER to save the motion\n"
    )
    # No progress display in a pipe.
    assert outcome.err.startswith(
        "brachis: warning: spline.intervals: the same joint path"
    )
    assert outcome.err.count("\n") == 1


def test_an_unverified_motion_and_a_verified_one_do_not_mix_in_one_folder(
    run, task, write, planned, tmp_path, request
):
    out = planned.copied(tmp_path / "out")
    (out / "notes.txt").write_text("mine")
    request.getfixturevalue("too_strict")
    outcome = run(f"plan {write(task)} --out {out} --json", code=1)
    assert outcome.data["verified"] is False
    for words in ("unverified", "verification (", "FAILED, allowed"):
        assert words in outcome.err
    suffixes = (".npz", ".json", ".png", "_candidates.png")
    unverified = {f"unverified{suffix}" for suffix in suffixes}
    assert names_in(out) == unverified | {"notes.txt"}
    request.getfixturevalue("monkeypatch").undo()
    run(f"plan {write(task)} --out {out}")
    assert names_in(out) == RESULT | FIGURES | {"notes.txt"}


FIGURES = {"overview.png", "candidates.png"}
RESULT = {"result.npz", "result.json"}


def names_in(folder):
    return {path.name for path in folder.iterdir()}


def contents(folder):
    return {path.name: path.read_bytes() for path in folder.iterdir()}


def no_space(path):
    return InputError(
        "the file cannot be written", where=str(path), found="No space left on device"
    )


def test_without_figures_none_is_drawn_and_older_ones_go(
    run, task, write, planned, tmp_path, monkeypatch
):
    out = planned.copied(tmp_path / "out")
    monkeypatch.delattr(plots, "save_figure")
    outcome = run(f"plan {write(task)} --out {out} --no-figures --json")
    assert names_in(out) == RESULT
    assert len(outcome.data["files"]) == 2


def test_without_matplotlib_the_result_is_written_and_the_figures_are_not(
    run, task, write, tmp_path, monkeypatch
):
    figure_class.cache_clear()
    monkeypatch.setitem(sys.modules, "matplotlib.figure", None)
    message = run(f"plan {write(task)} --out {tmp_path / 'out'}").err
    assert "but its figures were not: a figure needs Matplotlib" in message
    assert names_in(tmp_path / "out") == RESULT


def test_a_result_survives_a_full_disk_while_figures_are_written(
    run, task, write, planned, tmp_path, monkeypatch
):
    out = planned.copied(tmp_path / "out")
    before = contents(out)
    save_figure = plots.save_figure

    def save_some(figure, path):
        if path.name == "overview.png":
            raise no_space(path)
        save_figure(figure, path)

    monkeypatch.setattr(plots, "save_figure", save_some)
    outcome = run(f"plan {write(task)} --out {out} --json", code=3)
    assert "the result was written, but its figures were not: " in outcome.err
    assert f"{out / 'overview.png'}: the file cannot be written; found" in outcome.err
    data = outcome.data
    assert data["verified"] is True
    after = contents(out)
    assert after.keys() == RESULT | {"candidates.png"}
    assert {*data["files"]} == {str(out / name) for name in after}
    assert not after.items() & before.items()
    assert Trajectory.load(out / "result.npz").t_end == data["t_end"]


def test_a_failure_while_writing_the_result_leaves_the_earlier_one(
    error_of, task, write, planned, tmp_path, monkeypatch
):
    out = planned.copied(tmp_path / "out")
    before = contents(out)

    def fail(_text, path):
        raise no_space(path)

    monkeypatch.setattr(folder, "write_text", fail)
    assert f"{out / 'result.json'}: the file cannot be written; found" in error_of(
        f"plan {write(task)} --out {out}"
    )
    assert contents(out) == before


def test_a_plan_without_a_motion_says_which_files_are_of_an_earlier_one(
    run, error_of, task, write, planned, tmp_path
):
    out = planned.copied(tmp_path / "out")
    (out / "notes.txt").write_text("mine")
    before = contents(out)
    path = write(task)
    far = ("--set", "path.0.line.length=5", "--json")
    outcome = run("plan", path, *far, "--out", out, code=2)
    remark, error = outcome.err.splitlines()
    assert remark == (
        f"brachis: files of an earlier run remain in {out}: result.npz, result.json, overview.png, candidates.png"
    )
    assert "out of reach" in error
    assert "earlier" not in outcome.out
    assert contents(out) == before
    assert "earlier" not in error_of("plan", path, *far, "--out", tmp_path / "new")


def test_json_knows_no_nan(run, task, write, tmp_path, monkeypatch):
    honest = verified.verify_trajectory

    def endless(trajectory, **more):
        verification = honest(trajectory, **more)
        return replace(verification, worst_ratio=math.inf, path_error=math.nan)

    monkeypatch.setattr(verified, "verify_trajectory", endless)
    outcome = run(f"plan {write(task)} --out {tmp_path / 'out'} --json")
    for text in (outcome.out, (tmp_path / "out/result.json").read_text()):
        data = json.loads(text, parse_constant=pytest.fail)
        assert data["worst_ratio"] is None
        assert data["verification"]["path_error"] is None


@pytest.mark.parametrize("time_scaled, is_said", [(1.0, False), (1.00004, True)])
def test_a_plan_says_by_how_much_its_end_time_is_longer(
    run, task, write, monkeypatch, time_scaled, is_said
):
    plan = planner.plan

    def lengthen(*arguments, **options):
        result = plan(*arguments, **options)
        refined = replace(result.candidate.refined, time_scaled=time_scaled)
        return replace(result, candidate=replace(result.candidate, refined=refined))

    monkeypatch.setattr(planner, "plan", lengthen)
    text = run(f"plan {write(task)}").out
    words = "0.004 % to meet the limits between collocation points"
    assert ("end time lengthened by" in text, words in text) == (is_said, is_said)


@pytest.mark.parametrize(
    "search, choices, name",
    [
        ("effort: fast", {()}, "chart"),
        ("{guesses: numeric, least_motion: false}", {("j1",), ("j2",), ("j3",)}, "j2"),
    ],
    ids=["in charts", "of every choice"],
)
def test_a_plan_lists_its_candidates(run, task, write, search, choices, name):
    settings = {"redundant_joints": "auto", "search": yaml.safe_load(search)}
    path = write(task | settings)
    text = run(f"plan {path}").out
    data = run(f"plan {path} --json").data
    candidates = data["candidates"]
    assert f"candidates ({len(candidates)}" in text
    listed = {tuple(candidate["redundant_joints"]) for candidate in candidates}
    assert choices <= listed <= choices | {tuple(data["redundant_joints"])}, (
        "the fastest one in its last coordinates"
    )
    rows = text[text.index("candidates (") :]
    assert f"│ {name} " in rows
    assert "none" not in rows
    assert candidates[0]["verified"]
    assert candidates[0]["t_end"] == data["t_end"]
    assert f"{data['t_end']:.4f}" in text


def test_a_chart_is_one_row_of_the_summary(planned):
    trajectory = Trajectory.load(planned.out / "result.npz")
    assert trajectory.redundancy == "j3"
    assert "branch" in trajectory.summary()
    chart = {
        "redundant_joints": (),
        "branch": "chart",
        "chart_rows": np.ones((1, 1, 4)),
    }
    in_chart = replace(trajectory, **chart)
    words = "none chosen; the self-motion of all joints has 1 coordinate (a chart)"
    assert in_chart.summary()["redundant joints"] == words
    assert "branch" not in in_chart.summary()
    only_s = replace(in_chart, chart_rows=np.ones((1, 0, 4)))
    assert only_s.redundancy == "none"


def test_a_plan_says_what_its_time_limit_left_undone_in_its_json(
    run, task, write, tmp_path, monkeypatch
):
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
    outcome = run(f"plan {write(task)} --out {tmp_path / 'out'} --json", code=1)
    assert (tmp_path / "out/unverified.npz").exists()
    data = outcome.data
    assert data["interrupted"]
    reason = "the search that search.effort requires was not completed"
    assert data["undone"][-1] == reason
    assert "brachis: the search ended early" in outcome.err
    for step in data["undone"]:
        assert f"brachis: not completed: {step}\n" in outcome.err


def test_help_loads_neither_pinocchio_nor_numpy():
    code = "import sys, brachis.apps.cli.main\nprint(sorted({'pinocchio', 'numpy', 'scipy'} & set(sys.modules)))"
    assert output_of("-c", code).strip() == "[]"


def test_verify_against_a_weaker_robot_fails(run, task, write, tmp_path):
    task["robot"]["limits"] = {"velocity": None}  # torque limits from the URDF
    motion = tmp_path / "result.npz"
    brachis.plan(write(task)).trajectory.save(motion)
    weaker = tmp_path / "weaker.urdf"
    weaker.write_text(SCARA.read_text().replace('effort="10"', 'effort="9"'))
    data = run(f"verify {motion} --urdf {weaker} --json", code=1).data
    assert data["worst_ratio"] == pytest.approx(10 / 9, rel=1e-3)


def test_version(run):
    assert run("--version").out == f"brachis {__version__}\n"


def test_version_alone_is_printed_without_typer():
    """In a process of its own, where a message tells of every import."""
    command = [sys.executable, "-v", "-m", "brachis", "--version"]
    done = subprocess.run(command, capture_output=True, text=True, check=True)
    assert done.stdout == f"brachis {__version__}\n"
    assert "import 'brachis'" in done.stderr
    assert "import 'typer'" not in done.stderr


def test_inspect(run):
    assert run(f"inspect {SCARA} --task-space x,y").out.count(" planar ") == 3
    data = run(f"inspect {SCARA} --task-space x,y --json").data
    assert data["degree_of_redundancy"] == 1
    choices = [
        (row["redundant joints"], row["branches"]) for row in data["decompositions"]
    ]
    assert choices == [("j1", 2), ("j2", 2), ("j3", 2)]
    assert data["joints"][0]["torque"] == "10 Nm"
    locked = run(f"inspect {SCARA} --task-space x,y --lock j3=0.5 --json").out
    assert json.loads(locked)["degree_of_redundancy"] == 0
    run(f"inspect {SCARA} --lock j3", code=2)


def test_inspect_says_where_every_limit_holds(run, task, write):
    task["robot"]["limits"] = {"rms_torque": 9}
    task["tool_limits"] = {"speed": 2}
    path = write(task)
    everywhere = "met at all instants of a verified motion, to 1e-4"
    data = run(f"inspect {path} --json").data
    assert data["guarantees"]["torque"] == everywhere
    text = " ".join(run(f"inspect {path}").out.split())
    assert f"tool speed: {everywhere}" in text
    assert "limits on rms torque: met as a mean over the whole motion" in text


def test_inspect_of_a_task_shows_what_is_in_use(run, error_of, task, write):
    task["robot"] |= yaml.safe_load("""
    limits: {torque: {j1: [-5, 7]}, acceleration: {j2: 30}}
    friction: {viscous: {j3: 0.25}, rotor_inertia: 0.0001, gear_ratio: 100}
    payload: {mass: 2.5}
    mounting: ceiling
    speed_override: 50 %
    """)
    path = write(task)
    data = run(f"inspect {path} --json").data
    keys = ("acceleration", "torque", "mass", "viscous", "coulomb", "armature")
    assert [[row[key] for key in keys] for row in data["joints"]] == [
        ["none", "-5 to 7 Nm", "10 kg", "none", "none", "1 kg m^2"],
        ["30 rad/s^2", "10 Nm", "10 kg", "none", "none", "1 kg m^2"],
        ["none", "10 Nm", "12.5 kg", "0.25 Nm s/rad", "none", "1 kg m^2"],
    ]
    assert data["in_use"]["speed override"] == "50 % of the joint velocity limits"
    mounting = "mounting: at [0, 0, 0] m, roll, pitch, yaw [180, 0, 0] deg"
    assert mounting in run(f"inspect {path}").out
    assert "--lock" in error_of(f"inspect {path} --lock j3=0.5")


WELD = ROOT / "examples/13_weld_seams.yaml"


def test_inspect_of_a_task_shows_gravity_postures_and_path(run):
    shown = run(f"inspect {WELD}").out
    assert "gravity: [0, 0, -9.81] m/s^2\n" in shown
    assert "start posture: rail 0.0000 m, shoulder_pan_joint 0.4000 rad, " in shown
    assert "end posture: free\n" in shown
    assert "path: 2 segments (line), 0.7651 m long\n" in shown
    assert "path[1] at s = 1 (765.1 mm)\n" in shown
    assert "shoulder_pan_joint 22.9183 deg" in run(f"inspect {WELD} --degrees").out
    data = run(f"inspect {WELD} --json").data
    assert data["start_posture"][:2] == [0.0, 0.4]
    assert data["end_posture"] is None
    assert data["path"]["segments"] == ["line", "line"]
    joints = ROOT / "examples/11_from_toppra.yaml"
    data = run(f"inspect {joints} --json").data
    assert data["path"] == {"segments": ["spline"], "length": None}


@pytest.mark.parametrize(
    "change, words",
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
    refused = run(f"inspect {WELD} --set '{change}'", code=2)
    assert words in refused.err
    assert refused == run(f"plan {WELD} --set '{change}'", code=2)


def test_schema(run, tmp_path):
    printed = run("schema").data
    assert "redundant_joints" in printed["properties"]
    run(f"schema --out {tmp_path / 'schema.json'}")
    assert json.loads((tmp_path / "schema.json").read_text()) == printed


def test_every_command_shows_angles_in_degrees_and_json_stays_in_rad(run, task, write):
    task["robot"]["limits"] = {"torque": None, "acceleration": 20.0, "velocity": 0.5}
    file = write(task)
    planned = run(f"plan {file} --out {file.parent} --degrees")
    assert "j1 30.0000 deg, j2 -120.0000 deg" in planned.out
    result = file.parent / "result.npz"
    for options, shown, absent in (("--degrees", "deg", "rad"), ("", "rad", "deg")):
        text = run(f"verify {result} {options}").out
        assert f" {shown}/s " in text
        assert f" {absent}/s " not in text
    saving = f"({np.rad2deg(0.05):.3g} deg/s) saves"
    assert saving in run(f"bottleneck {result} --degrees").out
    assert run(f"verify {result} --degrees --json") == run(f"verify {result} --json")
