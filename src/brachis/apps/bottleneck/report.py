"""The bottleneck report: what limits cost, when they are active, and the reference.

A saved motion has neither collocation points nor multipliers, so its problem is solved
again. Task, URDF, redundant joints and branch (or the chart), knots and control points
are saved. The problem is built over these knots, with the branch margin that the motion
keeps, solved from the saved control points and refined as in a plan. The start is an
optimum already, so this takes a few iterations and ends at the same one.
"""

from __future__ import annotations

import os
from collections.abc import Iterator
from dataclasses import dataclass
from html import escape
from typing import TYPE_CHECKING, Any

import numpy as np
from threadpoolctl import ThreadpoolController

from brachis.apps.bottleneck.check import SensitivityCheck, check_sensitivities
from brachis.apps.bottleneck.reference import (
    KnotCost,
    Reference,
    find_reference,
    knot_cost,
)
from brachis.apps.bottleneck.saturation import THRESHOLD, Saturation, saturations
from brachis.apps.bottleneck.sensitivities import Sensitivities, sensitivities
from brachis.apps.bottleneck.text import in_words
from brachis.common.deadline import Deadline
from brachis.common.summary import LINES
from brachis.errors import InputError, PlanningError, UnreachableError
from brachis.kinematics import (
    ChartMap,
    ChartRows,
    JointMap,
    JointSpaceMap,
    chart_around,
)
from brachis.limits import Role
from brachis.optimise.backends import solver_named
from brachis.optimise.improve import SolvedProgram
from brachis.optimise.phase import Motion
from brachis.optimise.program import Program
from brachis.optimise.refine import RefinementOptions, refine
from brachis.optimise.session import SolverSession
from brachis.optimise.transcription import program_of
from brachis.problem.problem import Problem, decompositions_of
from brachis.robot import ROLL_JOINT
from brachis.robot.task_map import JOINTS
from brachis.search.candidates import MARGINS
from brachis.trajectory import Trajectory

if TYPE_CHECKING:
    from brachis.search.planned import PlannedMotion

_SAME = 1e-3
"""End times that differ by a larger fraction, beyond what the task gave away, are those of two motions."""
_KEPT = 1e-4
"""A motion keeps a branch margin of which it falls short by less: solvers and interpolation are not exact."""


def solved_again(trajectory: Trajectory) -> SolvedProgram:
    """Solve the problem of a saved motion from where it ended.

    Parameters
    ----------
    trajectory : Trajectory
        As `brachis.plan` made it, or loaded.

    Returns
    -------
    SolvedProgram
        As ``result.candidate.refined`` of the plan.

    Raises
    ------
    InputError
        The closed form or the branch is not known here; see `brachis.plan`.
    PlanningError
        The motion is not an optimum of its problem: no solver of the task came back to it.
    """
    with ThreadpoolController().limit(
        limits=1, user_api="blas"
    ):  # as in `plan`: batches are small
        program, x = _problem(trajectory)
        found = list(_answers(program, x, trajectory))
    for refined in found:
        if _came_back(refined, trajectory):
            return refined
    ends = ", ".join(
        f"{refined.reports[-1].solver}: {refined.t_end:.6g} s" for refined in found
    )
    raise PlanningError(
        "solving again does not come back to the saved motion, so that its multipliers are not known",
        found=ends or "no answer",
        allowed=f"{trajectory.t_end:.6g} s",
        hint="Ask for the bottlenecks of the task itself",
    )


def _problem(trajectory: Trajectory) -> tuple[Program, np.ndarray]:
    """Lay the problem down over the saved knots; the motion is its point x."""
    joint_map: JointMap
    if len(trajectory.chart_rows):
        problem = Problem.of(trajectory.robot, trajectory.task)
        joint_map = _chart(problem, trajectory)
    elif trajectory.task.task_space == JOINTS:
        problem = Problem.of(trajectory.robot, trajectory.task)
        joint_map = JointSpaceMap(problem.robot, problem.path)
    else:
        names = tuple(
            name for name in trajectory.redundant_joints if name != ROLL_JOINT
        )
        task = trajectory.task.model_copy(
            update={"redundant_joints": names, "branch": trajectory.branch}
        )
        (decomposition,) = decompositions_of(Problem.of(trajectory.robot, task))
        problem = decomposition.problem
        joint_map = decomposition.joint_map(trajectory.q[0], decomposition.branches[0])
    program = program_of(problem, joint_map, np.unique(trajectory.knots))
    motion = Motion(
        trajectory.t_end, trajectory.knots, trajectory.degree, trajectory.control_points
    )
    x = program.variables_from([motion])
    for margin in MARGINS:
        program = program.with_margin(margin)
        if program.safeguard_slack(x) >= -_KEPT:
            break
    return program, x


def _chart(problem: Problem, trajectory: Trajectory) -> ChartMap:
    """Lay the saved chart around the saved motion."""
    rows = ChartRows.of_arrays(trajectory.chart_rows, trajectory.chart_knots)
    s = trajectory.path_coordinate(trajectory.times)
    return chart_around(problem.task_map, problem.path, s, trajectory.q, rows)


def _came_back(refined: SolvedProgram, trajectory: Trajectory) -> bool:
    """Tell whether an answer is the fastest motion that a saved one was made from."""
    slower = trajectory.t_end / refined.t_end - 1.0
    return -_SAME <= slower <= trajectory.task.search.slower + _SAME


def _answers(
    program: Program, x: np.ndarray, trajectory: Trajectory
) -> Iterator[SolvedProgram]:
    """Solve and refine with one backend after the other, until one comes back to the motion."""
    task = trajectory.task
    deadline = Deadline.after(task.search.time_limit)
    settings = task.refinement
    options = RefinementOptions(
        settings.tolerance, settings.density, settings.max_rounds, deadline
    )
    curved = any(limit.guarantee.is_mean for limit in program.limits)
    for backend in solver_named(task.solver.name, curved=curved):
        if deadline.passed:
            return
        solve = SolverSession.for_task(
            backend,
            task.solver,
            program.phases[0].joint_map,
            deadline,
            lambda _text: None,
        )
        try:
            refined = refine(program, solve(program, x), solve, options)
        except (ImportError, UnreachableError):
            continue
        if refined.converged:
            yield refined
            if _came_back(refined, trajectory):
                return


@dataclass(frozen=True, repr=False)
class BottleneckReport:
    """What holds a motion back.

    Attributes
    ----------
    t_end : float
        Of the motion, s.
    sensitivities : Sensitivities or None
        What every limit costs; None for a motion that was not planned.
    saturations : tuple of Saturation
        When every limit is active, those active longest first.
    knots : KnotCost or None
        What the knots cost; None where that is not known.
    check : SensitivityCheck or None
        The predictions beside solving again, where asked for.
    reference : Reference or None
        The best value known, where asked for and found.
    reference_sought : bool
        True where it was asked for.

    Examples
    --------
    >>> import brachis
    >>> result = brachis.plan(brachis.examples.scara_line, redundant_joints=["j1"], effort="single", intervals=8)
    >>> print(str(result.bottleneck()).splitlines()[0])
    10 % more torque at j1 (1 Nm) saves 3.4 % (87 ms)
    """

    t_end: float
    sensitivities: Sensitivities | None
    saturations: tuple[Saturation, ...]
    knots: KnotCost | None = None
    check: SensitivityCheck | None = None
    reference: Reference | None = None
    reference_sought: bool = False

    def __str__(self) -> str:
        """Say all in plain words."""
        return self.text()

    def text(self, *, degrees: bool = False) -> str:
        """Say all in plain words, angles in degrees where asked for."""
        return "\n".join(in_words(**vars(self), degrees=degrees))

    def __repr__(self) -> str:
        """Say what there is room for on a screen."""
        lines = str(self).split("\n")
        return "\n".join([*lines[:LINES], "..."] if len(lines) > LINES else lines)

    def _repr_html_(self) -> str:
        """Say all in plain words in a notebook."""
        return f"<pre>{escape(str(self))}</pre>"

    def to_dict(self) -> dict[str, Any]:
        """Return the figures as plain data for JSON."""
        return {
            "t_end_s": self.t_end,
            "sensitivities": self.sensitivities and self.sensitivities.to_dict(),
            "active_from_ratio": THRESHOLD,
            "saturations": [entry.to_dict() for entry in self.saturations],
            "knots": self.knots and self.knots.to_dict(),
            "check": self.check and self.check.to_dict(),
            "reference": self.reference and self.reference.to_dict(),
        }


def report(
    motion: PlannedMotion | Trajectory | str | os.PathLike[str],
    *,
    check: bool = False,
    reference: bool = False,
) -> BottleneckReport:
    """Find out what holds a planned motion back.

    Parameters
    ----------
    motion : Result, Trajectory or path
        Of `brachis.plan`; or a trajectory, a loaded one for example, or its file, whose problem is solved again
        (`solved_again`).
    check : bool, optional
        Solve again with every limit raised by 1 % and compare with the multipliers' predictions.
    reference : bool, optional
        Plan again with discontinuous torque allowed on a fine mesh: the best value known, not a proven bound.

    Returns
    -------
    BottleneckReport

    Raises
    ------
    InputError
        The result was made without keeping its solved program, or a trajectory's closed form is not known here.
    PlanningError
        A trajectory is not an optimum of its problem; or, with `check`, no solver could solve the problem again.

    Examples
    --------
    >>> import brachis
    >>> result = brachis.plan(brachis.examples.scara_line, redundant_joints=["j1"], effort="single", intervals=8)
    >>> found = brachis.bottleneck.report(result.trajectory)  # as of a loaded one
    >>> [sensitivity.label.subject for sensitivity in found.sensitivities.limits][0]
    'j1'
    """
    if isinstance(motion, str | os.PathLike):
        motion = Trajectory.load(motion)
    if isinstance(motion, Trajectory) and motion.recovered is not None:
        if check or reference:
            hint = "brachis compare plans the same path; ask for the bottlenecks of that plan"
            problem = "the motion was not planned: nothing of it can be solved again"
            raise InputError(problem, where=motion.recovered.source, hint=hint)
        return BottleneckReport(motion.t_end, None, saturations(motion))
    if isinstance(motion, Trajectory):
        trajectory = motion
        refined = solved_again(motion)
    elif motion.candidate.refined is None:
        raise InputError(
            "the result holds no solved problem",
            where="result",
            allowed="a result of brachis.plan",
        )
    else:
        trajectory = motion.trajectory
        refined = motion.candidate.refined
    found = sensitivities(refined)
    tolerance = trajectory.task.refinement.tolerance
    limits = [
        limit for limit in refined.program.limits if limit.role is not Role.SAFEGUARD
    ]
    return BottleneckReport(
        t_end=trajectory.t_end,
        sensitivities=found,
        saturations=saturations(trajectory, limits),
        knots=knot_cost(trajectory, limits, refined.t_end),
        check=check_sensitivities(refined, found) if check else None,
        reference=find_reference(refined, tolerance=tolerance) if reference else None,
        reference_sought=reference,
    )
