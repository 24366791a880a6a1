"""Joint paths and estimated times of moves, which prescribe only the postures at both ends."""

from __future__ import annotations

import numpy as np

from brachis.common.arrays import interpolate_columns
from brachis.common.deadline import Deadline
from brachis.common.progress import Listener
from brachis.errors import PathError, TaskError
from brachis.kinematics import CHART, ChartRows, chart_around
from brachis.problem.feasibility import check_moves
from brachis.problem.problem import Problem
from brachis.search.guesses import SCREENED, SearchLevel
from brachis.search.holding import explain_postures
from brachis.search.lattice import step_lengths
from brachis.search.phase_plane import least_time
from brachis.search.sampled_paths import FreeSpace, sample_joint_path
from brachis.search.screening import screen_coarsely
from brachis.search.stages import InitialGuess

_SAMPLES = 3000
"""Number of samples after which OMPL gives up. For an iiwa14 behind walls, they take 1.5 s."""
_TRIES = 3
"""Number of times that OMPL may give up before there is no joint path."""
_STATIONS = 97
"""Number of postures along the joint path of a guess."""


def move_guesses(
    problem: Problem, level: SearchLevel, deadline: Deadline, listener: Listener
) -> list[InitialGuess]:
    """Find joint paths of a move: the straight one, or if something is in its way, the most promising ones round it.

    Parameters
    ----------
    problem : Problem
    level : SearchLevel
    deadline : Deadline
    listener : callable

    Raises
    ------
    TaskError
        The start or end posture is missing.
    PathError
        No joint path was found, or both postures are the same.
    NotInstalledError
        Something is in the way, and OMPL is missing.
    """
    for end in ("start", "end"):
        if end not in problem.given_postures:
            raise TaskError(
                "a move needs a start posture and an end posture",
                where=end,
                found="free",
                allowed="a posture",
            )
    check_moves(*problem.given_postures.values())
    ends = np.array([problem.start, problem.end])
    straight = guess_along(problem, ends, "line")
    space = FreeSpace.of(problem)
    if space.joins(*ends):
        return [straight]
    guesses: list[InitialGuess] = []
    for seed in range(1, 1 + SCREENED * level.in_charts):
        if seed > _TRIES and not guesses:
            break
        listener(f"sampling joint path {seed} round what is in the way")
        q = sample_joint_path(problem, space, seed, _SAMPLES, deadline)
        if q is not None:
            guesses.append(guess_along(problem, q, f"RRT-Connect {seed}"))
    if not guesses:
        raise _explain_blocked(straight)
    count = max(1, level.in_charts // 2)
    return screen_coarsely(guesses, count, deadline, listener)


def _explain_blocked(straight: InitialGuess) -> PathError:
    """Tell what is in the way of a straight joint path round which no other was found."""
    cause = explain_postures([straight])
    problem = "no joint path from the start to the end posture was found"
    if cause is None or cause.s_interval is None:
        return PathError(problem, where="task_space: free")
    middle = np.array([np.mean(cause.s_interval)])
    posture = ", ".join(
        f"{position:.3g}" for position in straight.postures_at(middle)[0]
    )
    return PathError(
        f"{problem}, and on the straight one {cause.problem}",
        s_interval=cause.s_interval,
        where="task_space: free",
        found=f"{cause.found}, near the posture [{posture}]",
        allowed=cause.allowed,
        hint="Move what is in the way, or choose other postures",
    )


def guess_along(problem: Problem, q: np.ndarray, origin: str) -> InitialGuess:
    """Return the guess of a move along the joint path through postures, (S, n)."""
    steps = np.abs(np.diff(q, axis=0) / problem.robot.scales).max(axis=1)
    length = np.append(0.0, np.cumsum(steps))
    s = length / length[-1]
    stations = np.union1d(s, np.linspace(0.0, 1.0, _STATIONS))
    postures = interpolate_columns(stations, s, q)
    rows = ChartRows.constant(np.eye(problem.robot.n))
    chart = chart_around(problem.task_map, problem.path, stations, postures, rows)
    estimate = least_time(problem, stations, postures)
    curves = chart.curves(stations, postures)
    return InitialGuess(problem, chart, curves, estimate, origin, CHART)


def price_moves(part: Problem, begins: np.ndarray, ends: np.ndarray) -> np.ndarray:
    """Estimate the least times, (N,) s, of moves from postures to others, (N, n) each.

    With limits on accelerations and torques at the average posture, a straight joint line takes 2 sqrt(A), and with
    limits on velocities B + A / B if it reaches them; see `step_lengths` for A and B.
    """
    middles = 0.5 * (begins + ends)
    numbers = np.arange(len(middles))
    lengths = step_lengths(part.limits, middles, ends - begins, numbers)
    by_acceleration, by_velocity = lengths
    longer = np.maximum(by_velocity, np.sqrt(by_acceleration))
    # For a move between equal postures, both terms are zero.
    return longer + by_acceleration / np.maximum(longer, np.finfo(float).tiny)
