"""What a plan gives: trajectory, verification, and how they came about."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Any

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
        Of the first solve and every refinement round.
    excess : float
        Largest excess over a limit on the dense grid, as a fraction.
    stretched : float
        Factor by which the end time was lengthened at the very end.
    collocation_points : int
    outcome : str
        In plain words.
    """

    solver: str
    guess: int
    reports: tuple[SolverReport, ...]
    excess: float
    stretched: float
    collocation_points: int
    outcome: str


@dataclass(frozen=True)
class Result:
    """What a plan gives: trajectory, verification, and how they came about.

    Attributes
    ----------
    task : Task
        All that was asked, defaults spelled out; ``plan(result.task)`` repeats the plan.
    trajectory : Trajectory
    verification : Verification
    family : str
        Family of the closed form.
    attempts : tuple of Attempt
        The last one gave the trajectory.
    timing : dict of str to float
        Wall time of every stage, s.
    """

    task: Task
    trajectory: Trajectory
    verification: Verification
    family: str
    attempts: tuple[Attempt, ...]
    timing: dict[str, float] = field(default_factory=dict)

    @property
    def t_end(self) -> float:
        """End time, s."""
        return self.trajectory.t_end

    @property
    def verified(self) -> bool:
        """True where every check of the verification passed."""
        return self.verification.passed

    @property
    def report(self) -> SolverReport:
        """The last solve's report."""
        return self.attempts[-1].reports[-1]

    def to_dict(self) -> dict[str, Any]:
        """Return the figures of the plan as plain data for JSON."""
        last = self.attempts[-1]
        return {
            "t_end": self.t_end,
            "redundant_joints": list(self.trajectory.redundant_joints),
            "branch": self.trajectory.branch,
            "family": self.family,
            "status": self.report.status.name.lower(),
            "advice": self.report.status.value,
            "solver": self.report.solver,
            "iterations": sum(report.iterations for report in last.reports),
            "refinement_rounds": len(last.reports) - 1,
            "collocation_points": last.collocation_points,
            "stretched": last.stretched,
            "attempts": [attempt.outcome for attempt in self.attempts],
            "wall_time_s": self.timing["total"],
            "timing_s": self.timing,
            "verified": self.verified,
            "worst_ratio": self.verification.worst_ratio,
            "path_error": self.verification.path_error,
            "joint_names": list(self.trajectory.joint_names),
        }
