"""The fastest timing of a joint path, found in the phase plane of the path parameter p and its rate dp/dt.

With u = d2p/dt2 and x = (dp/dt)^2, the motion along q(p) is

    qdot = q_dp sqrt(x),        qddot = q_dp u + q_ddp x,        dx/dp = 2 u.

Every limit on velocities, accelerations and torques becomes a row in (u, x), midway between stations:

    lower <= a u + b x + c <= upper,        a = v_a q_dp,   b = v_a q_ddp + v_v q_dp / (2 sqrt(x)),

where v_v and v_a are the partial derivatives of the limit's value with respect to qdot and qddot. The rows are exact
for rigid-body torques and accelerations. Friction, torque that falls with speed, power and the tool's acceleration are
linearised at the last timing, until rows and values agree. A limit independent of acceleration bounds only x.

Between two stations u is constant and x is linear in p, and the rows are met midway between them. A backward pass from
the end finds, at each station, the interval of x from which the next station can be reached. A forward pass then uses
the largest possible u at each station (Pham, Pham, IEEE Trans. Robotics 34(3), 2018).

Limits on the third derivative and on means have no such rows and are left out. If a task has any of these, the time is
only a lower bound.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from brachis import kernel
from brachis.common.arrays import apply_each
from brachis.limits import Limit
from brachis.timing.joint_path import JointPath, Passage, Timing, halfway, to_stations

_TINY = 1e-9
"""Magnitude of coefficients and slopes below which they are treated as zero."""
_ROUNDING = 1e-6
"""Fraction by which (dp/dt)^2 at the ends may be outside its limits because of rounding."""
_SLOWEST = 1e-3
"""Lowest rate at which rows are linearised, as a fraction of the median rate."""
_STOPPED = 1e-6
"""Lowest rate at stations other than the ends, as a fraction of the median rate."""
_ROUNDS = 20
"""Maximum number of linearisations."""
_EXACT = 1e-9
"""Difference between rows and values, as a fraction of the limit, that counts as rounding error."""
_LOOKS_AT_END = 4
"""Maximum number of linearisations to find the largest rate at an end."""
_CREDIBLE = 1e-2
"""Difference between rows and values, as a fraction of the limit, above which a timing is rejected."""
AGREEMENT = 1e-6
"""Relative change of the time at which linearisations end by default."""
_AT_ONCE = 2048
"""Number of steps whose bounds are computed together, so that their rows stay in the processor's cache."""
_HELD_BACK = 0.8
"""Maximum narrowing of a limit, as a fraction of the range that remains at rest."""


Narrower = np.ndarray | float
"""Amount by which both bounds of a limit move inwards, (P, c), or its lower and its upper bounds, (2, P, c)."""


@dataclass(frozen=True, eq=False)
class _Rows:
    """A limit as a block of rows: lower <= a u + b x <= upper at every place; without a, a maximum of x.

    Attributes
    ----------
    limit : Limit
    by_u : (P, c) ndarray or None
        The coefficients a; None if the limit does not depend on acceleration.
    by_x : (P, c) ndarray
        The coefficients b; if the limit does not depend on acceleration, the slope with respect to dp/dt.
    constant : (P, c) ndarray
        Value of the limit at u = x = 0.
    lower, upper : (P, c) ndarray
        Bounds of the rows; if the limit does not depend on acceleration, bounds on x.
    """

    limit: Limit
    by_u: np.ndarray | None
    by_x: np.ndarray
    constant: np.ndarray
    lower: np.ndarray
    upper: np.ndarray

    @classmethod
    def of(cls, limit: Limit, path: JointPath, motion: Passage) -> _Rows:
        """Linearise a limit at a motion. The bounds are not set."""
        partials = limit.partials(motion)
        constant = limit.values(motion)
        rate = motion.rate[:, None]
        by_u = None
        by_x = np.zeros_like(constant)
        if partials.qdot is not None:
            by_x = apply_each(partials.qdot, path.q_dp)
        if partials.qddot is None:
            constant = constant - by_x * rate
        else:
            by_u = apply_each(partials.qddot, path.q_dp)
            by_x = by_x / (2.0 * rate) + apply_each(partials.qddot, path.q_ddp)
            constant = constant - by_u * motion.acceleration[:, None] - by_x * rate**2
        return cls(limit, by_u, by_x, constant, constant, constant)

    def within(self, narrower: Narrower) -> _Rows:
        """Return the rows with the bounds of the limit, narrowed."""
        below, above = np.broadcast_to(narrower, (2, *self.constant.shape))
        lower = self.limit.lower + below - self.constant
        upper = self.limit.upper - above - self.constant
        if self.by_u is None:
            rates = np.full_like(upper, np.inf)
            is_sloped = np.abs(self.by_x) > _TINY
            bound = np.where(self.by_x > 0.0, upper, lower)
            np.divide(bound, self.by_x, out=rates, where=is_sloped)
            upper = np.maximum(rates, 0.0) ** 2
            lower = np.zeros_like(upper)
        return replace(self, lower=lower, upper=upper)

    def is_tangent_below(self, motion: Passage) -> bool:
        """Tell whether rows from another motion stay valid, as for magnitudes of vectors, which are convex."""
        if self.by_u is None or np.isfinite(self.limit.lower).any():
            return False
        return bool((self._excess(motion) <= _TINY).all())

    def error(self, motion: Passage) -> float:
        """Return the largest difference between the rows and the limit's values along a motion."""
        return float(np.abs(self._excess(motion)).max(initial=0.0))

    def _excess(self, motion: Passage) -> np.ndarray:
        """Return the amounts, (P, c), by which the rows exceed the limit's values along a motion."""
        rate = motion.rate[:, None]
        if self.by_u is None:
            values = self.by_x * rate
        else:
            values = self.by_u * motion.acceleration[:, None] + self.by_x * rate**2
        return np.asarray(values + self.constant - self.limit.values(motion))


class PhasePlane:
    """Limits along a joint path: slope x + lower <= u <= slope x + upper, and floor <= x <= ceiling.

    Parameters
    ----------
    limits : sequence of Limit
    path : JointPath
        Joint path with at least three stations.
    rate : (P,) ndarray, optional
        Estimate of dp/dt at the stations, 1/s. The limits are first linearised at this rate. By default the rate is
        constant, and the path takes 1 s.
    """

    def __init__(
        self,
        limits: Sequence[Limit],
        path: JointPath,
        rate: np.ndarray | None = None,
    ) -> None:
        self.path = path
        self._middles = path.middles()
        self._limits = [
            limit
            for limit in limits
            if limit.longer_time == "relieves" and not is_left_out(limit)
        ]
        self._steps = np.diff(path.p)
        self._narrower: Mapping[Limit, np.ndarray] = {}
        self._labels: list[str] = []
        self._rounds: list[list[_Rows]] = []
        if rate is None:
            rate = np.full(len(path.p), path.p[-1] - path.p[0])
        middle = _not_too_slow(halfway(rate))
        self._linearise(Passage(self._middles, middle, np.zeros_like(middle)))

    def _linearise(self, motion: Passage, agreeing: Sequence[_Rows] = ()) -> None:
        """Linearise the limits at a motion midway between the stations, and derive bounds from the rows.

        Parameters
        ----------
        motion : Passage
            Motion midway between the stations.
        agreeing : sequence of _Rows, optional
            Rows of the last linearisation that agree with the limits at the motion.
        """
        known = {block.limit: block for block in agreeing}
        rows = [
            known.get(limit)
            or _Rows.of(limit, self._middles, motion).within(
                self._narrower.get(limit, 0.0)
            )
            for limit in self._limits
        ]
        self._motion = motion
        new_rows = [block for block in rows if block not in agreeing]
        if not agreeing or any(block.by_u is None for block in new_rows):
            rates = np.pad(halfway(motion.rate), 1, mode="edge")
            rates[[0, -1]] = motion.rate[[0, -1]]
            at_stations = Passage(self.path, rates, np.zeros_like(rates))
            self._level_rows = [
                _Rows.of(block.limit, self.path, at_stations)
                for block in rows
                if block.by_u is None
            ]
            self._set_levels()
        self._rounds = [rows, *self._rounds[:2]]
        older = dict.fromkeys(block for last in self._rounds[1:] for block in last)
        earlier = [
            block
            for block in older
            if block not in rows and block.is_tangent_below(motion)
        ]
        self._set_bounds([*rows, *earlier])

    def _set_bounds(
        self, rows: Sequence[_Rows], changed: np.ndarray | None = None
    ) -> None:
        """Find the bounds on u and x from rows; keep them where no adjacent step is `changed`, (P - 1,) bool."""
        self._sloped = [block for block in rows if block.by_u is not None]
        ordered = self._sloped + [block for block in rows if block.by_u is None]
        labels = [str(label) for block in ordered for label in block.limit.labels]
        count = len(self._steps)
        if changed is None or labels != self._labels:
            changed = np.ones(count, dtype=bool)
            columns = sum(len(block.limit.labels) for block in self._sloped)
            self._next = np.empty((3, count, columns))
            self._floor = np.empty(count)
            self._ceiling = np.empty(count + 1)
        self._labels = labels
        for begin in range(0, count, _AT_ONCE):
            end = min(begin + _AT_ONCE, count)
            # A step bounds x at both of its ends.
            if changed[max(begin - 1, 0) : end].any():
                self._set_part(begin, end)
        self._ceiling[self.path.stops] = 0.0

    def _stack(self, steps: slice) -> tuple[np.ndarray, ...]:
        """Stack a, b and the bounds of rows that depend on u side by side for some steps, (S, c) each."""
        blank = [np.empty((len(self._steps[steps]), 0))]
        return tuple(
            np.hstack(
                blank + [getattr(block, attribute)[steps] for block in self._sloped]
            )
            for attribute in ("by_u", "by_x", "lower", "upper")
        )

    def _set_part(self, begin: int, end: int) -> None:
        """Find the bounds in steps and at the stations where these steps begin. The last step includes its end."""
        first = max(begin - 1, 0)
        steps = self._steps[first:end, None]
        a, b, low, high = self._stack(slice(first, end))
        chunk = slice(begin, end)
        inside = slice(begin - first, None)
        # From x at a station, x midway to the next one is x + step u, and x at the next station is x + 2 step u.
        lines = _as_lines(a + steps * b, b, low, high)
        self._next[:, chunk] = 2.0 * steps[inside] * np.array(lines)[:, inside]
        self._next[0, chunk] += 1.0
        floor, ceiling = kernel.bounds_of_pairs(*lines, _TINY)
        self._floor[chunk] = floor[inside]
        # Rows at the stations themselves prevent u from oscillating between neighbouring steps.
        lines = _as_lines(*(to_stations(term, steps) for term in (a, b, low, high)))
        at_stations = kernel.bounds_of_pairs(*lines, _TINY)[1]
        last = end + 1 if end == len(self._steps) else end
        stations = slice(begin, last)
        highest = self._levels[stations].min(axis=1, initial=np.inf)
        own_ceiling = np.append(ceiling, np.inf)[begin - first : last - first]
        ceilings = [own_ceiling, highest, at_stations[begin - first : last - first]]
        self._ceiling[stations] = np.min(ceilings, axis=0)

    def _set_levels(self) -> None:
        """Find the largest x at the stations, (P, c), from limits that do not depend on acceleration."""
        levels = [np.empty((len(self.path.p), 0))]
        for block in self._level_rows:
            narrower: Narrower = 0.0
            if block.limit in self._narrower:
                between = self._narrower[block.limit]
                ends = between[..., :1, :], between, between[..., -1:, :]
                padded = np.concatenate(ends, axis=-2)
                narrower = np.maximum(padded[..., 1:, :], padded[..., :-1, :])
            levels.append(block.within(narrower).upper)
        self._levels = np.hstack(levels)

    def narrow(self, narrower: Mapping[Limit, np.ndarray]) -> None:
        """Narrow the bounds of limits midway between the stations.

        Postures in which the arm can stay at rest remain possible.

        Parameters
        ----------
        narrower : mapping of Limit to (P - 1, c) ndarray
            Amounts by which to narrow each limit; with the shape (2, P - 1, c), separately for lower and upper bounds.
            Negative numbers move bounds outwards. Limits that are not in the mapping keep their bounds.
        """
        if not (narrower or self._narrower):
            return
        held = dict(narrower)
        for block in self._rounds[0]:
            if block.by_u is not None and block.limit in held:
                above = block.limit.upper - block.constant
                below = block.constant - block.limit.lower
                slack = np.minimum(above, below)
                allowed = np.where(slack > 0.0, _HELD_BACK * slack, np.inf)
                held[block.limit] = np.minimum(held[block.limit], allowed)
        changed = np.zeros(len(self._steps), dtype=bool)
        for limit in {**held, **self._narrower}:
            moved = np.subtract(held.get(limit, 0.0), self._narrower.get(limit, 0.0))
            changed |= moved.reshape(-1, *moved.shape[-2:]).any(axis=(0, 2))
        self._narrower = held
        rows = [
            block if block.by_u is None else block.within(held.get(block.limit, 0.0))
            for block in self._rounds[0]
        ]
        self._rounds = [rows]
        self._set_levels()
        self._set_bounds(rows, changed)

    @cached_property
    def weights(self) -> np.ndarray:
        """Largest fraction of a limit that one unit of each joint's acceleration uses up on most of the path, (n,)."""
        weights = [np.zeros(self.path.q.shape[1])]
        for limit in self._limits:
            by_qddot = limit.partials(self._motion).qddot
            if by_qddot is not None:
                weights.append(np.median(np.abs(by_qddot), axis=0).max(axis=0))
        return np.max(weights, axis=0)

    def solve(
        self, rates: tuple[float, float] = (0.0, 0.0), agreement: float = AGREEMENT
    ) -> Timing | None:
        """Find the fastest timing with dp/dt given at both ends, 1/s; return None if the joint path cannot be followed.

        An infinite rate leaves dp/dt free at that end, which gives the fastest timing of all. Linearisations end when
        the time changes by no more than a fraction `agreement`, or the rows differ from the limits by no more.
        """
        best: Timing | None = None
        error = np.inf
        factor = 1.0
        for _ in range(_ROUNDS):
            rate = self.fastest(rates)
            if rate is None:
                # Rows that were linearised at too fast a motion may allow no motion at all.
                if not self._is_curved:
                    return None
                factor *= 0.5 if best is None else 0.8
                slower = self._motion if best is None else self._pass(best)
                self._linearise(self._slow_down(slower, factor))
                continue
            timing = Timing.of(self.path, rate)
            change = np.inf if best is None else abs(timing.t_end / best.t_end - 1.0)
            best = timing
            motion = self._pass(timing)
            errors = [block.error(motion) for block in self._rounds[0]]
            error = max(errors, default=0.0)
            has_converged = change < AGREEMENT or error < agreement
            is_close_enough = change < agreement and error < _CREDIBLE
            if has_converged or is_close_enough:
                break
            factor = 1.0
            pairs = zip(self._rounds[0], errors, strict=True)
            self._linearise(motion, [block for block, off in pairs if off < _EXACT])
        return best if error < _CREDIBLE else None

    def _pass(self, timing: Timing) -> Passage:
        """Return the motion midway between the stations, nowhere so slow that friction vanishes."""
        rate = _not_too_slow(timing.middle_rate)
        return Passage(self._middles, rate, timing.acceleration)

    def _slow_down(self, motion: Passage, factor: float) -> Passage:
        """Return a motion slowed down by a factor below 1."""
        acceleration = factor**2 * motion.acceleration
        return Passage(self._middles, factor * motion.rate, acceleration)

    @cached_property
    def _is_curved(self) -> bool:
        """Whether another linearisation would give different rows."""
        motion = self._slow_down(self._motion, 0.5)
        rows = (block for block in self._rounds[0] if block.by_u is not None)
        return any(block.error(motion) > AGREEMENT for block in rows)

    def fastest(self, rates: tuple[float, float]) -> np.ndarray | None:
        """Find the largest dp/dt at the stations, (P,), 1/s, within the current rows; see `solve`."""
        first, last = (rate**2 for rate in rates)
        rows = self._next
        floor = self._floor
        ceiling = self._ceiling
        if math.isinf(last):
            # An added step that allows any change of x leaves x at the end free.
            last = 0.0
            floor = np.append(floor, 0.0)
            step = np.array([1.0, -np.inf, np.inf])[:, None, None]
            added = np.broadcast_to(step, (3, 1, rows.shape[2]))
            rows = np.concatenate([rows, added], axis=1)
        elif last > ceiling[-1] * (1.0 + _ROUNDING):
            return None
        # Find the intervals of x from which the end can be reached.
        levels = (floor, ceiling[: len(floor)])
        reach = kernel.go_backwards(
            tuple(rows), levels, last, flat=_TINY, rounding=_ROUNDING
        )
        if reach is None:
            return None
        low, high = (bound[: len(ceiling)] for bound in reach)
        if math.isinf(first):
            first = float(high[0])
        if not low[0] * (1.0 - _ROUNDING) <= first <= high[0] * (1.0 + _ROUNDING):
            return None
        factor, _, next_upper = self._next
        squares = kernel.go_forwards(factor, next_upper, (low, high), first)
        if not squares.max() > 0.0:
            return None
        # The motion does not stop on the way: a stop at a station is an artefact of the grid spacing.
        slowest = (_STOPPED * np.median(np.sqrt(squares))) ** 2
        squares[1:-1] = np.maximum(squares[1:-1], slowest)
        return np.sqrt(squares)

    def speed_factor(
        self, rate: np.ndarray, acceleration: np.ndarray
    ) -> tuple[float, float, str]:
        """Find the largest factor on the speed of a motion that the limits allow.

        Parameters
        ----------
        rate, acceleration : (P,) ndarray
            dp/dt, 1/s, and d2p/dt2, 1/s^2, at the stations.

        Returns
        -------
        tuple of float, float and str
            The largest factor; the path coordinate and the label of the limit that prevent a larger factor.
        """
        rate = np.sqrt(halfway(rate**2))
        acceleration = halfway(acceleration)
        self._linearise(Passage(self._middles, rate, acceleration))
        factors = self._factors(rate, acceleration)
        least = factors.min(axis=1)
        number = int(np.argmax(least <= least.min() * (1.0 + _ROUNDING)))
        column = int(np.argmin(factors[number]))
        place = float(self.path.s[number])
        return float(least[number]), place, self._labels[column]

    def _factors(self, rate: np.ndarray, acceleration: np.ndarray) -> np.ndarray:
        """Return the largest factor, (P - 1, c), on a motion's speed midway between stations, for each limit alone."""
        x = rate[:, None] ** 2
        slope, lower, upper = _as_lines(*self._stack(slice(None)))
        beside = acceleration[:, None] - slope * x
        levels = np.minimum(self._levels[1:], self._levels[:-1])
        bound = np.hstack([np.where(beside > 0.0, upper, lower), levels])
        used = np.hstack([beside, np.broadcast_to(x, levels.shape)])
        squares = np.divide(
            bound, used, out=np.full_like(bound, np.inf), where=used != 0.0
        )
        return np.sqrt(np.maximum(squares, 0.0))

    def active_limit(self, rate: np.ndarray) -> str:
        """Name the limit that is active on most of the path in a fastest motion with rates dp/dt, (P,), 1/s."""
        timing = Timing.of(self.path, rate)
        factors = self._factors(timing.middle_rate, timing.acceleration)
        columns = np.argmin(factors, axis=1)
        return self._labels[int(np.argmax(np.bincount(columns, self._steps)))]

    def largest_rate(self, end: int) -> tuple[float, str]:
        """Find the largest dp/dt, 1/s, allowed next to an end (0 or -1), and the limit that allows no more."""
        for _ in range(_LOOKS_AT_END):
            lines = _as_lines(*self._stack(slice(None)))
            slope, lower, upper = (line[end] for line in lines)
            tilt = slope[:, None] - slope
            clearance = upper[:, None] - lower
            falls = tilt < -_TINY
            squares = np.divide(
                clearance, -tilt, out=np.full_like(tilt, np.inf), where=falls
            )
            highest = np.append(squares.min(axis=1, initial=np.inf), self._levels[end])
            column = int(np.argmin(highest))
            rate = math.sqrt(max(highest[column], 0.0))
            label = self._labels[column]
            if not (self._is_curved and 0.0 < rate < np.inf):
                break
            rates = np.full(len(self._steps), rate)
            self._linearise(Passage(self._middles, rates, np.zeros_like(rates)))
        return rate, label


def _not_too_slow(rate: np.ndarray) -> np.ndarray:
    """Return rates that are raised where necessary, so that friction does not vanish."""
    return np.maximum(rate, _SLOWEST * np.median(rate))


def is_left_out(limit: Limit) -> bool:
    """Tell whether the phase plane leaves out a limit, such as limits on jerks, torque rates and means."""
    return limit.order > 2 or limit.guarantee.is_mean


def _as_lines(
    a: np.ndarray, b: np.ndarray, low: np.ndarray, high: np.ndarray
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Turn low <= a u + b x <= high, (P, c) each, into slope x + lower <= u <= slope x + upper."""
    # A coefficient of zero would give a vertical line. A tiny one gives bounds so far away that they have no effect.
    a = np.where(np.abs(a) < _TINY, _TINY, a)
    ends = low / a, high / a
    return -b / a, np.minimum(*ends), np.maximum(*ends)
