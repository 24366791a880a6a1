"""``brachis export --profile``, ``plan --profile`` and ``compare --plan``."""

import json

import yaml

from .conftest import quick_task


def test_from_a_plan_for_a_controller_to_the_run_that_came_back(
    run, error_of, tmp_path
):
    task = quick_task() | {"spline": {"intervals": 8}}
    (tmp_path / "task.yaml").write_text(yaml.safe_dump(task))
    out = tmp_path / "out"
    command = f"plan {tmp_path / 'task.yaml'} --out {out} --no-figures --profile"
    printed = run(f"{command} kuka_rsi_4ms").out
    assert "RobotSensorInterface (axis corrections) runs it, every 4 ms" in printed
    assert json.loads((out / "result.json").read_text())["run"]["passed"]

    export = f"export {out} --profile kuka_rsi_4ms --out"
    assert "verification: passed" in run(f"{export} {tmp_path / 'run.csv'}").out
    # The URDF states 100 rad/s, of which 1 % is too fast.
    message = error_of(f"{export} {tmp_path / 'seam.src'}")
    assert "s with 500 positions, rounded for the language" in message
    assert "allowed: 0.001 m, rad and 0.01 s" in message
    data = run(f"{export} {tmp_path / 'seam.src'} --time-tolerance 2 --json").data
    assert data["place"] <= 1e-3
    assert (tmp_path / "seam.src").read_text().startswith("DEF BRACHIS()")
    message = error_of(f"{export} {tmp_path / 'a.csv'} --degrees")
    assert "--degrees: this option cannot be used with a profile" in message

    compare = f"compare {tmp_path / 'run.csv'} --plan {out} --profile kuka_rsi_4ms"
    assert "j1 (A1)" in run(compare).out
    assert run(f"{compare} --json").data["tool"] < 1e-6
    half = f"compare {tmp_path / 'run.csv'} --plan {out}"
    assert "--profile: a run is compared with its plan" in error_of(half)
    assert "--robot: this option cannot be used" in error_of(
        f"{compare} --robot x.urdf"
    )
    assert "the robot or the plan is missing" in error_of(
        f"compare {tmp_path / 'run.csv'}"
    )


def test_a_run_that_breaks_limits_is_written_and_ends_with_1(run, tmp_path):
    task = quick_task() | {"spline": {"intervals": 8}}
    (tmp_path / "task.yaml").write_text(yaml.safe_dump(task))
    run(f"plan {tmp_path / 'task.yaml'} --out {tmp_path} --no-figures")
    (tmp_path / "coarse.yaml").write_text("extends: kuka_rsi_4ms\ndecimals: 2\n")
    profile = tmp_path / "coarse.yaml"
    command = f"export {tmp_path} --out {tmp_path / 'run.csv'} --profile {profile}"
    message = run(command, code=1).err
    assert "the motion exceeds limits as it is run" in message
    assert "the motion passes with" in message
    assert (tmp_path / "run.csv").exists()
