"""A phase of the NLP over the path.

Its variables are speeds at stations of the path, and redundant curves as splines of s.

Unlike in the program over time, the places of the path are fixed. Corners that are passed within milliseconds therefore
have their own stations. Between two stations, X = sdot^2 is linear in s and u = d2s/dt2 is constant, as in the phase
plane. At any place between stations

    ydot = y' sqrt(X),        yddot = y'' X + y' u.

Limits are imposed midway between the stations and at both ends.

The result is a joint path. Its timing is then recomputed on a finer grid.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace

import numpy as np

from brachis.common import tolerances
from brachis.common.arrays import LastCall, cut, spread
from brachis.errors import UnreachableError
from brachis.kernel import CurvePattern, VariableSlopes, collocation
from brachis.kinematics import JointState
from brachis.limits import Limit, Moments
from brachis.optimise.boundary import LocalBasis
from brachis.optimise.evaluator import Evaluation, Evaluator
from brachis.optimise.motion import follow_law
from brachis.optimise.phase import Phase
from brachis.optimise.phase_timing import PhaseTiming
from brachis.timing import Course, TimedCourse

_DEGREE = 3
_SLOWEST = 1e-3
"""Minimum of sdot^2 at stations other than the ends, as a fraction of its initial value."""
_MOST_CHANGED = 4.0
"""Factor on bounds of sdot^2 in a move: at a station at least the initial value divided by it, and nowhere more than
the largest initial value times it. The path coordinate of a move is arbitrary. Without these bounds, its tangents
vanish at a place that is passed with a very high sdot."""
_STOPPED = 1e-8
"""Fraction of the median sdot^2 below which the tool counts as being at rest at a station."""
_SHORTEST = tolerances.PATH
_NOTHING = 1e-24
"""Number that replaces a divisor of zero."""
_SAMPLES = 20
"""Number of places in each spline interval at which the initial splines are fitted to the curves."""
_SMALL = 2e-5
"""Violation of a limit on postures up to which the limit is not narrowed."""
_RAMP = 2.0
"""Number of places next to a given end posture over which the narrowing increases from zero."""
_MORE = 1.2
"""Factor on a violation, which gives the amount by which limits are narrowed."""
_STATIONS_A_PIECE = 4
"""Number of stations that are added in each short piece of a path."""
_Evaluated = tuple[tuple[np.ndarray, ...], Evaluation]
"""The motion at the places where limits are imposed, and the limits there."""


def violation_of_postures(phase: Phase, curves: np.ndarray) -> float:
    """Return the largest violation of a limit on postures along curves, (S, c)."""
    return phase.posture_violation(_moments_along(phase, curves))


def _moments_along(phase: Phase, curves: np.ndarray) -> Moments:
    """Return states at rest along curves, (S, c); raise UnreachableError if the joint map has no posture."""
    q = phase.joint_map.postures(curves)
    if not np.isfinite(q).all():
        raise UnreachableError("the joint path leaves the joint map")
    return replace(Moments.at_rest(q), s=curves[:, 0])


class PathPhase:
    """A phase of the NLP over the path.

    Parameters
    ----------
    phase : Phase
        Phase along a path, with limits up to the second order and given speeds at both ends.
    phase_timing : PhaseTiming
        Timing from which the solve starts.
    intervals, stations : int
        Number of intervals of the splines, and number of intervals between stations. Both are equally spaced in time.

    Attributes
    ----------
    curves_count : int
        Number of redundant curves.
    breaks : (M + 1,) ndarray
        Path coordinates of the ends of the splines' intervals.
    ends : tuple of float
        Path coordinates of both ends.
    start, x_lower, x_upper : (v,) ndarray
        Initial values and bounds of the variables. These are X at the stations, in units of its initial values, and the
        control points.
    jacobian_rows, jacobian_columns : (nnz,) int ndarray
    """

    def __init__(
        self,
        phase: Phase,
        phase_timing: PhaseTiming,
        intervals: int,
        stations: int,
    ) -> None:
        timing = phase_timing.timing
        assert timing is not None and phase.joint_map.path is not None
        self.phase = phase
        self.joint_map = phase.joint_map
        t = np.linspace(0.0, timing.t_end, _SAMPLES * intervals + 1)
        curves = phase_timing.course.curves(timing, t)[0]
        ascends = np.append(True, np.diff(curves[:, 0]) > _SHORTEST)
        t = t[ascends]
        curves = curves[ascends]
        s = curves[:, 0]
        evenly = np.linspace(0.0, timing.t_end, stations + 1)
        even_s = np.interp(evenly, t, s)
        self._s = _with_pieces(even_s, phase.joint_map.path.breaks)
        self._steps = np.diff(self._s)
        # Places where limits are imposed: their intervals between stations, and how much of these lies after the place.
        inner = np.full(len(self._steps), 0.5)
        self._number = np.pad(np.arange(len(inner)), 1, mode="edge")
        self._ahead = np.pad(inner, 1, constant_values=(1.0, 0.0))[:, None]
        behind = self._ahead[:, 0] * self._steps[self._number]
        self._places = self._s[self._number + 1] - behind
        law = phase.time_law
        rates = phase_timing.course.curves(timing, np.interp(self._s, s, t))[1][:, 0]
        squares = (rates if law is None else follow_law(law, self._s)[1]) ** 2
        self._units = np.maximum(squares, _STOPPED * np.median(squares))
        edges = np.linspace(0.0, timing.t_end, intervals + 1)
        self.breaks = np.interp(edges, t, s)
        self._knots = np.pad(self.breaks, _DEGREE, mode="edge")
        self._basis = self._basis_at(self._places)
        self._count = intervals + _DEGREE
        matrix = collocation(self._knots, _DEGREE, s)
        points = np.linalg.lstsq(matrix, curves[:, 1:], rcond=None)[0].T
        self.curves_count = len(points)
        self.ends = float(self.breaks[0]), float(self.breaks[-1])
        self._set_variables(squares, points)
        if law is None:
            self._begin_within_limits()
        self._limits = phase.limits_near(curves)
        self._evaluator = Evaluator(phase.joint_map, self._limits)
        ends = [(limit.lower, limit.upper) for limit in self._limits]
        lower_and_upper = np.concatenate(ends, axis=1)
        self._bounds = np.repeat(lower_and_upper[:, None], len(self._places), axis=1)
        # Splines over time deviate slightly from a joint path, so limits on postures are narrowed.
        for values, limit in self._posture_limits():
            self._narrow(values, limit.inset / limit.violation_scale)
        self._set_pattern(self._basis.columns)
        self._set_constants()
        self._evaluate = LastCall(self._evaluate_anew)

    def _set_pattern(self, columns: np.ndarray) -> None:
        """Set the pattern of the Jacobian. `columns`, (L, 4), are the control points with an effect at each place."""
        places, values = self._bounds.shape[1:]
        curves = np.arange(self.curves_count)
        of_curves = (len(self._s) + curves * self._count)[:, None, None] + columns
        variable = np.concatenate([self._number, self._number + 1, of_curves.ravel()])
        every = np.arange(places)
        place = np.repeat(every, columns.shape[1])
        points = np.tile(place, self.curves_count)
        of_curve = np.repeat(curves + 1, columns.size)
        self._pattern = CurvePattern(points, of_curve, places, 1 + self.curves_count)
        self.jacobian_columns = np.repeat(variable, values)
        point = np.concatenate([every, every, points])
        self.jacobian_rows = self.value_rows[0][point].ravel()

    def _set_constants(self) -> None:
        """Set s, s' and s'' at the places, and the slopes of X and u by X at the stations on both sides."""
        s = self._places[:, None]
        self._of_s = np.array([s, np.ones_like(s), np.zeros_like(s)])
        units = self._units[np.array([self._number, self._number + 1])][:, :, None]
        self._by_square = units * np.array([self._ahead, 1.0 - self._ahead])
        steps = 2.0 * self._steps[self._number, None]
        self._by_step = units * np.array([-1.0 / steps, 1.0 / steps])

    def _set_variables(self, squares: np.ndarray, points: np.ndarray) -> None:
        """Set the initial variables and their bounds. X at both ends and values that are given are fixed."""
        count = len(self._s)
        self.start = np.concatenate([squares / self._units, points.ravel()])
        is_fixed = np.zeros(len(self.start), dtype=bool)
        boundary = self.phase.boundary
        is_fixed[[0, count - 1]] = True
        if boundary.time_law is not None:
            is_fixed[:count] = True
        for conditions, end in (boundary.start, 0), (boundary.end, -1):
            for j, condition in enumerate(conditions[1:]):
                if np.isfinite(condition.value):
                    place = self.end_pattern(end)[j]
                    self.start[place] = condition.value
                    is_fixed[place] = True
        lower = np.full(len(self.start), -np.inf)
        upper = np.full(len(self.start), np.inf)
        lower[:count] = _SLOWEST
        if self.joint_map.is_move:
            lower[:count] = 1.0 / _MOST_CHANGED
            upper[:count] = _MOST_CHANGED * self._units.max() / self._units
        self.x_lower = np.where(is_fixed, self.start, lower)
        self.x_upper = np.where(is_fixed, self.start, upper)

    def _begin_within_limits(self) -> None:
        """Start from the fastest timing of the splines over these stations, if the limits allow a timing."""
        phase = self.phase
        squares, _ = self._split(self.start)
        course = self.course(self.start, self._s)
        rate = np.sqrt(squares)
        try:
            timed = TimedCourse(course, phase.joint_map, phase.limits, rate)
        except UnreachableError:
            return
        first, last = timed.speeds[[0, -1]] * rate[[0, -1]]
        timing = timed.solve((float(first), float(last)))
        if timing is None:
            return
        y, rates = timed.curves(timing, timing.times)
        timed_squares = np.interp(self._s, y[:, 0], rates[:, 0] ** 2) / self._units
        inner = slice(1, len(self._s) - 1)
        bounds = (self.x_lower[inner], self.x_upper[inner])
        self.start[inner] = timed_squares[1:-1].clip(*bounds)

    def state(self, x: np.ndarray) -> JointState:
        """Return the joint motion at the places; raise as `evaluate` does."""
        return self.evaluate(x).motion

    def last_interval(self, _x: np.ndarray) -> tuple[float, np.ndarray]:
        """Return 1 s and zero slopes, (r,): links of values do not depend on the duration."""
        return 1.0, np.zeros(self.curves_count)

    def end_slopes(self, _x: np.ndarray, _end: int) -> np.ndarray:
        """Return slopes of the curves at an end, (3, c, r), and zeros for time derivatives: only values are linked."""
        slopes = np.zeros((3, 1 + self.curves_count, self.curves_count))
        slopes[0, 1:] = np.eye(self.curves_count)
        return slopes

    def with_end(self, x: np.ndarray, end: int, q: np.ndarray) -> np.ndarray:
        """Return x with given joint positions at an end, (n or more,)."""
        changed = x.copy()
        posture = q[: self.joint_map.robot.n]
        curves = self.joint_map.coordinates(self.ends[end], posture)
        changed[self.end_pattern(end)] = curves[1:]
        return changed

    def end_pattern(self, end: int) -> np.ndarray:
        """Return the indices, (r,), of the variables that are the redundant curves' values at an end (0 or -1)."""
        curves = np.arange(self.curves_count)
        return len(self._s) + curves * self._count + end % self._count

    def _basis_at(self, s: np.ndarray) -> LocalBasis:
        """Return the curves' basis functions at path coordinates, (S,), and their derivatives with respect to s."""
        return LocalBasis.of(self._knots, _DEGREE, s)

    def _split(self, x: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Return X at the stations, (P,), and the control points, (r, M + 3)."""
        count = len(self._s)
        points = x[count:].reshape(self.curves_count, self._count)
        return x[:count] * self._units, points

    def _motion(self, x: np.ndarray) -> tuple[np.ndarray, ...]:
        """Return curves with two derivatives by s, (3, L, c), and X and u, (L, 1), where limits are imposed."""
        squares, points = self._split(x)
        redundant = self._basis.curves(points)[:3]
        curves = np.concatenate([self._of_s, redundant], axis=2)
        number = self._number
        square = squares[number + 1, None]
        square = square + self._ahead * (squares[number, None] - square)
        u = (np.diff(squares) / (2.0 * self._steps))[number]
        return curves, square, u[:, None]

    def evaluate(self, x: np.ndarray) -> Evaluation:
        """Evaluate joint motion and limits at all places; raise UnreachableError if the joint map has no posture."""
        return self._evaluate(x)[1]

    def _evaluate_anew(self, x: np.ndarray) -> _Evaluated:
        """Return the results of `_motion` and `evaluate`."""
        motion = self._motion(x)
        (y, y_ds, y_dds), square, u = motion
        orders = (y, y_ds * np.sqrt(square), y_dds * square + y_ds * u, 0.0 * y)
        t = self._places - self._s[0]
        return motion, self._evaluator.evaluate(*orders, t=t)

    def narrow(self, x: np.ndarray) -> float:
        """Narrow, along the whole path, those limits on postures that are exceeded between the places.

        Returns
        -------
        float
            The largest violation before narrowing.
        """
        motion = _moments_along(self.phase, self.curves(x))
        worst = 0.0
        for columns, limit in self._posture_limits():
            violation = limit.violation(limit.values(motion)).max(axis=0)
            worst = max(worst, float(violation.max()))
            excess = np.where(violation > _SMALL, _MORE * violation, 0.0)
            self._narrow(columns, excess / limit.violation_scale)
        return worst

    def _posture_limits(self) -> Iterator[tuple[slice, Limit]]:
        """Yield the limits that depend only on postures, each with the columns of its values."""
        first = 0
        for limit in self._limits:
            columns = slice(first, first + len(limit.lower))
            first = columns.stop
            if limit.is_of_postures:
                yield columns, limit

    def _narrow(self, columns: slice, by: np.ndarray | float) -> None:
        """Move both bounds of some values inwards by an amount, (c,), and by less next to a given end posture."""
        number = np.arange(float(len(self._places)))
        ends = self.phase.boundary.start, self.phase.boundary.end
        share = np.ones_like(number)
        for away, conditions in zip((number, number[::-1]), ends, strict=True):
            if any(np.isfinite(condition.value) for condition in conditions[1:]):
                share = np.minimum(share, away / _RAMP)
        self._bounds[0, :, columns] += share[:, None] * by
        self._bounds[1, :, columns] -= share[:, None] * by

    @property
    def lower(self) -> np.ndarray:
        """Lower bounds of the values of all limits at all places, (c,)."""
        return self._bounds[0].ravel()

    @property
    def upper(self) -> np.ndarray:
        """Upper bounds of the values of all limits at all places, (c,)."""
        return self._bounds[1].ravel()

    @property
    def value_rows(self) -> list[np.ndarray]:
        """Indices of all rows, (L, number of values): at each place, one row for each value."""
        places, values = self._bounds.shape[1:]
        return [np.arange(places * values).reshape(places, values)]

    def time(self, x: np.ndarray) -> float:
        """Return the time of the phase, s."""
        rates = np.sqrt(self._split(x)[0].clip(_NOTHING))
        return float((2.0 * self._steps / (rates[1:] + rates[:-1])).sum())

    def gradient(self, x: np.ndarray) -> np.ndarray:
        """Return the gradient of the time, (v,). It is zero with respect to X at the ends, where it is given."""
        rates = np.sqrt(self._split(x)[0].clip(_NOTHING))
        by_sum = -2.0 * self._steps / (rates[1:] + rates[:-1]) ** 2
        by_rate = np.pad(by_sum, (1, 0)) + np.pad(by_sum, (0, 1))
        by_square = by_rate / (2.0 * rates) * self._units
        by_square[[0, -1]] = 0.0
        return np.pad(by_square, (0, len(x) - len(by_square)))

    def rows(self, x: np.ndarray) -> np.ndarray:
        """Compute the values of all limits, (c,)."""
        return self.evaluate(x).values.ravel()

    def jacobian(self, x: np.ndarray) -> np.ndarray:
        """Compute the entries of the Jacobian on its pattern, (nnz,)."""
        by_squares, basis = self._slopes(x)
        by_points = np.repeat(basis[:, None], self.curves_count, axis=1).reshape(3, -1)
        variables = VariableSlopes(by_squares, self._pattern, by_points)
        return self.evaluate(x).differentiate(variables)[1].ravel()

    def _slopes(self, x: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Return slopes of the curves and their time derivatives at the places.

        Returns
        -------
        by_squares : (2, 3, L, c) ndarray
            With respect to X at the stations before and after each place.
        by_points : (3, L, 4) ndarray
            With respect to the control points of a curve.
        """
        (_, y_ds, y_dds), square, u = self._evaluate(x)[0]
        rate = np.sqrt(square)
        # X vanishes only where it is given.
        half = np.divide(0.5, rate, out=np.zeros_like(rate), where=rate > 0.0)
        by_squares = np.zeros((2, 3, *y_ds.shape))
        by_squares[:, 1] = self._by_square * (half * y_ds)
        by_squares[:, 2] = self._by_square * y_dds + self._by_step * y_ds
        value, first, second, _ = self._basis.values
        by_points = np.array([value, first * rate, second * square + first * u])
        return by_squares, by_points

    def curves(self, x: np.ndarray) -> np.ndarray:
        """Return s and the redundant curves at many places, (S, c)."""
        return self.course(x, spread(self.breaks, _SAMPLES)).y

    def course(self, x: np.ndarray, s: np.ndarray) -> Course:
        """Return the curves and their derivatives at path coordinates s, (S,)."""
        orders = self._basis_at(s).curves(self._split(x)[1])
        return Course.over_path(s, orders[:3])


def _with_pieces(s: np.ndarray, breaks: np.ndarray) -> np.ndarray:
    """Return stations, (P,), with further ones added in short pieces of the path, such as rounded corners."""
    breaks = cut(breaks, s[0], s[-1])
    inner = spread(breaks, _STATIONS_A_PIECE)
    is_short = np.repeat(np.diff(breaks), _STATIONS_A_PIECE) < 4.0 * np.diff(s).max()
    added = np.union1d(s, inner[:-1][is_short])
    return added[np.append(True, np.diff(added) > _SHORTEST)]
