"""A joint motion as nodes between which quintic polynomials meet the closed form to rounding.

A saved trajectory must be evaluated without the closed form (its family may be a plug-in, and the verification must
not depend on it). Joint positions, velocities and accelerations at the nodes define quintic Hermite pieces, which join
with continuous acceleration where the curves have one (splines of degree 2 have not, at knots). Nodes are added until
the pieces agree with the closed form in between, and their jerk with its jerk where they begin: there, the third
derivative of a quintic's error is largest.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from brachis.errors import UnreachableError
from brachis.kinematics.joint_map import JointMap, JointState

Curves = Callable[[np.ndarray], tuple[np.ndarray, ...]]

_PIECES = 4
"""Pieces of the longest interval at first; shorter ones have fewer: rounding shows in the jerk of short pieces."""
_POSITION_TOLERANCE = 1e-11
_ACCELERATION_TOLERANCE, _JERK_TOLERANCE = 1e-6, 1e-5
_LARGEST_ERROR = 1e-9
_ROUNDS = 8
_JUST_BEFORE = 1e-11
_ROUNDING = 60.0 * np.finfo(float).eps
"""Jerk of a piece of 1 s that comes of the rounding of positions of 1 rad."""
_NOISE = 1e-12
"""Of positions near a branch boundary, rad or m, at most."""
_GAIN = 0.5
"""Halving a piece leaves at most this part of a gap that is no noise."""


@dataclass(frozen=True)
class Nodes:
    """Joint motion at L + 1 times.

    Attributes
    ----------
    times : (L + 1,) ndarray
        s, ascending from 0 to t_end.
    q, qdot, qddot : (L + 1, n) ndarray
    qddot_before : (L + 1, n) ndarray
        Acceleration just before the nodes; differs from `qddot` where it jumps.
    position_error : float
        Largest difference found between the quintic pieces and the closed form, rad or m.
    """

    times: np.ndarray
    q: np.ndarray
    qdot: np.ndarray
    qddot: np.ndarray
    qddot_before: np.ndarray
    position_error: float


def interpolate(
    joint_map: JointMap, curves: Curves, breaks: np.ndarray, *, jumps: bool
) -> Nodes:
    """Place nodes so densely that quintic pieces stand for the closed form.

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
    steps = np.ceil(_PIECES * np.diff(breaks) / np.diff(breaks).max()).astype(int)
    pieces = [
        np.linspace(a, b, n, endpoint=False)
        for a, b, n in zip(breaks[:-1], breaks[1:], steps, strict=True)
    ]
    times = np.append(np.concatenate(pieces), breaks[-1])
    error, inherited = np.inf, np.full(len(times) - 1, np.inf)
    for _ in range(_ROUNDS):
        middle = 0.5 * (times[1:] + times[:-1])
        merged = np.sort(np.concatenate([times, middle]))
        state = joint_map.state(*curves(merged), t=merged)
        before = state.qddot
        if jumps:
            shift = _JUST_BEFORE * breaks[-1] * (np.arange(len(merged)) > 0)
            before = joint_map.state(*curves(merged - shift), near=state.q).qddot
        excess, noise, error = _excess(times, state, before, jumps=jumps)
        # What halving did not lessen, and what is as small as noise, is noise.
        bad = (excess > 1.0) & ((excess > noise) | (excess < _GAIN * inherited))
        if not bad.any():
            break
        times = np.union1d(times, middle[bad])
        inherited = np.repeat(np.where(bad, excess, 0.0), 1 + bad)
    if error > _LARGEST_ERROR:
        raise UnreachableError("the motion is too sharp for polynomial pieces")
    # The middles are known exactly as well; as nodes they make the error 64 times smaller still.
    return Nodes(
        merged,
        _positions(joint_map, curves, merged, state, before),
        state.qdot,
        state.qddot,
        before,
        error,
    )


def _positions(
    joint_map: JointMap,
    curves: Curves,
    times: np.ndarray,
    state: JointState,
    before: np.ndarray,
) -> np.ndarray:
    """Sum up positions, (L + 1, n), so that every piece has the closed form's jerk in its middle.

    The closed form's own are some 1e-15 rad off, each by itself: over 0.1 ms that is a jerk of 0.1 rad/s^3.
    What the sum is off at the end is shared by the pieces so that it adds the same jerk to each.
    """
    h = np.diff(times)[:, None]
    jerk = joint_map.state(
        *curves(np.sort(np.concatenate([times, times[:-1] + 0.5 * h[:, 0]])))
    ).qdddot[1::2]
    v, change = state.qdot, before[1:] - state.qddot[:-1]
    way = (
        0.5 * h * (v[:-1] + v[1:])
        - h**2 / 12.0 * change
        + h**3 / 30.0 * (change / h - jerk)
    )
    share = h**3 / np.sum(h**3)
    off = state.q[-1] - state.q[0] - way.sum(axis=0)
    q = np.cumsum(np.concatenate([state.q[:1], way + off * share]), axis=0)
    return np.where(np.abs(q - state.q).max(axis=0) <= _POSITION_TOLERANCE, q, state.q)


def _excess(
    times: np.ndarray, state: JointState, before: np.ndarray, *, jumps: bool
) -> tuple[np.ndarray, np.ndarray, float]:
    """Gaps of every piece in units of their tolerances, the largest of them, (L,); the same of noise; that of q."""
    h = np.diff(times)
    gap_q, gap_qddot = _middle_gaps(times, state, before)
    tolerances = [
        _POSITION_TOLERANCE,
        _ACCELERATION_TOLERANCE * (1.0 + np.abs(state.qddot).max()),
    ]
    gaps, noises = [gap_q, gap_qddot], [np.full(len(h), _NOISE), 6.0 * _NOISE / h**2]
    if not jumps:
        tolerances.append(_JERK_TOLERANCE * (1.0 + np.abs(state.qdddot).max()))
        gaps.append(_jerk_gaps(times, state))
        noises.append(60.0 * _NOISE / h**3)
    in_units = (
        np.array(values) / np.array(tolerances)[:, None] for values in (gaps, noises)
    )
    excess, noise = (values.max(axis=0) for values in in_units)
    return excess, noise, float(gap_q.max())


def _middle_gaps(
    times: np.ndarray, state: JointState, before: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """Largest differences of position and acceleration in the middle of every piece, (L,) each.

    States alternate between nodes and middles. In the middle of a quintic Hermite piece of length h:
    q = (q0 + q1)/2 + 5h/32 (v0 - v1) + h^2/64 (a0 + a1),  qddot = 3 (v1 - v0) / (2h) - (a0 + a1)/4.
    """
    h = np.diff(times)[:, None]
    q, v = state.q[::2], state.qdot[::2]
    ends = state.qddot[:-1:2] + before[2::2]
    position = (
        0.5 * (q[1:] + q[:-1])
        - 5.0 * h / 32.0 * np.diff(v, axis=0)
        + h**2 / 64.0 * ends
    )
    acceleration = 1.5 * np.diff(v, axis=0) / h - 0.25 * ends
    return np.abs(position - state.q[1::2]).max(axis=1), np.abs(
        acceleration - state.qddot[1::2]
    ).max(axis=1)


def _jerk_gaps(times: np.ndarray, state: JointState) -> np.ndarray:
    """Largest difference of jerk at the beginning of every piece, (L,), beyond what rounding makes of it.

    There a quintic Hermite piece of length h has
    qdddot = 60 (q1 - q0) / h^3 - (36 v0 + 24 v1) / h^2 - (9 a0 - 3 a1) / h.
    """
    h = np.diff(times)[:, None]
    q, v, a = state.q[::2], state.qdot[::2], state.qddot[::2]
    jerk = (
        60.0 * np.diff(q, axis=0) / h**3
        - (36.0 * v[:-1] + 24.0 * v[1:]) / h**2
        - (9.0 * a[:-1] - 3.0 * a[1:]) / h
    )
    rounding = _ROUNDING * (1.0 + np.abs(q).max()) / h**3
    return np.asarray((np.abs(jerk - state.qdddot[:-1:2]) - rounding).max(axis=1))
