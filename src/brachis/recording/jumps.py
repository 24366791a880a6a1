"""Accelerations that jump between two rows, found by what lies on both sides (subcell resolution).

A quintic piece between two rows, of which one is before and the other after a jump, overshoots by up to a tenth of it.
Going on from both rows at constant jerk, the velocities meet where the jump is (A. Harten, Journal of Computational
Physics 83, 1989). There the acceleration goes over from the one to the other within a small part of the period.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

_OVER = 0.01
"""Of a joint's largest acceleration: by so much a piece must leave the range between its ends to have a jump."""
_WITHIN = 0.02
"""Half of the least part of a period in which the acceleration goes over."""
_PLACES = np.linspace(1.5 * _WITHIN, 1.0 - 1.5 * _WITHIN, 401)
_INSIDE = np.linspace(0.0, 1.0, 21)[1:-1]


@dataclass(frozen=True, eq=False)
class States:
    """Motion at K times: (K,) and (K, n) each."""

    t: np.ndarray
    q: np.ndarray
    qdot: np.ndarray
    qddot: np.ndarray

    def one(self, i: int) -> tuple[np.ndarray, ...]:
        """Return position, velocity and acceleration, (n,), at one of the times."""
        return self.q[i], self.qdot[i], self.qddot[i]


def with_jumps(motion: States, jerk: np.ndarray) -> tuple[States, int]:
    """Add nodes where accelerations jump between two others, and return how many jumps there are.

    Parameters
    ----------
    motion : States
        At the rows.
    jerk : (K, n) ndarray
        From the same side of a jump as the other derivatives.
    """
    scale = np.maximum(np.abs(motion.qddot).max(axis=0), np.finfo(float).tiny)
    over = _overshoot(motion, scale)
    added = [found for i in np.flatnonzero(over > _OVER).tolist() if (found := _split(motion, jerk, i, scale, over[i]))]
    if not added:
        return motion, 0
    t = np.concatenate([motion.t, *(part.t for part in added)])
    order = np.argsort(t, kind="stable")
    parts = (
        np.concatenate([getattr(motion, name), *(getattr(part, name) for part in added)])[order]
        for name in ("q", "qdot", "qddot")
    )
    return States(t[order], *parts), len(added)


def _overshoot(motion: States, scale: np.ndarray) -> np.ndarray:
    """By how much the acceleration in each piece leaves the range between its ends, in parts of `scale`, (K - 1,)."""
    h = np.diff(motion.t)[:, None]
    way = np.diff(motion.q, axis=0)
    v0, v1, a0, a1 = motion.qdot[:-1], motion.qdot[1:], motion.qddot[:-1], motion.qddot[1:]
    gain, rest = (v1 - v0) / h - 0.5 * (a0 + a1), (way - v0 * h) / h**2 - a0 / 3.0 - a1 / 6.0
    # a(u) = a0 + (a1 - a0) u + u (1 - u) (c + d u) with the given velocity gain and way
    d = 60.0 * (gain - 2.0 * rest)
    c = 6.0 * gain - 0.5 * d
    u = _INSIDE[:, None, None]
    values = a0 + (a1 - a0) * u + u * (1.0 - u) * (c + d * u)
    beyond = np.maximum(values.max(axis=0) - np.maximum(a0, a1), np.minimum(a0, a1) - values.min(axis=0))
    worst: np.ndarray = (beyond / scale).max(axis=1)
    return worst


def _split(motion: States, jerk: np.ndarray, i: int, scale: np.ndarray, before: float) -> States | None:
    """Return two nodes between which the acceleration jumps in the piece after row i; None where they do not help."""
    h = float(motion.t[i + 1] - motion.t[i])
    left, right = (*motion.one(i), jerk[i]), (*motion.one(i + 1), jerk[i + 1])
    place, width = _where(left, right, h, scale)
    first, last = place * h - 0.5 * width, place * h + 0.5 * width
    if place <= 0.5:  # noqa: PLR2004  (what is left over is for the longer side)
        begin = _going_on(left, first)
        end = _over(begin, _going_on(right, last - h)[2], width)
    else:
        end = _going_on(right, last - h)
        begin = _over(end, _going_on(left, first)[2], -width)
    parts = (np.array(pair) for pair in zip(begin, end, strict=True))
    nodes = States(motion.t[i] + np.array([first, last]), *parts)
    both = (
        np.stack([x, *y, z]) for x, y, z in zip(left[:3], (nodes.q, nodes.qdot, nodes.qddot), right[:3], strict=True)
    )
    whole = States(np.array([motion.t[i], *nodes.t, motion.t[i + 1]]), *both)
    return nodes if _overshoot(whole, scale).max() < 0.5 * before else None


def _where(
    left: tuple[np.ndarray, ...], right: tuple[np.ndarray, ...], h: float, scale: np.ndarray
) -> tuple[float, float]:
    """Return the part of a period after which the velocities of both sides meet best, and the time of the change, s.

    A steady change from one acceleration to the other, D apart, within a time w leads D w^2 / 24 further than a jump in
    its middle.
    """

    def apart(place: np.ndarray | float, order: int) -> np.ndarray:
        u = np.asarray(place)[..., None] * h
        difference: np.ndarray = (_going_on(right, u - h)[order] - _going_on(left, u)[order]) / scale
        return difference

    place = float(_PLACES[int(np.argmin((apart(_PLACES, 1) ** 2).sum(axis=1)))])
    jump = apart(place, 2)
    place -= float(apart(place, 1) @ jump / (jump @ jump)) / h
    place = float(np.clip(place, _PLACES[0], _PLACES[-1]))
    square = 24.0 * float(apart(place, 0) @ jump / (jump @ jump))
    room = 2.0 * min(place, 1.0 - place) - _WITHIN
    return place, h * float(np.clip(np.sqrt(max(square, 0.0)) / h, 2.0 * _WITHIN, room))


def _going_on(state: tuple[np.ndarray, ...], t: np.ndarray | float) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Position, velocity and acceleration a time t after a state, at constant jerk."""
    q, qdot, qddot, jerk = state
    return (
        q + t * (qdot + t / 2.0 * (qddot + t / 3.0 * jerk)),
        qdot + t * (qddot + t / 2.0 * jerk),
        qddot + t * jerk,
    )


def _over(state: tuple[np.ndarray, ...], qddot: np.ndarray, t: float) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Go over to another acceleration within a time t."""
    return _going_on((*state, (qddot - state[2]) / t), t)
