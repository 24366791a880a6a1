"""The solver of a start: one backend with its options, until a deadline."""

from __future__ import annotations

import dataclasses
from dataclasses import dataclass

import numpy as np

from brachis.common.deadline import Deadline
from brachis.common.progress import Iteration, Listener
from brachis.kinematics import ChartMap, JointMap
from brachis.optimise.backends import (
    Progress,
    Solver,
    SolverOptions,
    SolverReport,
    SolveStatus,
)
from brachis.optimise.program import Program
from brachis.task import SolverSettings

_ITERATIONS = 100
"""Iterations for each redundant joint that ``auto`` grants a solver on one guess."""


@dataclass(frozen=True)
class SolverSession:
    """A backend that solves programs one after the other; call the session to solve.

    Attributes
    ----------
    backend : Solver
    options : SolverOptions
        The time limit holds for every single solve.
    deadline : Deadline
        Of all solves.
    progress : callable, optional
        Called between iterations with their number and the objective.
    acceptable : float
        An answer with no larger violation is usable, however the solve ended.
    """

    backend: Solver
    options: SolverOptions
    deadline: Deadline
    progress: Progress | None = None
    acceptable: float = -np.inf

    @classmethod
    def for_task(
        cls,
        backend: Solver,
        settings: SolverSettings,
        joint_map: JointMap,
        deadline: Deadline,
        listener: Listener,
    ) -> SolverSession:
        """Take the bounds from the task's ``solver`` part.

        In a chart many motions are equally fast, and no branch boundary slows a solve
        down. So a solve ends there after fewer iterates without gain.
        """
        iterations = settings.max_iterations
        default = SolverSettings.model_fields["max_iterations"].default
        if settings.name == "auto" and iterations == default:
            iterations = _ITERATIONS * max(joint_map.r, 1)
        options = SolverOptions(settings.tolerance, iterations, settings.time_limit)
        if isinstance(joint_map, ChartMap):
            options = dataclasses.replace(options, progress=1e-5, patience=10)

        def progress(iteration: int, objective: float) -> None:
            text = f"{backend.name}: iteration {iteration}, t_E = {objective:.4f} s"
            listener(Iteration(text))

        return cls(backend, options, deadline, progress)

    def __call__(self, program: Program, x: np.ndarray) -> SolverReport:
        """Solve a program from the point x, (v,)."""
        left = self.deadline.within(self.options.time_limit).left
        options = dataclasses.replace(self.options, time_limit=left)
        report = self.backend.solve(program, x, options, self.progress)
        if report.status.usable or report.violation > self.acceptable:
            return report
        return dataclasses.replace(report, status=SolveStatus.ACCEPTABLE)
