"""A robot with one joint through every command."""

import csv

import pytest

import brachis
from brachis.apps.plots import PLOTS
from support.chains import Joint, chain_urdf

LIMIT = {"lower": -1.0, "upper": 1.0, "velocity": 3.0, "effort": 20.0}
ROBOTS = {
    "prismatic": ((1.0, 0.0, 0.0), "x", 0.5),
    "revolute": ((0.0, 0.0, 1.0), "y", 0.2),
}


@pytest.fixture(scope="module", params=ROBOTS)
def files(request, tmp_path_factory):
    """Task and URDF of a robot with one joint, and its saved motion."""
    folder = tmp_path_factory.mktemp(request.param)
    axis, row, length = ROBOTS[request.param]
    joint = Joint(request.param, axis=axis, limit=LIMIT)
    (folder / "robot.urdf").write_text(chain_urdf([joint], tool=(0.5, 0.0, 0.0)))
    (folder / "task.yaml").write_text(f"""
    brachis: 1
    robot: {{urdf: robot.urdf, gravity: [0, 0, 0]}}
    start: {{joints: [0.1]}}
    task_space: [{row}]
    path: [{{line: {{by: [{length}]}}}}]
    spline: {{intervals: 10}}
    search: {{effort: single, least_motion: false}}
    """)
    result = brachis.plan(folder / "task.yaml")
    assert result.verified
    result.trajectory.save(folder / "result.npz")
    return folder


def test_plan(run, files, tmp_path):
    run(f"plan {files / 'task.yaml'} --out {tmp_path}")
    names = {path.name for path in tmp_path.iterdir()}
    assert names == {"result.npz", "result.json", "overview.png", "candidates.png"}


@pytest.mark.parametrize("kind", sorted({*PLOTS} - {"fit"}))
def test_plot(kind, run, files, tmp_path):
    run(f"plot {files / 'result.npz'} --kind {kind} --out {tmp_path / 'figure.svg'}")
    assert b"<svg" in (tmp_path / "figure.svg").read_bytes()


def test_export_verify_inspect(run, files, tmp_path):
    table = tmp_path / "motion.csv"
    for motion in (files / "result.npz", files):
        run(f"export {motion} --out {table} --dt 0.01")
    with table.open() as stream:
        assert {len(row) for row in csv.reader(stream)} == {5}
    assert run(f"verify {files / 'result.npz'} --json").data["passed"] is True
    outcome = run(f"inspect {files / 'robot.urdf'} --posture 0.2 --json")
    (choice,) = outcome.data["decompositions"]
    assert choice["solver"] != "-"
    outcome = run(f"verify {tmp_path}", code=2)
    message = "this folder contains no motion; allowed: result.npz or unverified.npz"
    assert message in outcome.err


@pytest.mark.parametrize("name", ["task.yaml", "result.npz"])
def test_bottleneck(name, run, files, tmp_path):
    outcome = run(f"bottleneck {files / name} --check --out {tmp_path} --json")
    costs = outcome.data["bottleneck"]["sensitivities"]
    assert costs["reliable"] is True
    assert sum(entry["change_for_10_percent_s"] for entry in costs["limits"]) < -1e-3
    assert (tmp_path / "timeline.png").exists()
