"""Solve changed programs, and keep the better motion each time.

A finer mesh, free knots, a different chart and different redundant joints are all changes of a solved program.
`improve` tries such changes in turn and returns a `SolvedProgram`.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass, field, replace
from functools import partial
from typing import Any

import numpy as np

from brachis.common.deadline import NEVER, Deadline
from brachis.common.progress import Iteration, Listener
from brachis.common.summary import Summary
from brachis.kinematics import ChartMap, JointMap
from brachis.optimise.backends import (
    NonlinearProgram,
    Progress,
    Solver,
    SolverOptions,
    SolverReport,
    SolveStatus,
    interior_solver,
    objective_at,
    residual,
)
from brachis.optimise.near_rows import NearRows, solve_near_rows, solve_near_values
from brachis.optimise.path_program import PathProgram
from brachis.optimise.program import Program
from brachis.problem.problem import Problem
from brachis.task import SolverSettings


@dataclass(frozen=True, repr=False)
class SolvedProgram(Summary):
    """A program and its solution, or the last attempt to solve it.

    Attributes
    ----------
    program : Program
    reports : tuple of SolverReport
        Reports of all solves that led to this program. The last report is that of `program`. Empty if nothing has been
        solved yet.
    not_completed : str
        Text that says what was not done because time ran out or a solve failed; empty if everything was done.
    violation : float
        Largest violation of a limit between the collocation points, as a fraction of the limit. Infinite if the closed
        form has no solution somewhere, NaN if the violation was not checked (see `refine`).
    time_scaled : float
        Factor by which refinement lengthened the motion as its last step.
    """

    program: Program
    reports: tuple[SolverReport, ...] = ()
    not_completed: str = ""
    violation: float = np.nan
    time_scaled: float = 1.0

    @property
    def report(self) -> SolverReport:
        """Report of the solve of `program` itself."""
        return self.reports[-1]

    @property
    def usable(self) -> bool:
        """Whether the solve of `program` itself ended with a motion."""
        return bool(self.reports) and self.report.status.usable

    @property
    def x(self) -> np.ndarray:
        """The solution, (v,), with its time multiplied by `time_scaled`."""
        return self.program.scale_time(self.report.x, self.time_scaled)

    @property
    def t_end(self) -> float:
        """End time of the solution, s."""
        return self.program.end_time(self.x)

    @property
    def converged(self) -> bool:
        """Whether the first solve succeeded. If so, `x` is a motion and not just an iterate."""
        return self.reports[0].status.usable


Solve = Callable[[Program, np.ndarray], SolverReport]
"""Function that solves a program from a point x, (v,)."""
Attempt = Callable[[Program, np.ndarray], SolvedProgram]
"""Function that solves a changed program from a point x, (v,), possibly with further changes."""
Change = Callable[[SolvedProgram], tuple[Program, np.ndarray] | str | None]
"""Function that turns the solved program kept so far into a new program and the point from which to solve it.

If no further change is worth trying, the function returns None, or a text that says what was not done.
"""


def improve(
    first: SolvedProgram,
    changes: Iterable[Change],
    attempt: Attempt,
    *,
    least_gain: float = -np.inf,
    go_on_above: float | None = -np.inf,
    judge: Callable[[SolvedProgram], float] | None = None,
    deadline: Deadline = NEVER,
    if_lost: str = "",
) -> SolvedProgram:
    """Try changes of a solved program in turn. Keep the better motion each time.

    Parameters
    ----------
    first : SolvedProgram
        The solved program to start with. Until a solve gives a motion, each attempt replaces the one before.
    changes : iterable of callable
        Functions, each called with the solved program kept so far.
    attempt : callable
        Function that solves the program that a change proposes; see `attempt_once`.
    least_gain : float, optional
        Fraction of the time by which a new motion must be shorter to be kept. By default every motion is kept.
    go_on_above : float or None, optional
        Gain, as a fraction of the time, above which the next change is tried. By default it is tried after every
        motion. With None, all changes are tried.
    judge : callable, optional
        Function that rates a solved program. A smaller number is better, and infinity means no motion. The default is
        the objective of a successful solve.
    deadline : Deadline, optional
        Deadline after which no change is tried.
    if_lost : str, optional
        Text that says what was not done, used if the last change gave no motion that is kept.

    Returns
    -------
    SolvedProgram
        The program that was kept, with the reports of all solves. Its own report comes last.
    """
    judge = judge or _objective
    incumbent = first
    best = judge(incumbent)
    not_completed = ""
    for change in changes:
        proposal = None if deadline.passed else change(incumbent)
        if proposal is None:
            break
        if isinstance(proposal, str):
            not_completed = proposal
            break
        tried = attempt(*proposal)
        value = judge(tried)
        gain = 1.0 - value / best  # NaN if neither is a motion
        reports = (*incumbent.reports, *tried.reports)
        was_usable = incumbent.usable
        if gain > least_gain or not was_usable:
            incumbent = replace(tried, reports=reports)
            best = value
        else:
            incumbent = replace(incumbent, reports=with_last(incumbent.report, reports))
        if was_usable and go_on_above is not None and not gain > go_on_above:
            not_completed = "" if tried.usable and gain > least_gain else if_lost
            break
    return replace(incumbent, not_completed=not_completed)


def _objective(solved: SolvedProgram) -> float:
    """Return the objective of a successful solve; infinity for any other solve."""
    return solved.report.objective if solved.usable else np.inf


def attempt_once(
    solve: Solve, program: Program, x: np.ndarray, *, accept_early_end: bool = False
) -> SolvedProgram:
    """Solve a program from x, (v,), once.

    Parameters
    ----------
    solve : callable
    program : Program
    x : (v,) ndarray
    accept_early_end : bool, optional
        Whether to accept a solve that ended early, if its motion is feasible and faster than the starting point.
    """
    report = solve(program, x)
    if accept_early_end:
        report = judge_early_end(report, program.end_time(x))
    return SolvedProgram(program, (report,))


def attempt_in_turn(
    solves: Sequence[Solve], program: Program, x: np.ndarray
) -> SolvedProgram:
    """Try several solves from x, (v,), in turn, until one of them gives a motion; see `attempt_once`."""
    reports: tuple[SolverReport, ...] = ()
    for solve in solves:
        tried = attempt_once(solve, program, x, accept_early_end=True)
        reports = (*reports, *tried.reports)
        if tried.usable:
            break
    return replace(tried, reports=reports)


_EARLY = (
    SolveStatus.ITERATION_LIMIT,
    SolveStatus.TIME_LIMIT,
    SolveStatus.STALLED,
    SolveStatus.FAILED,
)
"""Statuses of a solve that ended before it was finished. Even a solver that fails at the end may have made good
progress."""


def judge_early_end(report: SolverReport, before: float) -> SolverReport:
    """Mark a solve that ended early as acceptable if its motion is feasible and shorter than `before`, s."""
    is_better = report.feasible and report.objective < before
    if is_better and report.status in _EARLY:
        return replace(report, status=SolveStatus.ACCEPTABLE)
    return report


def keep_feasible(solved: SolvedProgram, x: np.ndarray) -> SolvedProgram:
    """If a solve ran out of time, keep its last point or its starting point x, whichever is feasible.

    Any motion within the limits is better than none. If both points are feasible, the faster one is kept.
    """
    report = solved.report
    if report.status is not SolveStatus.TIME_LIMIT:
        return solved
    program = solved.program
    begun = replace(
        report,
        x=x,
        objective=objective_at(program, x),
        violation=residual(program, x),
        multipliers=np.zeros_like(report.multipliers),
    )
    feasible = [candidate for candidate in (report, begun) if candidate.feasible]
    if not feasible:
        return solved
    fastest = min(feasible, key=lambda candidate: candidate.objective)
    accepted = replace(fastest, status=SolveStatus.ACCEPTABLE)
    return replace(
        solved,
        reports=(*solved.reports[:-1], accepted),
        not_completed="a solve ran out of time, so its motion may be far from the fastest",
    )


def with_last(
    last: SolverReport, reports: Sequence[SolverReport]
) -> tuple[SolverReport, ...]:
    """Return the reports with one of them, `last`, moved to the end."""
    return (*(report for report in reports if report is not last), last)


_ITERATIONS = 100
"""Maximum number of iterations per redundant joint that ``auto`` allows for a solve from one guess."""

_LARGE_PROGRAM = 1_000_000
"""Number of variables times rows of a program above which an interior-point method is at least as fast as other
methods, from a start that is not close to the solution."""
_NEAR_OPTIONS: dict[str, Any] = {"first_step": 0.1, "widening": 1e-6}
"""`SolverOptions` for solves from a motion that is nearly as fast as possible. At such a motion very many rows are
close to their bounds. With these options a small subproblem takes half as long."""
_PROGRESS = 1e-4
"""Gain over five iterates, as a fraction of the free time. If many motions are equally fast, a solve with less gain
ends."""

_NEARLY = 0.05
"""Permitted violation of a solution over the path, whose joint path is timed again. With 0.01, an active-set method
took 11 s for a program that an interior-point method had left with a violation of 0.03."""
_SAME = 1e-3
"""Relative tolerance for comparing the time of a starting point with that of the last solution."""


@dataclass(frozen=True)
class SolverSession:
    """A session with a backend, which solves one program after another. Call the session to solve a program.

    Attributes
    ----------
    backend : Solver
    options : SolverOptions
        Options of the solver. The time limit applies to each solve.
    deadline : Deadline
        Deadline of all solves together.
    progress : callable, optional
        Function called between iterations with their number and the objective.
    interior : Solver, optional
        Interior-point method that is tried first on large programs over the path, because they are sparse, and at a
        given speed with two or more redundant joints, because it ends at a smooth motion.
    """

    backend: Solver
    options: SolverOptions
    deadline: Deadline
    progress: Progress | None = None
    interior: Solver | None = None
    _last: list[SolverReport] = field(default_factory=list, repr=False)

    @classmethod
    def for_task(
        cls,
        backend: Solver,
        problem: Problem,
        joint_map: JointMap,
        deadline: Deadline,
        listener: Listener,
    ) -> SolverSession:
        """Create a session with the settings of the task's ``solver`` part.

        In charts, and where the time is given, many motions are equally fast. In these cases a solve ends after fewer
        iterates without gain.
        """
        settings = problem.task.solver
        has_time_law = any(problem.time_laws)
        iterations = settings.max_iterations
        default = SolverSettings.model_fields["max_iterations"].default
        if settings.name == "auto" and iterations == default:
            iterations = _ITERATIONS * max(joint_map.r, 1)
        limits = (settings.tolerance, iterations, settings.time_limit)
        options = SolverOptions(*limits, apart=has_time_law)
        if isinstance(joint_map, ChartMap) or (has_time_law and joint_map.r):
            options = replace(options, progress=_PROGRESS, patience=5)

        def progress(iteration: int, objective: float) -> None:
            listener(Iteration(f"iteration {iteration}, t_E = {objective:.4f} s"))

        interior = interior_solver(settings.name)
        return cls(backend, options, deadline, progress, interior)

    def over_path(self, options: SolverOptions) -> SolverSession:
        """Return the session for programs over the path, with different options.

        For these programs, the task can only lower the limits on iterations and time. It does not set the tolerance.
        """
        task = self.options
        path_options = replace(
            options,
            max_iterations=min(options.max_iterations, task.max_iterations),
            time_limit=min(options.time_limit, task.time_limit),
            apart=task.apart,
            acceptable=_NEARLY,
        )
        return replace(self, options=path_options)

    def choose_for_large(self, program: NonlinearProgram) -> Solver | None:
        """Return the solver that is tried first if a program is large; None if the program is not."""
        entries = len(program.x_lower) * len(program.lower)
        is_other = self.interior is not self.backend
        return self.interior if is_other and entries > _LARGE_PROGRAM else None

    def _choose_first(self, program: Program | PathProgram) -> Solver | None:
        """Return the interior-point method if it is tried first on a program; None if only the backend is tried."""
        if isinstance(program, PathProgram):
            return self.choose_for_large(program)
        is_other = self.interior is not self.backend
        return self.interior if is_other and _has_many_optima(program) else None

    def __call__(self, program: Program | PathProgram, x: np.ndarray) -> SolverReport:
        """Solve a program from the point x, (v,).

        If the last solve ended at x, this solve continues with the Hessian that the last one built up.
        """
        learnt = None
        if self._last and np.array_equal(self._last[0].x, x):
            learnt = self._last[0].learnt
        # The gain is relative to the free time, because only the free time can get shorter.
        share = program.free_time(x) / program.end_time(x) or 1.0
        progress = share * self.options.progress
        until = self.deadline.within(self.options.time_limit)

        def solve_with(
            backend: Solver, problem: NonlinearProgram, x: np.ndarray
        ) -> SolverReport:
            """Solve within the time that is left."""
            nonlocal learnt
            near_options = _NEAR_OPTIONS if isinstance(problem, NearRows) else {}
            options = replace(
                self.options,
                time_limit=until.left,
                progress=progress,
                learnt=learnt,
                **near_options,
            )
            report = backend.solve(problem, x, options, self.progress)
            if report.learnt is not None:
                learnt = report.learnt
            self._last[:] = [report]
            return replace(report, learnt=None)  # to keep results small

        first = self._choose_first(program)
        if first is not None:
            solve = partial(solve_with, first)
            # From a motion far from the optimum, a solve with the near values alone far exceeds limits of others.
            if isinstance(program, PathProgram) and self._goes_on(program, x):
                report = solve_near_values(program, x, solve)
            else:
                report = solve(program, x)
            # If a row cannot be met, this solver ends at its start. The other one still makes the motion faster.
            is_lost = report.status is SolveStatus.INFEASIBLE
            if not (is_lost and report.objective >= program.objective(x)):
                report = self._accept(report)
            if report.status.usable or until.passed:
                return report
        solve = partial(solve_with, self.backend)
        if self.backend.is_interior:
            return self._accept(solve(program, x))
        # Programs over the path or with free knots end at a different motion if some values are left out.
        is_fixed = isinstance(program, Program) and not program.has_free_knots
        is_answer = is_fixed and self._goes_on(program, x)
        # Without these rows, nothing limits a joint that has no near row. Its jerk reached 500 times the limit.
        kept_rows = program.third_order_rows if isinstance(program, Program) else ()
        report = solve_near_rows(
            program, x, solve, is_answer=is_answer, kept_rows=kept_rows
        )
        return self._accept(report)

    def _goes_on(self, program: Program | PathProgram, x: np.ndarray) -> bool:
        """Tell whether the last solve gave a motion, and the point x, (v,), is about as fast as that motion."""
        if not (self._last and self._last[0].status.usable):
            return False
        return bool(np.isclose(program.objective(x), self._last[0].objective, _SAME))

    def _accept(self, report: SolverReport) -> SolverReport:
        """Accept a solution that violates rows only slightly, however the solve ended."""
        if report.status.usable or report.violation > self.options.acceptable:
            return report
        return replace(report, status=SolveStatus.ACCEPTABLE)


def solves_in_turn(solve: Solve, program: Program) -> list[Solve]:
    """List the solve; for a session with an interior-point method, its two methods in their order for a program."""
    if not isinstance(solve, SolverSession) or solve.interior in (None, solve.backend):
        return [solve]
    backend = replace(solve, interior=None)
    interior = replace(backend, backend=solve.interior)
    return [interior, backend] if _has_many_optima(program) else [backend, interior]


def _has_many_optima(program: Program) -> bool:
    """Tell whether very many motions are equally fast: at a given speed, if two or more joints are redundant.

    An interior-point method then took 11 s, and an active-set method 33 s, on a rail with a free roll. With the rail
    alone redundant, it was the other way round: 29 s and 8 s.
    """
    r = max(phase.joint_map.r for phase in program.phases)
    return program.has_time_laws and r > 1
