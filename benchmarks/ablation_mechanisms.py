"""Mechanisms of the planner that `ablation` switches off one at a time, by patches of `unittest.mock`.

Each `Mechanism` lists replacements of functions or constants of brachis. A recorder around a function tells, in a plan
with everything on, whether a task uses the mechanism at all: where it does not, a plan without it is the same plan.
"""

from __future__ import annotations

import functools
import pkgutil
from collections.abc import Callable, Collection, Iterator, Sequence
from contextlib import ExitStack, contextmanager
from dataclasses import dataclass, replace
from typing import Any
from unittest import mock

from brachis.errors import BrachisError
from brachis.optimise.backends.monitor import SolveMonitor
from brachis.optimise.retiming import FINE, improve_joint_paths
from brachis.search.over_path import improve_guess, lay_along_timing
from brachis.search.stages import rank

IsUsed = Callable[..., bool]
"""Tells by the result of a function and by its arguments whether a call is a use of the mechanism."""


def always(_result: object, *_arguments: object, **_keywords: object) -> bool:
    """Take every call as a use."""
    return True


@dataclass(frozen=True)
class Mechanism:
    """A mechanism and how it is switched off.

    Attributes
    ----------
    name : str
        For the command line.
    about : str
        What happens without it.
    patches : dict of str to object
        What takes the place of each name, as in ``package.module.name``.
    use : str
        Name of the function whose calls are uses; the first name of `patches` if empty.
    is_used : callable
        Which calls are uses.
    """

    name: str
    about: str
    patches: dict[str, Any]
    use: str = ""
    is_used: IsUsed = always

    @contextmanager
    def off(self) -> Iterator[None]:
        """Patch the planner."""
        with ExitStack() as stack:
            for target, replacement in self.patches.items():
                stack.enter_context(mock.patch(target, replacement))
            yield

    def is_any_in(self, names: Collection[str]) -> bool:
        """Tell whether the mechanism, or one of those joined by +, is among those that are used."""
        return any(name in names for name in self.name.split("+"))

    @property
    def recorded(self) -> str:
        """Name of the function whose calls are recorded."""
        return self.use or next(iter(self.patches))


@contextmanager
def record_uses(mechanisms: Sequence[Mechanism]) -> Iterator[set[str]]:
    """Collect the names of the mechanisms that are used."""
    names: set[str] = set()
    with ExitStack() as stack:
        for mechanism in mechanisms:
            original = pkgutil.resolve_name(mechanism.recorded)
            if not callable(original):
                names.add(mechanism.name)
                continue
            recorder = _recorder(original, mechanism, names)
            stack.enter_context(mock.patch(mechanism.recorded, recorder))
        yield names


def _recorder(
    original: Callable[..., Any], mechanism: Mechanism, names: set[str]
) -> Callable[..., Any]:
    """Wrap a function so that a use of it adds the mechanism's name."""

    @functools.wraps(original, updated=())
    def call(*arguments: Any, **keywords: Any) -> Any:
        try:
            result = original(*arguments, **keywords)
        except BrachisError:
            names.add(mechanism.name)
            raise
        if mechanism.is_used(result, *arguments, **keywords):
            names.add(mechanism.name)
        return result

    return call


_SEARCH = "brachis.search."
_OPTIMISE = "brachis.optimise."
_BACKENDS = _OPTIMISE + "backends."

find_original = pkgutil.resolve_name
plan_simpler = find_original(_SEARCH + "fewer_joints._plan_simpler")
finish_over_path = find_original(_SEARCH + "pipeline._finish_over_path")
improve_in_parallel = find_original(_SEARCH + "screening._improve_in_parallel")


def return_first(first: Any, *_arguments: Any, **_keywords: Any) -> Any:
    """Change nothing."""
    return first


def return_second(_first: Any, second: Any, *_arguments: Any, **_keywords: Any) -> Any:
    """Change nothing of the second argument."""
    return second


def return_none(*_arguments: Any, **_keywords: Any) -> None:
    """Do nothing."""


def return_empty(*_arguments: Any, **_keywords: Any) -> Any:
    """Find nothing."""
    return ()


def solve_all_rows(
    program: Any, x: Any, solve: Callable[..., Any], **_keywords: Any
) -> Any:
    """Take the place of `solve_near_rows`."""
    return solve(program, x)


def choose_by_estimate(guesses: Any, count: int, *_arguments: Any) -> Any:
    """Take the place of `screen`."""
    return sorted(guesses, key=lambda guess: guess.estimate)[:count]


def improve_roughly_alone(
    guesses: Any, effort: Any, charts: int, alike: int, **keywords: Any
) -> Any:
    """Take the place of `_improve_in_parallel`, without the coarse search, which has one chart."""
    if charts == 1:
        return list(guesses)
    return improve_in_parallel(guesses, effort, charts, alike, **keywords)


def improve_in_one_chart(
    guess: Any, program: Any, solve: Any, effort: Any, _charts: int = 1
) -> Any:
    """Take the place of `improve_guess`."""
    return improve_guess(guess, program, solve, effort, charts=1)


def plan_from_motion_alone(
    problem: Any, robot: Any, task: Any, known: Any, *others: Any
) -> Any:
    """Take the place of `_plan_simpler`, without a plan that begins with nothing."""
    if known is None:
        return None
    return plan_simpler(problem, robot, task, known, *others)


def rank_as_it_is(guess: Any, program: Any, _session: Any) -> Any:
    """Take the place of `improve_over_path`."""
    return rank(guess, program)


def fit_untimed(_phase: Any, curves: Any) -> Any:
    """Take the place of `_time_guess`."""
    return curves, None


def solve_here(
    solver: Any, problem: Any, x: Any, options: Any, progress: Any = None
) -> Any:
    """Take the place of `Solver.solve`, without another process."""
    return solver.run(SolveMonitor(problem, options, progress), x)


def finish_by_timing_alone(
    candidate: Any, session: Any, options: Any, to_beat: float
) -> Any:
    """Take the place of `_finish_over_path`, without solves over time where the timing can be laid."""
    program = candidate.program
    tolerance = candidate.problem.task.spline.tolerance
    legs = candidate.guess.legs
    paths = improve_joint_paths(program, legs, session, tolerance, FINE)
    reports = (*candidate.reports, *paths.reports)
    planned = lay_along_timing(candidate, program, paths.timings, reports, options)
    return planned or finish_over_path(candidate, session, options, to_beat)


def is_found(result: Any, *_arguments: Any, **_keywords: Any) -> bool:
    """Take those calls that find something."""
    return bool(result) if isinstance(result, list | bool) else result is not None


MECHANISMS = (
    Mechanism(
        "nothing",
        "the same plan again: what noise is",
        {},
        use=_SEARCH + "portfolio.Search.run",
    ),
    Mechanism(
        "near_rows",
        "all rows from the first solve on",
        {_OPTIMISE + "improve.solve_near_rows": solve_all_rows},
        use=_OPTIMISE + "near_rows.NearRows.__init__",
    ),
    Mechanism(
        "best_joints",
        "no other chart or joints in place of its rows after a solve over time",
        {_SEARCH + "pipeline.best_of_joints": return_second},
    ),
    Mechanism(
        "idle_joints",
        "idle joints move as they like",
        {_SEARCH + "fewer_joints._hold_idle_joints": return_none},
        is_used=is_found,
    ),
    Mechanism(
        "halving",
        "the mesh of a solve over time is not halved",
        {_OPTIMISE + "mesh.refine_mesh": return_first},
    ),
    Mechanism(
        "without_tolerances",
        "no plan without tolerances beside the one with them",
        {_SEARCH + "fewer_joints._plan_simpler": plan_from_motion_alone},
        is_used=lambda _result, *arguments: arguments[3] is None,
    ),
    Mechanism(
        "screening",
        "guesses by their estimated times alone",
        {_SEARCH + "guesses.screen": choose_by_estimate},
        is_used=lambda _result, guesses, *_: len(guesses) > 1,
    ),
    Mechanism(
        "coarse_screening",
        "no coarse search before the rough one; the better guesses by estimated times",
        {_SEARCH + "screening._improve_in_parallel": improve_roughly_alone},
        is_used=lambda _result, _guesses, _effort, charts, *_, **_keywords: charts == 1,
    ),
    Mechanism(
        "screening_ends",
        "screening does not end when several guesses are about equally fast",
        {_SEARCH + "screening._NEAR_LEAST": 0.0},
        use=_SEARCH + "screening._improve_in_parallel",
    ),
    Mechanism(
        "random_joint_paths",
        "no joint paths carried along from random postures",
        {_SEARCH + "guesses.random_joint_paths": return_empty},
        is_used=is_found,
    ),
    Mechanism(
        "hopeless",
        "loads at rest and speeds are not looked at before a plan",
        {
            _SEARCH + "schedule.refuse_hopeless": return_none,
            _SEARCH + "guesses.refuse_hopeless": return_none,
        },
        use=_SEARCH + "hopeless.explain_speeds",
    ),
    Mechanism(
        "differential_ik",
        "no guesses by differential inverse kinematics",
        {_SEARCH + "schedule.numeric_guesses": return_empty},
        is_used=is_found,
    ),
    Mechanism(
        "begin_with_timing",
        "solves over time begin with even knots",
        {_SEARCH + "over_time.begin_with_timing": return_none},
        is_used=is_found,
    ),
    Mechanism(
        "follow_meshes",
        "splines along a timing over one choice of knots",
        {_OPTIMISE + "follow._MESHES": 1},
        use=_OPTIMISE + "retiming.follow",
    ),
    Mechanism(
        "more_charts",
        "a guess is improved over the path in one chart",
        {
            _SEARCH + "over_path.improve_guess": improve_in_one_chart,
            _SEARCH + "screening.improve_guess": improve_in_one_chart,
        },
        use=_SEARCH + "over_path._lay_chart",
        is_used=is_found,
    ),
    Mechanism(
        "timed_guess",
        "guesses over time are smooth from rest to rest",
        {_SEARCH + "phase_plane._time_guess": fit_untimed},
    ),
    Mechanism(
        "interior_solver",
        "the task's first solver, for large programs and at given speeds",
        {
            _OPTIMISE + "improve.interior_solver": return_none,
        },
    ),
    Mechanism(
        "levels",
        "a solve over time begins over all given knots",
        {_SEARCH + "over_time.coarsest": return_first},
        is_used=lambda result, program: result.intervals != program.intervals,
    ),
    Mechanism(
        "centred_chart",
        "the chart is not laid anew around the better joint path",
        {_SEARCH + "over_path._centre": return_first},
    ),
    Mechanism(
        "improve_over_time",
        "joint paths are not improved over time after the search over the path",
        {_SEARCH + "over_time._solve_from_timings": return_none},
    ),
    Mechanism(
        "over_path",
        "guesses are ranked by the timing of the lattice's joint path",
        {_SEARCH + "pipeline.improve_over_path": rank_as_it_is},
    ),
    Mechanism(
        "improve_before_ranking",
        "guesses are chosen and ranked by the timings of joint paths that are not improved yet",
        {
            _SEARCH + "pipeline.improve_over_path": rank_as_it_is,
            _SEARCH + "guesses.screen": choose_by_estimate,
        },
        use=_SEARCH + "over_path.improve_joint_paths",
    ),
    Mechanism(
        "child_process",
        "large solves in this process",
        {_BACKENDS + "child_process.Solver.solve": solve_here},
        use=_BACKENDS + "child_process.subprocess_solve",
    ),
    Mechanism(
        "fine_stations",
        "no more than 64 intervals of the redundant curves over the path",
        {_SEARCH + "pipeline.FINE": replace(FINE, intervals=FINE.intervals[:2])},
        use=_SEARCH + "pipeline._finish_over_path",
    ),
    Mechanism(
        "narrowing",
        "limits on postures over the path are not narrowed between stations",
        {_OPTIMISE + "retiming._NARROWED": 0},
        use=_OPTIMISE + "path_program.PathProgram.narrow",
    ),
    Mechanism(
        "over_time_after_path",
        "no solve over time where splines along the timing were not verified, or not credible",
        {_SEARCH + "pipeline._finish_over_path": finish_by_timing_alone},
    ),
)


def find(name: str) -> Mechanism:
    """Find a mechanism by its name, or join several whose names are joined by +."""
    known = {mechanism.name: mechanism for mechanism in MECHANISMS}
    unknown = [part for part in name.split("+") if part not in known]
    if unknown:
        raise SystemExit(f"no mechanism {unknown[0]}; there are {', '.join(known)}")
    if name in known:
        return known[name]
    parts = [known[part] for part in name.split("+")]
    patches: dict[str, Any] = {}
    for mechanism in parts:
        patches |= mechanism.patches
    return Mechanism(name, "; ".join(part.about for part in parts), patches)
