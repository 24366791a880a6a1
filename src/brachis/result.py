"""What a plan gives: trajectory, verification, and how they came about."""

from __future__ import annotations

from dataclasses import asdict, dataclass, field
from typing import Any

from brachis.plausibility import Remark
from brachis.refine import Refined
from brachis.solvers import SolverReport
from brachis.task import Task
from brachis.trajectory import Trajectory
from brachis.verify import Verification


@dataclass(frozen=True)
class Attempt:
    """One initial guess with one solver.

    Attributes
    ----------
    solver : str
    guess : int
        Number of the initial guess.
    reports : tuple of SolverReport
        Of all solves: with ever smaller branch margins, then of the refinement rounds.
    refinement_rounds : int
        How many of them were refinement rounds.
    violation : float
        Largest violation of a limit on the dense grid, as a fraction.
    time_scaled : float
        Factor by which the end time was lengthened at the very end.
    collocation_points : int
    outcome : str
        In plain words.
    refined : Refined or None
        The last program, its answer and its multipliers; None where nothing was solved.
    undone : str
        What the time, or a solve that failed, left undone, in words; empty where nothing.
    """

    solver: str
    guess: int
    reports: tuple[SolverReport, ...]
    refinement_rounds: int
    violation: float
    time_scaled: float
    collocation_points: int
    outcome: str
    refined: Refined | None = None
    undone: str = ""


@dataclass(frozen=True)
class Candidate:
    """One way to plan the motion that the search looked at.

    Attributes
    ----------
    redundant_joints : tuple of str
    branch : str
        Label of the branch; empty where no course was found.
    origin : str
        Where the initial guess came from, for example ``lattice 2``.
    solver : str
        Empty where nothing was solved.
    estimate : float
        Least time along the initial course from the phase plane, s; a rough one.
    coarse : float
        End time at the first collocation points, s; infinite where there is none.
    t_end : float
        End time when refined, s; infinite where it was not.
    status : str
        In plain words.
    verified : bool
    """

    redundant_joints: tuple[str, ...]
    branch: str
    origin: str
    solver: str
    estimate: float
    coarse: float
    t_end: float
    status: str
    verified: bool = False

    def to_dict(self) -> dict[str, Any]:
        """Return plain data for JSON."""
        return {**asdict(self), "redundant_joints": list(self.redundant_joints)}


@dataclass(frozen=True)
class Result:
    """What a plan gives: trajectory, verification, and how they came about.

    Attributes
    ----------
    task : Task
        All that was asked, with the robot's settings and all defaults; ``plan(None, result.task)`` repeats the plan.
    trajectory : Trajectory
    verification : Verification
    family : str
        Family of the closed form.
    attempts : tuple of Attempt
        In the order in which they were made.
    chosen : int
        Index of the attempt that gave the trajectory.
    timing : dict of str to float
        Wall time of every stage, s.
    candidates : tuple of Candidate
        All that the search looked at, the fastest verified one first.
    interrupted : bool
        True where Ctrl-C or ``search.time_limit`` ended the search: a faster motion may have been missed.
    undone : tuple of str
        What was left undone, in plain words.
    warnings : tuple of Remark
        What of robot, task and motion is hardly meant.
    """

    task: Task
    trajectory: Trajectory
    verification: Verification
    family: str
    attempts: tuple[Attempt, ...]
    chosen: int
    timing: dict[str, float] = field(default_factory=dict)
    candidates: tuple[Candidate, ...] = ()
    interrupted: bool = False
    undone: tuple[str, ...] = ()
    warnings: tuple[Remark, ...] = ()

    @property
    def t_end(self) -> float:
        """End time, s."""
        return self.trajectory.t_end

    @property
    def verified(self) -> bool:
        """True where every check of the verification passed."""
        return self.verification.passed

    @property
    def attempt(self) -> Attempt:
        """The attempt that gave the trajectory."""
        return self.attempts[self.chosen]

    @property
    def report(self) -> SolverReport:
        """Report of the solve that gave the trajectory."""
        return self.attempt.reports[-1]

    def to_dict(self) -> dict[str, Any]:
        """Return the figures of the plan as plain data for JSON."""
        last = self.attempt
        return {
            "t_end": self.t_end,
            "redundant_joints": list(self.trajectory.redundant_joints),
            "branch": self.trajectory.branch,
            "start_posture": self.trajectory.position(0.0).tolist(),
            "end_posture": self.trajectory.position(self.t_end).tolist(),
            "position_units": list(self.trajectory.robot.position_units),
            "family": self.family,
            "status": self.report.status.name.lower(),
            "advice": self.report.status.value,
            "solver": self.report.solver,
            "iterations": sum(report.iterations for report in last.reports),
            "refinement_rounds": last.refinement_rounds,
            "collocation_points": last.collocation_points,
            "time_scaled": last.time_scaled,
            "attempts": [attempt.outcome for attempt in self.attempts],
            "candidates": [candidate.to_dict() for candidate in self.candidates],
            "interrupted": self.interrupted,
            "undone": list(self.undone),
            "warnings": [remark.to_dict() for remark in self.warnings],
            "wall_time_s": self.timing["total"],
            "timing_s": self.timing,
            "verified": self.verified,
            "worst_ratio": self.verification.worst_ratio,
            "path_error": self.verification.path_error,
            "joint_names": list(self.trajectory.joint_names),
        }
