"""Jacobians of phases and programs as matrices, exact and by differences."""

from __future__ import annotations

import numpy as np

SIZES = ("tool_speed", "tool_acceleration", "tool_angular_speed")


def dense(program, x) -> np.ndarray:
    matrix = np.zeros((len(program.lower), program.variables))
    places = program.jacobian_rows * program.variables + program.jacobian_columns
    assert len(np.unique(places)) == len(places), "the pattern has a place twice"
    matrix.flat[places] = program.jacobian(x)
    return matrix


def differences(program, x, h=1e-4) -> np.ndarray:
    """Central differences of fourth order of the rows, column by column."""
    return differences_of(program.rows, x, h)


def differences_of(function, x, h) -> np.ndarray:
    """Central differences of fourth order of any function of x, along the last axis."""
    columns = []
    for unit in np.eye(len(x)):
        near = function(x + h * unit) - function(x - h * unit)
        far = function(x + 2.0 * h * unit) - function(x - 2.0 * h * unit)
        columns.append((8.0 * near - far) / (12.0 * h))
    return np.stack(columns, axis=-1)


def comparable_rows(phase, limit, x) -> np.ndarray:
    """Rows whose differences tell: the direction of a tool that hardly moves turns within a step, and kinks bend."""
    state = phase.state(x)
    kind = limit.kind
    near = np.abs(state.s[:, None] - limit.breaks).min(axis=1, initial=np.inf) > 1e-3
    if kind in SIZES:
        near &= limit.values(state)[:, 0] > 0.05
    if kind == "torque_speed":
        for joint, curve in enumerate(phase.joint_map.robot.limits.torque_speed):
            bends = np.array(curve or np.empty((0, 2)))[:, 0]
            gaps = np.abs(np.abs(state.qdot[:, joint, None]) - bends[bends > 0.0])
            near &= gaps.min(axis=1, initial=np.inf) > 3e-3
    if limit.guarantee.is_mean:
        return np.ones(len(limit.lower), dtype=bool)
    return np.repeat(near, len(limit.lower))
