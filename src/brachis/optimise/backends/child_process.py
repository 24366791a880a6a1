"""A solver: a backend with safe inputs and one solve at a time. Large programs are solved in a separate process.

A backend checks the time only between its iterations and evaluations. An active-set method may spend minutes in a
single quadratic subproblem of thousands of variables, without calling our code. Such solves run in a separate process,
which can be ended. The same applies to solves with the option `apart`: if a speed is given, Uno's BQPD may pivot
forever in a restoration.
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
from brachis.optimise.backends.monitor import SolveMonitor, is_usable, report_point
from brachis.optimise.backends.protocol import (
    NonlinearProgram,
    Progress,
    SolverOptions,
    SolverReport,
    SolveStatus,
)

ENTRIES = 1_000_000
"""Number of variables times rows above which a solve runs in a separate process. An iteration of Uno takes 0.2 s at
this size, and 18 s at nine times this size.

If the time limit is below 10 s, smaller problems are also solved in a separate process, because one iteration may take
all of the time.
"""
_GRACE = 0.25
"""Seconds after the time limit at which a process is ended. A backend that checks the limit returns before then."""
_SILENCE = 5.0
"""Seconds without an iteration after which the process of a small program is ended. An iteration takes hundredths of a
second."""
_LONGEST = 1e6
"""Seconds without an iteration after which any process is ended, because the system cannot wait indefinitely."""
Run = Callable[[SolveMonitor, np.ndarray], SolverReport]
"""Type of a backend's function: ``run(monitor, x)`` solves the monitor's program from x and returns
``monitor.report(...)``."""
solve_lock = threading.RLock()
"""Lock for all solves. Uno's BQPD and IPOPT's MUMPS keep their state in memory shared by all threads, so two solves at
once would crash."""


@dataclass(frozen=True)
class Solver:
    """A backend that can be called safely.

    Attributes
    ----------
    name : str
    run : callable
        ``run(monitor, x)`` solves the monitor's program from x; see `SolveMonitor`.
    is_interior : bool, optional
        Whether the backend uses an interior-point method. Such a method moves away from the bounds at first, so a start
        close to the optimum does not help.
    """

    name: str
    run: Run
    is_interior: bool = False

    def solve(
        self,
        program: NonlinearProgram,
        x: np.ndarray,
        options: SolverOptions,
        progress: Progress | None,
    ) -> SolverReport:
        """Solve `program` from the starting point `x`.

        If a large program is not solved in time, the report has the status `TIME_LIMIT`. Its `x` is Uno's best feasible
        iterate, or the starting point if there is none. If a solve is ended because it sent nothing, the status is
        `STALLED`.

        Raises
        ------
        KeyboardInterrupt
            The user interrupted the solve. The error is raised once the backend has returned.
        """
        bounds = (program.lower, program.upper, program.x_lower, program.x_upper)
        refuse = partial(report_point, self.name, program, x)
        if options.time_limit <= 0.0:
            return refuse(SolveStatus.TIME_LIMIT, "no time was left")
        if not is_usable(x) or any(np.isnan(bound).any() for bound in bounds):
            message = "the start or a bound is not a finite number"
            return refuse(SolveStatus.EVALUATION_ERROR, message)
        with solve_lock:
            max_entries = ENTRIES * min(1.0, (options.time_limit / 10.0) ** 2)
            # A daemonic process may not have children. In it, the time limit is checked only between iterations.
            alone = multiprocessing.current_process().daemon
            entries = len(x) * len(program.lower)
            if (options.apart or entries > max_entries) and not alone:
                return subprocess_solve(self, program, x, options, progress)
            return self.run(SolveMonitor(program, options, progress), x)


def subprocess_solve(
    solver: Solver,
    program: NonlinearProgram,
    x: np.ndarray,
    options: SolverOptions,
    progress: Progress | None,
) -> SolverReport:
    """Solve in a separate process: start the process, pass on its progress, and end it."""
    began = time.monotonic()
    until = began + options.time_limit
    # A forked process needs no copy of the program, but forking is safe only with the system libraries of Linux.
    method = "fork" if sys.platform.startswith("linux") else "spawn"
    context: Any = multiprocessing.get_context(method)
    receiver, sender = context.Pipe(duplex=False)
    process = context.Process(
        target=_work, args=(sender, solver.run, program, x, options), daemon=True
    )
    try:
        # The forked process uses nothing that other threads may have locked.
        with interrupts.block_in_children(), warnings.catch_warnings():
            warnings.filterwarnings(
                "ignore", message=".*multi-threaded", category=DeprecationWarning
            )
            process.start()
        sender.close()
        is_large = len(x) * len(program.lower) > ENTRIES
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
    return report_point(solver.name, program, point, status, message, now - began)


def _receive(
    receiver: Connection, until: float, silence: float, progress: Progress | None
) -> tuple[SolverReport | Exception | SolveStatus | None, np.ndarray | None]:
    """Receive and pass on the progress until the result arrives.

    Returns
    -------
    answer : SolverReport, Exception, SolveStatus or None
        The result; None if no result arrives in time or the process has crashed; `SolveStatus.STALLED` if nothing
        arrives for `silence`, s.
    best : (v,) ndarray or None
        The best feasible iterate that was received.
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
    program: NonlinearProgram,
    x: np.ndarray,
    options: SolverOptions,
) -> None:
    """Solve within the separate process.

    The system ends the process when its time is up, whatever it is doing, even if the parent process no longer exists.
    """
    signal.signal(signal.SIGALRM, signal.SIG_DFL)
    if np.isfinite(options.time_limit):
        signal.setitimer(signal.ITIMER_REAL, options.time_limit + _GRACE)

    sent: np.ndarray | None = None

    def progress(iteration: int, objective: float) -> None:
        """Send an iteration to the parent process. If there is a new best feasible iterate, send it too."""
        nonlocal sent
        best = None if monitor.best is None else monitor.best[1]
        sender.send((iteration, objective, None if best is sent else best))
        sent = best

    monitor = SolveMonitor(program, options, progress)
    try:
        with use_one_thread():
            sender.send(run(monitor, x))
    except Exception as error:  # noqa: BLE001  (raised in the parent process)
        sender.send(_make_sendable(error))


def _make_sendable(error: Exception) -> Exception:
    """Return an error unchanged, or a RuntimeError with its text if it cannot be sent to another process."""
    try:
        pickle.loads(pickle.dumps(error))  # noqa: S301  (our own data)
    except Exception:  # noqa: BLE001  (whatever a user-defined class does)
        return RuntimeError(f"{type(error).__name__}: {error}")
    return error
