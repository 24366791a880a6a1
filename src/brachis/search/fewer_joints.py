"""The search for the motion of a plan, helped by simpler plans with fewer joints.

Before tolerances are used, the search looks for a plan in which the tool stays exactly on the path. Afterwards, idle
joints, which move no row of the task space, are held still unless moving them saves time.
"""

from __future__ import annotations

import dataclasses
from collections.abc import Callable

from brachis.common.deadline import Deadline
from brachis.common.progress import Listener
from brachis.errors import BrachisError, UrdfError
from brachis.problem.problem import Problem
from brachis.robot import Robot
from brachis.search.given_motion import lock_idle, widen_plan, without_tolerances
from brachis.search.portfolio import Search
from brachis.search.stages import FinishedCandidate, SearchOutcome
from brachis.task import Task, Tolerances
from brachis.trajectory import Trajectory

Opening = Callable[[Problem, Deadline], Search]
"""A function that opens the search for a problem."""
_WORTH_MOVING = 2.0
"""Moving idle joints has to save this multiple of the spline tolerance, as either plan may be slow by one tolerance."""


def search_motion(
    problem: Problem,
    robot: Robot,
    known_motion: Trajectory | None,
    open_search: Opening,
    deadline: Deadline,
    report: Listener,
) -> SearchOutcome:
    """Search for the fastest motion, from a known motion if given; raise an error that explains why none was found."""
    search = open_search(problem, deadline)
    exact = None
    if known_motion is None and problem.task.tolerances != Tolerances():
        report("planning for a tool that stays exactly on the path")
        task = without_tolerances(problem.task)
        soon = deadline.part(0.5)  # the rest is for the search with tolerances
        exact = _plan_simpler(problem, robot, task, None, open_search, soon)
    with search.end_early():
        search.run(
            known_motion, exact if exact is not None and exact.verified else None
        )
    if search.best is None and search.interrupted and exact is not None:
        search.candidates.append(exact)
        search.best = exact
    best = search.best
    if best is not None and search.is_satisfied and not search.interrupted:
        with search.end_early():
            held = _hold_idle_joints(problem, robot, best, open_search, deadline)
            if held is not None:
                search.candidates.append(held)
                search.best = held
    return search.outcome()


def _hold_idle_joints(
    problem: Problem,
    robot: Robot,
    best: FinishedCandidate,
    open_search: Opening,
    deadline: Deadline,
) -> FinishedCandidate | None:
    """Plan again from the best motion with idle joints at rest; None if none is idle, or if moving them saves time."""
    if not problem.task_map.m:
        return None
    postures = problem.given_postures
    try:
        idle = lock_idle(robot, problem.task, problem.task_map, postures)
    except UrdfError:
        # The task allows idle joints to be outside the URDF's ranges, where they cannot be locked.
        return None
    if idle is None:
        return None
    held = _plan_simpler(problem, *idle, best.trajectory, open_search, deadline)
    worth = 1.0 - _WORTH_MOVING * problem.task.spline.tolerance
    if held is None or not held.verified or worth * held.t_end > best.t_end:
        return None
    return held


def _plan_simpler(
    problem: Problem,
    robot: Robot,
    task: Task,
    known_motion: Trajectory | None,
    open_search: Opening,
    deadline: Deadline,
) -> FinishedCandidate | None:
    """Plan with fewer joints, by a search or from a known motion alone; the motion need not be verified."""
    try:
        simpler = Problem.of(robot, task, problem.own_limits)
        search = open_search(simpler, deadline)
        if known_motion is None:
            search.run()
        else:
            search.run(known_motion, max_batches=1)
    except BrachisError:  # all joints are needed
        return None
    if search.best is None:
        return None
    origin = "without tolerances" if known_motion is None else "with idle joints held"
    return widen_plan(dataclasses.replace(search.best, origin=origin), problem)
