"""The nonlinear program of a task on a robot, with a phase for each leg of the path, in coordinates of a joint map.

Where the arm stops, the phases on both sides are at rest in the same posture, which is free. Where the tool's speed is
given on one side, s and its derivatives are known there. Links make the redundant joints continue with the same number
of derivatives.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence

import numpy as np

from brachis.common.arrays import spread
from brachis.errors import UnreachableError
from brachis.kinematics import ChartMap, JointMap
from brachis.optimise.boundary import Boundary, EndCondition
from brachis.optimise.bspline import clamped_knots
from brachis.optimise.grid import FixedGrid
from brachis.optimise.links import CurveLink, Link, PostureLink
from brachis.optimise.mesh import COARSE_INTERVALS
from brachis.optimise.phase import Phase
from brachis.optimise.program import Program
from brachis.problem.problem import Problem
from brachis.task import FREE

_FOR_SPEEDS = 12
"""Number of intervals of each phase in the first mesh if a speed is given. With 20, plans took two to three times as
long."""
_END_INTERVAL = 0.2
"""Maximum length, s, of the first and last intervals of a phase with a given time. In these intervals, the joints come
from or go over to a motion that is as fast as possible. With 0.1 the end times of ten lines were the same. With 0.4
some plans took twice as long, and with even intervals one of the ten plans failed."""


def program_of(problem: Problem, joint_maps: Sequence[JointMap]) -> Program:
    """Set up the NLP of a decomposition over even knot intervals, which are shorter at the ends of a given speed.

    Parameters
    ----------
    problem : Problem
    joint_maps : sequence of JointMap
        One joint map for each leg. Its start is at, or close to, the posture at the beginning of the leg.

    Returns
    -------
    Program
    """
    spline = problem.task.spline
    grids = []
    for law in problem.time_laws:
        breaks = breaks_of(problem)
        if law is not None and spline.intervals == "auto":
            breaks = _halve_at_ends(breaks, law.duration)
        knots = clamped_knots(spline.degree, breaks)
        t_norm = spread(breaks, spline.points_per_interval)
        grids.append(FixedGrid(knots, spline.degree, t_norm))
    return program_over(problem, joint_maps, grids)


def _halve_at_ends(breaks: np.ndarray, duration: float) -> np.ndarray:
    """Halve the first and the last interval of a phase until they are short enough.

    Parameters
    ----------
    breaks : (N + 1,) ndarray
        Ends of the intervals in normalised time.
    duration : float
        Duration of the phase, s.
    """
    halvings = np.ceil(np.log2(breaks[1] * duration / _END_INTERVAL))
    added = breaks[1] * 0.5 ** np.arange(halvings, 0.0, -1.0)
    return np.union1d(breaks, [added, 1.0 - added])


def program_over(
    problem: Problem, joint_maps: Sequence[JointMap], grids: Sequence[FixedGrid]
) -> Program:
    """Set up the NLP as `program_of` does, over a given grid for each phase.

    Raises
    ------
    UnreachableError
        The motion has to be periodic, but its coordinates at the start and the end of the path differ.
    """
    is_periodic = problem.task.boundary.periodic
    chart = joint_maps[0]
    if is_periodic and isinstance(chart, ChartMap) and not chart.rows.is_constant:
        raise UnreachableError(
            "chart coordinates at start and end differ, so the motion cannot be periodic in them"
        )
    phases: list[Phase] = []
    links: list[Link] = []
    firsts = []
    for part in problem.parts:
        first = len(phases)
        firsts.append(first)
        maps = joint_maps[first : first + len(part.legs)]
        links += _links(part, maps, first)
        for number, joint_map in enumerate(maps):
            boundary = boundary_of(part, joint_map, number)
            grid = grids[first + number]
            pause = part.legs[number].dwell
            phases.append(Phase(joint_map, part.limits, grid, boundary, pause=pause))
    for before, after, orders in problem.joins:
        last_phase = firsts[before] + len(problem.parts[before].legs) - 1
        links.append(_join(phases, last_phase, firsts[after], orders))
    return Program(phases, links)


def _join(
    phases: Sequence[Phase], before: int, after: int, orders: tuple[int, ...]
) -> PostureLink:
    """Link the postures, or their derivatives of some orders, in which one part ends and another begins."""
    maps = [phases[number].joint_map for number in (before, after)]
    joints = min(joint_map.robot.n for joint_map in maps)
    combinations = np.eye(joints)
    if not any(joint_map.is_move for joint_map in maps):
        # Both postures meet the path, so only the self-motion is left.
        most = max(maps, key=lambda joint_map: joint_map.r)
        combinations = most.self_motion_rows(float(most is maps[0]))
    return PostureLink(before, after, orders, combinations)


def maps_by_leg(
    problem: Problem, joint_map: JointMap, starts: np.ndarray
) -> list[JointMap]:
    """Divide a map of the whole path into maps of the legs, which begin in given postures, (legs, n)."""
    if len(problem.legs) == 1:
        return [joint_map]
    pairs = zip(problem.leg_paths, starts, strict=True)
    return [joint_map.along(path, start) for path, start in pairs]


def boundary_of(problem: Problem, joint_map: JointMap, number: int) -> Boundary:
    """Set up the boundary conditions of leg `number` in the coordinates of a joint map."""
    leg = problem.legs[number]
    last = len(problem.legs) - 1
    is_periodic = problem.task.boundary.periodic
    free = np.full(problem.robot.n, np.nan)
    start = free if number or problem.start is None else problem.start
    end = free if number < last or problem.end is None else problem.end
    y_start = joint_map.coordinates(leg.begin, start)
    y_end = joint_map.coordinates(leg.end, end)
    zeros = np.zeros(problem.task.spline.vanishing)
    if is_periodic and not last and problem.time_laws[0] is None:
        return Boundary.at_rest(y_start, y_end, len(zeros), periodic=True)
    sides = []
    for side, values in ((0, y_start), (-1, y_end)):
        s_derivatives = _derivatives_of_s(problem, number, side)
        derivatives = zeros if _is_at_rest(problem, number, side) else np.empty(0)
        first = EndCondition(float(values[0]), s_derivatives)
        redundant = (EndCondition(float(value), derivatives) for value in values[1:])
        sides.append((first, *redundant))
    return Boundary(sides[0], sides[1], time_law=problem.time_laws[number])


def _is_at_rest(problem: Problem, number: int, side: int) -> bool:
    """Tell whether the arm is at rest at the beginning (side 0) or end (-1) of a leg."""
    before = number - 1 if side == 0 else number
    if 0 <= before < len(problem.legs) - 1:
        return problem.legs[before].stops
    boundary = problem.task.boundary
    is_free = boundary.periodic or boundary.speeds[side] == FREE
    return not is_free and not problem.leg_rates[number][side]


def _derivatives_of_s(problem: Problem, number: int, side: int) -> np.ndarray:
    """Return the given time derivatives of s at the beginning (side 0) or end (-1) of a leg; empty if not given."""
    if _is_at_rest(problem, number, side):
        return np.zeros(problem.task.spline.vanishing)
    beside = problem.leg_beside(number, side)
    if beside not in (None, number):
        time_law = problem.time_laws[beside]
        if time_law is None:
            return np.empty(0)
        derivatives = time_law.ends[-1 - side]
        return derivatives[1 : 1 + derivatives_in_motion(problem)]
    if problem.task.boundary.speeds[side] == FREE:
        return np.empty(0)
    derivatives = np.zeros(problem.task.spline.vanishing)
    derivatives[0] = problem.leg_rates[number][side]
    return derivatives


def derivatives_in_motion(problem: Problem) -> int:
    """Return the number of continuous derivatives between phases in motion: with the jerk if a limit needs it."""
    order = max((limit.order for limit in problem.limits), default=2)
    return min(order, problem.task.spline.degree - 1)


def _links(
    problem: Problem, joint_maps: Sequence[JointMap], first: int
) -> Iterator[Link]:
    """Yield links between successive phases, and in a periodic motion also from the last phase to the first.

    The phases are numbered from `first` on.
    """
    several = len(joint_maps) > 1
    last = first + len(joint_maps) - 1
    redundant = tuple(range(1, 1 + joint_maps[0].r))
    in_motion = tuple(range(1 + derivatives_in_motion(problem)))
    for number, leg in enumerate(problem.legs[:-1] if redundant else (), first):
        orders = (0,) if leg.stops else in_motion
        yield CurveLink(number, number + 1, orders, redundant)
    has_law = problem.time_laws[0] is not None or problem.time_laws[-1] is not None
    if not problem.task.boundary.periodic or not (several or has_law):
        return
    if redundant:
        # If the start posture is given, it fixes both ends.
        orders = in_motion if problem.start is None else in_motion[1:]
        yield CurveLink(last, first, orders, redundant)
    if not has_law:
        yield CurveLink(last, first, in_motion[1:], (0,))


def breaks_of(problem: Problem) -> np.ndarray:
    """Return the ends, (N + 1,), of a phase's uniform intervals; for "auto", those in the first mesh."""
    count = problem.task.spline.intervals
    if count == "auto":
        # The distance to reach a given speed may be short. With few intervals, no motion reaches the speed.
        count = _FOR_SPEEDS if any(problem.time_laws) else COARSE_INTERVALS
    return np.linspace(0.0, 1.0, count + 1)
