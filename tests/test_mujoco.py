"""Independent physics: MuJoCo, from the same URDF, agrees with the torques and follows the path with them."""

import numpy as np
import pytest

import brachis
from brachis.robot import dynamics
from brachis.verify import verify_trajectory
from support.effort import QUICK
from support.mujoco_models import follow, mujoco_model

mujoco = pytest.importorskip("mujoco")

TASKS = (brachis.examples.scara_line, brachis.examples.tx90l_rail_line)


@pytest.fixture(scope="module", params=TASKS, ids=lambda path: path.stem)
def motion(request):
    """A planned trajectory and MuJoCo's own model of its robot."""
    trajectory = brachis.plan(request.param, intervals=20, **QUICK).trajectory
    assert verify_trajectory(trajectory).passed
    return trajectory, *mujoco_model(trajectory.robot)


def test_inverse_dynamics_agree(motion):
    trajectory, model, order = motion
    data = mujoco.MjData(model)
    t = np.linspace(0.0, trajectory.t_end, 501)
    found = np.empty((len(t), len(order)))
    for k, (q, v, a) in enumerate(
        zip(
            trajectory.position(t),
            trajectory.velocity(t),
            trajectory.acceleration(t),
            strict=True,
        )
    ):
        data.qpos[order], data.qvel[order], data.qacc[order] = q, v, a
        mujoco.mj_inverse(model, data)
        found[k] = data.qfrc_inverse[order]
    limit = trajectory.robot.limits.torque
    planned = trajectory.torque(t)
    assert np.abs(planned / limit).max() > 0.99
    assert np.abs((found - planned) / limit).max() < 1e-6


def test_the_planned_torque_follows_the_path(motion):
    trajectory, model, order = motion
    robot = trajectory.robot
    tool = model.body(robot.tool_frame).id
    t = np.arange(0.0, trajectory.t_end, 2e-4)
    positions, _ = robot.tool_placements(trajectory.position(t))
    states = follow(trajectory, model, order, t)
    places = np.array([data.xpos[tool].copy() for data, _ in states])
    assert np.linalg.norm(places - positions, axis=1).max() < 1e-4


def test_a_cell_with_a_positioner():
    robot = brachis.robots.tx90l_positioner
    model, order = mujoco_model(robot)
    workpiece, tool = (model.body(name).id for name in ("workpiece", "tool"))
    data = mujoco.MjData(model)
    states = np.random.default_rng(0).normal(size=(3, 20, robot.n))
    planned = dynamics.torque(robot, *states)
    positions, _ = robot.tool_placements(states[0])
    for k, (q, v, a) in enumerate(states.swapaxes(0, 1)):
        data.qpos[order], data.qvel[order], data.qacc[order] = q, v, a
        mujoco.mj_inverse(model, data)
        error = data.qfrc_inverse[order] - planned[k]
        assert np.abs(error / robot.limits.torque).max() < 1e-6
        away = data.xpos[tool] - data.xpos[workpiece]
        seen = data.xmat[workpiece].reshape(3, 3).T @ away
        np.testing.assert_allclose(seen, positions[k], atol=1e-9)


def test_a_closed_cycle_does_not_drift():
    """Three times through a program of two lines, which ends where it began."""
    program = [
        {"path": [{"line": {"by": [0.0, 0.3]}}], "path_start": [0.7, -0.1]},
        {"dwell": 0.1},
        {"move": "next"},
        {"path": [{"line": {"by": [0.2, 0.0]}}], "path_start": [0.6, 0.5]},
        {"move": "next"},
    ]
    result = brachis.plan(
        "scara3", program=program, task_space=["x", "y"], end="start", **QUICK
    )
    assert result.verified
    trajectory = result.trajectory
    model, order = mujoco_model(trajectory.robot)
    tool = model.body(trajectory.robot.tool_frame).id
    steps = int(trajectory.t_end / 2e-4)
    t = np.arange(3 * steps + 1) * (trajectory.t_end / steps)
    states = follow(trajectory, model, order, t)
    places = np.array([data.xpos[tool].copy() for data, _ in states])
    begins = places[::steps]
    assert np.linalg.norm(begins - begins[0], axis=1).max() < 1e-6
