"""Conversion of recorded positions to a motion that is twice continuously differentiable.

The derivatives at a row are those of a polynomial through five neighbouring rows. Of all windows of five rows that
contain this row, the window whose polynomial bends least is used (essentially non-oscillatory interpolation: A. Harten,
B. Engquist, S. Osher, S. R. Chakravarthy, Journal of Computational Physics 71, 1987). Where accelerations jump, as they
do in time-optimal motions, a spline through all rows would overshoot by a fifth of the jump and ring on both sides.
Velocities and accelerations from the file are used instead if they agree with these derivatives.

Positions that are measured, or rounded to few digits, have no meaningful second derivatives. Such positions are
replaced by a smoothing spline.

A jump of the acceleration between two rows is located from the motion on both sides. A quintic piece from a row before
a jump to a row after it overshoots by up to a tenth of the jump. If the motion is continued from both rows at constant
jerk, the two velocities meet at the jump (subcell resolution: A. Harten, Journal of Computational Physics 83, 1989).
There, the acceleration is made to change from the value on one side to the value on the other within a small fraction
of the period.

A recorded motion waits where several rows have the same posture. Between its waits, such a motion moves along the path.
"""

from __future__ import annotations

from dataclasses import dataclass
from itertools import chain
from typing import Any

import numpy as np

from brachis.apps.recording.recording import FEWEST_ROWS, Recording
from brachis.common import tolerances
from brachis.common.arrays import extrapolate
from brachis.common.words import write_count
from brachis.trajectory.pieces import piece_coefficients

_TINY = np.finfo(float).tiny
_DEGREE = 5
"""Degree of smoothing splines."""
_AT_REST = {1: 1e-3, 2: 1e-2}
"""Fractions of the largest velocity (1) and acceleration (2) below which their values at an end count as zero."""
_NARROWEST = 0.02
"""Half of the smallest fraction of a period within which the acceleration changes at a jump."""


@dataclass(frozen=True, eq=False)
class RecordedNodes:
    """A motion of quintic pieces between nodes.

    Attributes
    ----------
    t : (L,) ndarray
        Times of the nodes, s.
    states : (3, L, n) ndarray
        Joint positions q, velocities qdot and accelerations qddot at the nodes.
    notes : tuple of str
        Notes on how velocities and accelerations were found.
    """

    t: np.ndarray
    states: np.ndarray
    notes: tuple[str, ...] = ()

    @property
    def q(self) -> np.ndarray:
        """Joint positions at the nodes, (L, n)."""
        return self.states[0]

    @property
    def qdot(self) -> np.ndarray:
        """Joint velocities at the nodes, (L, n)."""
        return self.states[1]

    @property
    def qddot(self) -> np.ndarray:
        """Joint accelerations at the nodes, (L, n)."""
        return self.states[2]

    @property
    def at_rest(self) -> tuple[bool, bool]:
        """Whether the motion is at rest at both ends, and whether its accelerations also vanish there."""
        ends = [0, -1]
        return not self.qdot[ends].any(), not self.qddot[ends].any()


def nodes_of(recording: Recording, deviation: np.ndarray) -> RecordedNodes:
    """Find velocities and accelerations for recorded positions.

    Parameters
    ----------
    recording : Recording
    deviation : (n,) ndarray
        Standard deviation of every joint's positions, rad or m; 0 for exact positions.
    """
    t = recording.t
    states = _smooth(t, recording.q, deviation)
    is_exact = np.isnan(states[0, 0])
    notes = []
    for unit in dict.fromkeys(recording.units):
        of_unit = ~is_exact & (np.array(recording.units) == unit)
        if of_unit.any():
            notes.append(
                f"positions in {unit}, velocities and accelerations of a smoothing spline, "
                f"{deviation[of_unit].max():.2g} {unit} (rms) off"
            )
    if is_exact.any():
        states[:, :, is_exact], note = _interpolate(recording, is_exact)
        notes.append(note)
        t, states, jumps = _add_jumps(t, states)
        if jumps:
            pairs = write_count(jumps, "pair")
            notes.append(f"accelerations jump between {pairs} of rows")
    for order, share in _AT_REST.items():
        largest = np.abs(states[order]).max(axis=0)
        small = share * np.maximum(largest, share * largest.max())
        for end in (0, -1):
            if np.all(np.abs(states[order, end]) <= small):
                states[order, end] = 0.0
    return RecordedNodes(t, states[:3], tuple(notes))


def _smooth(t: np.ndarray, q: np.ndarray, deviation: np.ndarray) -> np.ndarray:
    """Return positions and three derivatives of smoothing splines, (4, K, n); NaN for joints without a spline."""
    states = np.full((4, *q.shape), np.nan)
    bends = np.maximum(np.abs(np.diff(q, n=2, axis=0)).max(axis=0), _TINY)
    # In a quintic piece of 1 s, a position error of 1 rad gives an acceleration of 60 rad/s^2.
    rounding = 60.0 * deviation / bends
    # Rounding noise, relative to the largest acceleration, above which positions are smoothed. Above the first level,
    # they are smoothed only if a spline explains them; above the second, always.
    for threshold, in_any_case in ((1e-3, False), (0.2, True)):
        is_rough = rounding > threshold
        if is_rough.any():
            spline, off = _fit_rows(t, q[:, is_rough], deviation[is_rough])
            if off <= 2.0 or in_any_case:  # two standard deviations
                states[:, :, is_rough] = spline
                break
    return states


def _interpolate(recording: Recording, joints: np.ndarray) -> tuple[np.ndarray, str]:
    """Return positions and three derivatives, (4, K, j), of some joints, and a note on how they were found."""
    states = _differentiate(recording.t, recording.q[:, joints])
    note = (
        "velocities and accelerations are those of polynomials, each through five rows"
    )
    rates = ((1, recording.qdot, "velocities"), (2, recording.qddot, "accelerations"))
    for order, recorded, words in rates:
        if recorded is None:
            continue
        differences = np.median(np.abs(recorded[:, joints] - states[order]), axis=0)
        if (differences > 0.02 * np.abs(states[order]).max(axis=0)).any():
            note += f"; the file's {words} do not agree with them and are left out"
            continue
        states[order:] = _differentiate(recording.t, recorded[:, joints])[: 4 - order]
        note = f"{words} are the file's"
        if order == 1:
            note += ", accelerations are those of polynomials through five rows of them"
    return states, note


def _differentiate(t: np.ndarray, values: np.ndarray) -> np.ndarray:
    """Return values, (K, n), and three derivatives at their times, (4, K, n)."""
    count = len(t)
    h = float(np.median(np.diff(t)))
    windows = np.arange(count - FEWEST_ROWS + 1)[:, None] + np.arange(FEWEST_ROWS)
    powers = np.arange(FEWEST_ROWS)
    # Bending of the polynomial through every five rows, with each joint relative to its own range.
    around = (t[windows] - t[windows].mean(axis=1, keepdims=True)) / h
    highest = np.linalg.solve(around[:, :, None] ** powers, values[windows])[:, -1]
    ranges = np.maximum(np.ptp(values, axis=0), _TINY)
    bends = (np.abs(highest) / ranges).max(axis=1)
    # Of the windows that contain a row, the window centred on the row is used unless another one bends much less.
    before = FEWEST_ROWS - 1
    padded = np.pad(bends, before, constant_values=np.inf)
    containing = np.lib.stride_tricks.sliding_window_view(padded, FEWEST_ROWS)
    weights = np.where(powers == before // 2, 0.25, 1.0)
    chosen = np.arange(count) - before + np.argmin(weights * containing, axis=1)
    rows = windows[chosen]
    local = (t[rows] - t[:, None]) / h
    coefficients = np.linalg.solve(local[:, :, None] ** powers, values[rows])
    derivatives = np.moveaxis(coefficients[:, :4], 1, 0)
    derivatives[0] = values
    factors = np.array([1.0, 1.0, 2.0, 6.0]) / h ** np.arange(4)
    return derivatives * factors[:, None, None]


def _fit_rows(
    t: np.ndarray, q: np.ndarray, deviation: np.ndarray
) -> tuple[np.ndarray, float]:
    """Fit a least-squares spline to rows (K, n), with the minimum number of intervals that explains them.

    At each end, as many derivatives vanish as the rows allow: none, the velocity, or the velocity and the acceleration.
    See `_fit_spline`.
    """
    # Add intervals until the spline is about as far from the rows as noise alone would be, which is 1.
    count = 4.0
    while True:
        states, off = _fit_spline(t, q, deviation, int(count), 0, 0)
        if off <= 1.05 or 1.2 * count > len(t) / 2.0:
            break
        count *= 1.2
    largest = np.abs(states).max(axis=1)
    first = _count_vanishing(t - t[0], q, deviation, largest)
    last = _count_vanishing(t[-1] - t[::-1], q[::-1], deviation, largest)
    return _fit_spline(t, q, deviation, int(count), first, last)


def _count_vanishing(
    t: np.ndarray, q: np.ndarray, deviation: np.ndarray, largest: np.ndarray
) -> int:
    """Count the derivatives that vanish at an end, where t is 0, with polynomials through the rows close to it."""
    is_away = (np.abs(q - q[0]) > 220.0 * deviation).any(axis=1)
    first = int(np.argmax(is_away)) if is_away.any() else len(t)
    count = max(8, first) + 1
    near = t[:count]
    u = near / near[-1]
    # Derivatives vanish if they are small relative to the largest ones, or below five standard deviations.
    for order, small in ((2, 0.2), (1, 0.05)):
        powers = u[:, None] ** np.array([0, order, order + 1, order + 2])
        covariance = np.linalg.inv(powers.T @ powers)
        factor = order / float(near[-1]) ** order  # 1! and 2!
        derivatives = factor * np.abs(covariance[1] @ powers.T @ q[:count])
        known = 5.0 * factor * np.sqrt(covariance[1, 1]) * deviation
        if (derivatives <= np.maximum(small * largest[order], known)).all():
            return order
    return 0


def _fit_spline(
    t: np.ndarray,
    q: np.ndarray,
    deviation: np.ndarray,
    count: int,
    first: int,
    last: int,
) -> tuple[np.ndarray, float]:
    """Fit a spline of `count` intervals, with `first` and `last` vanishing derivatives at its two ends.

    Returns
    -------
    (4, K, n) ndarray
        Positions and three derivatives at the rows.
    float
        Root mean square distance of the worst joint from the rows, in standard deviations of the rows.
    """
    from scipy.interpolate import BSpline
    from scipy.sparse import csr_array
    from scipy.sparse.linalg import spsolve

    rows = np.arange(len(t))
    breaks = np.interp(np.linspace(0.0, rows[-1], count + 1), rows, t)
    knots = np.pad(breaks, _DEGREE, mode="edge")
    # Derivatives vanish at an end if its control points are equal, so these control points follow from the free ones.
    points = np.arange(len(knots) - _DEGREE - 1)
    columns = np.clip(points - first, 0, points[-1] - first - last)
    tied = csr_array((np.ones(len(points)), (points, columns)))
    design = BSpline.design_matrix(t, knots, _DEGREE) @ tied
    free = np.asarray(spsolve(design.T @ design, design.T @ q))
    free = free.reshape(-1, q.shape[1])
    spline = BSpline(knots, tied @ free, _DEGREE)
    states = np.stack([spline(t, nu=order) for order in range(4)])
    off = np.sqrt(np.mean(((states[0] - q) / deviation) ** 2, axis=0)).max()
    return states, float(off)


def _add_jumps(t: np.ndarray, states: np.ndarray) -> tuple[np.ndarray, np.ndarray, int]:
    """Add two nodes between rows where accelerations jump.

    Parameters
    ----------
    t : (K,) ndarray
    states : (4, K, n) ndarray
        Positions and three derivatives at the rows, each taken from one side of a jump.

    Returns
    -------
    (L,) ndarray
        Times of the rows and of the new nodes.
    (3, L, n) ndarray
        Positions and two derivatives at these times.
    int
        Number of jumps.
    """
    scale = np.maximum(np.abs(states[2]).max(axis=0), _TINY)
    overshoots = _overshoots(t, states, scale)
    times = [t]
    state_arrays = [states[:3]]
    for i in np.flatnonzero(overshoots > 0.01):
        begin = states[:, i]
        end = states[:, i + 1]
        h = float(t[i + 1] - t[i])
        after, nodes = _place_jump(begin, end, h, scale)
        refined_t = np.array([0.0, *after, h])
        refined = np.concatenate([begin[:3, None], nodes, end[:3, None]], axis=1)
        if _overshoots(refined_t, refined, scale).max() < 0.5 * overshoots[i]:
            times.append(t[i] + after)
            state_arrays.append(nodes)
    merged = np.concatenate(times)
    order = np.argsort(merged, kind="stable")
    return merged[order], np.concatenate(state_arrays, axis=1)[:, order], len(times) - 1


def _overshoots(t: np.ndarray, states: np.ndarray, scale: np.ndarray) -> np.ndarray:
    """Return how far the acceleration in each quintic piece leaves the range of its ends, relative to `scale`."""
    from scipy.interpolate import BPoly

    q, qdot, qddot = states[:3]
    coefficients, _ = piece_coefficients(t, q, qdot, qddot, qddot)
    inner = t[:-1] + np.diff(t) * np.linspace(0.0, 1.0, 21)[1:-1, None]
    values = BPoly(coefficients, t)(inner, nu=2)
    above = values.max(axis=0) - np.maximum(qddot[1:], qddot[:-1])
    below = np.minimum(qddot[1:], qddot[:-1]) - values.min(axis=0)
    worst: np.ndarray = (np.maximum(above, below) / scale).max(axis=1)
    return worst


def _place_jump(
    before: np.ndarray, after: np.ndarray, h: float, scale: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """Return two nodes in a period h, between which the acceleration changes from the value before to the value after.

    The middle of the change is where the velocities continued from both sides agree best. If the accelerations differ
    by D, a steady change within a time w leads D w^2 / 24 further than a jump at the middle of this time.

    Parameters
    ----------
    before, after : (4, n) ndarray
        Position and three derivatives at both ends of the period.
    h : float
    scale : (n,) ndarray
        Largest acceleration of each joint.

    Returns
    -------
    (2,) ndarray
        Times of the nodes after the beginning of the period, s.
    (3, 2, n) ndarray
        Positions and two derivatives at the nodes.
    """

    def gap(place: Any, order: int) -> Any:
        """Return the difference between the two sides' derivatives at fractions of the period, relative to `scale`."""
        t = np.asarray(place)[..., None] * h
        difference = extrapolate(after, t - h)[order] - extrapolate(before, t)[order]
        return difference / scale

    places = np.linspace(1.5 * _NARROWEST, 1.0 - 1.5 * _NARROWEST, 401)
    place = places[np.argmin((gap(places, 1) ** 2).sum(axis=1))]
    jump = gap(place, 2)
    size = max(jump @ jump, _TINY)
    place = place - gap(place, 1) @ jump / size / h
    place = np.clip(place, places[0], places[-1])
    square = 24.0 * gap(place, 0) @ jump / size
    widest = 2.0 * min(place, 1.0 - place) - _NARROWEST
    share = np.clip(np.sqrt(max(square, 0.0)) / h, 2.0 * _NARROWEST, widest)
    width = h * share
    first = place * h - 0.5 * width
    last = place * h + 0.5 * width
    begin = extrapolate(before, first)
    end = extrapolate(after, last - h)
    # The node closer to its row is exact. From there, the acceleration changes at constant jerk to that of the other
    # node.
    jerk = (end[2] - begin[2]) / width
    if place <= 0.5:
        end = extrapolate([*begin, jerk], width)
    else:
        begin = extrapolate([*end, jerk], -width)
    return np.array([first, last]), np.stack([begin, end], axis=1)


def find_rests(nodes: RecordedNodes) -> list[tuple[int, int]]:
    """Find the waits inside a motion, given by the numbers of their first and last nodes.

    A wait has at least five rows, and neither the first nor the last row of the motion is among them.
    """
    speed = np.abs(nodes.qdot).max(axis=1)
    same = np.all(np.abs(np.diff(nodes.q, axis=0)) <= tolerances.ROUNDING, axis=1)
    slow = speed <= 1e-3 * speed.max()  # motion up to this speed is due to rounding
    still = np.concatenate([[False], same & slow[1:] & slow[:-1], [False]])
    edges = np.flatnonzero(np.diff(still))
    last = len(nodes.t) - 1
    return [
        (first, end)
        for first, end in edges.reshape(-1, 2).tolist()
        if first > 0 and end < last and end - first + 1 >= FEWEST_ROWS
    ]


def with_rests(nodes: RecordedNodes) -> RecordedNodes:
    """Return the motion without rounding errors of positions, velocities and accelerations in its waits."""
    states = nodes.states.copy()
    for first, end in find_rests(nodes):
        states[0, first : end + 1] = nodes.q[first]
        states[1:, first : end + 1] = 0.0
    return RecordedNodes(nodes.t, states, nodes.notes)


def split_at_rests(
    nodes: RecordedNodes, rests: list[tuple[int, int]]
) -> list[RecordedNodes]:
    """Return the moving parts of a motion, between its waits."""
    edges = [0, *chain(*rests), len(nodes.t) - 1]
    moves = [slice(a, b + 1) for a, b in zip(edges[::2], edges[1::2], strict=True)]
    return [RecordedNodes(nodes.t[move], nodes.states[:, move]) for move in moves]
