"""What a new user writes first, as a script that a strict type checker accepts; the tests run it as it is."""

from __future__ import annotations

import sys
from pathlib import Path

import numpy as np

import brachis
from brachis import Arc, Circle, Helix, Line, Spline


def main(folder: Path) -> None:
    """Plan in all the ways there are, and look at what comes out."""
    # The robot comes along; keywords are the task's keys.
    q0 = np.array([0.5236, -2.0944, 2.0944])
    robot = brachis.robots.scara3.with_limits(torque={"j1": 12.0}, velocity=6.0)
    result = brachis.plan(
        robot,
        path=Line(by=[0.0, 0.3], blend=0.05) + Line(by=np.array([-0.2, 0.0])),
        start=q0,
        task_space=["x", "y"],
        redundant_joints=["j1"],
        limits={"acceleration": 40.0},
        intervals=10,
        effort="single",
    )
    print(f"{result.t_end:.3f} s, verified: {result.verified}")

    # A heavier tool: from the motion that is known, in a fraction of the time.
    heavier = brachis.plan(robot.with_payload(0.5), result.task, start_from=result)
    assert heavier.verified
    assert heavier.t_end > result.t_end

    # What came out.
    samples = result.sample(dt=0.004)
    fastest = float(samples.tool_speed.max())
    print(
        f"{len(samples)} samples, the tool at {fastest:.3f} m/s at most, ends at {samples.tool_position[-1]} m"
    )
    position: np.ndarray = result.trajectory.position(0.1)
    assert position.shape == (3,)
    assert result.trajectory.at(0.1).tool_quaternion.shape == (1, 4)
    result.save(folder / "result.npz")
    brachis.plots.save_figure(result.plot(), folder / "overview.png")
    print(result.bottleneck())
    print(result)
    loaded = brachis.Trajectory.load(folder / "result.npz")
    assert brachis.verify_trajectory(loaded).passed

    # Many at a time; failures are values.
    tasks = [brachis.examples.scara_line, folder / "missing.yaml"]
    for outcome in brachis.plan_many(
        tasks, redundant_joints=["j1"], intervals=8, effort="single"
    ):
        if isinstance(outcome, brachis.Result):
            print(f"{outcome.t_end:.3f} s")
        else:
            print(f"no plan: {outcome.problem}")

    # Paths of all kinds.
    angle = np.linspace(0.1, 1.0, 50)
    arc = Arc(center=[0.5, 0.0, 0.3], angle_deg=30, normal=[0, 0, 1])
    path = (
        arc
        + Circle([0.5, 0.0, 0.3], normal=(0, 0, 1))
        + Helix([0.5, 0.0, 0.3], pitch=0.02, turns=2)
    )
    path += (
        Spline(
            through=np.column_stack([np.cos(angle), np.sin(angle), 0.3 + 0.0 * angle])
        ),
    )
    print([segment.kind for segment in path])

    try:
        brachis.plan(
            "scara3", path=Line(by=[9.0, 0.0]), start=q0, task_space=["x", "y"]
        )
    except brachis.BrachisError as error:
        print(error)


if __name__ == "__main__":
    main(Path(sys.argv[1]))
