"""MuJoCo's own model of a robot, from the robot's URDF."""

from __future__ import annotations

import re

import numpy as np
import pinocchio as pin

COMPILER = """
  <mujoco>
    <compiler discardvisual="true" fusestatic="false" inertiafromgeom="false" balanceinertia="false" strippath="false"/>
  </mujoco>
"""


def mujoco_model(robot):
    """The model, and the places of the robot's joints in its coordinates."""
    import mujoco

    text = robot.urdf.replace("</robot>", COMPILER + "</robot>")
    text = re.sub(
        r'ixx="0(\.0)?"', 'ixx="1e-12"', text
    )  # slender rods, which MuJoCo refuses, turn about z alone
    model = mujoco.MjModel.from_xml_string(text)
    model.opt.disableflags |= mujoco.mjtDisableBit.mjDSBL_CONTACT
    model.opt.gravity[:] = robot.model.gravity.linear
    order = [model.joint(name).qposadr[0] for name in robot.joint_names]
    assert sorted(order) == list(range(model.nq))
    return model, np.array(order)


def follow(trajectory, model, order, t, bandwidth=50.0):
    """Yield data with the joints' errors at times (K,), over the end and again.

    Feedforward of the planned torque and a weak feedback, in steps of MuJoCo's own integrator; the bandwidth of the
    feedback, rad/s, is low beside motions that last half a second, so that feedforward does the work.
    """
    import mujoco

    robot, data = trajectory.robot, mujoco.MjData(model)
    model.opt.timestep = t[1] - t[0]
    model.opt.integrator = mujoco.mjtIntegrator.mjINT_RK4
    data.qpos[order], data.qvel[order] = trajectory.q[0], trajectory.qdot[0]
    masses = pin.crba(robot.model, robot.model.createData(), trajectory.q[0])
    stiffness, damping = (
        bandwidth**2 * np.diag(masses),
        2.0 * bandwidth * np.diag(masses),
    )
    once = np.mod(t, trajectory.t_end)
    curves = (trajectory.position, trajectory.velocity, trajectory.torque)
    for q, v, tau in zip(*(curve(once) for curve in curves), strict=True):
        error = q - data.qpos[order]
        rate = v - data.qvel[order]
        mujoco.mj_kinematics(model, data)
        yield data, error
        data.qfrc_applied[order] = tau + stiffness * error + damping * rate
        mujoco.mj_step(model, data)
