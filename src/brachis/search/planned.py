"""The data of a plan's result: the trajectory, its verification, and how they were found. Methods are in `result`."""

from __future__ import annotations

import os
from collections.abc import Mapping
from dataclasses import asdict, dataclass, field, replace
from functools import cached_property
from typing import TYPE_CHECKING, Any

from brachis.common.arrays import clear_rounding
from brachis.common.summary import Summary
from brachis.common.threads import use_one_thread
from brachis.explain import Sensitivities, explain_motion
from brachis.optimise.backends import SolverReport
from brachis.robot.plausibility import Issue
from brachis.search.least_motion import LeastMotion
from brachis.search.stages import Candidate, FinishedCandidate
from brachis.task import FitReport, Task
from brachis.timing import TimingGap
from brachis.trajectory import Samples, Trajectory, settings_in_use
from brachis.trajectory.sensitivities import Gradient
from brachis.verify import Verification

if TYPE_CHECKING:
    import pandas as pd


def describe_motion(
    trajectory: Trajectory, verification: Verification
) -> dict[str, Any]:
    """Return the figures of a verified motion as plain data for JSON."""
    return {
        "t_end": trajectory.t_end,
        "redundant_joints": list(trajectory.redundant_joints),
        "branch": trajectory.branch,
        "phases": [phase.to_dict() for phase in trajectory.phases],
        "parts": [part.to_dict() for part in trajectory.parts],
        "events": [asdict(event) for event in trajectory.events],
        "joint_names": list(trajectory.joint_names),
        "verified": verification.passed,
        "worst_ratio": verification.worst_ratio,
        "path_error": verification.path_error,
    }


@dataclass(frozen=True, repr=False)
class PlannedMotion(Summary):
    """The data of a plan's result, without the methods that plot or view it; see `brachis.Result`."""

    task: Task
    trajectory: Trajectory
    verification: Verification
    family: str
    candidate: FinishedCandidate
    least_motion: LeastMotion | None = None
    timing: dict[str, float] = field(default_factory=dict)
    candidates: tuple[Candidate, ...] = ()
    interrupted: bool = False
    not_completed: tuple[str, ...] = ()
    warnings: tuple[Issue, ...] = ()
    timing_gap: TimingGap | None = None

    def sample(self, dt: float, *, last: str = "exact") -> Samples:
        """Sample the trajectory every `dt` seconds, as `Trajectory.sample` does."""
        return self.trajectory.sample(dt, last=last)

    def save(self, path: str | os.PathLike[str]) -> None:
        """Write the trajectory and its sensitivities to an npz file, which `Trajectory.load` reads."""
        self.explained_trajectory.save(path)

    @property
    def explained_trajectory(self) -> Trajectory:
        """The trajectory, with the sensitivities that tell what holds it back."""
        return replace(self.trajectory, sensitivities=self.sensitivities)

    @cached_property
    def sensitivities(self) -> Sensitivities:
        """The time that limits and other demands of the task cost, computed from the multipliers of the plan."""
        candidate = self.candidate
        with use_one_thread():
            return explain_motion(
                candidate.problem, candidate.refined, candidate.optimum
            )

    @property
    def gradients(self) -> tuple[Gradient, ...]:
        """Derivatives of the end time with respect to placements, payload and process speeds."""
        return self.sensitivities.gradients

    def to_dataframe(self, dt: float) -> pd.DataFrame:
        """Return a pandas table with a row every `dt` seconds."""
        return self.trajectory.to_dataframe(dt)

    def summary(self) -> Mapping[str, object]:
        """Return the figures shown to the user, by name."""
        report = self.solver_report
        verified = sum(candidate.verified for candidate in self.candidates)
        shown = {
            "verified": "yes" if self.verified else "NO",
            "worst ratio to a limit": f"{self.verification.worst_ratio:.5f}",
            "path error": f"{self.verification.path_error:.1e} m or rad",
            "solver": f"{report.solver}, {report.status.name.lower()}",
            "candidates": f"{len(self.candidates)}, {verified} verified",
            "planning time": f"{self.timing.get('total', 0.0):.2f} s (without imports)",
            "timing": "" if self.timing_gap is None else str(self.timing_gap),
            "not completed": "; ".join(self.not_completed),
            "warnings": "; ".join(remark.message for remark in self.warnings),
        }
        filled = {name: text for name, text in shown.items() if text}
        return {**self.trajectory.summary(), **filled}

    @property
    def t_end(self) -> float:
        """End time, s."""
        return self.trajectory.t_end

    @property
    def duration(self) -> float:
        """End time, s, under the name that other planners use."""
        return self.t_end

    @property
    def verified(self) -> bool:
        """Whether every check of the verification passed."""
        return self.verification.passed

    @property
    def fits(self) -> tuple[FitReport, ...]:
        """How close the path is to the points that it was fitted to, with one report for each file or array."""
        return self.task.fits

    @property
    def smoothing(self) -> str:
        """The outcome of the search for the smoothest motion, in words."""
        return "off" if self.least_motion is None else self.least_motion.status

    @property
    def solver_report(self) -> SolverReport:
        """The report of the solve that gave the trajectory."""
        return self.candidate.reports[-1]

    def to_dict(self) -> dict[str, Any]:
        """Return the figures of the plan as plain data for JSON."""
        candidate = self.candidate
        report = self.solver_report
        trajectory = self.trajectory
        start, end = clear_rounding(trajectory.position([0.0, self.t_end])).tolist()
        return {
            **describe_motion(trajectory, self.verification),
            "start_posture": start,
            "end_posture": end,
            "position_units": list(trajectory.robot.position_units),
            "family": self.family,
            "in_use": settings_in_use(trajectory),
            "status": report.status.name.lower(),
            "advice": report.status.value,
            "solver": report.solver,
            "iterations": sum(solve.iterations for solve in candidate.reports),
            "refinement_rounds": candidate.refinement_rounds,
            "collocation_points": candidate.collocation_points,
            "time_scaled": candidate.time_scaled,
            "least_motion": self.least_motion and self.least_motion.to_dict(),
            "fits": [fit.to_dict() for fit in self.fits],
            "candidates": [tried.to_dict() for tried in self.candidates],
            "interrupted": self.interrupted,
            "undone": list(self.not_completed),
            "warnings": [remark.to_dict() for remark in self.warnings],
            "wall_time_s": self.timing["total"],
            "timing_s": self.timing,
            "timing_gap": self.timing_gap and self.timing_gap.to_dict(),
            "margins": [asdict(margin) for margin in self.verification.margins],
        }
