"""The saved quintic pieces, evaluated by piece and place in it, so that a piece of a microsecond is as clear as any.

Roots of polynomials in Bernstein form, many at a time: where a motion turns, peaks or crosses a value.

A polynomial of degree m is monotone between the roots of its derivative, which has degree m - 1; so the roots follow
one degree after the other, from the linear case on, each between neighbouring ones of the degree below. A polynomial
whose Bernstein coefficients do not change their sign has no root at all, which decides nearly every case.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, fields

import numpy as np

from brachis.robot import Robot
from brachis.trajectory import Trajectory
from brachis.verify.mechanics import torques

_STEPS = 60
_ROUNDING = 1e-14


def values_of(coefficients: np.ndarray, u: np.ndarray) -> np.ndarray:
    """Evaluate F polynomials, (m + 1, F, ...), each at its own u in [0, 1], (F,)."""
    degree = len(coefficients) - 1
    factors = np.array([math.comb(degree, k) for k in range(degree + 1)], dtype=float)
    up, down = np.ones((degree + 1, len(u))), np.ones((degree + 1, len(u)))
    np.cumprod(np.broadcast_to(u, (degree, len(u))), axis=0, out=up[1:])
    np.cumprod(np.broadcast_to(1.0 - u, (degree, len(u))), axis=0, out=down[1:])
    return np.einsum("k,kf,kf,kf...->f...", factors, up, down[::-1], coefficients)


def roots(coefficients: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Find the places in (0, 1) at which polynomials change their sign.

    Parameters
    ----------
    coefficients : (m + 1, F) ndarray
        Bernstein coefficients of F polynomials of degree m >= 1.

    Returns
    -------
    column : (Z,) int ndarray
        Polynomial of every root, ascending.
    u : (Z,) ndarray
        Root; ascending within a polynomial.
    """
    kept = np.flatnonzero(
        (coefficients.min(axis=0) < 0.0) & (coefficients.max(axis=0) > 0.0)
    )
    c = coefficients[:, kept]
    if len(c) == 2:
        return kept, c[0] / (c[0] - c[1])
    turns, at = roots(np.diff(c, axis=0))
    every = np.arange(len(kept))
    column = np.concatenate([every, turns, every])
    u = np.concatenate([np.zeros(len(kept)), at, np.ones(len(kept))])
    order = np.lexsort((u, column))
    column, u = column[order], u[order]
    value = values_of(c[:, column], u)
    crossing = np.flatnonzero(
        (column[1:] == column[:-1]) & (value[1:] * value[:-1] < 0.0)
    )
    found = _between(
        c[:, column[crossing]],
        u[crossing],
        u[crossing + 1],
        value[crossing],
        value[crossing + 1],
    )
    exact = (value == 0.0) & (u > 0.0) & (u < 1.0)
    column, u = (
        np.concatenate([column[crossing], column[exact]]),
        np.concatenate([found, u[exact]]),
    )
    order = np.lexsort((u, column))
    return kept[column[order]], u[order]


def _between(
    c: np.ndarray, a: np.ndarray, b: np.ndarray, at_a: np.ndarray, at_b: np.ndarray
) -> np.ndarray:
    """Find the root between a and b, where monotone polynomials have values of opposite sign (the Illinois method)."""
    enough = _ROUNDING * np.abs(c).max(axis=0, initial=0.0)
    powers = _powers(c)
    u = a
    for _ in range(_STEPS if len(a) else 0):
        u = np.clip((a * at_b - b * at_a) / (at_b - at_a), a, b)
        value = powers[-1]
        for coefficient in powers[-2::-1]:
            value = value * u + coefficient
        if np.all((np.abs(value) <= enough) | (b - a <= _ROUNDING)):
            break
        left = (
            value * at_a > 0.0
        )  # the root lies right of u; the value that stays is halved
        a, b = np.where(left, u, a), np.where(left, b, u)
        at_a, at_b = (
            np.where(left, value, 0.5 * at_a),
            np.where(left, 0.5 * at_b, value),
        )
    return u


def _powers(c: np.ndarray) -> np.ndarray:
    """Coefficients of the powers of u, (m + 1, F), of polynomials in Bernstein form."""
    return np.array(
        [math.comb(len(c) - 1, k) * np.diff(c, n=k, axis=0)[0] for k in range(len(c))]
    )


def turns(coefficients: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Find where polynomials, (m + 1, F), turn within (0, 1).

    Returns
    -------
    column : (Z,) int ndarray
    u, value : (Z,) ndarray
    """
    column, u = roots(np.diff(coefficients, axis=0))
    return column, u, values_of(coefficients[:, column], u)


_SAME_PLACE = 1e-9


@dataclass(frozen=True, eq=False)
class Pieces:
    """Joint motion as polynomials in Bernstein form over L pieces; u in [0, 1] is the place in a piece.

    Attributes
    ----------
    times : (L + 1,) ndarray
        s.
    lengths : (L,) ndarray
        s.
    nodes : (L, n) ndarray
        Positions where the pieces begin, rad or m.
    position : (6, L, n) ndarray
        Coefficients relative to `nodes`.
    velocity : (5, L, n) ndarray
    acceleration : (4, L, n) ndarray
    jerk : (3, L, n) ndarray
    """

    times: np.ndarray
    lengths: np.ndarray
    nodes: np.ndarray
    position: np.ndarray
    velocity: np.ndarray
    acceleration: np.ndarray
    jerk: np.ndarray

    @classmethod
    def of(cls, trajectory: Trajectory) -> Pieces:
        """Take the pieces of a trajectory."""
        position, lengths = trajectory.pieces.c, np.diff(trajectory.times)
        velocity = 5.0 * np.diff(position, axis=0) / lengths[:, None]
        acceleration = 4.0 * np.diff(velocity, axis=0) / lengths[:, None]
        jerk = trajectory.jerk_pieces.c
        return cls(
            trajectory.times,
            lengths,
            trajectory.q[:-1],
            position,
            velocity,
            acceleration,
            jerk,
        )

    def time(self, piece: np.ndarray, u: np.ndarray) -> np.ndarray:
        """Return the times of places, s."""
        return np.asarray(self.times[piece] + u * self.lengths[piece])

    def place(self, t: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Piece and place in it of times t, (K,), s; at a node the piece that begins there."""
        piece = np.clip(
            np.searchsorted(self.times, t, side="right") - 1, 0, len(self.lengths) - 1
        )
        return piece, np.clip((t - self.times[piece]) / self.lengths[piece], 0.0, 1.0)


@dataclass(frozen=True, eq=False)
class States:
    """The motion at K places, ascending in time; where pieces join, both sides.

    Attributes
    ----------
    piece : (K,) int ndarray
    u, t : (K,) ndarray
        Place in the piece; time, s.
    q, qdot, qddot, qdddot, tau : (K, n) ndarray
    """

    piece: np.ndarray
    u: np.ndarray
    t: np.ndarray
    q: np.ndarray
    qdot: np.ndarray
    qddot: np.ndarray
    qdddot: np.ndarray
    tau: np.ndarray

    @classmethod
    def at(
        cls, pieces: Pieces, robot: Robot, piece: np.ndarray, u: np.ndarray
    ) -> States:
        """Evaluate pieces at places, in any order; each place once."""
        order = np.lexsort((u, piece))
        piece, u = piece[order], u[order]
        again = (
            (piece[1:] == piece[:-1]) & (u[1:] - u[:-1] <= _SAME_PLACE) & (u[1:] < 1.0)
        )
        first = np.append(True, ~again)[: len(piece)]
        piece, u = piece[first], u[first]
        q = pieces.nodes[piece] + values_of(pieces.position[:, piece], u)
        qdot, qddot = (
            values_of(pieces.velocity[:, piece], u),
            values_of(pieces.acceleration[:, piece], u),
        )
        qdddot = values_of(pieces.jerk[:, piece], u)
        return cls(
            piece,
            u,
            pieces.time(piece, u),
            q,
            qdot,
            qddot,
            qdddot,
            torques(robot, q, qdot, qddot),
        )

    def only(self, chosen: np.ndarray | slice) -> States:
        """Return some of the states, in the order that is chosen."""
        return States(*(getattr(self, field.name)[chosen] for field in fields(self)))

    def merged(self, other: States) -> tuple[States, np.ndarray]:
        """Return these states and others, ascending, and where each one was among those put one after the other."""
        names = [field.name for field in fields(self)]
        both = States(
            *(
                np.concatenate([getattr(self, name), getattr(other, name)])
                for name in names
            )
        )
        order = np.lexsort((both.u, both.piece))
        return both.only(order), order
