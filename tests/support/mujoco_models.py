"""MuJoCo's own model of a robot, from the robot's URDF."""

from __future__ import annotations

import re

import numpy as np

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
