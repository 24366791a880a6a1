"""Interface of the checks of limits, and the search for the largest ratio of a motion."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import NamedTuple

import numpy as np

from brachis.verify.motion import CheckedMotion, MotionStates, turns

_AT_ONCE = 5000
"""Number of steps that are processed together, so that their data stay in the processor's cache."""


class Worst(NamedTuple):
    """The largest ratio to a limit.

    Attributes
    ----------
    ratio : float
    subject : str
        Joint, tool, or other subject that has this ratio.
    time : float
        Time at which this ratio occurs, s.
    remark : str
        Note on the check; often empty.
    is_kept : bool
        Whether the planner takes the limit into account.
    """

    ratio: float
    subject: str
    time: float
    remark: str = ""
    is_kept: bool = True


LimitCheck = Callable[[CheckedMotion], Worst | None]
"""Function that finds the worst ratio to a kind of limit; it returns None if there is no such limit."""


def worst_between(
    motion: CheckedMotion,
    ratio_at: Callable[[MotionStates], np.ndarray],
    subjects: Sequence[str],
    states: MotionStates | None = None,
) -> Worst:
    """Find the largest of several ratios that are not polynomials, at the given states and between them.

    Steps between states are halved as long as the largest ratio may lie within one of them. Over a step of length h, a
    ratio with curvature c rises above its higher end by at most (c h - |slope|)^2 / 4 c, if it peaks within the step at
    all. For c, four times the second divided differences at both ends are used.

    Parameters
    ----------
    motion : CheckedMotion
    ratio_at : callable
        ``ratio_at(states)`` returns the ratios, (K, c).
    subjects : sequence of str
        Names of the subjects of the c ratios.
    states : MotionStates, optional
        Initial states. Default: the states of the whole motion.

    Returns
    -------
    Worst
        The largest ratio. If 100,000 more states are not enough to find this ratio, `ratio` is an upper bound, with a
        remark.
    """
    states = motion.states if states is None else states
    most_states = len(states.t) + 100_000
    ratio = np.concatenate([ratio_at(chunk) for chunk in states.split()])
    for _ in range(40):
        steps, bounds = _may_hold_more(states, motion.pieces.lengths, ratio)
        if not len(steps):
            break
        if len(states.t) + len(steps) > most_states:
            k = int(np.argmax(bounds))
            column = int(np.argmax(ratio[steps[k]]))
            remark = f"search stopped early: {ratio.max():.6g} was found, and this is an upper bound"
            time = states.t[steps[k]]
            return Worst(bounds[k], subjects[column], time, remark)
        middle = 0.5 * (states.u[steps] + states.u[steps + 1])
        new = MotionStates.at(motion.pieces, states.index[steps], middle)
        states, order = states.merge(new)
        ratio = np.concatenate([ratio, ratio_at(new)])[order]
    k, column = map(int, np.unravel_index(np.argmax(ratio), ratio.shape))
    return Worst(ratio[k, column], subjects[column], states.t[k])


def worst_size(
    motion: CheckedMotion,
    largest: float | None,
    sizes: Callable[[MotionStates], np.ndarray],
    subject: str = "tool",
) -> Worst | None:
    """Find the largest ratio of a quantity, (K,), to its maximum; None if the quantity is not limited."""
    if largest is None or np.isinf(largest):
        return None

    def ratios(states: MotionStates) -> np.ndarray:
        """Return the quantity divided by its maximum, (K, 1)."""
        return sizes(states)[:, None] / largest

    return worst_between(motion, ratios, (subject,))


def _may_hold_more(
    states: MotionStates, lengths: np.ndarray, ratio: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """List the steps that may contain the largest ratio of all, (S,), and upper bounds on the ratio in them, (S,)."""
    highest = ratio.max()
    candidates = []
    for begin in range(0, len(ratio), _AT_ONCE):
        # The curvature at an end of a step needs the adjacent step.
        first = max(begin - 1, 0)
        rows = slice(first, begin + _AT_ONCE + 2)
        step, bounds = _open_steps(states.only(rows), lengths, ratio[rows], highest)
        number = first + step
        is_in_chunk = (number >= begin) & (number < begin + _AT_ONCE)
        candidates.append((number[is_in_chunk], bounds[is_in_chunk]))
    steps, bounds = (np.concatenate(arrays) for arrays in zip(*candidates, strict=True))
    return steps, bounds


def _open_steps(
    states: MotionStates, lengths: np.ndarray, ratio: np.ndarray, highest: float
) -> tuple[np.ndarray, np.ndarray]:
    """List the steps that may contain a ratio above the highest one known; see `_may_hold_more`."""
    inside = states.index[1:] == states.index[:-1]
    width = np.where(inside, np.diff(states.u), 1.0)
    length = (width * lengths[states.index[:-1]])[:, None]
    slope = np.diff(ratio, axis=0) / length
    bend = np.zeros_like(ratio)
    both = (inside[1:] & inside[:-1])[:, None]
    change = np.abs(np.diff(slope, axis=0)) / (length[1:] + length[:-1])
    bend[1:-1] = np.where(both, change, 0.0)
    bend = 4.0 * np.maximum(bend[1:], bend[:-1])
    climb = np.maximum(bend * length - np.abs(slope), 0.0)
    rise = climb**2 / np.maximum(4.0 * bend, np.finfo(float).tiny)
    bounds = (np.maximum(ratio[1:], ratio[:-1]) + rise).max(axis=1)
    # Steps shorter than a millionth of a piece, or with a possible excess below 5e-6, are not halved.
    open_steps = inside & (width > 1e-6) & (bounds > highest + 5e-6)
    steps = np.flatnonzero(open_steps)
    return steps, bounds[steps]


def largest(
    motion: CheckedMotion, ratios: Callable[[slice], tuple[np.ndarray, np.ndarray]]
) -> Worst:
    """Find the largest value of polynomials in Bernstein form; there are two polynomials for each piece and joint.

    The largest value is at an end of a piece, or at an extremum of a polynomial that has a coefficient above the values
    at all ends.

    Parameters
    ----------
    motion : CheckedMotion
    ratios : callable
        ``ratios(index)`` returns the coefficients of both polynomials in some pieces, (m + 1, l, n) each.
    """
    peaks: list[tuple[float, int, float, int]] = []
    highest = -np.inf
    count = len(motion.pieces.lengths)
    for begin in range(0, count, _AT_ONCE):
        coefficients = np.stack(ratios(slice(begin, begin + _AT_ONCE)), axis=1)
        _, _, pieces, joints = coefficients.shape
        flat = coefficients.reshape(len(coefficients), -1)
        ends = flat[[0, -1]]
        end, column = map(int, np.unravel_index(np.argmax(ends), ends.shape))
        value = float(ends[end, column])
        u = float(end)
        highest = max(value, highest)
        higher = np.flatnonzero(flat.max(axis=0) > highest)
        turning, at, values = turns(flat[:, higher])
        if values.max(initial=-np.inf) > value:
            k = int(np.argmax(values))
            value = float(values[k])
            column = int(higher[turning[k]])
            u = float(at[k])
        peaks.append((value, begin + column // joints % pieces, u, column % joints))
    value, index, u, joint = peaks[int(np.argmax([row[0] for row in peaks]))]
    time = motion.pieces.time(np.array([index]), np.array([u]))[0]
    return Worst(value, motion.robot.joint_names[joint], time)
