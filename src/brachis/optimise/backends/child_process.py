"""A solver: a backend, run only with numbers that it can be trusted with, one solve at a time, and large ones apart.

A backend sees the time between its iterations and evaluations. An active-set method may spend minutes within a single
quadratic subproblem of thousands of variables, where nothing of ours is called. Such solves run in a process of their
own, which can be ended. So do those that ask for it: where a speed is given, Uno's BQPD may pivot for ever in a
restoration.
"""

from __future__ import annotations

import multiprocessing
import pickle
import signal
import sys
import threading
import time
import warnings
from collections.abc import Callable
from dataclasses import dataclass
from functools import partial
from multiprocessing.connection import Connection
from typing import Any

import numpy as np

from brachis.common import interrupts
from brachis.common.threads import use_one_thread
from brachis.optimise.backends.monitor import (
    SolveMonitor,
    is_usable,
    objective_at,
    residual,
)
from brachis.optimise.backends.protocol import (
    NonlinearProgram,
    Progress,
    SolverOptions,
    SolverReport,
    SolveStatus,
)

ENTRIES = 1_000_000
"""Variables times rows above which a solve runs apart: an iteration takes Uno 0.2 s there, 18 s at nine times that.

Below a time limit of 10 s smaller problems, too, are solved apart: one iteration may take all of it.
"""
_GRACE = 0.25
"""Seconds after its time limit at which a process is ended; a backend that sees the limit answers before."""
_SILENCE = 5.0
"""Seconds without an iteration after which a small problem's process is ended: an iteration takes hundredths."""
_LONGEST = 1e6
"""Seconds without an iteration after which any process is ended: the system cannot wait for ever."""
Run = Callable[[SolveMonitor, np.ndarray], SolverReport]
"""What a backend does: ``run(monitor, x)`` solves the monitor's problem from x, and returns ``monitor.report(...)``."""
solve_lock = threading.RLock()
"""Uno's BQPD and IPOPT's MUMPS keep their state in memory that all threads share: two solves at once crash."""


@dataclass(frozen=True)
class Solver:
    """A backend that can be called safely.

    Attributes
    ----------
    name : str
    run : callable
        ``run(monitor, x)`` solves the monitor's problem from x; see `SolveMonitor`.
    is_interior : bool, optional
        Whether it is an interior-point method. It leaves the bounds at first: a start near the optimum does not help.
    """

    name: str
    run: Run
    is_interior: bool = False

    def solve(
        self,
        problem: NonlinearProgram,
        x: np.ndarray,
        options: SolverOptions,
        progress: Progress | None,
    ) -> SolverReport:
        """Solve `problem` from the start `x`.

        A large problem that is not solved in time has Uno's best feasible iterate as its `x`, or the start if none is
        known, and the status `TIME_LIMIT`; one whose solve is ended for its silence, the status `STALLED`.

        Raises
        ------
        KeyboardInterrupt
            The user interrupted; passed on once the backend has returned.
        """
        bounds = (problem.lower, problem.upper, problem.x_lower, problem.x_upper)
        refuse = partial(_report_point, self.name, problem, x)
        if options.time_limit <= 0.0:
            return refuse(SolveStatus.TIME_LIMIT, "no time was left")
        if not is_usable(x) or any(np.isnan(bound).any() for bound in bounds):
            message = "the start or a bound is not a finite number"
            return refuse(SolveStatus.EVALUATION_ERROR, message)
        with solve_lock:
            max_entries = ENTRIES * min(1.0, (options.time_limit / 10.0) ** 2)
            # A daemonic process may have no children; the limit then holds between iterations alone.
            alone = multiprocessing.current_process().daemon
            entries = len(x) * len(problem.lower)
            if (options.apart or entries > max_entries) and not alone:
                return subprocess_solve(self, problem, x, options, progress)
            return self.run(SolveMonitor(problem, options, progress), x)


def _report_point(
    solver: str,
    problem: NonlinearProgram,
    x: np.ndarray,
    status: SolveStatus,
    message: str,
    wall_time: float = 0.0,
) -> SolverReport:
    """Report a solve without an answer; `x`, (v,), takes its place."""
    values = (objective_at(problem, x), residual(problem, x))
    none = np.zeros(len(problem.lower))
    return SolverReport(solver, status, x, *values, none, 0, wall_time, message)


def subprocess_solve(
    solver: Solver,
    problem: NonlinearProgram,
    x: np.ndarray,
    options: SolverOptions,
    progress: Progress | None,
) -> SolverReport:
    """Start a process that solves, pass on its progress, and end it."""
    began = time.monotonic()
    until = began + options.time_limit
    # A fork has the problem at once; beyond Linux the system's libraries do not bear it.
    method = "fork" if sys.platform.startswith("linux") else "spawn"
    context: Any = multiprocessing.get_context(method)
    receiver, sender = context.Pipe(duplex=False)
    process = context.Process(
        target=_work, args=(sender, solver.run, problem, x, options), daemon=True
    )
    try:
        # The fork touches nothing that threads may hold.
        with interrupts.block_in_children(), warnings.catch_warnings():
            warnings.filterwarnings(
                "ignore", message=".*multi-threaded", category=DeprecationWarning
            )
            process.start()
        sender.close()
        is_large = len(x) * len(problem.lower) > ENTRIES
        silence = np.inf if is_large else _SILENCE
        answer, best = _receive(receiver, until + _GRACE, silence, progress)
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
    now = time.monotonic()
    status = SolveStatus.FAILED
    message = "crashed"
    if answer is SolveStatus.STALLED:
        status = answer
        message = "ended: a subproblem took too long"
    if now > until:
        status = SolveStatus.TIME_LIMIT
        message = "ended: it did not finish in time"
    point = x if best is None else best
    return _report_point(solver.name, problem, point, status, message, now - began)


def _receive(
    receiver: Connection, until: float, silence: float, progress: Progress | None
) -> tuple[SolverReport | Exception | SolveStatus | None, np.ndarray | None]:
    """Pass on the progress until the answer comes.

    Returns
    -------
    answer : SolverReport, Exception, SolveStatus or None
        None where none comes in time, or at all; `SolveStatus.STALLED` where nothing is heard for `silence`, s.
    best : (v,) ndarray or None
        The best feasible iterate that was heard of.
    """
    best = None
    while receiver.poll(max(min(until - time.monotonic(), silence, _LONGEST), 0.0)):
        try:
            message = receiver.recv()
        except EOFError:
            return None, best
        if isinstance(message, SolverReport | Exception):
            return message, best
        iteration, objective, iterate = message
        best = best if iterate is None else iterate
        if progress is not None:
            progress(iteration, objective)
    return None if time.monotonic() >= until else SolveStatus.STALLED, best


def _work(
    sender: Connection,
    run: Run,
    problem: NonlinearProgram,
    x: np.ndarray,
    options: SolverOptions,
) -> None:
    """Solve within the process.

    The system ends it when its time is up, wherever it is then, even if nobody waits for it any more.
    """
    signal.signal(signal.SIGALRM, signal.SIG_DFL)
    if np.isfinite(options.time_limit):
        signal.setitimer(signal.ITIMER_REAL, options.time_limit + _GRACE)

    sent: np.ndarray | None = None

    def progress(iteration: int, objective: float) -> None:
        """Tell the other process of an iteration, and of a better feasible iterate."""
        nonlocal sent
        best = None if monitor.best is None else monitor.best[1]
        sender.send((iteration, objective, None if best is sent else best))
        sent = best

    monitor = SolveMonitor(problem, options, progress)
    try:
        with use_one_thread():
            sender.send(run(monitor, x))
    except Exception as error:  # noqa: BLE001  (raised where the solve was asked for)
        sender.send(_make_sendable(error))


def _make_sendable(error: Exception) -> Exception:
    """Return an error as it is, or one with its text if it cannot be sent to another process."""
    try:
        pickle.loads(pickle.dumps(error))  # noqa: S301  (its own)
    except Exception:  # noqa: BLE001  (whatever a class of the user's own does)
        return RuntimeError(f"{type(error).__name__}: {error}")
    return error
