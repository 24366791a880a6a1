"""What the search tries: starts, and the attempts that are made from them."""

from __future__ import annotations

import dataclasses
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from brachis.common.summary import Summary
from brachis.errors import write_count
from brachis.kinematics import CHART, ChartMap, ClosedFormMap, JointSpaceMap
from brachis.optimise.backends import SolverReport
from brachis.optimise.improve import SolvedProgram
from brachis.optimise.program import Program
from brachis.problem.problem import Problem
from brachis.trajectory import Trajectory
from brachis.verify import Verification

PathMap = ClosedFormMap | ChartMap | JointSpaceMap
"""Joint maps along a path."""


def coordinates(redundant_joints: Sequence[str], branch: str) -> str:
    """Say in which coordinates a motion is planned beside s: redundant joints, a chart's own, or none."""
    return ", ".join(redundant_joints) or (CHART if branch == CHART else "none")


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
        Least time along the joint path from the phase plane, or of a quick solve, s; infinite where there is none.
    origin : str
        Where it is from, in plain words, for example ``lattice 2``.
    family : str
        Family of the closed form; ``chart`` or ``path of joints`` where there is none.
    solver : str
        The solver that plans from it; empty while none is chosen.
    timed : bool
        Whether the joint path's values are those of a motion, at even times.
    """

    problem: Problem
    joint_map: PathMap
    joint_path: np.ndarray
    estimate: float
    origin: str
    family: str
    solver: str = ""
    timed: bool = False

    @property
    def in_chart(self) -> bool:
        """Whether the coordinates are a chart's."""
        return isinstance(self.joint_map, ChartMap)

    def with_solver(self, name: str) -> InitialGuess:
        """Return the same start for a solver."""
        return dataclasses.replace(self, solver=name)


@dataclass(frozen=True, eq=False, repr=False)
class Candidate(Summary):
    """What came of a start: first a solved program, then, once it is finished, a verified motion.

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
    start : Start or None
        None where no joint path was found, and once the search is over.
    program : Program or None
        The first one that was solved; None where there was none, and once the search is over.
    target : Program or None
        The program over all its knots, where `program` has only some of them.
    reports : tuple of SolverReport
        Of all solves: with ever smaller branch margins, on ever finer meshes, then of the refinement rounds.
    coarse : float
        End time at the first collocation points, s; infinite where there is none.
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
    reports: tuple[SolverReport, ...] = ()
    coarse: float = np.inf
    refined: SolvedProgram | None = None
    trajectory: Trajectory | None = None
    verification: Verification | None = None
    not_completed: str = ""

    @classmethod
    def of(cls, start: InitialGuess, status: str, **more: Any) -> Candidate:
        """Begin an attempt."""
        joint_map = start.joint_map
        names = joint_map.redundant_joints
        branch = joint_map.branch_label
        return cls(
            names,
            branch,
            start.origin,
            start.solver,
            start.estimate,
            status,
            start,
            **more,
        )

    @property
    def usable(self) -> bool:
        """True where there is a first plan that can be finished."""
        return (
            self.program is not None
            and bool(self.reports)
            and self.reports[-1].status.usable
        )

    @property
    def in_chart(self) -> bool:
        """Whether it is planned in a chart."""
        return self.start is not None and self.start.in_chart

    @property
    def keeps_knots(self) -> bool:
        """True where the finished plan has the same knots, so that its end time is no shorter."""
        if self.start is None or self.program is None or self.target is None:
            return False
        spline = self.start.problem.task.spline
        return (
            spline.knots != "free"
            and spline.intervals != "auto"
            and self.program.intervals == self.target.intervals
        )

    @property
    def t_end(self) -> float:
        """End time of the trajectory, s; infinite where there is none."""
        return np.inf if self.trajectory is None else self.trajectory.t_end

    @property
    def verified(self) -> bool:
        """Whether there is a trajectory that passed every check."""
        return self.verification is not None and self.verification.passed

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

    def finished(
        self,
        *,
        reports: tuple[SolverReport, ...],
        refined: SolvedProgram,
        trajectory: Trajectory | None,
        verification: Verification | None,
        tolerance: float,
    ) -> Candidate:
        """Return the attempt with its motion, and with a status that says what became of it.

        Parameters
        ----------
        reports, refined, trajectory, verification
            See the attributes.
        tolerance : float
            Largest violation of a limit that is allowed, as a fraction of it.
        """
        last = refined.reports[-1]
        if verification is not None and verification.passed:
            status = "verified"
        elif not refined.converged:
            status = f"{last.solver}: {last.status.value}"
        elif not np.isfinite(refined.violation):
            status = f"{last.solver}: the motion leaves the branch, or the chart, between collocation points"
        else:
            if refined.violation > tolerance:
                found = f"limits exceeded by {100.0 * refined.violation:.2g} %"
            else:
                found = (
                    "too sharp for a trajectory"
                    if verification is None
                    else "the verification fails"
                )
            rounds = write_count(len(refined.reports) - 1, "refinement round")
            status = (
                f"{last.solver}: t_E = {refined.t_end:.4f} s after {rounds}, {found}"
            )
        (phase,) = refined.program.phases
        return dataclasses.replace(
            self,
            redundant_joints=phase.joint_map.redundant_joints,
            branch=phase.joint_map.branch_label,
            status=status,
            reports=reports,
            refined=refined,
            trajectory=trajectory,
            verification=verification,
        )

    def without_programs(self) -> Candidate:
        """Return the attempt without what only the search needs."""
        return dataclasses.replace(self, start=None, program=None, target=None)

    def summary(self) -> Mapping[str, object]:
        """Return what is shown: what was tried and what came of it."""
        tried = {
            "joints": coordinates(self.redundant_joints, self.branch),
            "origin": self.origin,
        }
        ended = {"t_end": f"{self.t_end:.4f} s"} if np.isfinite(self.t_end) else {}
        return {**tried, **ended, "status": self.status}

    def to_dict(self) -> dict[str, Any]:
        """Return plain data for JSON."""
        return {
            "redundant_joints": list(self.redundant_joints),
            "branch": self.branch,
            "origin": self.origin,
            "solver": self.solver,
            "estimate": self.estimate,
            "coarse": self.coarse,
            "t_end": self.t_end,
            "status": self.status,
            "verified": self.verified,
        }
