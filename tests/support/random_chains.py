"""Random serial chains as models of Pinocchio."""

from __future__ import annotations

import numpy as np
import pinocchio as pin


def random_model(n: int, seed: int) -> tuple[pin.Model, int]:
    """A serial chain of n joints with any axes, and the index of its tool frame."""
    rng = np.random.default_rng(seed)
    model = pin.Model()
    model.gravity.linear = rng.normal(0.0, 9.0, 3)
    parent = 0
    for i in range(n):
        axis = rng.normal(size=3)
        axis /= np.linalg.norm(axis)
        turns = rng.random() < 0.7
        kind = "Revolute" if turns else "Prismatic"
        joint = getattr(pin, f"JointModel{kind}Unaligned")(axis)
        parent = model.addJoint(parent, joint, pin.SE3.Random(), f"joint {i}")
        model.appendBodyToJoint(parent, pin.Inertia.Random(), pin.SE3.Random())
    frame = pin.Frame("tool", parent, 0, pin.SE3.Random(), pin.FrameType.OP_FRAME)
    return model, model.addFrame(frame)
