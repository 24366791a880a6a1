"""The end of a program's search part by part, where the parts meet at rest.

Once the program over the path has found the postures in which the parts meet, each part can be finished by itself
between these postures. A program over time of all parts, which is needed for given speeds and limits of third order,
would be large: for two seams with approaches it has a thousand variables, and was not solved within a minute.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np

from brachis.optimise.extraction import compose
from brachis.optimise.improve import SolvedProgram
from brachis.optimise.program import Program
from brachis.optimise.transcription import program_of
from brachis.problem.chain import ProblemChain
from brachis.problem.problem import Problem
from brachis.search.stages import (
    Candidate,
    ChainGuess,
    FinishedCandidate,
    RankedCandidate,
    fail,
    rank,
)
from brachis.search.verified import verify

Finish = Callable[[RankedCandidate], Candidate]
"""Function that finishes the candidate of a single task."""


def finish_by_parts(candidate: RankedCandidate, finish: Finish) -> Candidate:
    """Finish the parts of a program one by one, between the postures in which they meet.

    Parameters
    ----------
    candidate : RankedCandidate
        Candidate of a `ChainGuess`.
    finish : callable

    Returns
    -------
    Candidate
        A `FinishedCandidate` if every part has a motion.

    Raises
    ------
    UnreachableError
        The joint path of a part leaves its joint map.
    """
    guess = candidate.guess
    assert isinstance(guess, ChainGuess)
    finished: list[FinishedCandidate] = []
    problems = _between_postures(guess)
    for part, problem in zip(guess.parts, problems, strict=True):
        alone = replace(part, problem=problem, solver=guess.solver)
        outcome = finish(rank(alone, program_of(problem, alone.maps_by_leg())))
        if not isinstance(outcome, FinishedCandidate):
            return fail(candidate, outcome.status, outcome.reports)
        finished.append(outcome)
    motion = compose(guess.problem, [outcome.trajectory for outcome in finished])
    # The program that explains the motion has the postures in which the parts meet as given ones.
    chain = guess.problem
    assert isinstance(chain, ProblemChain)
    chain = replace(chain, chained=tuple(problems))
    known = replace(candidate, guess=replace(guess, problem=chain))
    return verify(known, candidate.reports, _together(finished), motion)


def _between_postures(guess: ChainGuess) -> list[Problem]:
    """Return the problems of the parts with given postures at both ends; a move leads from part to part."""
    ends = [part.postures_at(np.array([0.0, 1.0])) for part in guess.parts]
    count = len(ends)
    problems = []
    for number, (part, problem) in enumerate(
        zip(guess.parts, guess.problem.parts, strict=True)
    ):
        start, end = ends[number]
        if part.joint_map.is_move:
            n = problem.robot.n
            if problem.start is None:
                start = ends[number - 1][1, :n]
            if problem.end is None:
                end = ends[(number + 1) % count][0, :n]
        problems.append(replace(problem, start=start, end=end))
    return problems


def _together(parts: list[FinishedCandidate]) -> SolvedProgram:
    """Return the programs of all parts as one, at their solutions, without links and multipliers."""
    phases = [phase for part in parts for phase in part.refined.program.phases]
    program = Program(phases)
    x = np.concatenate([part.refined.x for part in parts])
    report = replace(
        parts[0].refined.report,
        x=x,
        objective=program.objective(x),
        multipliers=np.zeros(len(program.lower)),
    )
    violation = max(part.refined.violation for part in parts)
    return SolvedProgram(program, (report,), violation=violation)
