"""The one loop that changes a solved program and keeps the better motion."""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import partial

import numpy as np
import pytest

from brachis.common.deadline import Deadline
from brachis.optimise.backends import (
    SolverReport,
    SolveStatus,
)
from brachis.optimise.guess import shortest_time
from brachis.optimise.improve import (
    SolvedProgram,
    attempt_once,
    improve,
    keep_feasible,
)
from brachis.optimise.program import Program
from support.phases import phase_of
from support.starts import starting_points


@dataclass(frozen=True)
class Fake:
    """A program whose solve takes a known end time."""

    t_end: float
    usable: bool = True

    def end_time(self, x):
        return float(x[0])

    def scale_time(self, x, factor):
        return x * factor


def solve(program, _x):
    status = SolveStatus.OPTIMAL if program.usable else SolveStatus.TIME_LIMIT
    return SolverReport(
        "fake",
        status,
        np.array([program.t_end]),
        program.t_end,
        0.0,
        np.empty(0),
        1,
        0.0,
        "",
    )


def changes_to(*programs):
    """Changes to programs, one after the other, and the end times that each was proposed from."""
    begun_at = []

    def change_to(program):
        def change(kept):
            begun_at.append(kept.t_end if kept.reports else None)
            return program, np.array([5.0])

        return change

    return [change_to(program) for program in programs], begun_at


FIRST = SolvedProgram(Fake(5.0), (solve(Fake(5.0), None),))


def run(start, changes, *, early=False, **options):
    """Improve with the solver of fakes."""
    attempt = partial(attempt_once, solve, accept_early_end=early)
    return improve(start, changes, attempt, **options)


GAINS = {"least_gain": 0.0, "go_on_above": None}
KEEPING = {
    "every motion": ([4.0, 6.0, 5.5], {}, 5.5, [5.0, 4.0, 6.0]),
    "gains alone": ([4.0, 6.0, 4.5], GAINS, 4.0, [5.0, 4.0, 4.0]),
    "up to a small gain": (
        [4.0, 3.99, 1.0],
        {"least_gain": 0.0, "go_on_above": 0.01},
        3.99,
        [5.0, 4.0],
    ),
    "what something else judges to be better": (
        [4.0, 6.0],
        {**GAINS, "judge": lambda solved: 10.0 - solved.t_end},
        6.0,
        [5.0, 5.0],
    ),
}


@pytest.mark.parametrize("case", KEEPING)
def test_which_motions_stay(case):
    times, options, t_end, proposed_from = KEEPING[case]
    changes, begun_at = changes_to(*map(Fake, times))
    best = run(FIRST, changes, **options)
    assert best.t_end == best.program.t_end == best.reports[-1].objective == t_end
    assert begun_at == proposed_from
    tried = times[: len(begun_at)]
    assert sorted(report.objective for report in best.reports) == sorted([5.0, *tried])


def test_a_failure_ends_it():
    changes, begun_at = changes_to(Fake(4.0), Fake(1.0, usable=False), Fake(2.0))
    best = run(FIRST, changes)
    assert best.t_end == 4.0
    assert len(begun_at) == 2


def test_without_a_motion_the_next_one_takes_its_place():
    changes, begun_at = changes_to(Fake(4.0, usable=False), Fake(3.0), Fake(2.99))
    nothing = SolvedProgram(Fake(np.inf))
    best = run(nothing, changes, least_gain=0.1)
    assert best.t_end == 3.0
    assert begun_at == [None, 4.0, 3.0]
    changes, _ = changes_to(Fake(4.0, usable=False), Fake(3.0, usable=False))
    assert run(nothing, changes).program.t_end == 3.0


def test_it_ends_with_the_time_or_with_a_reason():
    changes, begun_at = changes_to(Fake(4.0))
    over = run(FIRST, changes, deadline=Deadline(0.0))
    assert over.t_end == 5.0
    assert not begun_at
    reasons = [lambda _kept: "too many", lambda _kept: pytest.fail("it went on")]
    assert run(FIRST, reasons).not_completed == "too many"
    nothing = [lambda _kept: None, lambda _kept: pytest.fail("it went on")]
    assert run(FIRST, nothing).not_completed == ""


@pytest.mark.parametrize("t_end, best", [(4.0, 4.0), (6.0, 5.0)])
def test_an_early_end_counts_if_it_is_faster_than_its_beginning(t_end, best):
    changes, _ = changes_to(Fake(t_end, usable=False))
    result = run(FIRST, changes, early=True)
    assert result.t_end == best
    assert best == 5.0 or result.report.status is SolveStatus.ACCEPTABLE


def test_the_end_time_has_the_factor_of_the_answer():
    lengthened = SolvedProgram(Fake(5.0), FIRST.reports, time_scaled=1.01)
    assert lengthened.t_end == pytest.approx(5.05)
    assert lengthened.report.x[0] == 5.0


def test_if_the_time_is_up_a_feasible_start_is_the_answer():
    program = Program([phase_of("r1")])
    start = shortest_time(program, next(starting_points(program)))
    far = program.scale_time(start, 0.5)
    late = replace(FIRST.report, status=SolveStatus.TIME_LIMIT, x=far, violation=1.0)
    unfinished = SolvedProgram(program, (late,))
    result = keep_feasible(unfinished, start)
    assert result.usable
    np.testing.assert_array_equal(result.report.x, start)
    assert result.t_end == program.end_time(start)
    assert keep_feasible(unfinished, far).report is late
