"""The end of a program's search part by part, where the arm stops between the parts.

Once the program over the path has found the postures in which the arm stops, the parts between two stops can be
finished by themselves. A program over time of all parts, which is needed for given speeds and limits of third order,
would be large: for two seams with approaches it has a thousand variables, and was not solved within a minute.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace

import numpy as np

from brachis.optimise.extraction import compose
from brachis.optimise.improve import SolvedProgram
from brachis.optimise.program import Program
from brachis.optimise.transcription import program_of
from brachis.problem.chain import ProblemChain
from brachis.search.stages import (
    Candidate,
    ChainGuess,
    FinishedCandidate,
    InitialGuess,
    RankedCandidate,
    fail,
    rank,
)
from brachis.search.verified import verify
from brachis.trajectory import Trajectory

Finish = Callable[[RankedCandidate], Candidate]
"""Function that finishes the candidate of a single task."""
Smooth = Callable[[FinishedCandidate, float], Trajectory]
"""Function that returns the smoothest motion of a candidate, sought for a share of the remaining time."""


def finish_by_parts(
    candidate: RankedCandidate, finish: Finish, smooth: Smooth
) -> Candidate:
    """Finish the parts of a program one by one, between the postures in which they meet; then smooth each of them.

    Parameters
    ----------
    candidate : RankedCandidate
        Candidate of a `ChainGuess`.
    finish, smooth : callable

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
    # The program that explains the motion has the postures in which the arm stops as given ones.
    chain = _between_postures(guess)
    for numbers in chain.flights:
        alone = _guess_of(guess, chain, numbers)
        outcome = finish(rank(alone, program_of(alone.problem, alone.maps_by_leg())))
        if not isinstance(outcome, FinishedCandidate):
            return fail(candidate, outcome.status, outcome.reports)
        finished.append(outcome)
    count = len(finished)
    motions = [
        smooth(outcome, 1.0 / (count - number))
        for number, outcome in enumerate(finished)
    ]
    components = [
        part for motion in motions for _, part in motion.components or [(0.0, motion)]
    ]
    motion = compose(guess.problem, components)
    known = replace(candidate, guess=replace(guess, problem=chain))
    done = verify(known, candidate.reports, _together(finished), motion)
    if isinstance(done, FinishedCandidate):
        return replace(done, is_smoothed=True)
    return done


def _guess_of(
    guess: ChainGuess, chain: ProblemChain, numbers: Sequence[int]
) -> InitialGuess:
    """Return the guess of some successive parts of a program, given by their numbers."""
    parts = [
        replace(guess.parts[number], problem=chain.parts[number], solver=guess.solver)
        for number in numbers
    ]
    if len(parts) == 1:
        return parts[0]
    return ChainGuess.of_parts(chain.piece(numbers), parts, np.inf)


def _between_postures(guess: ChainGuess) -> ProblemChain:
    """Return the problem with given postures where the arm stops; a move leads from part to part."""
    chain = guess.problem
    assert isinstance(chain, ProblemChain)
    ends = [part.postures_at(np.array([0.0, 1.0])) for part in guess.parts]
    count = len(ends)
    problems = list(chain.parts)
    for flight in chain.flights:
        for number, side in ((flight[0], 0), (flight[-1], 1)):
            problem = problems[number]
            posture = ends[number][side]
            if guess.parts[number].joint_map.is_move:
                beside = ends[(number - 1 + 2 * side) % count]
                posture = beside[1 - side, : problem.robot.n]
            name = ("start", "end")[side]
            if getattr(problem, name) is None:
                problems[number] = replace(problem, **{name: posture})
    return replace(chain, chained=tuple(problems))


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
