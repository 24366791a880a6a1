"""Jacobians of phases as matrices, exact and by differences."""

from __future__ import annotations

import numpy as np

SIZES = ("tool_speed", "tool_acceleration", "tool_angular_speed")


def dense(phase, x) -> np.ndarray:
    matrix = np.zeros((len(phase.lower), phase.variables))
    np.add.at(matrix, (phase.jacobian_rows, phase.jacobian_columns), phase.jacobian(x))
    return matrix


def differences(phase, x, h=1e-4) -> np.ndarray:
    """Central differences of fourth order, column by column."""
    columns = []
    for unit in np.eye(len(x)):
        near = phase.rows(x + h * unit) - phase.rows(x - h * unit)
        far = phase.rows(x + 2.0 * h * unit) - phase.rows(x - 2.0 * h * unit)
        columns.append((8.0 * near - far) / (12.0 * h))
    return np.stack(columns, axis=1)


def told(phase, limit, x) -> np.ndarray:
    """Rows whose differences tell: the direction of a tool that hardly moves turns within a step, and kinks bend."""
    state, kind = phase.state(x), limit.kind
    near = np.abs(state.s[:, None] - limit.breaks).min(axis=1, initial=np.inf) > 1e-3
    if kind in SIZES:
        near &= limit.values(state)[:, 0] > 0.05
    return (
        np.repeat(near, len(limit.lower))
        if not limit.guarantee.is_mean
        else np.ones(len(limit.lower), dtype=bool)
    )
