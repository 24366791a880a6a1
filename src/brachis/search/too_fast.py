"""Speeds that are asked for and out of reach: which, where, how far, and which numbers to change.

In the phase plane the fastest motion along a joint path has at every place the largest speed that any motion along that
joint path has there. So where that motion, made without limits that ask for a least speed, falls short of one, every
motion does; and what it has there is what could be asked for. A redundant robot may have better joint paths than those
that are known: only what is far from possible is refused before a plan is tried.

A tool speed v along a path with the slope z = |dx/ds| asks for ds/dt = v / z and d2s/dt2 = -(dz/ds / z) (ds/dt)^2. A
limit a u + b x + c (`Limit.lines`) then bounds v^2 at every place: which one does, and where, is named.

Limits on the jerk are unknown to the phase plane. What they leave is told by the plan without the least speed. Friction
is unknown to it too: it helps to brake, so that with friction a part near the path's end may be passed faster.
"""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass

import numpy as np

from brachis.errors import PlanningError, Remedy, UnreachableError
from brachis.limits import HasPhasePlaneRows, JointStates, Limit, Moments
from brachis.limits.tool import ToolSpeed
from brachis.optimise.candidate import Candidate, InitialGuess
from brachis.problem.feasibility import in_figures
from brachis.problem.problem import Problem
from brachis.search.phase_plane import along, fastest, graded

_EXACT = 0.97
_HOPELESS = 0.5
_UNLIKELY = 0.8
"""Share of a speed above which it may be possible yet: where the phase plane is exact, where not, and after plans."""
_STATIONS = 401
_BISECTIONS = 10
_SAMPLES = 400
_AT_REST = (0.0, 0.0)
_FIRST = 0.96
"""Part of the largest speed in the phase plane that is tried first: splines fall a little short of it."""
_ROOM = 0.01
"""Part of the path by which a part with a speed begins behind, or ends before, the way to the speed."""
_STILL = 1e-9
"""m per unit s, below which the tool stands still along the path."""


@dataclass(frozen=True)
class TooFast:
    """A speed that is out of reach.

    Attributes
    ----------
    share : float
        Of it that is possible, below 1.
    error : PlanningError
    """

    share: float
    error: PlanningError


def refuse_hopeless_speeds(starts: Sequence[InitialGuess]) -> None:
    """Refuse speeds that are far out of reach along the joint paths of all starts.

    Raises
    ------
    PlanningError
    """
    found = None
    for start in starts:
        possible = _in_phase_plane(start)
        if possible is None or possible.share >= (
            _EXACT if _is_bound(start) else _HOPELESS
        ):
            return
        found = possible if found is None or possible.share > found.share else found
    if found is not None:
        raise found.error


def _is_bound(start: InitialGuess) -> bool:
    """Tell whether the phase plane bounds the speed: no other joint path is there, and no friction helps to brake."""
    robot = start.problem.robot
    rubs = (robot.friction.viscous + robot.friction.coulomb > 0.0) & np.isfinite(
        robot.limits.torque_upper
    )
    return not start.joint_map.r and not rubs.any()


def out_of_reach(
    attempts: Sequence[Candidate], solve: Callable[[InitialGuess], Candidate]
) -> TooFast | None:
    """Tell which least speed no attempt could hold, by a plan without it from the start of the most promising one.

    Parameters
    ----------
    attempts : sequence of Attempt
        That failed.
    solve : callable
        Plans from a start at the first collocation points.

    Returns
    -------
    TooFast or None
        None where no least speed is asked for, or another reason is to blame.
    """
    starts = [
        attempt.start
        for attempt in attempts
        if attempt.start is not None and attempt.solver
    ]
    if not starts or not any(
        limit.longer_time == "violates" for limit in starts[0].problem.limits
    ):
        return None
    start = min(starts, key=lambda start: start.estimate)
    problem = dataclasses.replace(start.problem, limits=tuple(_others(start.problem)))
    attempt = solve(dataclasses.replace(start, problem=problem))
    if not attempt.usable or attempt.program is None:
        return None
    (phase,), (motion,) = (
        attempt.program.phases,
        attempt.program.motions(attempt.reports[-1].x),
    )
    t = np.linspace(0.0, motion.t_end, _SAMPLES)
    try:
        moments = phase.joint_map.state(*motion.at(t), t=t)
    except UnreachableError:
        return None
    s = np.linspace(0.0, 1.0, _STATIONS)
    q = np.column_stack([np.interp(s, moments.s, joint) for joint in moments.q.T])
    return _falling_short(start, moments, "in the fastest motion without it", s, q)


def unlikely(found: TooFast) -> bool:
    """Tell whether a plan falls short by so much that no other joint path, and no more knots, will make up for it."""
    return found.share < _UNLIKELY


def _others(problem: Problem) -> Iterator[Limit]:
    return (limit for limit in problem.limits if limit.longer_time != "violates")


def _in_phase_plane(start: InitialGuess) -> TooFast | None:
    """Tell which speed no motion along the start's joint path has; None where all are possible, or none is asked."""
    problem = start.problem
    rates = start.problem.end_rates
    asked = any(limit.longer_time == "violates" for limit in problem.limits)
    if problem.task.boundary.periodic or not (asked or any(rates)):
        return None
    s = np.linspace(0.0, 1.0, _STATIONS)
    q = start.joint_map.postures(along(start.joint_path, s))
    if not np.isfinite(q).all():
        return None
    stations = graded(problem.limits)
    others = list(_others(problem))
    if fastest(problem.limits, s, q, rates, stations) is not None:
        return None
    rate = fastest(others, s, q, rates, stations)
    if rate is None:
        return _ends_too_fast(problem, s, q, stations)
    q_ds = np.gradient(q, s, axis=0, edge_order=2)
    places, slopes = (
        np.column_stack([np.interp(stations, s, joint) for joint in part.T])
        for part in (q, q_ds)
    )
    still = np.zeros_like(places)
    moments = Moments(places, slopes * rate[:, None], still, still, stations)
    best = (
        "along the best joint path that was found"
        if start.joint_map.r
        else "in the fastest motion"
    )
    return _falling_short(start, moments, best, s, q)


def _ends_too_fast(
    problem: Problem, s: np.ndarray, q: np.ndarray, stations: np.ndarray
) -> TooFast | None:
    """Tell at which end the path cannot be passed as fast as asked for; the other is at rest, or slower likewise."""
    others = list(_others(problem))
    if fastest(others, s, q, _AT_REST, stations) is None:
        return None
    found: list[tuple[float, str]] = []
    for end, key in enumerate(("start_speed", "end_speed")):
        alone = np.where(np.arange(2) == end, problem.end_rates, 0.0)
        low = 0.0
        high = 1.0
        for _ in range(_BISECTIONS if alone.any() else 0):
            middle = 0.5 * (low + high)
            # On a short path a speed may ask for one at the other end.
            both = (middle * alone, middle * np.array(problem.end_rates))
            possible = any(
                fastest(others, s, q, (rates[0], rates[1]), stations) is not None
                for rates in both
            )
            low, high = (middle, high) if possible else (low, middle)
        if alone.any():
            found.append((low, key))
    share, key = min(found, default=(1.0, ""))
    if share >= _EXACT:
        return None
    asked = getattr(problem.task.boundary, key)
    unit = problem.task.speed_unit
    error = PlanningError(
        f"the limits do not allow so high a speed at the path's {key.removesuffix('_speed')}",
        where=f"boundary.{key}",
        found=f"{asked:g} {unit}, where one joint path was estimated to allow about {share * asked:.3g} {unit}",
        hint="Raise the limits that hold the motion back",
    )
    given = problem.task.boundary
    remedies = [
        Remedy(
            f"boundary.{name}",
            getattr(given, name),
            _FIRST * part * getattr(given, name),
            unit,
        )
        for part, name in found
        if part < _EXACT
    ]
    return TooFast(share, error.with_remedies(*remedies))


def _falling_short(
    start: InitialGuess, motion: JointStates, how: str, s: np.ndarray, q: np.ndarray
) -> TooFast | None:
    """Tell where a motion, whose places ascend, falls short of a least speed most; None where it does not.

    Its joint path is q, (S, n), at s, (S,).
    """
    problem = start.problem
    worst: tuple[float, Limit, int, np.ndarray, np.ndarray] | None = None
    for limit in problem.limits:
        if limit.longer_time != "violates":
            continue
        values = limit.values(motion)
        beyond = np.where(
            _within(limit, motion.s).any(axis=1, keepdims=True),
            limit.violation(values),
            -np.inf,
        )
        column = int(np.argmax(beyond.max(axis=0)))
        if worst is None or beyond[:, column].max() > worst[0]:
            worst = (
                float(beyond[:, column].max()),
                limit,
                column,
                values[:, column],
                beyond[:, column],
            )
    if worst is None or worst[0] <= 0.0:
        return None
    share, limit, column, values, beyond = 1.0 - worst[0], *worst[1:]
    label = limit.labels[column]
    place = int(np.argmax(beyond))
    found, allowed = in_figures(limit, column, float(values[place]))
    parts = _within(limit, motion.s)
    inside = np.flatnonzero(parts[:, int(np.argmax(parts[place]))])
    best = inside[int(np.argmin(beyond[inside]))]
    most, _ = in_figures(limit, column, float(values[best]))
    what, cuts = _explain_reach(motion.s[inside], beyond[inside] <= 0.0)
    figure = next(bound.figure for bound in limit.bounds if bound.column == column)
    possible = float(found)
    remedies: list[Remedy] = []
    for number, part in enumerate(problem.task.tool_limits.process_speed):
        key = f"tool_limits.process_speed[{number}]"
        if not label.key.startswith(key):
            continue
        cap = _find_speed_cap(problem, s, q, part.s)
        possible = min(possible, cap.speed)
        if cap.speed < figure:
            there = f"{cap.speed:.3g} m/s at s = {cap.s:.3g}{' on that joint path' if start.joint_map.r else ''}"
            what = f"the {cap.limit} limit lets the tool keep no more than {there}"
            cuts = {}
        remedies.append(
            Remedy(
                f"{key}.speed",
                part.speed,
                _FIRST * part.speed * possible / figure,
                "m/s",
            )
        )
        remedies += [
            Remedy(f"{key}.s[{end}]", part.s[end], cut, is_refined=False)
            for end, cut in cuts.items()
        ]
    error = PlanningError(
        f"no motion was found with the {label.kind} that is asked for: {what}",
        where=f"{label.key or limit.name} ({label.subject})",
        found=f"{found} to {most} {label.unit} on that part, the least at s = {motion.s[place]:.2g}, {how}",
        allowed=f"{allowed} {label.unit}",
        hint="Raise the limits that hold the motion back",
    )
    return TooFast(share, error.with_remedies(*remedies))


@dataclass(frozen=True)
class _SpeedCap:
    """Largest speed of the tool, m/s, that a limit allows it to keep, and the s at which it allows no more."""

    speed: float
    s: float = 0.0
    limit: str = ""


def _find_speed_cap(
    problem: Problem, s: np.ndarray, q: np.ndarray, part: tuple[float, float]
) -> _SpeedCap:
    """Find the largest speed that the tool can keep on a part of a joint path, q, (S, n), at s, (S,)."""
    q_ds = np.gradient(q, s, axis=0, edge_order=2)
    slope = ToolSpeed(problem.robot).slope(q, q_ds)
    inside = (s >= part[0]) & (s <= part[1]) & (slope > _STILL)
    if not inside.any():
        return _SpeedCap(math.inf)
    q_dds = np.gradient(q_ds, s, axis=0, edge_order=2)
    bend = -np.gradient(slope, s) / np.maximum(slope, _STILL)
    worst = _SpeedCap(math.inf)
    for limit in _others(problem):
        if not isinstance(limit, HasPhasePlaneRows):
            continue
        rows = limit.phase_plane_rows(s[inside], q[inside], q_ds[inside], q_dds[inside])
        slant = rows.x
        lower = -np.inf
        if rows.u is not None:
            slant = rows.x + rows.u * bend[inside, None]
            lower = -1.0
        with np.errstate(divide="ignore", invalid="ignore"):
            level = (
                np.where(slant > 0.0, 1.0 - rows.constant, lower - rows.constant)
                / slant
            )
        squares = (
            np.where(slant == 0.0, np.inf, np.maximum(level, 0.0))
            * slope[inside, None] ** 2
        )
        row, column = np.unravel_index(int(np.argmin(squares)), squares.shape)
        speed = math.sqrt(squares[row, column])
        if speed < worst.speed:
            label = limit.labels[column if squares.shape[1] == len(limit.labels) else 0]
            worst = _SpeedCap(speed, float(s[inside][row]), str(label))
    return worst


def _within(limit: Limit, s: np.ndarray) -> np.ndarray:
    """Tell which places, (P,), are within which parts between breaks of a limit, (P, p) bool; breaks come in pairs."""
    breaks = np.sort(limit.breaks)
    ends = (
        breaks.reshape(-1, 2)
        if len(breaks) and len(breaks) % 2 == 0
        else np.array([[0.0, 1.0]])
    )
    return np.asarray((s[:, None] >= ends[:, 0]) & (s[:, None] <= ends[:, 1]))


def _explain_reach(s: np.ndarray, reached: np.ndarray) -> tuple[str, dict[int, float]]:
    """Say where of the places, (P,), a speed is reached, (P,) bool, and to which s ends of the part could be moved."""
    if not reached.any():
        return "it is reached nowhere on that part", {}
    first, last = s[reached][[0, -1]]
    if not reached[(s >= first) & (s <= last)].all():
        return f"it cannot be held all the way from s = {first:.3g} to {last:.3g}", {}
    before = not reached[0]
    behind = not reached[-1]
    ways = [f"before s = {s[0]:.2g}"] * before + [f"behind s = {s[-1]:.2g}"] * behind
    # One end alone: a number is tried by itself.
    cuts = (
        {}
        if before and behind
        else {0: float(first) + _ROOM}
        if before
        else {1: float(last) - _ROOM}
    )
    return f"the path {' and '.join(ways)} is too short for the way to it", cuts
