"""Random serial chains as models of Pinocchio."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pinocchio as pin


def random_model(n: int, seed: int) -> tuple[pin.Model, int]:
    """A serial chain of n joints with any axes, and the index of its tool frame."""
    rng = np.random.default_rng(seed)
    model = pin.Model()
    model.gravity.linear = rng.normal(0.0, 9.0, 3)
    return model, _add_chain(model, rng, "joint", "tool", n)


def random_cell(carriers: int, n: int, seed: int) -> pin.Model:
    """An arm of n joints that ends in the frame "tool", beside a chain that ends in the frame "workpiece"."""
    rng = np.random.default_rng(seed)
    pin.seed(seed)
    model = pin.Model()
    model.name = "cell"
    model.gravity.linear = rng.normal(0.0, 9.0, 3)

    def make_box() -> pin.Inertia:
        return pin.Inertia.FromBox(2.0, *rng.uniform(0.2, 0.6, 3))

    _add_chain(model, rng, "carrier", "workpiece", carriers, make_box)
    _add_chain(model, rng, "joint", "tool", n, make_box)
    model.lowerPositionLimit[:] = -5.0
    model.upperPositionLimit[:] = 5.0
    return model


def _add_chain(
    model: pin.Model,
    rng: np.random.Generator,
    name: str,
    end: str,
    count: int,
    make_body: Callable[[], pin.Inertia] = pin.Inertia.Random,
) -> int:
    """Add joints with any axes and bodies from the world on, and a frame behind them; return the frame's index."""
    parent = 0
    for i in range(count):
        axis = rng.normal(size=3)
        axis /= np.linalg.norm(axis)
        turns = rng.random() < 0.7
        kind = "Revolute" if turns else "Prismatic"
        joint = getattr(pin, f"JointModel{kind}Unaligned")(axis)
        parent = model.addJoint(parent, joint, pin.SE3.Random(), f"{name} {i}")
        model.appendBodyToJoint(parent, make_body(), pin.SE3.Random())
    frame = pin.Frame(end, parent, 0, pin.SE3.Random(), pin.FrameType.OP_FRAME)
    return int(model.addFrame(frame))
