"""The chain of a model in the form that the kernel needs: at the zero posture, in the world frame."""

from __future__ import annotations

import numpy as np
import pinocchio as pin

from brachis.kernel import Chain


def chain_of(
    model: pin.Model, tool_frame: int, friction: np.ndarray | None = None
) -> Chain:
    """Describe the joints, the bodies and a frame of a serial model at its zero posture.

    The columns (v, w) of the world Jacobian are the joints' screws: w is an axis, and w x v a point on it.

    Parameters
    ----------
    model : pinocchio.Model
    tool_frame : int
        Index of the tool frame.
    friction : (n, 4) ndarray, optional
        Friction terms (see `Chain`); zeros if left out.
    """
    data = model.createData()
    zero = np.zeros(model.nq)
    columns = pin.computeJointJacobians(model, data, zero).reshape(6, model.nq)
    linear = columns[:3].T
    angular = columns[3:].T
    revolute = np.linalg.norm(angular, axis=1) > 0.5
    inertias = list(model.inertias)[1:]
    placements = list(data.oMi)[1:]
    bodies = [
        placement.act(inertia)
        for placement, inertia in zip(placements, inertias, strict=True)
    ]
    tool = pin.updateFramePlacement(model, data, tool_frame)
    return Chain(
        revolute=revolute,
        axes=np.where(revolute[:, None], angular, linear),
        points=np.where(revolute[:, None], np.cross(angular, linear), 0.0),
        tool_position=np.array(tool.translation),
        tool_rotation=np.array(tool.rotation),
        masses=np.array([body.mass for body in bodies]),
        centers=np.array([body.lever for body in bodies]),
        inertias=np.array([body.inertia[np.triu_indices(3)] for body in bodies]),
        gravity=np.array(model.gravity.linear),
        friction=np.zeros((model.nq, 4)) if friction is None else friction,
    )
