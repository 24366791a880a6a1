"""The work of the search, fit to be sent to other processes: a coarse plan, and its finish.

A coarse plan solves the NLP at the first collocation points. Finishing refines it and verifies the motion.
"""

from __future__ import annotations

import multiprocessing
import os
import warnings
from collections.abc import Callable, Generator, Sequence
from dataclasses import dataclass, replace
from typing import Any, TypeVar

import numpy as np
from threadpoolctl import ThreadpoolController

from brachis import interrupts
from brachis.deadline import Deadline
from brachis.mesh import adapt_mesh, coarsest
from brachis.nlp import Program
from brachis.nlp.guess import starting_point
from brachis.refine import RefinementOptions, Solve
from brachis.result import Attempt
from brachis.search.finishing import Motion, attempt_of, refined_until_verified
from brachis.search.motion import judge
from brachis.search.seeds import Seed
from brachis.search.solving import MARGINS, Listener, continued, solve_with
from brachis.setting import breaks_of, program_of
from brachis.solvers import SolverReport, SolveStatus, solver_named

NOT_TRIED = "not tried: the time was up"
_MANY_VARIABLES = 150
"""Above this a cold solve takes seconds, and the problem is first solved over some of its knots."""
_KNOT_TIME = 0.4
"""Part of the remaining time that may go into the knots."""

_MAIN = "MainProcess"

_Given = TypeVar("_Given")
_Made = TypeVar("_Made")


@dataclass(frozen=True)
class Way:
    """A seed and the solver that plans from it.

    Attributes
    ----------
    seed : Seed
    solver : str
    """

    seed: Seed
    solver: str


@dataclass(frozen=True)
class Coarse:
    """A plan at the first collocation points.

    Attributes
    ----------
    way : Way
    program : Program or None
        None where nothing was solved.
    target : Program or None
        The program over all its knots, where `program` has only some of them.
    reports : tuple of SolverReport
        Of all solves; the last one belongs to `program`.
    status : str
        In plain words.
    """

    way: Way
    program: Program | None
    reports: tuple[SolverReport, ...]
    status: str
    target: Program | None = None

    @property
    def usable(self) -> bool:
        """True where there is a plan."""
        return bool(self.reports) and self.reports[-1].status.usable

    @property
    def t_end(self) -> float:
        """End time, s; infinite where there is no plan."""
        return self.reports[-1].objective if self.usable else np.inf

    @property
    def keeps_knots(self) -> bool:
        """True where the finished plan has the same knots, so that its end time is no shorter."""
        spline = self.way.seed.choice.setting.task.spline
        if spline.knots == "free" or spline.intervals == "auto" or self.program is None or self.target is None:
            return False
        return self.program.intervals == self.target.intervals

    @property
    def family(self) -> str:
        """Family of the closed form."""
        return self.way.seed.choice.match.family


def plan_coarse(way: Way, deadline: Deadline, share: float, listener: Listener) -> Coarse:
    """Solve the NLP from a seed.

    Parameters
    ----------
    way : Way
    deadline : Deadline
    share : float
        Time that this plan may take at most, s.
    listener : callable

    Returns
    -------
    Coarse
    """
    if deadline.passed:
        return Coarse(way, None, (), NOT_TRIED)
    seed, setting = way.seed, way.seed.choice.setting
    target = program_of(setting, seed.decomposition, breaks_of(setting.task))
    program = coarsest(target) if target.variables > _MANY_VARIABLES else target
    x = starting_point(program, [seed.course])
    if x is None:
        return Coarse(way, None, (), "the splines through the course leave the branch")
    try:
        program, reports = continued(program, x, _solve(way, deadline.within(share), listener), MARGINS)
    except ImportError as error:
        return Coarse(way, None, (), f"{way.solver}: not installed ({error})")
    return Coarse(way, program, reports, _in_words(reports[-1].status), target)


def finish(numbered: tuple[int, Coarse], deadline: Deadline, listener: Listener) -> tuple[Attempt, Motion | None]:
    """Refine and verify a coarse plan; only verify it where the time is up.

    Parameters
    ----------
    numbered : tuple of int, Coarse
        Number of the candidate, and its usable plan.
    deadline : Deadline
    listener : callable

    Returns
    -------
    Attempt
    Motion or None
        None where no trajectory came out.
    """
    number, coarse = numbered
    assert coarse.program is not None  # noqa: S101  (it is usable)
    setting = coarse.way.seed.choice.setting
    task, settings = setting.task, setting.task.refinement
    options = RefinementOptions(settings.tolerance, settings.density, settings.max_rounds, deadline.part(_KNOT_TIME))
    program, reports, undone = adapt_mesh(
        coarse.program,
        coarse.reports,
        _solve(coarse.way, options.deadline, listener),
        task.spline,
        options,
        target=coarse.target,
    )
    decomposition = coarse.way.seed.decomposition
    refined, motion = refined_until_verified(
        program,
        reports[-1],
        _solve(coarse.way, deadline, listener),
        replace(options, deadline=deadline),
        lambda answer: judge(decomposition, answer, setting),
    )
    return attempt_of(refined, reports[:-1], number, settings.tolerance, motion, undone), motion


def _in_words(status: SolveStatus) -> str:
    name = status.name.lower().replace("_", " ")
    if not status.usable:
        return name
    return "planned" if status is SolveStatus.OPTIMAL else f"planned, {name}"


def _solve(way: Way, deadline: Deadline, listener: Listener) -> Solve:
    """Make a function that solves with the way's solver."""
    seed = way.seed
    (solver,) = solver_named(way.solver)
    return solve_with(solver, seed.choice.setting.task.solver, len(seed.choice.redundant), deadline, listener)


def each(
    function: Callable[..., _Made], given: Sequence[_Given], *others: object, jobs: int, listener: Listener
) -> Generator[_Made, None, None]:
    """Do a piece of work for every item, in up to `jobs` processes.

    Parameters
    ----------
    function : callable
        ``function(item, *others, listener)``; a function of a module, so that it can be sent to other processes.
    given : sequence
        The items.
    *others : object
        The same for all items.
    jobs : int
        With 1, and within another program's workers, the work is done here, item by item as it is asked for.
    listener : callable
        Only heard of work that is done here.

    Yields
    ------
    object
        What the function returns, in the order of the items.
    """
    if jobs == 1 or len(given) <= 1 or _within_a_worker():
        for item in given:
            interrupts.check()
            yield function(item, *others, listener)
        return
    interrupts.check()
    from joblib import Parallel, delayed  # noqa: PLC0415  (a fifth of a second that a single process need not wait)

    made: Any = None
    try:
        with interrupts.blocked():  # joblib would lose a press while its processes start, and they would die of it
            made = Parallel(n_jobs=jobs, backend="loky", return_as="generator")(
                delayed(_apart)(function, item, *others) for item in given
            )
        for one in made:  # noqa: UP028  ("yield from" would close `made` before the lines below)
            yield one
    finally:
        with interrupts.postponed(), warnings.catch_warnings():  # that work is thrown away is meant
            warnings.simplefilter("ignore")
            if made is not None:
                made.close()


def processes(jobs: int) -> int:
    """Return the number of processes that is used where a task asks for `jobs`: no more than there are processors."""
    return min(jobs, os.cpu_count() or 1)


def _within_a_worker() -> bool:
    """Tell whether this is somebody's worker process: processes of processes would multiply."""
    from joblib.parallel import get_active_backend  # noqa: PLC0415

    return bool(get_active_backend()[0].nesting_level) or multiprocessing.current_process().name != _MAIN


def _apart(function: Callable[..., _Made], *arguments: object) -> _Made:
    """Run in a process of its own: one thread for linear algebra, nobody listening."""
    with ThreadpoolController().limit(limits=1, user_api="blas"):
        return function(*arguments, _deaf)


def _deaf(_text: str) -> None:
    """Listen to nothing."""
