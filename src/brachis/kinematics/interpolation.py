"""A joint motion as nodes. Between them, quintic polynomials agree with the closed form up to rounding.

It must be possible to evaluate a saved trajectory without the closed form: the closed form may come from a plug-in, and
the verification must not depend on it. Joint positions, velocities and accelerations at the nodes define quintic
Hermite pieces. The acceleration is continuous from piece to piece if that of the curves is continuous; for splines of
degree 2, it jumps at knots. Nodes are added until the pieces agree with the closed form between the nodes. The jerks
must agree at the beginning of each piece, where the third derivative of a quintic's error is largest.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np

from brachis.common.arrays import spread
from brachis.errors import UnreachableError
from brachis.kinematics.joint_map import JointMap, JointState

Curves = Callable[[np.ndarray], tuple[np.ndarray, ...]]

_POSITION_TOLERANCE = 1e-11
"""Largest permitted gap between the pieces and the closed form, rad or m."""


@dataclass(frozen=True)
class Nodes:
    """Joint motion at L + 1 times.

    Attributes
    ----------
    times : (L + 1,) ndarray
        Times, ascending from 0 to t_end, s.
    q, qdot, qddot : (L + 1, n) ndarray
    qddot_before : (L + 1, n) ndarray
        Acceleration just before each node. It differs from `qddot` where the acceleration jumps.
    """

    times: np.ndarray
    q: np.ndarray
    qdot: np.ndarray
    qddot: np.ndarray
    qddot_before: np.ndarray


def join_nodes(nodes_by_phase: Sequence[Nodes]) -> Nodes:
    """Join the nodes of successive phases. Where two phases meet, the nodes of the later one are used."""
    begins = np.cumsum([0.0, *(nodes.times[-1] for nodes in nodes_by_phase[:-1])])
    times = [
        begin + nodes.times for begin, nodes in zip(begins, nodes_by_phase, strict=True)
    ]
    q, qdot, qddot = (
        _join([getattr(nodes, name) for nodes in nodes_by_phase])
        for name in ("q", "qdot", "qddot")
    )
    later = (nodes.qddot_before[1:] for nodes in nodes_by_phase)
    before = np.concatenate([nodes_by_phase[0].qddot_before[:1], *later])
    return Nodes(_join(times), q, qdot, qddot, before)


def _join(arrays: Sequence[np.ndarray]) -> np.ndarray:
    """Join arrays, leaving out the last row of each array except the last array."""
    return np.concatenate([*(array[:-1] for array in arrays[:-1]), arrays[-1]])


def interpolate(
    joint_map: JointMap, curves: Curves, breaks: np.ndarray, *, jumps: bool
) -> Nodes:
    """Place nodes densely enough for quintic pieces to replace the closed form.

    Parameters
    ----------
    joint_map : JointMap
    curves : callable
        ``curves(t)`` returns y, ydot, yddot, ydddot, each (K, 1 + r), at times (K,) in seconds.
    breaks : (N + 1,) ndarray
        Times between which the curves are polynomials, s.
    jumps : bool
        Whether accelerations may jump at the breaks.

    Returns
    -------
    Nodes

    Raises
    ------
    UnreachableError
        The motion leaves the branch between the breaks.
    """
    # Use two pieces in the longest interval and one in shorter ones: in short pieces, rounding shows in the jerk.
    steps = np.ceil(2 * np.diff(breaks) / np.diff(breaks).max()).astype(int)
    times = spread(breaks, steps)
    inherited = np.full(len(times) - 1, np.inf)
    for _ in range(8):
        merged = spread(times, 2)
        state = joint_map.state(*curves(merged), t=merged)
        before = state.qddot
        if jumps:
            shift = 1e-11 * breaks[-1] * (np.arange(len(merged)) > 0)
            before = joint_map.state(*curves(merged - shift), near=state.q).qddot
        gaps, noises = _measure_gaps(times, state, before, orders=2 if jumps else 3)
        excess = gaps.max(axis=0)
        noise = noises.max(axis=0)
        # Treat a gap as noise if halving did not reduce it by half, or if it is no larger than the noise.
        bad = (excess > 1.0) & ((excess > noise) | (excess < 0.5 * inherited))
        if not bad.any():
            break
        times = np.union1d(times, merged[1::2][bad])
        inherited = np.repeat(np.where(bad, excess, 0.0), 1 + bad)
    if _POSITION_TOLERANCE * gaps[0].max() > 1e-9:
        raise UnreachableError("the motion is too sharp for polynomial pieces")
    # The middles are exact as well. Using them as nodes reduces the error by another factor of 64.
    q = _sum_positions(joint_map, curves, merged, state, before)
    return Nodes(merged, q, state.qdot, state.qddot, before)


def _sum_positions(
    joint_map: JointMap,
    curves: Curves,
    times: np.ndarray,
    state: JointState,
    before: np.ndarray,
) -> np.ndarray:
    """Add up positions, (L + 1, n), so that in its middle every piece has the jerk of the closed form.

    Each position from the closed form has an independent error of about 1e-15 rad. In a piece of 0.1 ms, such an error
    amounts to a jerk of 0.1 rad/s^3. At the end the sum has an error, which is distributed over the pieces so that it
    adds the same jerk to each.
    """
    h = np.diff(times)[:, None]
    jerk = joint_map.state(*curves(spread(times, 2))).qdddot[1::2]
    v = state.qdot
    change = before[1:] - state.qddot[:-1]
    travel = (
        0.5 * h * (v[:-1] + v[1:])
        - h**2 / 12.0 * change
        + h**3 / 30.0 * (change / h - jerk)
    )
    share = h**3 / np.sum(h**3)
    off = state.q[-1] - state.q[0] - travel.sum(axis=0)
    q = np.cumsum(np.concatenate([state.q[:1], travel + off * share]), axis=0)
    return np.where(np.abs(q - state.q).max(axis=0) <= _POSITION_TOLERANCE, q, state.q)


def _measure_gaps(
    times: np.ndarray, state: JointState, before: np.ndarray, orders: int
) -> tuple[np.ndarray, np.ndarray]:
    """Return the largest gaps of every piece in position, acceleration and jerk, and their noise, in tolerances.

    The states are those at nodes and at middles, alternately. In the middle of a quintic Hermite piece of length h:
    q = (q0 + q1)/2 + 5h/32 (v0 - v1) + h^2/64 (a0 + a1),  qddot = 3 (v1 - v0) / (2h) - (a0 + a1)/4.
    At its beginning, qdddot = 60 (q1 - q0) / h^3 - (36 v0 + 24 v1) / h^2 - (9 a0 - 3 a1) / h.

    Returns
    -------
    gaps, noises : (orders, L) ndarray
        Gaps and noise for the position, the acceleration and, if `orders` is 3, the jerk.
    """
    h = np.diff(times)[:, None]
    q = state.q[::2]
    v = state.qdot[::2]
    ends = state.qddot[:-1:2] + before[2::2]
    position = 0.5 * (q[1:] + q[:-1]) - 5.0 * h / 32.0 * np.diff(v, axis=0)
    position += h**2 / 64.0 * ends - state.q[1::2]
    acceleration = 1.5 * np.diff(v, axis=0) / h - 0.25 * ends - state.qddot[1::2]
    largest = 1.0 + np.abs(state.qddot).max()
    # For each order: the gap, its noise, and the tolerance.
    # Positions close to a branch boundary have a noise of at most 1e-12 rad or m.
    measures = [
        (np.abs(position), 1e-12 + 0.0 * h, _POSITION_TOLERANCE),
        (np.abs(acceleration), 6e-12 / h**2, 1e-6 * largest),
    ]
    if orders == 3:
        a = state.qddot[::2]
        jerk = 60.0 * np.diff(q, axis=0) / h**3 - (9.0 * a[:-1] - 3.0 * a[1:]) / h
        jerk -= (36.0 * v[:-1] + 24.0 * v[1:]) / h**2 + state.qdddot[:-1:2]
        rounding = 60.0 * np.finfo(float).eps * (1.0 + np.abs(q).max()) / h**3
        largest = 1.0 + np.abs(state.qdddot).max()
        measures.append((np.abs(jerk) - rounding, 60e-12 / h**3, 1e-5 * largest))
    gaps = [gap.max(axis=1) / tolerance for gap, _, tolerance in measures]
    noises = [noise[:, 0] / tolerance for _, noise, tolerance in measures]
    return np.array(gaps), np.array(noises)
