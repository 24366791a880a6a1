"""``brachis import`` and ``brachis compare``."""

import json

import numpy as np
import pytest
import yaml

import brachis

from .conftest import SCARA, quick_task


@pytest.fixture(scope="module")
def recording(tmp_path_factory):
    """A slow motion as a file in degrees, and a task file with the robot and its settings."""
    folder = tmp_path_factory.mktemp("recorded")
    task = quick_task() | {"spline": {"intervals": 6}}
    trajectory = brachis.plan(task, limits={"torque": 5.0, "velocity": None}).trajectory
    samples = trajectory.sample(0.01)
    table = np.column_stack([samples.t, np.rad2deg(samples.q)])
    np.savetxt(
        folder / "today.csv",
        table,
        delimiter=",",
        header="t,j1,j2,j3",
        comments="",
        fmt="%.17g",
    )
    (folder / "cell.yaml").write_text(yaml.safe_dump(task))
    return folder / "today.csv", folder / "cell.yaml", trajectory


def test_import_verifies_a_recording_which_every_command_takes(
    run, recording, tmp_path
):
    file, cell, trajectory = recording
    out = tmp_path / "today.npz"
    outcome = run(f"import {file} --robot {cell} --angle deg --out {out} --degrees")
    assert " deg/s " in outcome.out
    assert f"end time t_E: {trajectory.t_end:.4f} s" in outcome.out
    assert "verification: passed" in outcome.out
    assert "unknown: the motion between the rows" in outcome.out
    run(f"verify {out}")
    assert (
        "the cost of the limits is unknown: the motion was not planned, or was saved without its sensitivities"
        in run(f"bottleneck {out}").out
    )
    run(f"export {out} --out {tmp_path / 'again.json'}")
    outcome = run(f"import {file} --robot {SCARA} --angle deg --out {out} --json")
    assert outcome.data["t_end"] == pytest.approx(trajectory.t_end)
    run(f"import {file} --robot {cell} --angle deg --out {cell}", code=2)


def test_compare(run, recording, tmp_path):
    file, cell, trajectory = recording
    out = tmp_path / "out"
    outcome = run(f"compare {file} --robot {cell} --angle deg --out {out}")
    data = json.loads((out / "comparison.json").read_text())
    assert data["t_end_today"] == pytest.approx(trajectory.t_end)
    assert outcome.out.startswith(f"{100 * data['saved']:.1f} % faster: ")
    assert "used by the recorded motion" in outcome.out
    names = sorted(path.name for path in out.iterdir())
    assert names == ["comparison.json", "comparison.png", "result.npz", "today.npz"]
    run(f"verify {out / 'result.npz'}")


@pytest.mark.parametrize(
    "options, message",
    [
        (("--angle", "grad"), "there is no unit of angle named 'grad'; allowed: rad"),
        (("--angle", "deg", "--task-space", "yaw,x,y"), "yaw"),
        (("--angle", "deg", "--tolerance", "0"), "the tolerance of a path is out of"),
        (("--angle", "deg", "--noise", "-1"), "noise"),
        ((), 'If these are degrees, set units={"angle": "deg"} or --angle deg'),
    ],
)
def test_a_wrong_option_is_an_error_and_nothing_is_written(
    error_of, recording, tmp_path, options, message
):
    file, cell, _ = recording
    out = tmp_path / "today.npz"
    assert message in error_of("import", file, "--robot", cell, *options, "--out", out)
    assert not out.exists()
