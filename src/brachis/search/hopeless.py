"""What no motion along the known joint paths can hold: a mean of loads below what holds the arm, and speeds.

In the phase plane the fastest motion along a joint path has at every place the largest speed that any motion along that
joint path has there. If that motion, made without limits that ask for a least speed, falls short of one, every motion
does; and the speed that it has there is what could be asked for. A redundant robot may have better joint paths than
those that are known: only what is far from possible is refused before a plan is tried.

A tool speed v along a path with the slope z = |dx/ds| asks for ds/dt = v / z and d2s/dt2 = -(dz/ds / z) (ds/dt)^2. A
limit a u + b x + c (`HasPhasePlaneRows`) then bounds v^2 at every place: which one does, and where, is named.

Limits on the jerk are unknown to the phase plane. What they leave is known from the plan without the least speed.
Friction is unknown to it too: it helps to brake, so that with friction a part near the path's end may be passed faster.
"""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Callable, Sequence
from typing import NamedTuple

import numpy as np

from brachis.errors import Remedy, UnreachableError
from brachis.limits import HasPhasePlaneRows, JointStates, Limit, Moments
from brachis.limits.tool import ToolSpeed
from brachis.optimise.candidate import Candidate, InitialGuess
from brachis.problem.feasibility import in_figures, load_remedies
from brachis.problem.problem import Problem
from brachis.search.failure import Failure
from brachis.search.phase_plane import (
    PhasePlane,
    interpolate,
    least_speeds,
    postures_along,
    spread_stations,
)

UNLIKELY = 0.8
"""Share of a speed below which no other joint path, and no more knots, make up for what a plan falls short by."""
_EXACT = 0.97
"""Share of a speed below which it is impossible according to the phase plane, where that is exact."""
_FIRST = 0.96
"""Part of the largest speed in the phase plane that is tried first: splines fall a little short of it."""
_STILL = 1e-9
"""Speed below which the tool stands still along the path, m per unit s."""
_S = np.linspace(0.0, 1.0, 401)
"""Path coordinates at which joint paths are looked at."""


def refuse_hopeless(starts: Sequence[InitialGuess]) -> None:
    """Refuse loads and speeds that are far out of reach along the joint paths of all guesses, before plans are tried.

    Raises
    ------
    PlanningError
    """
    if not starts:
        return
    problem = starts[0].problem
    # Friction may help to hold the arm, and a motion between different speeds may be a fall: these are tried.
    if not _has_friction(problem).any() and not any(problem.end_rates):
        failure = explain_holding(starts, everywhere=True)
        if failure is not None:
            raise failure.error()
    failures = []
    for start in starts:
        # The phase plane is exact without other joint paths, and without friction that helps to brake.
        driven = np.isfinite(problem.robot.limits.torque_upper)
        is_exact = not start.joint_map.r and not (_has_friction(problem) & driven).any()
        failure = _explain_in_phase_plane(start)
        if failure is None or failure.share >= (_EXACT if is_exact else 0.5):
            return
        failures.append(failure)
    raise max(failures, key=lambda failure: failure.share).error()


def _has_friction(problem: Problem) -> np.ndarray:
    """Tell which joints have friction, (n,) bool."""
    friction = problem.robot.friction
    return np.asarray(friction.viscous + friction.coulomb > 0.0)


class _Load(NamedTuple):
    """What holding the arm takes of a limit of a mean: least, largest and mean ratio to the limit."""

    limit: Limit
    column: int
    least: float
    largest: float
    mean: float


def explain_holding(
    starts: Sequence[InitialGuess], *, everywhere: bool = False
) -> Failure | None:
    """Tell which limit of a mean leaves too little for holding the arm along all joint paths; None: none does.

    Parameters
    ----------
    starts : sequence of InitialGuess
    everywhere : bool, optional
        Whether each posture has to exceed the limit by itself, not their mean alone.
    """

    def measure(load: _Load) -> float:
        return load.least if everywhere else load.mean

    worst: list[_Load] = []
    for start in starts:
        q = postures_along(start, _S[::4])
        if q is None:
            continue
        loads = [
            load
            for limit in start.problem.limits
            if limit.guarantee.is_mean
            for load in _loads_at_rest(limit, q)
        ]
        if not loads:
            return None
        worst.append(max(loads, key=measure))
    if not worst:
        return None
    load = min(worst, key=measure)
    # Before a plan is tried it has to be out of the question; afterwards it is the most likely reason.
    if measure(load) < (1.05 if everywhere else 0.95):
        return None
    label = load.limit.labels[load.column]
    figure = _figure(load.limit, load.column)
    low, high = (f"{figure * ratio:.4g}" for ratio in (load.least, load.largest))
    taken = f"{low} to {high}" if low != high else low
    mean = f"{load.mean * figure:.4g}"
    remedies = load_remedies(
        starts[0].problem.robot, load.limit, load.column, load.mean
    )
    return Failure(
        f"the {label.kind} limit of {label.subject!r} is too low to hold the arm against gravity along the path",
        where=label.key or load.limit.name,
        found=f"{taken} {label.unit} to hold the arm, {mean} {label.unit} on average (root mean square)",
        needed=f"{figure:.4g} {label.unit}",
        hint="Move the path so that its postures need less, or change the mounting of the robot",
        remedies=remedies,
    )


def _loads_at_rest(limit: Limit, q: np.ndarray) -> list[_Load]:
    """List what postures (S, n) at rest take of each column of a limit of a mean."""
    values = limit.values(Moments.at_rest(q))
    ratios = np.abs(limit.ratio(values))
    means = np.abs(limit.ratio(values.mean(axis=0, keepdims=True)))[0]
    return [
        _Load(limit, column, float(own.min()), float(own.max()), float(mean))
        for column, (own, mean) in enumerate(zip(ratios.T, means, strict=True))
    ]


def _figure(limit: Limit, column: int) -> float:
    """Return the figure that the user gave for a column of a limit."""
    return next(bound.figure for bound in limit.bounds if bound.column == column)


def explain_speed(
    candidates: Sequence[Candidate], solve: Callable[[InitialGuess], Candidate]
) -> Failure | None:
    """Tell which least speed no candidate could hold, by a plan without it from the most promising guess.

    Parameters
    ----------
    candidates : sequence of Candidate
        That failed.
    solve : callable
        Plans from a guess at the first collocation points.

    Returns
    -------
    Failure or None
        None without a least speed, or if another reason is to blame.
    """
    starts = [
        each.start for each in candidates if each.start is not None and each.solver
    ]
    if not starts or not least_speeds(starts[0].problem.limits):
        return None
    start = min(starts, key=lambda start: start.estimate)
    problem = dataclasses.replace(start.problem, limits=tuple(_others(start.problem)))
    candidate = solve(dataclasses.replace(start, problem=problem))
    if not candidate.usable or candidate.program is None:
        return None
    (phase,) = candidate.program.phases
    (motion,) = candidate.program.motions(candidate.reports[-1].x)
    t = np.linspace(0.0, motion.t_end, 400)
    try:
        moments = phase.joint_map.state(*motion.at(t), t=t)
    except UnreachableError:
        return None
    q = interpolate(_S, moments.s, moments.q)
    return _explain_shortfall(start, moments, "in the fastest motion without it", q)


def _others(problem: Problem) -> list[Limit]:
    """Limits that do not ask for a least speed."""
    return [limit for limit in problem.limits if limit.longer_time != "violates"]


def _explain_in_phase_plane(start: InitialGuess) -> Failure | None:
    """Tell which speed no motion along the guess's joint path has; None if all are possible, or none is asked for."""
    problem = start.problem
    rates = problem.end_rates
    is_asked = any(rates) or bool(least_speeds(problem.limits))
    q = postures_along(start, _S) if is_asked else None
    if q is None or problem.task.boundary.periodic:
        return None
    stations = spread_stations(problem.limits)
    if PhasePlane(problem.limits, _S, q, stations).fastest(rates) is not None:
        return None
    others = PhasePlane(_others(problem), _S, q, stations)
    rate = others.fastest(rates)
    if rate is None:
        return _explain_end_speed(problem, others)
    q_ds = np.gradient(q, _S, axis=0, edge_order=2)
    places = interpolate(stations, _S, q)
    qdot = interpolate(stations, _S, q_ds) * rate[:, None]
    still = np.zeros_like(places)
    moments = Moments(places, qdot, still, still, stations)
    best = "along the best joint path that was found"
    return _explain_shortfall(
        start, moments, best if start.joint_map.r else "in the fastest motion", q
    )


def _explain_end_speed(problem: Problem, plane: PhasePlane) -> Failure | None:
    """Tell at which end the path cannot be passed as fast as asked for; the other is at rest, or slower likewise."""

    def is_possible(rates: np.ndarray) -> bool:
        return plane.fastest((float(rates[0]), float(rates[1]))) is not None

    if not is_possible(np.zeros(2)):
        return None
    asked = np.array(problem.end_rates)
    shares: dict[str, float] = {}
    for end, key in enumerate(("start_speed", "end_speed")):
        if not asked[end]:
            continue
        alone = np.where(np.arange(2) == end, asked, 0.0)
        low = 0.0
        high = 1.0
        for _ in range(10):
            middle = 0.5 * (low + high)
            # On a short path a speed may ask for one at the other end.
            both = is_possible(middle * alone) or is_possible(middle * asked)
            low, high = (middle, high) if both else (low, middle)
        shares[key] = low
    key = min(shares, key=lambda key: (shares[key], key))
    share = shares[key]
    if share >= _EXACT:
        return None
    unit = problem.task.speed_unit
    speeds = {key: getattr(problem.task.boundary, key) for key in shares}
    most = f"{share * speeds[key]:.3g} {unit}"
    return Failure(
        f"the limits do not allow this speed at the path's {key.removesuffix('_speed')}",
        where=f"boundary.{key}",
        found=f"{speeds[key]:g} {unit}; along one joint path about {most} is possible (estimate)",
        hint="Raise the limits that hold the motion back",
        remedies=[
            Remedy(f"boundary.{key}", speed, _FIRST * shares[key] * speed, unit)
            for key, speed in speeds.items()
            if shares[key] < _EXACT
        ],
        share=share,
    )


def _explain_shortfall(
    start: InitialGuess, motion: JointStates, how: str, q: np.ndarray
) -> Failure | None:
    """Tell where a motion, whose places ascend, falls short of a least speed most; None if it does not.

    Its joint path is q, (S, n).
    """
    problem = start.problem
    worst = 0.0
    for each in least_speeds(problem.limits):
        parts = _parts_of(each, motion.s)
        everything = each.values(motion)
        shortfall = np.where(
            parts.any(axis=1, keepdims=True), each.violation(everything), -np.inf
        )
        if shortfall.max() > worst:
            worst = float(shortfall.max())
            limit = each
            column = int(np.argmax(shortfall.max(axis=0)))
            values = everything[:, column]
            beyond = shortfall[:, column]
            # Of the part with the worst place.
            place = int(np.argmax(beyond))
            inside = np.flatnonzero(parts[:, int(np.argmax(parts[place]))])
    if not worst > 0.0:
        return None
    label = limit.labels[column]
    found, allowed = in_figures(limit, column, float(values[place]))
    best = inside[int(np.argmin(beyond[inside]))]
    most, _ = in_figures(limit, column, float(values[best]))
    what, cuts = _describe_reach(motion.s[inside], beyond[inside] <= 0.0)
    figure = _figure(limit, column)
    remedies: list[Remedy] = []
    for number, part in enumerate(problem.task.tool_limits.process_speed):
        key = f"tool_limits.process_speed[{number}]"
        if not label.key.startswith(key):
            continue
        speed, s, name = _find_speed_cap(problem, q, part.s)
        if speed < figure:
            on_path = " on that joint path" if start.joint_map.r else ""
            what = f"the {name} limit lets the tool keep no more than {speed:.3g} m/s at s = {s:.3g}{on_path}"
            cuts = {}
        guess = _FIRST * part.speed * min(float(found), speed) / figure
        remedies.append(Remedy(f"{key}.speed", part.speed, guess, "m/s"))
        remedies += [
            Remedy(f"{key}.s[{end}]", part.s[end], cut, is_refined=False)
            for end, cut in cuts.items()
        ]
    return Failure(
        f"no motion was found with the required {label.kind}: {what}",
        where=f"{label.key or limit.name} ({label.subject})",
        found=f"{found} to {most} {label.unit} on that part, the least at s = {motion.s[place]:.2g}, {how}",
        needed=f"{allowed} {label.unit}",
        hint="Raise the limits that hold the motion back",
        remedies=remedies,
        share=1.0 - worst,
    )


def _find_speed_cap(
    problem: Problem, q: np.ndarray, part: tuple[float, float]
) -> tuple[float, float, str]:
    """Find the largest speed that the tool can keep on a part of a joint path, (S, n), m/s; where, and which limit."""
    q_ds = np.gradient(q, _S, axis=0, edge_order=2)
    q_dds = np.gradient(q_ds, _S, axis=0, edge_order=2)
    slope = ToolSpeed(problem.robot).slope(q, q_ds)
    bend = -np.gradient(slope, _S) / np.maximum(slope, _STILL)
    inside = (part[0] <= _S) & (part[1] >= _S) & (slope > _STILL)
    cap = (math.inf, 0.0, "")
    for limit in _others(problem) if inside.any() else ():
        if not isinstance(limit, HasPhasePlaneRows):
            continue
        rows = limit.phase_plane_rows(
            _S[inside], q[inside], q_ds[inside], q_dds[inside]
        )
        slant = rows.x
        lower = -np.inf
        if rows.u is not None:
            slant = rows.x + rows.u * bend[inside, None]
            lower = -1.0
        end = np.where(slant > 0.0, 1.0, lower) - rows.constant
        with np.errstate(divide="ignore", invalid="ignore"):
            level = np.where(slant == 0.0, np.inf, np.maximum(end / slant, 0.0))
        squares = level * slope[inside, None] ** 2
        row, column = np.unravel_index(int(np.argmin(squares)), squares.shape)
        speed = math.sqrt(squares[row, column])
        if speed < cap[0]:
            label = limit.labels[column if squares.shape[1] == len(limit.labels) else 0]
            cap = (speed, float(_S[inside][row]), str(label))
    return cap


def _parts_of(limit: Limit, s: np.ndarray) -> np.ndarray:
    """Tell which places, (P,), are within which parts between breaks of a limit, (P, p) bool; breaks come in pairs."""
    breaks = np.sort(limit.breaks)
    if not len(breaks) or len(breaks) % 2:
        breaks = np.array([0.0, 1.0])
    ends = breaks.reshape(-1, 2)
    return np.asarray((s[:, None] >= ends[:, 0]) & (s[:, None] <= ends[:, 1]))


def _describe_reach(s: np.ndarray, reached: np.ndarray) -> tuple[str, dict[int, float]]:
    """Say where of the places, (P,), a speed is reached, (P,) bool, and to which s ends of the part could be moved."""
    if not reached.any():
        return "it is not reached anywhere on that part", {}
    first, last = (float(end) for end in s[reached][[0, -1]])
    if not reached[(s >= first) & (s <= last)].all():
        return f"it cannot be held all the way from s = {first:.3g} to {last:.3g}", {}
    # The part begins behind, or ends before, the run-up to the speed.
    places = {}
    cuts = {}
    if not reached[0]:
        places[0] = f"before s = {s[0]:.2g}"
        cuts[0] = first + 0.01
    if not reached[-1]:
        places[1] = f"after s = {s[-1]:.2g}"
        cuts[1] = last - 0.01
    text = f"the path {' and '.join(places.values())} is too short to reach it"
    # Of two ends neither is enough by itself.
    return text, cuts if len(cuts) == 1 else {}
