"""From recorded positions to a motion that is twice continuously differentiable.

Derivatives at a row are those of a polynomial through five rows beside it. Of the five rows before, around and behind
it those are taken through which the polynomial bends least (essentially non-oscillatory interpolation: A. Harten,
B. Engquist, S. Osher, S. R. Chakravarthy, Journal of Computational Physics 71, 1987): where accelerations jump, as they
do in time-optimal motions, a spline through all rows would overshoot by a fifth of the jump and ring on both sides.

Velocities and accelerations of the file take their place where they agree with them.

Positions that are rounded to few digits have no second derivatives of their own: a smoothing spline takes their place.

Smoothing splines through positions that have few digits, or are measured.

Accelerations that jump between two rows, found by what lies on both sides (subcell resolution).

A quintic piece between two rows, of which one is before and the other after a jump, overshoots by up to a tenth of it.
Going on from both rows at constant jerk, the velocities meet where the jump is (A. Harten, Journal of Computational
Physics 83, 1989). There the acceleration goes over from the one to the other within a small part of the period.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from brachis.apps.recording.recording import FEWEST, Recording
from brachis.errors import write_count

_DEGREE, _FEWEST, _MORE, _ROWS = 5, 4, 1.2, 2.0
"""The first number of intervals, the factor to the next one, and the fewest rows in each."""
_NEAR, _EXPLAINED = 1.05, 2.0
"""Standard deviations that a spline is to be off, where noise alone is off by one; and may be."""
_AT_END, _ROWS_AT_END = 220.0, 8
"""Standard deviations that a joint has moved by where an end is over, and the fewest rows of one."""
_SMALL, _SURE = {1: 0.05, 2: 0.2}, 5.0
"""What velocity and acceleration at an end at rest are, of the largest ones; and the standard deviations of one that is
known."""


@dataclass(frozen=True, eq=False)
class Smoothed:
    """A spline near rows of positions.

    Attributes
    ----------
    derivatives : (4, K, n) ndarray
        Positions and three derivatives at the rows.
    off : float
        Root mean square of what it is off, of the worst joint, in standard deviations of the rows.
    """

    derivatives: np.ndarray
    off: float

    @property
    def explains(self) -> bool:
        """Whether it is as near to the rows as they are exact."""
        return self.off <= _EXPLAINED


def fit_rows(t: np.ndarray, q: np.ndarray, deviation: np.ndarray) -> Smoothed:
    """Return a least-squares spline of the fewest intervals that explain the rows.

    Of its ends it takes the calmest ones that the rows allow: in motion, at rest, at rest without acceleration. Those
    are splines whose first control points are one.

    Parameters
    ----------
    t : (K,) ndarray
        s.
    q : (K, n) ndarray
        rad or m.
    deviation : (n,) ndarray
        Standard deviation of every joint's rows, rad or m.
    """
    count = float(_FEWEST)
    found = _fitted(t, q, deviation, int(count), (0, 0))
    while found.off > _NEAR and _MORE * count <= len(t) / _ROWS:
        count *= _MORE
        found = _fitted(t, q, deviation, int(count), (0, 0))
    largest = np.abs(found.derivatives).max(axis=1)
    beginning = _vanishing(t - t[0], q, deviation, largest)
    return _fitted(
        t,
        q,
        deviation,
        int(count),
        (beginning, _vanishing(t[-1] - t[::-1], q[::-1], deviation, largest)),
    )


def _vanishing(
    t: np.ndarray, q: np.ndarray, deviation: np.ndarray, largest: np.ndarray
) -> int:
    """Tell how many derivatives vanish at an end, from which t is counted, by polynomials through the rows near it."""
    away = (np.abs(q - q[0]) > _AT_END * deviation).any(axis=1)
    rows = slice(
        0, max(_ROWS_AT_END, int(np.argmax(away)) if away.any() else len(t)) + 1
    )
    u, span = t[rows] / t[rows][-1], float(t[rows][-1])
    for order in (2, 1):
        powers = u[:, None] ** np.array([0, order, order + 1, order + 2])
        covariance = np.linalg.inv(powers.T @ powers)
        factor = order / span**order  # 1! and 2!
        found = factor * np.abs(covariance[1] @ powers.T @ q[rows])
        known = _SURE * factor * np.sqrt(covariance[1, 1]) * deviation
        if (found <= np.maximum(_SMALL[order] * largest[order], known)).all():
            return order
    return 0


def _fitted(
    t: np.ndarray,
    q: np.ndarray,
    deviation: np.ndarray,
    count: int,
    ends: tuple[int, int],
) -> Smoothed:
    """Fit a spline of so many intervals, at whose ends so many derivatives vanish."""
    from scipy.interpolate import BSpline
    from scipy.sparse.linalg import spsolve

    breaks = np.interp(
        np.linspace(0.0, 1.0, count + 1), np.linspace(0.0, 1.0, len(t)), t
    )
    knots = np.concatenate([np.full(_DEGREE, t[0]), breaks, np.full(_DEGREE, t[-1])])
    tied = _tied(len(knots) - _DEGREE - 1, ends)
    rows = BSpline.design_matrix(t, knots, _DEGREE) @ tied
    spline = BSpline(
        knots,
        tied @ spsolve(rows.T @ rows, rows.T @ q).reshape(-1, q.shape[1]),
        _DEGREE,
    )
    found = np.stack([spline(t, nu=order) for order in range(4)])
    return Smoothed(
        found, float(np.sqrt(np.mean(((found[0] - q) / deviation) ** 2, axis=0)).max())
    )


def _tied(count: int, ends: tuple[int, int]) -> Any:
    """Return the matrix, (count, free), from free control points to all; at an end the first ones are one."""
    from scipy.sparse import csr_array

    columns = np.clip(np.arange(count) - ends[0], 0, count - 1 - sum(ends))
    return csr_array(
        (np.ones(count), (np.arange(count), columns)),
        shape=(count, int(columns[-1]) + 1),
    )


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
    added = [
        found
        for i in np.flatnonzero(over > _OVER).tolist()
        if (found := _split(motion, jerk, i, scale, over[i]))
    ]
    if not added:
        return motion, 0
    t = np.concatenate([motion.t, *(part.t for part in added)])
    order = np.argsort(t, kind="stable")
    parts = (
        np.concatenate(
            [getattr(motion, name), *(getattr(part, name) for part in added)]
        )[order]
        for name in ("q", "qdot", "qddot")
    )
    return States(t[order], *parts), len(added)


def _overshoot(motion: States, scale: np.ndarray) -> np.ndarray:
    """By how much the acceleration in each piece leaves the range between its ends, in parts of `scale`, (K - 1,)."""
    h = np.diff(motion.t)[:, None]
    way = np.diff(motion.q, axis=0)
    v0, v1, a0, a1 = (
        motion.qdot[:-1],
        motion.qdot[1:],
        motion.qddot[:-1],
        motion.qddot[1:],
    )
    gain, rest = (
        (v1 - v0) / h - 0.5 * (a0 + a1),
        (way - v0 * h) / h**2 - a0 / 3.0 - a1 / 6.0,
    )
    # a(u) = a0 + (a1 - a0) u + u (1 - u) (c + d u) with the given velocity gain and way
    d = 60.0 * (gain - 2.0 * rest)
    c = 6.0 * gain - 0.5 * d
    u = _INSIDE[:, None, None]
    values = a0 + (a1 - a0) * u + u * (1.0 - u) * (c + d * u)
    beyond = np.maximum(
        values.max(axis=0) - np.maximum(a0, a1), np.minimum(a0, a1) - values.min(axis=0)
    )
    worst: np.ndarray = (beyond / scale).max(axis=1)
    return worst


def _split(
    motion: States, jerk: np.ndarray, i: int, scale: np.ndarray, before: float
) -> States | None:
    """Return two nodes between which the acceleration jumps in the piece after row i; None where they do not help."""
    h = float(motion.t[i + 1] - motion.t[i])
    left, right = (*motion.one(i), jerk[i]), (*motion.one(i + 1), jerk[i + 1])
    place, width = _where(left, right, h, scale)
    first, last = place * h - 0.5 * width, place * h + 0.5 * width
    if place <= 0.5:
        begin = _going_on(left, first)
        end = _over(begin, _going_on(right, last - h)[2], width)
    else:
        end = _going_on(right, last - h)
        begin = _over(end, _going_on(left, first)[2], -width)
    parts = (np.array(pair) for pair in zip(begin, end, strict=True))
    nodes = States(motion.t[i] + np.array([first, last]), *parts)
    both = (
        np.stack([x, *y, z])
        for x, y, z in zip(
            left[:3], (nodes.q, nodes.qdot, nodes.qddot), right[:3], strict=True
        )
    )
    whole = States(np.array([motion.t[i], *nodes.t, motion.t[i + 1]]), *both)
    return nodes if _overshoot(whole, scale).max() < 0.5 * before else None


def _where(
    left: tuple[np.ndarray, ...],
    right: tuple[np.ndarray, ...],
    h: float,
    scale: np.ndarray,
) -> tuple[float, float]:
    """Return the part of a period after which the velocities of both sides meet best, and the time of the change, s.

    A steady change from one acceleration to the other, D apart, within a time w leads D w^2 / 24 further than a jump in
    its middle.
    """

    def apart(place: np.ndarray | float, order: int) -> np.ndarray:
        u = np.asarray(place)[..., None] * h
        difference: np.ndarray = (
            _going_on(right, u - h)[order] - _going_on(left, u)[order]
        ) / scale
        return difference

    place = float(_PLACES[int(np.argmin((apart(_PLACES, 1) ** 2).sum(axis=1)))])
    jump = apart(place, 2)
    place -= float(apart(place, 1) @ jump / (jump @ jump)) / h
    place = float(np.clip(place, _PLACES[0], _PLACES[-1]))
    square = 24.0 * float(apart(place, 0) @ jump / (jump @ jump))
    room = 2.0 * min(place, 1.0 - place) - _WITHIN
    return place, h * float(np.clip(np.sqrt(max(square, 0.0)) / h, 2.0 * _WITHIN, room))


def _going_on(
    state: tuple[np.ndarray, ...], t: np.ndarray | float
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Position, velocity and acceleration a time t after a state, at constant jerk."""
    q, qdot, qddot, jerk = state
    return (
        q + t * (qdot + t / 2.0 * (qddot + t / 3.0 * jerk)),
        qdot + t * (qddot + t / 2.0 * jerk),
        qddot + t * jerk,
    )


def _over(
    state: tuple[np.ndarray, ...], qddot: np.ndarray, t: float
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Go over to another acceleration within a time t."""
    return _going_on((*state, (qddot - state[2]) / t), t)


_ROUNDED, _NOISY = 1e-3, 0.2
"""Of a joint's largest acceleration, what rounding makes of it where a smoothing spline takes its place if it is as
near to the rows as they are exact, and where in any case."""
_BETWEEN = 60.0
"""Acceleration of a quintic piece of 1 s, for a position that is 1 rad off."""
_AGREES = 0.02
"""Of the largest one, what half of the file's rates may differ from those of polynomials."""
_CENTRED = 0.25
"""Factor on the bend around a row, which is taken unless others bend much less."""
_AT_REST = (1e-3, 1e-2)
"""Of the largest velocity and acceleration: what is less at an end is rest."""


@dataclass(frozen=True, eq=False)
class Nodes:
    """A motion in quintic pieces between nodes.

    Attributes
    ----------
    t : (L + 1,) ndarray
        s.
    q, qdot, qddot : (L + 1, n) ndarray
    told : tuple of str
        How velocities and accelerations were found.
    """

    t: np.ndarray
    q: np.ndarray
    qdot: np.ndarray
    qddot: np.ndarray
    told: tuple[str, ...]

    @property
    def at_rest(self) -> tuple[bool, bool]:
        """Whether both ends are at rest, and whether their accelerations vanish too."""
        ends = [0, -1]
        return not self.qdot[ends].any(), not self.qddot[ends].any()


def nodes_of(recording: Recording, deviation: np.ndarray) -> Nodes:
    """Find velocities and accelerations.

    Parameters
    ----------
    recording : Recording
    deviation : (n,) ndarray
        Standard deviation of every joint's positions, rad or m; 0 where they are exact.
    """
    t, told = recording.t, []
    parts = _smoothed(t, recording.q, deviation)
    exact = np.isnan(parts[0, 0])
    for unit in dict.fromkeys(recording.units):
        of_unit = ~exact & (np.array(recording.units) == unit)
        if of_unit.any():
            off = f"{deviation[of_unit].max():.2g} {unit} (rms) off"
            told.append(
                f"positions in {unit}, velocities and accelerations of a smoothing spline, {off}"
            )
    if not exact.any():
        return _nodes(States(t, *parts[:3]), *told)
    parts[:, :, exact], how = _interpolated(recording, exact)
    motion, jumps = with_jumps(States(t, *parts[:3]), parts[3])
    pairs = write_count(jumps, "pair")
    return _nodes(
        motion,
        *told,
        how,
        *([f"accelerations jump between {pairs} of rows"] if jumps else []),
    )


def _smoothed(t: np.ndarray, q: np.ndarray, deviation: np.ndarray) -> np.ndarray:
    """Return positions and three derivatives of splines, (4, K, n), NaN of joints that need none."""
    parts = np.full((4, *q.shape), np.nan)
    bends = np.maximum(
        np.abs(np.diff(q, n=2, axis=0)).max(axis=0), np.finfo(float).tiny
    )
    doubt = _BETWEEN * deviation / bends
    for least in (_ROUNDED, _NOISY):
        rough = doubt > least
        if rough.any():
            spline = fit_rows(t, q[:, rough], deviation[rough])
            if spline.explains or least == _NOISY:
                parts[:, :, rough] = spline.derivatives
                break
    return parts


def _interpolated(recording: Recording, joints: np.ndarray) -> tuple[np.ndarray, str]:
    """Return positions and three derivatives, (4, K, j), of some joints, and how they were found."""
    parts = _differentiated(recording.t, recording.q[:, joints])
    told = (
        "velocities and accelerations are those of polynomials through five rows each"
    )
    names = {1: ("qdot", "velocities"), 2: ("qddot", "accelerations")}
    for order, (name, words) in names.items():
        given = getattr(recording, name)
        if given is None:
            continue
        given = given[:, joints]
        largest = np.abs(parts[order]).max(axis=0)
        if (np.median(np.abs(given - parts[order]), axis=0) > _AGREES * largest).any():
            told += f"; the file's {words} do not agree with them and are left out"
            continue
        parts[order:] = _differentiated(recording.t, given)[: 4 - order]
        told = f"{words} are the file's"
        if order == 1:
            told = "velocities are the file's, accelerations are those of polynomials through five rows of them"
    return parts, told


def _nodes(motion: States, *told: str) -> Nodes:
    qdot, qddot = (
        _with_rest(part, least)
        for part, least in zip((motion.qdot, motion.qddot), _AT_REST, strict=True)
    )
    return Nodes(motion.t, motion.q, qdot, qddot, told)


def _with_rest(values: np.ndarray, least: float) -> np.ndarray:
    """Return derivatives, (K, n), whose first and last row are zero where they are small."""
    values, largest = values.copy(), np.abs(values).max(axis=0)
    for end in (0, -1):
        if np.all(
            np.abs(values[end]) <= least * np.maximum(largest, largest.max() * least)
        ):
            values[end] = 0.0
    return values


def _differentiated(t: np.ndarray, values: np.ndarray) -> np.ndarray:
    """Return values, (K, n), and three derivatives at their times, (4, K, n)."""
    count = len(t)
    h = float(np.median(np.diff(t)))
    first = np.arange(count - FEWEST + 1)[:, None] + np.arange(FEWEST)
    powers = np.arange(FEWEST)
    # Bend of the polynomial through every five rows, each joint beside its own range.
    around = ((t[first] - t[first].mean(axis=1, keepdims=True)) / h)[
        :, :, None
    ] ** powers
    highest = np.linalg.solve(around, values[first])[:, -1]
    bend = (
        np.abs(highest) / np.maximum(np.ptp(values, axis=0), np.finfo(float).tiny)
    ).max(axis=1)
    chosen = np.empty(count, dtype=int)
    for i in range(count):
        candidates = np.arange(max(0, i - FEWEST + 1), min(i, count - FEWEST) + 1)
        weights = np.where(candidates == i - FEWEST // 2, _CENTRED, 1.0)
        chosen[i] = candidates[int(np.argmin(weights * bend[candidates]))]
    rows = first[chosen]
    local = ((t[rows] - t[:, None]) / h)[:, :, None] ** powers
    coefficients = np.linalg.solve(local, values[rows])
    return np.stack(
        [
            values,
            coefficients[:, 1] / h,
            2.0 * coefficients[:, 2] / h**2,
            6.0 * coefficients[:, 3] / h**3,
        ]
    )
