"""The stages of a search, each with a frozen type: initial guess, candidate, ranked candidate, finished candidate.

An `InitialGuess` is a joint path. Every attempt to plan from a guess is a `Candidate`, even if the attempt fails. A
candidate whose joint path was improved is a `RankedCandidate`. A candidate with a motion that was refined and then
checked by the verification, whether it passed or not, is a `FinishedCandidate`.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, fields, replace
from typing import Any

import numpy as np

from brachis.common.arrays import cut, interpolate_columns
from brachis.common.summary import Summary
from brachis.errors import UnreachableError
from brachis.kinematics import CHART, ChartMap, ClosedFormMap, JointMap, JointSpaceMap
from brachis.optimise.backends import SolverReport
from brachis.optimise.improve import SolvedProgram
from brachis.optimise.program import Program
from brachis.optimise.transcription import maps_by_leg
from brachis.problem.chain import ProblemChain
from brachis.problem.problem import Problem
from brachis.trajectory import Trajectory
from brachis.verify import Verification

NOT_TRIED = "not tried: the search ended"
"""Status of a candidate for which there was no time."""
RANKED = "not finished: ranked by the time along its joint path"
"""Status of a candidate that was not finished."""
SLOW = "not refined: no faster than another over as many knots"
"""Status of a candidate that does not beat the best one before refinement."""
NO_TIMING = "the limits allow no timing"
"""Status of a candidate whose joint path cannot be followed within the limits."""
SearchMap = ClosedFormMap | ChartMap | JointSpaceMap
"""Joint maps along a path."""


def coordinates(redundant_joints: Sequence[str], branch: str) -> str:
    """Name the coordinates, besides s, of a planned motion: redundant joints, coordinates of a chart, or none."""
    return ", ".join(redundant_joints) or (CHART if branch == CHART else "none")


@dataclass(frozen=True, eq=False, repr=False)
class InitialGuess(Summary):
    """A joint path from which a plan is begun.

    Attributes
    ----------
    problem : Problem
    joint_map : ClosedFormMap, ChartMap or JointSpaceMap
        Combination of robot, path and coordinates, for a motion that begins at, or close to, its start posture.
    joint_path : (S, 1 + r) ndarray
        Successive values of the map's curves: s and the redundant joints, or s and the chart's sigma.
    estimate : float
        Least time along the joint path from the phase plane, s; infinite if unknown.
    origin : str
        Where the guess comes from, in plain words, for example ``lattice 2``.
    family : str
        Family of the closed form; ``chart`` or ``path of joints`` without one.
    solver : str
        The solver that plans from the guess; empty while no solver is chosen.
    durations : tuple of float or None
        Duration of every leg, s, if the joint path's values are those of a motion: equally many for each leg, at even
        times. None otherwise.
    is_improved : bool
        Whether the joint path is roughly a local optimum for the limits that the phase plane covers.
    """

    problem: Problem
    joint_map: SearchMap
    joint_path: np.ndarray
    estimate: float
    origin: str
    family: str
    solver: str = ""
    durations: tuple[float, ...] | None = None
    is_improved: bool = False

    @property
    def alone(self) -> tuple[InitialGuess, ...]:
        """The guesses of single tasks of which the guess consists."""
        return (self,)

    @property
    def legs(self) -> list[np.ndarray]:
        """The parts of the joint path on the legs, (S, 1 + r) each."""
        legs = self.problem.legs
        if self.durations is not None or len(legs) == 1:
            return np.split(self.joint_path, len(legs))
        s = self.joint_path[:, 0]
        curves_by_leg = []
        for leg in legs:
            stations = cut(s, leg.begin, leg.end)
            curves_by_leg.append(interpolate_columns(stations, s, self.joint_path))
        return curves_by_leg

    def maps_by_leg(self) -> list[JointMap]:
        """Return the joint map of every leg; raise UnreachableError if the joint path leaves it."""
        legs = self.legs
        if len(legs) == 1:
            return [self.joint_map]
        q = self.joint_map.postures(np.concatenate(legs))
        begins = np.cumsum([0, *(len(curves) for curves in legs[:-1])])
        if not np.isfinite(q).all():
            raise UnreachableError("the joint path leaves the branch, or the chart")
        return maps_by_leg(self.problem, self.joint_map, q[begins])

    def with_legs(self, legs: Sequence[np.ndarray], time: float) -> InitialGuess:
        """Return the guess with improved joint paths of its legs, (S, 1 + r) each, and the time of all legs, s."""
        curves = np.concatenate(legs)
        grows = np.append(True, np.diff(curves[:, 0]) > 0.0)
        return replace(
            self,
            joint_path=curves[grows],
            estimate=time + self.problem.dwell_time,
            durations=None,
            is_improved=True,
        )

    def postures_at(self, s: np.ndarray) -> np.ndarray:
        """Return postures, (S, n), at path coordinates, (S,); NaN where none exists."""
        path = self.joint_path
        return self.joint_map.postures(interpolate_columns(s, path[:, 0], path))

    @property
    def in_chart(self) -> bool:
        """Whether the coordinates are those of a chart."""
        return isinstance(self.joint_map, ChartMap)


@dataclass(frozen=True, eq=False, repr=False)
class ChainGuess(InitialGuess):
    """Guesses of the parts of a `ProblemChain`.

    Attributes
    ----------
    parts : tuple of InitialGuess
    """

    parts: tuple[InitialGuess, ...] = field(kw_only=True)

    @classmethod
    def of_parts(
        cls, problem: ProblemChain, parts: Sequence[InitialGuess], estimate: float
    ) -> ChainGuess:
        """Combine guesses of the parts; the joint map is that with the most redundant curves."""
        most = max(parts, key=lambda part: part.joint_map.r)
        origin = "; ".join(part.origin for part in parts)
        known = (problem, most.joint_map, np.empty((0, 1)), estimate, origin)
        return cls(*known, most.family, most.solver, parts=tuple(parts))

    @property
    def alone(self) -> tuple[InitialGuess, ...]:
        """The guesses of the parts."""
        return self.parts

    @property
    def legs(self) -> list[np.ndarray]:
        """The joint paths of the legs of all parts."""
        return [curves for part in self.parts for curves in part.legs]

    def maps_by_leg(self) -> list[JointMap]:
        """Return the joint maps of the legs of all parts."""
        return [joint_map for part in self.parts for joint_map in part.maps_by_leg()]

    def with_legs(self, legs: Sequence[np.ndarray], time: float) -> ChainGuess:
        """Return the guess with improved joint paths of its legs."""
        parts = []
        first = 0
        for part in self.parts:
            last = first + len(part.problem.legs)
            parts.append(part.with_legs(legs[first:last], np.inf))
            first = last
        estimate = time + self.problem.dwell_time
        return replace(self, parts=tuple(parts), estimate=estimate, is_improved=True)

    def postures_at(self, s: np.ndarray) -> np.ndarray:
        """Return the postures of all parts side by side, (S, sum of n), at path coordinates, (S,), of each part."""
        return np.hstack([part.postures_at(s) for part in self.parts])

    @property
    def in_chart(self) -> bool:
        """False: no chart is laid anew for the whole."""
        return False


@dataclass(frozen=True, eq=False, repr=False, kw_only=True)
class Candidate(Summary):
    """An attempt to find a motion, and its outcome.

    Attributes
    ----------
    redundant_joints : tuple of str
        Redundant joints; empty if no joint is chosen, as in most charts.
    branch : str
        Label of the branch, or ``chart``; empty if no joint path was found.
    origin : str
        See `InitialGuess`.
    solver : str
        Name of the solver; empty if nothing was solved.
    estimate : float
        See `InitialGuess`. Candidates are ranked by it.
    status : str
        Outcome in plain words.
    begun : float
        End time over the first knots, s; infinite if no other knots follow.
    adapted : float
        End time over all knots, before refinement, s; infinite if there was no such program.
    reports : tuple of SolverReport
        Reports of all solves: over the path, over time on ever finer meshes, then of the refinement rounds.

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
    begun: float = np.inf
    adapted: float = np.inf
    reports: tuple[SolverReport, ...] = ()

    @property
    def t_end(self) -> float:
        """End time of the trajectory, s; infinite if there is no trajectory."""
        return np.inf

    @property
    def verified(self) -> bool:
        """Whether there is a trajectory that passed every check."""
        return False

    @property
    def is_settled(self) -> bool:
        """Whether the candidate is verified, or fails only checks that the task wants to be reported, not enforced."""
        return False

    def describe(self) -> str:
        """Say in one line what the outcome is, and how long the motion takes if there is one."""
        time = f"t_E = {self.t_end:.4f} s, " if np.isfinite(self.t_end) else ""
        return f"{self.solver}: {time}{self.status}"

    def summary(self) -> Mapping[str, object]:
        """Return the texts shown to the user, by name: what was tried, and the outcome."""
        joints = coordinates(self.redundant_joints, self.branch)
        shown = {"joints": joints, "origin": self.origin}
        if np.isfinite(self.t_end):
            shown["t_end"] = f"{self.t_end:.4f} s"
        return {**shown, "status": self.status}

    def to_dict(self) -> dict[str, Any]:
        """Return plain data for JSON."""
        names = ("branch", "origin", "solver", "estimate", "t_end", "status")
        plain = {name: getattr(self, name) for name in (*names, "verified")}
        return {"redundant_joints": list(self.redundant_joints), **plain}

    def without_program(self) -> Candidate:
        """Return the candidate without the data that only the search needs."""
        return Candidate(**facts_of(self))


@dataclass(frozen=True)
class Marks:
    """End times, s, that a candidate has to beat; infinite while no motion is verified.

    Attributes
    ----------
    begun : float
        End time over the first knots. More knots shorten every motion by about the same amount.
    adapted : float
        End time over all knots. A motion that is no faster is not refined.
    """

    begun: float = np.inf
    adapted: float = np.inf

    def beat(self, candidate: Candidate) -> bool:
        """Tell whether a candidate is no faster over the same knots."""
        is_slow = self.begun <= candidate.begun < np.inf
        return is_slow or self.adapted <= candidate.adapted < np.inf


def faster(*candidates: Candidate) -> Candidate:
    """Return the fastest candidate, and settled ones before all others."""
    return min(
        candidates, key=lambda candidate: (not candidate.is_settled, candidate.t_end)
    )


def round_end_time(time: float) -> float:
    """Round an end time, so that digits that differ between processes do not decide."""
    return float(f"{time:.6g}")


def facts_of(candidate: Candidate) -> dict[str, Any]:
    """Return the fields that all candidates have, which are carried over from stage to stage."""
    names = (field.name for field in fields(Candidate))
    return {name: getattr(candidate, name) for name in names}


def name_coordinates(maps: Sequence[JointMap]) -> dict[str, Any]:
    """Name the redundant joints and the branches of joint maps; those of moves only if nothing else is planned."""
    chosen = [joint_map for joint_map in maps if not joint_map.is_move] or maps[:1]
    names = (name for joint_map in chosen for name in joint_map.redundant_joints)
    branches = dict.fromkeys(joint_map.branch_label for joint_map in chosen)
    return {
        "redundant_joints": tuple(dict.fromkeys(names)),
        "branch": "; ".join(branches),
    }


def begin_candidate(guess: InitialGuess, status: str) -> Candidate:
    """Return a candidate for an initial guess."""
    parts = guess.parts if isinstance(guess, ChainGuess) else (guess,)
    return Candidate(
        **name_coordinates([part.joint_map for part in parts]),
        origin=guess.origin,
        solver=guess.solver,
        estimate=guess.estimate,
        status=status,
    )


@dataclass(frozen=True, eq=False, repr=False, kw_only=True)
class RankedCandidate(Candidate):
    """A candidate whose joint path has been improved over the path, if possible; it may be finished later.

    Attributes
    ----------
    guess : InitialGuess
        Guess with the better joint path.
    program : Program
        Program of the guess's joint maps, over the given knots.
    not_completed : str
        What was left undone for lack of time or after a failed solve, in words; empty if nothing was.
    """

    guess: InitialGuess
    program: Program
    not_completed: str = ""

    @property
    def problem(self) -> Problem:
        """The problem that is planned."""
        return self.guess.problem

    @property
    def family(self) -> str:
        """Name of the closed form's family."""
        return self.guess.family


def rank(
    guess: InitialGuess, program: Program, reports: tuple[SolverReport, ...] = ()
) -> RankedCandidate:
    """Rank a guess by its estimate."""
    known = facts_of(begin_candidate(guess, RANKED))
    known["reports"] = reports
    return RankedCandidate(**known, guess=guess, program=program)


def fail(
    candidate: Candidate, status: str, reports: tuple[SolverReport, ...] = ()
) -> Candidate:
    """Return a candidate that failed, with the reason and the reports of further solves."""
    known = facts_of(candidate)
    known |= {"status": status, "reports": (*candidate.reports, *reports)}
    return Candidate(**known)


@dataclass(frozen=True, eq=False, repr=False, kw_only=True)
class FinishedCandidate(Candidate):
    """A candidate with a motion that the verification has checked.

    Attributes
    ----------
    problem : Problem
        The problem that was planned: that of the task, or a simpler one (see `widen_plan`).
    family : str
        Name of the closed form's family.
    refined : SolvedProgram
        The last program, and its solution.
    optimum : SolvedProgram
        The program whose multipliers tell what limits cost. This is the last one or, if splines were laid along the
        timing of a joint path, the program over time that improved this joint path. If `is_smoothed`, the fastest
        motion, which is not refined.
    trajectory : Trajectory
    verification : Verification
        Verification of the trajectory.
    not_completed : str
        See `RankedCandidate`.
    is_smoothed : bool
        Whether a smoother motion that is as fast as the optimum was looked for while it was planned.

    Examples
    --------
    >>> import brachis
    >>> result = brachis.plan(brachis.examples.scara_line, redundant_joints=["j1"], effort="single", intervals=8)
    >>> result.candidate.verified, result.candidate.branch
    (True, 'elbow_positive')
    """

    problem: Problem
    family: str
    refined: SolvedProgram
    optimum: SolvedProgram
    trajectory: Trajectory
    verification: Verification
    not_completed: str = ""
    is_smoothed: bool = False

    @property
    def t_end(self) -> float:
        """End time of the trajectory, s."""
        return self.trajectory.t_end

    @property
    def verified(self) -> bool:
        """Whether the trajectory passed every check."""
        return self.verification.passed

    @property
    def is_settled(self) -> bool:
        """Whether the candidate is verified, or fails only checks that the task wants to be reported, not enforced."""
        return all(
            check.passed or not check.is_kept for check in self.verification.checks
        )

    @property
    def refinement_rounds(self) -> int:
        """Number of solves that were refinement rounds."""
        return len(self.refined.reports) - 1

    @property
    def violation(self) -> float:
        """Largest violation of a limit on the dense grid, as a fraction."""
        return self.refined.violation

    @property
    def time_scaled(self) -> float:
        """Factor by which the end time was multiplied in the last step."""
        return self.refined.time_scaled

    @property
    def collocation_points(self) -> int:
        """Number of collocation points of the last program."""
        return self.refined.program.collocation_points

    def without_program(self) -> FinishedCandidate:
        """Return the candidate unchanged: its program is part of the result."""
        return self


@dataclass(frozen=True)
class SearchOutcome:
    """Outcome of a search that found a motion; see `brachis.search.portfolio.Search`.

    Attributes
    ----------
    best : FinishedCandidate
    candidates : tuple of Candidate
        All candidates of the search, the fastest verified one first.
    interrupted : bool
    not_completed : tuple of str
        What was left undone, in plain words.
    """

    best: FinishedCandidate
    candidates: tuple[Candidate, ...]
    interrupted: bool
    not_completed: tuple[str, ...]
