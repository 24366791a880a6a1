"""The saved quintic pieces, evaluated by piece and place in it, so that a piece of a microsecond is as clear as any."""

from __future__ import annotations

from dataclasses import dataclass, fields

import numpy as np

from brachis.robot import Robot
from brachis.trajectory import Trajectory
from brachis.verify.mechanics import torques
from brachis.verify.polynomials import values_of

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
        return cls(trajectory.times, lengths, trajectory.q[:-1], position, velocity, acceleration, jerk)

    def time(self, piece: np.ndarray, u: np.ndarray) -> np.ndarray:
        """Return the times of places, s."""
        return np.asarray(self.times[piece] + u * self.lengths[piece])

    def place(self, t: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Piece and place in it of times t, (K,), s; at a node the piece that begins there."""
        piece = np.clip(np.searchsorted(self.times, t, side="right") - 1, 0, len(self.lengths) - 1)
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
    def at(cls, pieces: Pieces, robot: Robot, piece: np.ndarray, u: np.ndarray) -> States:
        """Evaluate pieces at places, in any order; each place once."""
        order = np.lexsort((u, piece))
        piece, u = piece[order], u[order]
        again = (piece[1:] == piece[:-1]) & (u[1:] - u[:-1] <= _SAME_PLACE) & (u[1:] < 1.0)
        first = np.append(True, ~again)[: len(piece)]
        piece, u = piece[first], u[first]
        q = pieces.nodes[piece] + values_of(pieces.position[:, piece], u)
        qdot, qddot = values_of(pieces.velocity[:, piece], u), values_of(pieces.acceleration[:, piece], u)
        qdddot = values_of(pieces.jerk[:, piece], u)
        return cls(piece, u, pieces.time(piece, u), q, qdot, qddot, qdddot, torques(robot, q, qdot, qddot))

    def only(self, chosen: np.ndarray | slice) -> States:
        """Return some of the states, in the order that is chosen."""
        return States(*(getattr(self, field.name)[chosen] for field in fields(self)))

    def merged(self, other: States) -> tuple[States, np.ndarray]:
        """Return these states and others, ascending, and where each one was among those put one after the other."""
        names = [field.name for field in fields(self)]
        both = States(*(np.concatenate([getattr(self, name), getattr(other, name)]) for name in names))
        order = np.lexsort((both.u, both.piece))
        return both.only(order), order
