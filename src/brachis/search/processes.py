"""Work shared between this process and other processes.

This process works while the others start, and waits only when all work is handed out.
"""

from __future__ import annotations

import atexit
import multiprocessing
import os
import time
from collections.abc import Callable, Generator, Sequence
from concurrent.futures import BrokenExecutor, Future, wait
from functools import cache
from importlib import import_module
from pickle import PicklingError
from typing import Any, TypeVar

from brachis.common import interrupts
from brachis.common.progress import Listener, ignore
from brachis.common.threads import use_one_thread
from brachis.errors import BrachisError

_MAIN = "MainProcess"
_WORTH_STARTING = 3.0
"""Minimum remaining work, s, for which other processes are started; starting them takes a second or two."""
_WORTH_SENDING = 0.7
"""Minimum remaining work, s, for which work is handed out to processes that were started earlier."""
_IDLE_TIME = 300.0
"""Time, s, after which a process without work ends."""
_HEARTBEAT = 0.1
"""Maximum time, s, until Ctrl-C is noticed."""

_Input = TypeVar("_Input")
_Output = TypeVar("_Output")


def run_in_processes(
    function: Callable[..., _Output],
    arguments: Sequence[_Input],
    *shared_arguments: object,
    jobs: int | str,
    listener: Listener,
) -> Generator[_Output, None, None]:
    """Call a function once for each argument, in up to `jobs` processes.

    Work that was handed out is completed even if its result is no longer wanted.

    Parameters
    ----------
    function : callable
        ``function(argument, *shared_arguments, listener)``; a function of a module, so that it can be sent to other
        processes.
    arguments : sequence
        One argument for each call.
    *shared_arguments : object
        Further arguments, the same for all calls.
    jobs : int or "auto"
        With 1, or inside a worker of another program, the work is done in this process, one call at a time, as results
        are requested. With ``auto`` this is also the case until the remaining work is expected to take longer than 3 s,
        or 0.7 s if an earlier plan has started the processes. Work that cannot be sent to other processes is done here
        too.
    listener : callable
        Called only for work that is done in this process.

    Yields
    ------
    object
        What the function returns, in the order of the arguments.

    Raises
    ------
    BrachisError
        A process ended before its work was done.
    """
    count = process_count(jobs)
    is_alone = count == 1 or len(arguments) <= 1 or _is_within_a_worker()
    outcomes: list[Future[_Output]] = []
    elapsed = 0.0
    done = 0
    for number in range(len(arguments)):
        while number == len(outcomes) or not outcomes[number].done():
            interrupts.check()
            waiting = arguments[len(outcomes) :]
            has_workers = _start_workers.cache_info().currsize > 0
            worth = _WORTH_SENDING if has_workers else _WORTH_STARTING
            is_long = elapsed / max(done, 1) * len(waiting) > worth
            if not is_alone and (jobs != "auto" or is_long):
                outcomes += _hand_out(count - 1, waiting, function, *shared_arguments)
            if len(outcomes) < len(arguments):
                began = time.perf_counter()
                argument = arguments[len(outcomes)]
                outcomes.append(
                    _do_here(function, argument, *shared_arguments, listener)
                )
                elapsed += time.perf_counter() - began
                done += 1
            else:
                wait([outcomes[number]], _HEARTBEAT)
        failure = outcomes[number].exception()
        if isinstance(failure, BrokenExecutor | PicklingError):
            _refuse_lost_work(failure)
            outcomes[number] = _do_here(
                function, arguments[number], *shared_arguments, listener
            )
        yield outcomes[number].result()


def _hand_out(
    count: int,
    waiting: Sequence[_Input],
    function: Callable[..., _Output],
    *shared_arguments: object,
) -> list[Future[_Output]]:
    """Hand out the first arguments to `count` processes: as many as they can take, but no more than their share."""
    workers = _start_workers(count, os.getpid())
    share = len(waiting) * count // (count + 1)
    quota = min(share, workers.count_free())
    return [
        workers.submit(function, argument, *shared_arguments)
        for argument in waiting[:quota]
    ]


def _refuse_lost_work(failure: Exception) -> None:
    """Raise an error if a process ended, perhaps because of its work; work that could not be sent can be done here."""
    from joblib.externals.loky.process_executor import TerminatedWorkerError

    if isinstance(failure, BrokenExecutor):
        _start_workers.cache_clear()
    if isinstance(failure, TerminatedWorkerError):
        raise BrachisError(
            "a process that helped with the plan ended before its work was done",
            found=str(failure).partition("\n")[0].rstrip("."),
            hint="Set search.jobs: 1",
        ) from failure


def process_count(jobs: int | str) -> int:
    """Return the number of processes to use if a task asks for `jobs`, a number or ``auto``.

    It is never larger than the number of processors available to this process.
    """
    if jobs == 1:
        return 1
    from joblib import cpu_count

    processors = int(cpu_count())
    return processors if isinstance(jobs, str) else min(jobs, processors)


class _Workers:
    """A pool of `count` other processes."""

    def __init__(self, count: int) -> None:
        from joblib.externals.loky import ProcessPoolExecutor

        self._executor = ProcessPoolExecutor(
            count, timeout=_IDLE_TIME, initializer=interrupts.ignore
        )
        atexit.register(self._end, os.getpid())
        self._under_way: list[Future[Any]] = []
        self._starting = [self.submit(_import_planner) for _ in range(count)]

    def submit(
        self, function: Callable[..., _Output], *arguments: object
    ) -> Future[_Output]:
        """Hand out a piece of work."""
        with interrupts.block_in_children():
            future = self._executor.submit(_run_in_worker, function, *arguments)
        self._under_way.append(future)
        return future

    def _end(self, owner: int) -> None:
        """End the processes when the process that owns them ends, but not when a fork of it ends."""
        if os.getpid() == owner:
            self._executor.shutdown(kill_workers=True)

    def count_free(self) -> int:
        """Count the pieces of work that may be handed out: two for each process that is ready."""
        self._under_way = [future for future in self._under_way if not future.done()]
        ready = sum(future.done() for future in self._starting)
        return max(0, 2 * ready - len(self._under_way))


@cache
def _start_workers(count: int, _owner: int) -> _Workers:
    """Start other processes, once for the process with the number `_owner`; a fork of it needs its own pool."""
    return _Workers(count)


def _import_planner(_listener: Listener) -> None:
    """Import the modules that plans need."""
    import_module("brachis.search.portfolio")


def _do_here(function: Callable[..., _Output], *arguments: object) -> Future[_Output]:
    """Do a piece of work in this process."""
    outcome: Future[_Output] = Future()
    try:
        outcome.set_result(function(*arguments))
    except BrachisError as error:  # raised when the outcome is asked for
        outcome.set_exception(error)
    return outcome


def _run_in_worker(function: Callable[..., _Output], *arguments: object) -> _Output:
    """Do a piece of work in another process, with one thread for linear algebra and without a listener."""
    with use_one_thread():
        return function(*arguments, ignore)


def _is_within_a_worker() -> bool:
    """Tell whether this process is itself a worker; workers that started workers would multiply."""
    from joblib.parallel import get_active_backend

    return (
        bool(get_active_backend()[0].nesting_level)
        or multiprocessing.current_process().name != _MAIN
    )
