"""Solves that may not come back in time run in a process of their own, which can be ended.

A backend hears of the time between its iterations and evaluations. An active-set method may spend minutes within a
single quadratic subproblem of thousands of variables, where nothing of ours is called.

A lock for backends that threads of one process must not run at the same time.
"""

from __future__ import annotations

import functools
import importlib
import inspect
import multiprocessing
import signal
import sys
import threading
import time
import warnings
from multiprocessing.connection import Connection
from typing import Any

import numpy as np
from threadpoolctl import ThreadpoolController

from brachis.common import interrupts
from brachis.optimise.backends.monitor import ended
from brachis.optimise.backends.protocol import (
    Problem,
    Progress,
    Solve,
    SolverOptions,
    SolverReport,
    SolveStatus,
)

ENTRIES = 1_000_000
"""Variables times rows above which a solve runs apart: an iteration takes Uno 0.2 s there, 18 s at nine times that."""
SHORT = 10.0
"""Seconds of a time limit below which smaller problems, too, are solved apart: one iteration may take all of them."""
_GRACE = 0.25
"""Seconds after its time limit at which a process is ended; a backend that hears of the limit answers before."""
_METHOD = "fork" if sys.platform.startswith("linux") else "spawn"
"""How processes are made: a fork has the problem at once, yet elsewhere the system's libraries do not bear it."""


def apart_if_large(solve: Solve) -> Solve:
    """Let large problems be solved in a process that is ended soon after the time limit (decorator).

    Such a report has the start as its `x`, and says `TIME_LIMIT`.
    """

    @functools.wraps(solve)
    def solved(
        problem: Problem,
        x: np.ndarray,
        options: SolverOptions,
        progress: Progress | None,
    ) -> SolverReport:
        # A daemonic process may have none of its own; the backend's limit then holds between its iterations alone.
        entries_allowed = ENTRIES * min(1.0, (options.time_limit / SHORT) ** 2)
        if (
            len(x) * len(problem.lower) <= entries_allowed
            or multiprocessing.current_process().daemon
        ):
            return solve(problem, x, options, progress)
        name = solve.__module__.rpartition(".")[2]
        return _solve_apart(solve.__module__, name, problem, x, options, progress)

    return solved


def _solve_apart(
    module: str,
    name: str,
    problem: Problem,
    x: np.ndarray,
    options: SolverOptions,
    progress: Progress | None,
) -> SolverReport:
    """Start the process, pass on what it says, and end it."""
    began = time.monotonic()
    context: Any = multiprocessing.get_context(_METHOD)
    receiver, sender = context.Pipe(duplex=False)
    process = context.Process(
        target=_work, args=(sender, module, problem, x, options), daemon=True
    )
    try:
        with (
            interrupts.block_in_children(),
            warnings.catch_warnings(),
        ):  # the fork touches nothing that threads may hold
            warnings.filterwarnings(
                "ignore", message=".*multi-threaded", category=DeprecationWarning
            )
            process.start()
        sender.close()
        answer = _heard(receiver, began + options.time_limit + _GRACE, progress)
    finally:
        if process.pid is not None:
            process.kill()
            process.join()
        sender.close()
        receiver.close()
    if isinstance(answer, Exception):
        raise answer
    if isinstance(answer, SolverReport):
        return answer
    late = time.monotonic() > began + options.time_limit
    status, message = (
        (SolveStatus.TIME_LIMIT, "ended: it did not come back in time")
        if late
        else (SolveStatus.FAILED, "crashed")
    )
    return ended(name, problem, x, status, message, time.monotonic() - began)


def _heard(
    receiver: Connection, until: float, progress: Progress | None
) -> SolverReport | Exception | None:
    """Pass on the progress until the answer comes; None where none comes in time, or at all."""
    while receiver.poll(max(until - time.monotonic(), 0.0)):
        try:
            said = receiver.recv()
        except EOFError:
            return None
        if isinstance(said, SolverReport | Exception):
            return said
        if progress is not None:
            progress(*said)
    return None


def _work(
    sender: Connection,
    module: str,
    problem: Problem,
    x: np.ndarray,
    options: SolverOptions,
) -> None:
    """Solve within the process.

    The system ends it when its time is up, wherever it is then, even if nobody waits for it any more.
    """
    signal.signal(signal.SIGALRM, signal.SIG_DFL)
    signal.setitimer(signal.ITIMER_REAL, options.time_limit + _GRACE)
    solve = inspect.unwrap(importlib.import_module(module).solve)

    def progress(iteration: int, objective: float) -> None:
        sender.send((iteration, objective))

    try:
        with ThreadpoolController().limit(limits=1, user_api="blas"):
            sender.send(solve(problem, x, options, progress))
    except Exception as error:  # noqa: BLE001  (raised where the solve was asked for)
        sender.send(error)


_LOCK = threading.RLock()
"""Uno's BQPD and IPOPT's MUMPS keep their state in memory that all threads share: two solves at once crash."""


def one_at_a_time(solve: Solve) -> Solve:
    """Let a solve wait until no other thread is in one (decorator)."""

    @functools.wraps(solve)
    def waiting(
        problem: Problem,
        x: np.ndarray,
        options: SolverOptions,
        progress: Progress | None,
    ) -> SolverReport:
        with _LOCK:
            return solve(problem, x, options, progress)

    return waiting
