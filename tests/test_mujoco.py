"""Independent physics: MuJoCo, from the same URDF, agrees with the torques and follows the path with them."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pinocchio as pin
import pytest

import brachis
from brachis.verify import verify_trajectory
from support.effort import QUICK
from support.mujoco_models import mujoco_model

mujoco = pytest.importorskip("mujoco")

ROOT = Path(__file__).parents[1]
TX90L = {
    "brachis": 1,
    "start": {"joints": [0, 0.3, 0.2, 1.5, 0.2, 1.2, 0.1]},
    "task_space": "pose",
    "path": [{"line": {"by": [0, 0.8, 0]}}],
    "redundant_joints": ["rail"],
    "spline": {"intervals": 20},
}
TASKS = {"scara3": ROOT / "examples/01_scara_line.yaml", "tx90l_rail": TX90L}
BANDWIDTH = 50.0
"""Of the feedback, rad/s: slow beside motions that last half a second, so that feedforward does the work."""


@pytest.fixture(scope="module", params=sorted(TASKS))
def motion(request):
    """A planned trajectory and MuJoCo's own model of its robot."""
    urdf = ROOT / f"robots/{request.param}/robot.urdf"
    trajectory = brachis.plan(urdf, TASKS[request.param], **QUICK).trajectory
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
    """Feedforward of the planned torque and a weak feedback, in small steps of MuJoCo's own integrator."""
    trajectory, model, order = motion
    model.opt.timestep = 2e-4
    model.opt.integrator = mujoco.mjtIntegrator.mjINT_RK4
    data = mujoco.MjData(model)
    data.qpos[order] = trajectory.q[0]
    inertia = np.diag(
        pin.crba(
            trajectory.robot.model, trajectory.robot.model.createData(), trajectory.q[0]
        )
    )
    stiffness, damping = BANDWIDTH**2 * inertia, 2.0 * BANDWIDTH * inertia
    tool = model.body(trajectory.robot.tool_frame).id
    worst, t = 0.0, np.arange(0.0, trajectory.t_end, model.opt.timestep)
    planned = (trajectory.position(t), trajectory.velocity(t), trajectory.torque(t))
    positions, _ = trajectory.robot.tool_placements(planned[0])
    for q, v, tau, position in zip(*planned, positions, strict=True):
        error, rate = q - data.qpos[order], v - data.qvel[order]
        mujoco.mj_kinematics(model, data)
        worst = max(worst, float(np.linalg.norm(data.xpos[tool] - position)))
        data.qfrc_applied[order] = tau + stiffness * error + damping * rate
        mujoco.mj_step(model, data)
    print(f"largest distance from the path {worst:.2e} m")  # noqa: T201
    assert worst < 1e-4
