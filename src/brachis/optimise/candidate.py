"""What the search tries: initial guesses, the candidates that are made from them, and how these are finished."""

from __future__ import annotations

import contextlib
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from brachis.common.arrays import cut, interpolate_columns
from brachis.common.summary import Summary
from brachis.common.words import write_count
from brachis.errors import UnreachableError
from brachis.kinematics import CHART, ChartMap, ClosedFormMap, JointMap, JointSpaceMap
from brachis.optimise.backends import SolverReport
from brachis.optimise.extraction import extract_trajectory
from brachis.optimise.improve import Solve, SolvedProgram
from brachis.optimise.program import Program
from brachis.optimise.refine import RefinementOptions, refine
from brachis.optimise.transcription import maps_by_leg
from brachis.problem.problem import Problem
from brachis.trajectory import Trajectory
from brachis.verify import Verification, verify_trajectory

PathMap = ClosedFormMap | ChartMap | JointSpaceMap
"""Joint maps along a path."""


def coordinates(redundant_joints: Sequence[str], branch: str) -> str:
    """Name the coordinates in which a motion is planned, s apart: redundant joints, a chart's own, or none."""
    return ", ".join(redundant_joints) or (CHART if branch == CHART else "none")


def describe_coordinates(trajectory: Trajectory) -> str:
    """Say in which coordinates a motion is planned, s apart, in words that do not need the name of a chart."""
    joints = trajectory.redundant_joints
    count = len(trajectory.control_points) - 1
    if joints or trajectory.branch != CHART:
        return coordinates(joints, trajectory.branch)
    if count == 0:
        return "none"
    return f"no joint is chosen; a chart measures the self-motion of all joints by {write_count(count, 'coordinate')}"


@dataclass(frozen=True, eq=False, repr=False)
class InitialGuess(Summary):
    """A joint path from which a plan is begun.

    Attributes
    ----------
    problem : Problem
    joint_map : ClosedFormMap, ChartMap or JointSpaceMap
        Robot, path and coordinates put together, for a motion that begins at, or near, its start posture.
    joint_path : (S, 1 + r) ndarray
        Successive values of the map's curves: s and the redundant joints, or s and the chart's sigma.
    estimate : float
        Least time along the joint path from the phase plane, s; infinite where nobody knows.
    origin : str
        Where it is from, in plain words, for example ``lattice 2``.
    family : str
        Family of the closed form; ``chart`` or ``path of joints`` without one.
    solver : str
        The solver that plans from it; empty while none is chosen.
    durations : tuple of float or None
        Of every leg, s, where the joint path's values are those of a motion: for one leg after the other equally many,
        at even times. None where they are not.
    is_improved : bool
        Whether the joint path is the best one next to it, roughly, for the limits that the phase plane knows.
    """

    problem: Problem
    joint_map: PathMap
    joint_path: np.ndarray
    estimate: float
    origin: str
    family: str
    solver: str = ""
    durations: tuple[float, ...] | None = None
    is_improved: bool = False

    @property
    def legs(self) -> list[np.ndarray]:
        """The part of the joint path on every leg, (S, 1 + r) each."""
        legs = self.problem.legs
        if self.durations is not None or len(legs) == 1:
            return np.split(self.joint_path, len(legs))
        s = self.joint_path[:, 0]
        parts = []
        for leg in legs:
            own = cut(s, leg.begin, leg.end)
            parts.append(interpolate_columns(own, s, self.joint_path))
        return parts

    def maps_by_leg(self) -> list[JointMap]:
        """Take the joint map leg by leg; raise UnreachableError where the joint path leaves it."""
        parts = self.legs
        if len(parts) == 1:
            return [self.joint_map]
        q = self.joint_map.postures(np.concatenate(parts))
        begins = np.cumsum([0, *(len(part) for part in parts[:-1])])
        if not np.isfinite(q).all():
            raise UnreachableError("the joint path leaves the branch, or the chart")
        return maps_by_leg(self.problem, self.joint_map, q[begins])

    def postures_at(self, s: np.ndarray) -> np.ndarray:
        """Take postures, (S, n), at path coordinates, (S,); NaN where there are none."""
        path = self.joint_path
        return self.joint_map.postures(interpolate_columns(s, path[:, 0], path))

    @property
    def in_chart(self) -> bool:
        """Whether the coordinates are a chart's."""
        return isinstance(self.joint_map, ChartMap)


@dataclass(frozen=True, eq=False, repr=False)
class Candidate(Summary):
    """What came of an initial guess: first a solved program, then, once it is finished, a verified motion.

    Attributes
    ----------
    redundant_joints : tuple of str
        None where the coordinates are a chart's.
    branch : str
        Label of the branch, or ``chart``; empty where no joint path was found.
    origin : str
        See `InitialGuess`.
    solver : str
        Empty where nothing was solved.
    estimate : float
        See `InitialGuess`; a rough one.
    status : str
        In plain words.
    start : InitialGuess or None
        None where no joint path was found, and once the search is over.
    program : Program or None
        The first one that was solved; over the path, the one whose joint path was improved. None where there was none,
        and once the search is over.
    target : Program or None
        The program over all its knots; None over the path.
    is_over_path : bool
        Whether it is not solved over time: the joint path of `start` is the answer, and its estimate the end time.
    reports : tuple of SolverReport
        Of all solves: with one or two branch margins, on ever finer meshes, then of the refinement rounds.
    coarse : float
        End time at the first collocation points, s; infinite without a motion.
    adapted : float
        End time over the knots that were reached, before refinement, s; infinite while it is not finished.
    to_beat : float
        An `adapted` end time, s, from which on it is not refined: another motion is as fast.
    refined : SolvedProgram or None
        The last program, its answer and its multipliers; None while it is not finished.
    trajectory : Trajectory or None
        None while it is not finished, and where none came out.
    verification : Verification or None
        Of the trajectory.
    not_completed : str
        What the time, or a solve that failed, left undone, in words; empty where nothing.

    Examples
    --------
    >>> import brachis
    >>> result = brachis.plan(brachis.examples.scara_line, redundant_joints=["j1"], effort="single", intervals=8)
    >>> result.candidates[0].status
    'verified'
    """

    redundant_joints: tuple[str, ...]
    branch: str
    origin: str
    solver: str
    estimate: float
    status: str
    start: InitialGuess | None = None
    program: Program | None = None
    target: Program | None = None
    is_over_path: bool = False
    reports: tuple[SolverReport, ...] = ()
    coarse: float = np.inf
    adapted: float = np.inf
    to_beat: float = np.inf
    refined: SolvedProgram | None = None
    trajectory: Trajectory | None = None
    verification: Verification | None = None
    not_completed: str = ""

    @classmethod
    def of(cls, start: InitialGuess, status: str, **more: Any) -> Candidate:
        """Begin with an initial guess."""
        names = start.joint_map.redundant_joints
        branch = start.joint_map.branch_label
        known = (start.origin, start.solver, start.estimate)
        return cls(names, branch, *known, status, start, **more)

    @property
    def usable(self) -> bool:
        """True where there is a first plan that can be finished."""
        if self.program is None:
            return False
        return self.is_over_path or self.reports[-1].status.usable

    @property
    def in_chart(self) -> bool:
        """Whether it is planned in a chart."""
        return self.start is not None and self.start.in_chart

    @property
    def keeps_knots(self) -> bool:
        """True where the finished plan has the same knots, so that its end time cannot be shorter."""
        if self.start is None or self.program is None or self.target is None:
            return False
        spline = self.start.problem.task.spline
        is_given = spline.knots != "free" and spline.intervals != "auto"
        return is_given and self.program.intervals == self.target.intervals

    @property
    def t_end(self) -> float:
        """End time of the trajectory, s; infinite without one."""
        return np.inf if self.trajectory is None else self.trajectory.t_end

    @property
    def verified(self) -> bool:
        """Whether there is a trajectory that passed every check."""
        return self.verification is not None and self.verification.passed

    @property
    def is_settled(self) -> bool:
        """Whether it is verified, or fails only at what the task wants checked and not kept."""
        if self.verification is None:
            return False
        return all(each.passed or not each.is_kept for each in self.verification.checks)

    @property
    def refinement_rounds(self) -> int:
        """How many of the solves were refinement rounds."""
        return 0 if self.refined is None else len(self.refined.reports) - 1

    @property
    def violation(self) -> float:
        """Largest violation of a limit on the dense grid, as a fraction; infinite while it is not refined."""
        return np.inf if self.refined is None else self.refined.violation

    @property
    def time_scaled(self) -> float:
        """Factor by which the end time was lengthened at the very end."""
        return 1.0 if self.refined is None else self.refined.time_scaled

    @property
    def collocation_points(self) -> int:
        """Number of collocation points of the last program."""
        return 0 if self.refined is None else self.refined.program.collocation_points

    def describe(self) -> str:
        """Say in a line what came of it, and how long its motion takes if there is one."""
        time = "" if self.trajectory is None else f"t_E = {self.t_end:.4f} s, "
        return f"{self.solver}: {time}{self.status}"

    def without_programs(self) -> Candidate:
        """Return the candidate without what only the search needs."""
        return replace(self, start=None, program=None, target=None, to_beat=np.inf)

    def summary(self) -> Mapping[str, object]:
        """Return what is shown: what was tried and what came of it."""
        joints = coordinates(self.redundant_joints, self.branch)
        shown = {"joints": joints, "origin": self.origin}
        if self.trajectory is not None:
            shown["t_end"] = f"{self.t_end:.4f} s"
        return {**shown, "status": self.status}

    def to_dict(self) -> dict[str, Any]:
        """Return plain data for JSON."""
        names = ("branch", "origin", "solver", "estimate", "coarse", "t_end", "status")
        plain = {name: getattr(self, name) for name in (*names, "verified")}
        return {"redundant_joints": list(self.redundant_joints), **plain}


def refine_and_verify(
    candidate: Candidate,
    program: Program,
    reports: tuple[SolverReport, ...],
    solve: Solve,
    options: RefinementOptions,
) -> Candidate:
    """Refine and verify; only verify where the time is up.

    Parameters
    ----------
    candidate : Candidate
        Of which the program is made.
    program : Program
    reports : tuple of SolverReport
        Of all solves so far; the last one is the program's.
    solve : callable
        ``solve(program, x)`` returns a `SolverReport`.
    options : RefinementOptions

    Returns
    -------
    Candidate
    """
    refined = refine(program, reports[-1], solve, options)
    return verify(candidate, reports[:-1], refined)


def verify(
    candidate: Candidate, before: tuple[SolverReport, ...], refined: SolvedProgram
) -> Candidate:
    """Make the trajectory of a refined program and verify it.

    Parameters
    ----------
    candidate : Candidate
    before : tuple of SolverReport
        Of earlier solves.
    refined : SolvedProgram
    """
    start = candidate.start
    assert start is not None
    problem = start.problem
    trajectory = None
    verification = None
    if refined.converged and np.isfinite(refined.violation):
        with contextlib.suppress(UnreachableError):
            trajectory = extract_trajectory(problem.task, refined.program, refined.x)
            verification = verify_trajectory(trajectory, own_limits=problem.user_limits)
    phase = refined.program.phases[0]
    tolerance = problem.task.refinement.tolerance
    return replace(
        candidate,
        redundant_joints=phase.joint_map.redundant_joints,
        branch=phase.joint_map.branch_label,
        status=_in_words(refined, verification, tolerance),
        reports=(*before, *refined.reports),
        refined=refined,
        trajectory=trajectory,
        verification=verification,
    )


def _in_words(
    refined: SolvedProgram, verification: Verification | None, tolerance: float
) -> str:
    """Say what became of a refined program, whose limits may be exceeded by a fraction `tolerance`."""
    last = refined.report
    if verification is not None and verification.passed:
        return "verified"
    if not refined.converged:
        return f"{last.solver}: {last.status.value}"
    if not np.isfinite(refined.violation):
        return f"{last.solver}: the motion leaves the branch, or the chart, between collocation points"
    if refined.violation > tolerance:
        found = f"limits exceeded by {100.0 * refined.violation:.2g} %"
    elif verification is None:
        found = "too sharp for a trajectory"
    else:
        found = "the verification fails"
    rounds = write_count(len(refined.reports) - 1, "refinement round")
    return f"{last.solver}: t_E = {refined.t_end:.4f} s after {rounds}, {found}"
