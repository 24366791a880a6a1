"""A task bound to a robot: path and postures, and the choices of redundant joints and branch."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from itertools import pairwise
from typing import Any

import numpy as np

from brachis import ik
from brachis.common.summary import Summary
from brachis.errors import (
    BrachisError,
    DecompositionError,
    StartError,
    UnknownNameError,
    check_names,
)
from brachis.kinematics import ClosedFormMap, Newton
from brachis.limits import Limit, limits_of
from brachis.path import (
    Leg,
    Path,
    TimeLaw,
    check_closed,
    legs_of,
    path_of,
    path_speed,
    time_law_of,
    with_feed_rates,
    with_held_speeds,
)
from brachis.problem.feasibility import (
    branch_of,
    check_independent,
    check_postures,
    check_regular,
    check_smoothness,
)
from brachis.robot import Robot, TaskMap, bind
from brachis.robot.custom_limits import LimitModel
from brachis.robot.task_map import JointSpace
from brachis.task import Task

Join = tuple[int, int, tuple[int, ...]]
"""Numbers of the parts before and after a place, and the orders of the derivatives that must be equal there."""


@dataclass(frozen=True, repr=False)
class Problem(Summary):
    """A task bound to a robot.

    Attributes
    ----------
    task : Task
    robot : Robot
        The robot, with a virtual joint for each direction in which the tool may deviate from the path.
    task_map : TaskMap
    path : Path
    start, end : (n,) ndarray or None
        Postures at the ends of the path; None for an end that is free. Both are the same if the motion is periodic.
        Otherwise `end` is the posture on the path closest to the given one, which may be off the path by a rounding
        error.
    limits : tuple of Limit
    legs : tuple of Leg
        Parts of the path that are travelled without a break.
    time_laws : tuple of TimeLaw or None
        Time law of each leg; None if its speed is free.
    own_limits : tuple of LimitModel
        Limits that are not in the task, as the user gave them.
    beside : tuple of (E, n) ndarray or None
        Postures from which the arm comes, and postures to which it goes on, if they are known.
    variants : tuple of Problem
        The same path travelled otherwise, if the planner chooses how: backwards, or from another place on.
    """

    task: Task
    robot: Robot
    task_map: TaskMap
    path: Path
    start: np.ndarray | None
    end: np.ndarray | None
    limits: tuple[Limit, ...]
    legs: tuple[Leg, ...]
    time_laws: tuple[TimeLaw | None, ...]
    own_limits: tuple[LimitModel, ...] = ()
    beside: tuple[np.ndarray | None, np.ndarray | None] = (None, None)
    variants: tuple[Problem, ...] = ()

    @classmethod
    def of(
        cls, robot: Robot, task: Task, own_limits: Sequence[LimitModel] = ()
    ) -> Problem:
        """Bind a task to a robot, and check the postures that the task gives.

        Parameters
        ----------
        robot : Robot
        task : Task
        own_limits : sequence of LimitModel, optional
            Limits that are not in the task.

        Raises
        ------
        InputError
            The task space, the postures, the path or a limit of the user does not fit the robot, or the splines are not
            smooth enough for a limit.
        """
        robot, task_map = bind(robot, task.task_space, task.tolerances)
        at_start = task.joints_at("start")
        at_end = task.joints_at("end")
        start = at_start and robot.posture(*at_start)
        end = at_end and robot.posture(*at_end)
        if robot.n >= task_map.m and task_map.is_of_tool:
            check_independent(task_map)
        path = path_of(task_map, task)
        task = with_held_speeds(with_feed_rates(task, path), task_map, path)
        if task.boundary.periodic:
            check_closed(task_map, path)
            end = start
        legs = legs_of(task, task_map, path)
        time_laws = tuple(time_law_of(leg, task_map, path) for leg in legs)
        limits = limits_of(robot, task, own_limits)
        check_smoothness(limits, task.spline)
        problem = cls(
            task,
            robot,
            task_map,
            path,
            start,
            end,
            limits,
            legs,
            time_laws,
            tuple(own_limits),
        )
        limits = check_postures(task, task_map, limits, problem.given_postures, path)
        if end is not None and not task.boundary.periodic:
            end = _on_path(task_map, end, path, 1.0)
        if start is not None and task.begins_elsewhere:
            start = _on_path(task_map, start, path, 0.0)
        return replace(problem, limits=limits, start=start, end=end)

    def waiting(self, wait: float) -> Problem:
        """Return the problem with a wait at its end, s."""
        last = replace(self.legs[-1], dwell=wait)
        return replace(self, legs=(*self.legs[:-1], last))

    @property
    def is_chain(self) -> bool:
        """Whether the motion consists of the motions of other problems."""
        return False

    @property
    def parts(self) -> tuple[Problem, ...]:
        """The problems whose motions follow one another: only this one; see `brachis.problem.chain.ProblemChain`."""
        return (self,)

    def key_of(self, _number: int, key: str) -> str:
        """Return a key of a part as one of the task, for messages."""
        return key

    def name_keys(self, _number: int, _error: BrachisError) -> None:
        """Leave an error as it is; see `brachis.problem.chain.ProblemChain`."""

    def with_part(self, _number: int, part: Problem) -> Problem:
        """Return the problem with another part in place of the part with a number."""
        return part

    @property
    def flying_orders(self) -> int:
        """Number of time derivatives that are continuous where parts meet in motion."""
        return min(2, self.task.spline.vanishing)

    @property
    def flights(self) -> list[list[int]]:
        """Numbers of the parts, divided where the arm stops: one list, because there is only one part."""
        return [[0]]

    @property
    def joins(self) -> list[Join]:
        """Places where parts meet in motion, or in a free posture: none, because there is only one part."""
        return []

    @property
    def given_postures(self) -> dict[str, np.ndarray]:
        """Given postures, by the names ``start`` and ``end``; an end that is free is left out."""
        both = {"start": self.start, "end": self.end}
        return {name: posture for name, posture in both.items() if posture is not None}

    @cached_property
    def leg_paths(self) -> tuple[Path, ...]:
        """The path of each leg; only the pieces on the leg are sampled."""
        return tuple(self.path.between(leg.begin, leg.end) for leg in self.legs)

    @cached_property
    def leg_rates(self) -> tuple[tuple[float, float], ...]:
        """ds/dt at the beginning and end of each leg, 1/s.

        The rate is 0 at rest. At the ends of a periodic motion it is 0 if no speed is given there.
        """
        first, last = self.end_rates
        inner = [self._rate_between(*pair) for pair in pairwise(range(len(self.legs)))]
        return tuple(pairwise([first, *inner, last]))

    def leg_beside(self, number: int, side: int) -> int | None:
        """Return the number of the leg before (side 0) or after (-1) a leg; None where the motion begins or ends."""
        beside = number - 1 if side == 0 else number + 1
        if self.task.boundary.periodic:
            return beside % len(self.legs)
        return beside if 0 <= beside < len(self.legs) else None

    @property
    def dwell_time(self) -> float:
        """Total time for which the tool stands still between legs, s."""
        return sum(leg.dwell for leg in self.legs)

    @property
    def r(self) -> int:
        """Degree of redundancy: the number of joints minus the number of rows of the task space."""
        return self.robot.n - self.task_map.m

    def _law_rate(self, leg: int, end: int) -> float:
        """Return ds/dt at an end (0 or -1) of a leg, 1/s; 0 if its speed is free."""
        law = self.time_laws[leg]
        return 0.0 if law is None else float(law.ends[end, 1])

    def _rate_between(self, before: int, after: int) -> float:
        """Return ds/dt where one leg ends and another begins, 1/s."""
        if self.legs[before].stops:
            return 0.0
        return self._law_rate(before, -1) or self._law_rate(after, 0)

    @property
    def end_rates(self) -> tuple[float, float]:
        """ds/dt at the path's start and end, 1/s."""
        boundary = self.task.boundary
        if boundary.periodic:
            rate = self._rate_between(-1, 0)
            return rate, rate
        rates = [self._law_rate(end, end) for end in (0, -1)]
        for end, speed in enumerate(boundary.given_speeds):
            if speed and self.time_laws[-end] is None:
                rates[end] = speed / path_speed(self.task_map, self.path, float(end))
        first, last = rates
        return first, last


def _on_path(
    task_map: TaskMap, posture: np.ndarray, path: Path, s: float
) -> np.ndarray:
    """Return the posture, (n,), at s on the path that is closest to a given one, which may already be there."""
    place = path.sample([s]).target
    if not task_map.m:
        return posture
    if isinstance(task_map, JointSpace):
        return np.asarray(place[0])
    miss = task_map.difference(place, task_map.values(posture[None]))
    if task_map.robot.n < task_map.m or np.abs(miss).max() < 1e-12:
        return posture
    (nearest,) = Newton(task_map).nearest(place, posture[None])
    return nearest if np.isfinite(nearest).all() else posture


@dataclass(frozen=True, repr=False)
class Decomposition(Summary):
    """Redundant joints with their closed form, and the branches on which a motion may begin.

    Attributes
    ----------
    problem : Problem
    match : Match
    redundant : tuple of int
        Indices of the redundant joints, ascending.
    branches : tuple of int
        Indices into ``match.solver.branches``; there is only one if the start or end posture is given.
    """

    problem: Problem
    match: ik.Match
    redundant: tuple[int, ...]
    branches: tuple[int, ...]

    @property
    def name(self) -> str:
        """Names of the redundant joints."""
        return ", ".join(self.match.redundant_joints) or "none"

    @property
    def clearance(self) -> float:
        """Smallest branch margin of the start posture, or of the end posture if the start is free; zero if both are."""
        posture = self.problem.end if self.problem.start is None else self.problem.start
        if posture is None:
            return 0.0
        margins = self.match.solver.branch_margins(posture[None], self.branches[0])
        return float(margins.min(initial=np.inf))

    def joint_map(self, start: np.ndarray, branch: int) -> ClosedFormMap:
        """Combine robot, path and closed form for a motion that begins at, or close to, `start`, (n,)."""
        task_map = self.problem.task_map
        path = self.problem.path
        solver = self.match.solver
        return ClosedFormMap(task_map, path, solver, self.redundant, branch, start)


@dataclass(frozen=True, eq=False, repr=False)
class Decompositions(Sequence[Decomposition]):
    """The decompositions that the task allows. They are computed when first used; see `decompositions_of`.

    Searches in charts that begin at a given posture never need them.

    Attributes
    ----------
    problem : Problem
    families : sequence of Family
    """

    problem: Problem
    families: Sequence[ik.Family]

    @cached_property
    def _found(self) -> list[Decomposition]:
        return decompositions_of(self.problem, self.families)

    def __len__(self) -> int:
        """Return the number of decompositions."""
        return len(self._found)

    def __getitem__(self, index: Any) -> Any:
        """Return one of the decompositions, or several."""
        return self._found[index]


def decompositions_of(
    problem: Problem, families: Sequence[ik.Family] = ()
) -> list[Decomposition]:
    """List the decompositions, which are choices of redundant joints, that the task allows.

    Parameters
    ----------
    problem : Problem
    families : sequence of Family, optional
        Families of closed-form inverse kinematics to try before the built-in ones.

    Returns
    -------
    list of Decomposition
        With ``redundant_joints: auto``, the decomposition with the largest branch margin at the start posture comes
        first. The list is empty if the robot has no closed form, or if the path is a prescribed joint path. If the task
        names the redundant joints, the list has at least one item.

    Raises
    ------
    DecompositionError
        No closed form fits the robot and the task.
    StartError
        A given posture is singular, or it is not on the branch to which the task's branch or redundant joints restrict
        the motion.
    UnknownNameError
        The robot has no joint, or the closed form has no branch, with the name that the task gives.
    """
    task = problem.task
    robot = problem.robot
    task_map = problem.task_map
    if not task_map.is_of_tool:
        return []
    if task.redundant_joints != "auto":
        names = _with_tool_joints(task_map, task.redundant_joints)
        return [
            _decomposition(problem, ik.find(robot, task_map, names, families=families))
        ]
    tried = ik.find_all(robot, task_map, families=families)
    matches = [candidate for candidate in tried if isinstance(candidate, ik.Match)]
    is_bound = task.branch != "auto" or task.search.guesses != "lattice"
    if not matches and (is_bound or robot.n < task_map.m):
        if len(tried) <= 1:
            # There is nothing to choose: report why the only choice fails, or that the number of joints is wrong.
            ik.find(robot, task_map, (), families=families)
        raise DecompositionError(
            "no choice of redundant joints has a closed form",
            redundant_joints=(),
            reasons={
                ", ".join(c.redundant_joints): "; ".join(c.reasons.values())
                for c in tried
            },
        )
    allowed: list[Decomposition] = []
    refusals: list[StartError | UnknownNameError] = []
    for match in matches:
        try:
            allowed.append(_decomposition(problem, match))
        except (StartError, UnknownNameError) as error:
            refusals.append(error)
    if refusals and not allowed and (is_bound or robot.n == task_map.m):
        raise refusals[0]
    if not allowed:
        check_regular(task, task_map, problem.given_postures)
    return sorted(allowed, key=lambda decomposition: -decomposition.clearance)


def _with_tool_joints(task_map: TaskMap, names: tuple[str, ...]) -> tuple[str, ...]:
    """Add the virtual joints of the tool if exactly these are missing from the redundant joints in `names`."""
    robot = task_map.robot
    virtual = [joint.name for joint in robot.tool_joints if joint.name not in names]
    is_short = robot.n - task_map.m - len(names) == len(virtual)
    return (*names, *virtual) if is_short else names


def _decomposition(problem: Problem, match: ik.Match) -> Decomposition:
    """Find the branches on which a motion may begin."""
    task_map = problem.task_map
    names = problem.robot.joint_names
    redundant = tuple(names.index(name) for name in match.redundant_joints)
    stated_branch = problem.task.branch
    labels = match.solver.branches
    if stated_branch != "auto":
        check_names("branch", [stated_branch], labels, "branch")
    branches = tuple(
        i for i, label in enumerate(labels) if stated_branch in ("auto", label)
    )
    for name, posture in problem.given_postures.items():
        key = problem.task.posture_key(name)
        branch = branch_of(task_map, match, posture, key)
        if branch not in branches:
            origin = "start posture" if stated_branch == "auto" else "task's branch"
            leave_out = "end" if stated_branch == "auto" else "branch"
            raise StartError(
                f"the {name} posture is on a different branch from the {origin}",
                where=key,
                found=labels[branch],
                allowed=labels[branches[0]],
                hint=f"Leave out {leave_out}, or set {key} to a posture of that branch",
            )
        branches = (branch,)
    return Decomposition(problem, match, redundant, branches)
