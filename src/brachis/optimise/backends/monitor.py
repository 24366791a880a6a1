"""The layer between program and backend. It counts, measures time, handles interrupts, and judges the solution."""

from __future__ import annotations

import signal
import threading
import time
from collections.abc import Callable
from typing import Any, Self

import numpy as np

from brachis.common.interrupts import SigintHandler
from brachis.errors import UnreachableError
from brachis.optimise.backends.protocol import (
    NonlinearProgram,
    Progress,
    SolverOptions,
    SolverReport,
    SolveStatus,
)

_LARGEST = 1e30
"""Largest number passed to a backend. Backends multiply numbers. The square of a larger number may overflow and crash
the interpreter."""

_SMALL_BARRIER = 1e-5
"""Largest barrier parameter at which iterates show whether the solve has settled."""
_NEARLY_FEASIBLE = 1e-3
"""Violation of rows up to which an iterate counts. If ten times the tolerance is larger, it applies instead."""

Function = Callable[[np.ndarray], float | np.ndarray]
"""A function of the variables of a program."""


class SolveMonitor:
    """A monitor that watches one solve.

    A backend written in another language may lose Python exceptions. This includes a KeyboardInterrupt, which Python
    would raise at the first line of any callback. The backend must therefore get no error except UnreachableError.
    The monitor is a context manager around the call of the backend, and stores such errors. The backend then has to
    stop, and `report` raises the error.

    Parameters
    ----------
    program : NonlinearProgram
    options : SolverOptions
    progress : Progress or None

    Attributes
    ----------
    best : tuple of (float, (v,) ndarray) or None
        The best iterate that the backend has reported, among those that are feasible or acceptable: its objective times
        1 + violation, and its variables. None before the first.
    """

    def __init__(
        self,
        program: NonlinearProgram,
        options: SolverOptions,
        progress: Progress | None,
    ) -> None:
        self.program = program
        self.options = options
        self.iterations = 0
        self.failure: BaseException | None = None
        self.timed_out = False
        self.exhausted = False
        self.best: tuple[float, np.ndarray] | None = None
        self._evaluations = 0
        self.stagnated = False
        self._recent: list[float] = []
        self._feasible_below = 10.0 * options.tolerance
        self._acceptable = max(self._feasible_below, options.acceptable)
        self._progress = progress
        self._handler: Any = None
        self._during: Any = None
        self._began = time.perf_counter()

    def __enter__(self) -> Self:
        """Install a handler for SIGINT, if this thread is allowed to do so and the signal is not ignored."""
        ignored = signal.getsignal(signal.SIGINT) is signal.SIG_IGN
        if threading.current_thread() is threading.main_thread():
            self._during = signal.SIG_IGN if ignored else self._keep_interrupt
            self._handler = signal.signal(signal.SIGINT, self._during)
            remembers = isinstance(self._handler, SigintHandler)
            if remembers and self._handler.pending:  # not checked before
                self.failure = KeyboardInterrupt()
        return self

    def __exit__(self, *_exception: object) -> None:
        """Restore the previous handler for SIGINT."""
        if self._handler is not None:
            signal.signal(signal.SIGINT, self._handler)

    def _keep_interrupt(self, _signal: int, _frame: object) -> None:
        self.failure = KeyboardInterrupt()
        if isinstance(self._handler, SigintHandler):
            self._handler.remember()

    @property
    def elapsed(self) -> float:
        """Wall time since the monitor was created, s."""
        return time.perf_counter() - self._began

    def between_iterations(self, objective: float) -> bool:
        """Count an iteration, inform the user, and tell whether the backend has to stop."""
        self.iterations += 1
        if self._progress is not None:
            try:
                self._progress(self.iterations, objective)
            except (KeyboardInterrupt, Exception) as error:  # noqa: BLE001  (`report` raises it)
                self.failure = error
        return self.must_stop()

    def keep(self, x: np.ndarray, objective: float, infeasibility: float) -> None:
        """Store an iterate if it is the best one so far."""
        needed = objective * (1.0 + infeasibility)
        counts = infeasibility <= self._acceptable
        if counts and (self.best is None or needed < self.best[0]):
            self.best = needed, x

    def has_settled(
        self, objective: float, infeasibility: float, *, may_rise: bool = False
    ) -> bool:
        """Tell whether iterates have stopped improving. Store the result in `stagnated`.

        If no limit affects a redundant joint, for example the roll of a tool, there is a set of equally fast motions. A
        solver wanders within this set without ever meeting its optimality conditions. Iterates are compared by their
        objective times 1 + violation. The last iterate has to be feasible. If iterates may become slower before they
        become faster, only those just before the last ones count, and a rise counts as much as a gain.
        """
        needed = objective * (1.0 + infeasibility)
        counts = infeasibility <= max(_NEARLY_FEASIBLE, self._feasible_below)
        self._recent = [*self._recent, needed] if counts else []
        patience = self.options.patience
        first = -2 * patience if may_rise else None
        before = self._recent[first:-patience]
        least = self.options.progress * abs(objective)
        gain = min(before) - min(self._recent[-patience:]) if before else 0.0
        if may_rise:
            gain = abs(gain)
        is_feasible = infeasibility <= self._feasible_below
        self.stagnated = bool(before) and is_feasible and gain <= least
        return self.stagnated

    def ends_interior(
        self, objective: float, infeasibility: float, barrier: float
    ) -> bool:
        """Tell whether an interior-point method has to stop after an iteration, or has settled.

        Such a method moves away from the bounds first, so its iterates are slower than the starting point for some
        time. They count only once the barrier parameter is small.
        """
        stop = self.between_iterations(objective)
        violation = infeasibility if barrier <= _SMALL_BARRIER else np.inf
        return self.has_settled(objective, violation, may_rise=True) or stop

    def must_stop(self) -> bool:
        """Tell whether the user has interrupted the solve, or its time or its evaluations are used up."""
        self.timed_out = self.timed_out or self.elapsed > self.options.time_limit
        # A solver that needs more evaluations than this is stuck at a point that cannot be evaluated.
        self.exhausted = self._evaluations > 10 * self.options.max_iterations
        return self.timed_out or self.exhausted or self.failure is not None

    def objective(self, x: np.ndarray) -> float:
        """Return the objective at x; raise UnreachableError if it is not finite."""
        return float(self._finite(self.program.objective, x))

    def gradient(self, x: np.ndarray) -> np.ndarray:
        """Return the gradient of the objective at x; raise UnreachableError if it is not finite."""
        return self._finite(self.program.gradient, x)

    def rows(self, x: np.ndarray) -> np.ndarray:
        """Return the rows at x; raise UnreachableError if a row is not finite, or once the solve has to stop."""
        return self._evaluate(self.program.rows, x)

    def jacobian(self, x: np.ndarray) -> np.ndarray:
        """Return the Jacobian entries at x; raise as `rows` does."""
        return self._evaluate(self.program.jacobian, x)

    def _evaluate(self, function: Function, x: np.ndarray) -> np.ndarray:
        if self._handler is not None:
            # The backend may have installed its own handler in the meantime.
            signal.signal(signal.SIGINT, self._during)
        if self.must_stop():
            raise UnreachableError("the solve has to stop")
        self._evaluations += 1
        return self._finite(function, x)

    def hessian(
        self, function: Callable[..., np.ndarray], x: np.ndarray, *multipliers: Any
    ) -> np.ndarray:
        """Return the Hessian at x from a function of x and multipliers; raise as `rows` does."""
        if self.must_stop():
            raise UnreachableError("the solve has to stop")
        return self._finite(lambda at: function(at, *multipliers), x)

    def _finite(self, function: Function, x: np.ndarray) -> np.ndarray:
        if not is_usable(x):
            raise UnreachableError("the solver asked for a point that is not finite")
        try:
            with np.errstate(over="ignore", invalid="ignore"):  # checked below
                values = np.asarray(function(np.array(x)))
        except UnreachableError:
            raise
        except (KeyboardInterrupt, Exception) as error:
            # Compiled backends lose exceptions raised in callbacks, for example by a user-defined limit.
            self.failure = error
            raise UnreachableError("the solve has to stop") from error
        if not is_usable(values):
            raise UnreachableError("a value or a slope is not finite at this point")
        return values

    def report(
        self,
        solver: str,
        status: SolveStatus,
        x: np.ndarray,
        multipliers: np.ndarray,
        message: str,
    ) -> SolverReport:
        """Report the solution, with a status that is based on its residuals.

        Raises
        ------
        BaseException
            The stored error or KeyboardInterrupt.
        """
        if self.failure is not None:
            raise self.failure
        violation = residual(self.program, x)
        ends_early = self.timed_out or status is SolveStatus.ITERATION_LIMIT
        if ends_early and violation > self._acceptable and self.best:
            x = self.best[1]
            violation = residual(self.program, x)
            multipliers = np.zeros_like(multipliers)
        if self.stagnated and not status.usable:
            status = SolveStatus.STAGNATED
        feasible = violation <= self._feasible_below
        if status.usable and not feasible:
            status = SolveStatus.INFEASIBLE
        elif self.timed_out and not status.usable:
            status = SolveStatus.TIME_LIMIT
        elif self.exhausted and not status.usable:
            status = SolveStatus.ITERATION_LIMIT
        elif violation == np.inf:
            status = SolveStatus.EVALUATION_ERROR
        objective = objective_at(self.program, x)
        known = (x, objective, violation, multipliers, self.iterations, self.elapsed)
        return SolverReport(solver, status, *known, message)


def is_usable(values: np.ndarray) -> bool:
    """Tell whether all values are finite, and small enough for their products to be finite too."""
    return bool(np.abs(values).max(initial=0.0) <= _LARGEST)


def objective_at(
    program: NonlinearProgram, x: np.ndarray, otherwise: float = np.inf
) -> float:
    """Return the objective at x, or `otherwise` if x cannot be evaluated."""
    try:
        with np.errstate(over="ignore", invalid="ignore"):
            value = program.objective(x)
    except UnreachableError:
        return otherwise
    return otherwise if np.isnan(value) else value


def residual(program: NonlinearProgram, x: np.ndarray) -> float:
    """Return the largest violation of rows and bounds at x; infinite if x cannot be evaluated."""
    of_bounds = np.minimum(x - program.x_lower, program.x_upper - x)
    least = float(np.append(row_slack(program, x), of_bounds).min(initial=0.0))
    return np.inf if np.isnan(least) else 0.0 - least


def report_point(
    solver: str,
    program: NonlinearProgram,
    x: np.ndarray,
    status: SolveStatus,
    message: str,
    wall_time: float = 0.0,
    iterations: int = 0,
) -> SolverReport:
    """Report a point, (v,), that no backend has found, without multipliers."""
    values = (objective_at(program, x), residual(program, x))
    none = np.zeros(len(program.lower))
    effort = (iterations, wall_time)
    return SolverReport(solver, status, x, *values, none, *effort, message)


def row_slack(program: NonlinearProgram, x: np.ndarray) -> np.ndarray:
    """Return distances of rows from their nearer bounds, (c,); negative if violated, -inf if x cannot be evaluated."""
    try:
        with np.errstate(over="ignore", invalid="ignore"):
            rows = program.rows(x)
    except UnreachableError:
        return np.full(len(program.lower), -np.inf)
    slack = np.minimum(rows - program.lower, program.upper - rows)
    return np.nan_to_num(slack, nan=-np.inf, neginf=-np.inf)
