"""Joint paths between two postures round what is in the way, by the planner RRT-Connect of OMPL.

OMPL samples postures within the joint ranges, joins them by straight steps, and shortens the joint path that it finds.
Its coordinates are the joint positions times `step_weights`, so that short joint paths are fast ones.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from brachis.common.deadline import Deadline
from brachis.errors import NotInstalledError
from brachis.limits import Limit
from brachis.limits.joint import reciprocals_near
from brachis.problem.problem import Problem
from brachis.search.joint_path import sampling_box

_STEP = 0.05
"""Maximum step of a joint between checked postures, rad or m."""
_FEW = 4
"""Every step is first checked at one of so many postures. Most steps that are not free fail there."""
_SLACK = 1e-9
"""Allowance for rounding, as a violation."""
_TYPICAL_TIME = 0.5
"""Time, s, that weighs velocities against accelerations, as in the length of the lattice."""
_LEAST_WEIGHT = 0.05
"""Minimum weight of a joint, as a fraction of the largest. Joints without a limit would turn at random."""


@dataclass(frozen=True)
class FreeSpace:
    """The postures that the limits on resting arms allow.

    Attributes
    ----------
    limits : tuple of Limit
        Limits that depend on the posture alone.
    """

    limits: tuple[Limit, ...]

    @classmethod
    def of(cls, problem: Problem) -> FreeSpace:
        """Return the postures from which splines may deviate a little, as far as both given postures allow."""
        ends = np.array([problem.start, problem.end])
        limits = (limit for limit in problem.limits if limit.at_rest != "nothing")
        narrowed = tuple(limit.keep_inside(ends) for limit in limits)
        return cls(narrowed)

    def contains(self, q: np.ndarray) -> bool:
        """Tell whether all limits are met in all postures, (K, n)."""
        return all(limit.holds_at_rest(q, _SLACK).all() for limit in self.limits)

    def joins(self, first: np.ndarray, last: np.ndarray) -> bool:
        """Tell whether the straight step between two free postures, (n,), is free."""
        largest = np.abs(last - first).max()
        q = np.linspace(first, last, 2 + int(largest / _STEP))
        inner = q[1:-1]
        return self.contains(inner[::_FEW]) and self.contains(inner)


def step_weights(problem: Problem) -> np.ndarray:
    """Return the weights of the joints, (n,), with which steps between postures are compared."""
    accelerations, velocities = reciprocals_near(
        problem.robot, problem.limits, problem.given_postures["start"]
    )
    weights = accelerations + _TYPICAL_TIME * velocities
    return np.maximum(weights, _LEAST_WEIGHT * weights.max())


def sample_joint_path(
    problem: Problem, space: FreeSpace, seed: int, iterations: int, deadline: Deadline
) -> np.ndarray | None:
    """Find a joint path between the given postures by random sampling, and shorten it.

    Parameters
    ----------
    problem : Problem
    space : FreeSpace
    seed : int
        Seed of OMPL's random numbers, above 0. The same seed gives the same joint path.
    iterations : int
        Number of samples after which the search is given up.
    deadline : Deadline

    Returns
    -------
    (S, n) ndarray or None
        Postures that straight steps join; None if none were found.

    Raises
    ------
    NotInstalledError
        OMPL is missing.
    """
    try:
        from ompl import base, geometric, util
    except ImportError as error:
        raise NotInstalledError("a move round bodies", "ompl", "moves") from error

    weights = step_weights(problem)
    n = problem.robot.n
    remaining = iterations

    def posture(state: Any) -> np.ndarray:
        """Return the posture of a state of OMPL."""
        return np.array(state[0:n]) / weights

    class StepValidator(base.MotionValidator):  # type: ignore[misc]
        """Checks all postures of a step at once."""

        def checkMotion(self, first: Any, last: Any) -> bool:  # noqa: N802
            """Tell whether the step from a valid state is free."""
            end = posture(last)
            return space.contains(end[None]) and space.joins(posture(first), end)

    def is_over() -> bool:
        """Count down, and tell whether to give up."""
        nonlocal remaining
        remaining -= 1
        return remaining < 0 or deadline.passed

    util.setLogLevel(util.LogLevel.LOG_NONE)
    util.RNG.setSeed(seed)
    coordinates = base.RealVectorStateSpace(n)
    bounds = base.RealVectorBounds(n)
    ends = np.array([problem.start, problem.end])
    inside = np.vstack([sampling_box(problem.robot, ends[0]), ends]) * weights
    for joint, positions in enumerate(inside.T.tolist()):
        bounds.setLow(joint, min(positions))
        bounds.setHigh(joint, max(positions))
    coordinates.setBounds(bounds)
    setup = geometric.SimpleSetup(coordinates)
    information = setup.getSpaceInformation()
    setup.setStateValidityChecker(lambda state: space.contains(posture(state)[None]))
    validator = StepValidator(information)
    information.setMotionValidator(validator)
    states = coordinates.allocState(), coordinates.allocState()
    for state, q in zip(states, ends, strict=True):
        state[0:n] = (q * weights).tolist()
    setup.setStartAndGoalStates(*states)
    setup.setPlanner(geometric.RRTConnect(information))
    setup.solve(base.PlannerTerminationCondition(is_over))
    if not setup.haveExactSolutionPath():
        return None
    path = setup.getSolutionPath()
    simplifier = geometric.PathSimplifier(information)
    simplifier.reduceVertices(path)
    simplifier.partialShortcutPath(path)
    return np.array([posture(state) for state in path.getStates()])
