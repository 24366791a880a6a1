"""Work for several processes."""

from __future__ import annotations

import multiprocessing
import os
import time
import warnings
from collections.abc import Callable, Generator, Sequence
from concurrent.futures import BrokenExecutor
from pickle import PicklingError
from typing import Any, TypeVar

from threadpoolctl import ThreadpoolController

from brachis.common import interrupts
from brachis.common.deadline import NEVER, Deadline
from brachis.common.progress import Listener, ignore
from brachis.errors import BrachisError

_MAIN = "MainProcess"
_START = 5.0
"""Seconds that processes may take to start: two on a free machine, more on a busy one."""

_PAYS = 6.0
"""Seconds of work for which other processes are started."""

_Given = TypeVar("_Given")
_Made = TypeVar("_Made")


def run_in_processes(
    function: Callable[..., _Made],
    given: Sequence[_Given],
    *others: object,
    jobs: int | str,
    listener: Listener,
    deadline: Deadline = NEVER,
) -> Generator[_Made, None, None]:
    """Do a piece of work for every item, in up to `jobs` processes.

    Parameters
    ----------
    function : callable
        ``function(item, *others, listener)``; a function of a module, so that it can be sent to other processes.
    given : sequence
        The items.
    *others : object
        The same for all items.
    jobs : int or "auto"
        With 1, and within another program's workers, the work is done here, item by item as it is asked for. With
        ``auto`` it is, until what is left takes longer than to start other processes.
    listener : callable
        Only heard of work that is done here.
    deadline : Deadline, optional
        By which processes have to have started.

    Yields
    ------
    object
        What the function returns, in the order of the items.

    Raises
    ------
    BrachisError
        The work cannot be sent to other processes, or a process ended before its work was done.
    """
    count = process_count(jobs, deadline)
    is_alone = count == 1 or len(given) <= 1 or _within_a_worker()
    taken = 0.0
    done = 0
    for item in given:
        left = taken / max(done, 1) * (len(given) - done)
        pays = jobs != "auto" or (left > _PAYS and deadline.left >= _START)
        if not is_alone and pays:
            break
        interrupts.check()
        began = time.perf_counter()
        made_here = function(item, *others, listener)
        taken += time.perf_counter() - began
        done += 1
        yield made_here
    given = given[done:]
    if not given:
        return
    interrupts.check()
    from joblib import Parallel, delayed

    made: Any = None
    try:
        with (
            interrupts.block_in_children()
        ):  # joblib would lose a press, and its processes die of it
            made = Parallel(n_jobs=count, backend="loky", return_as="generator")(
                delayed(_apart)(function, item, *others) for item in given
            )
        for one in made:  # noqa: UP028  ("yield from" would close `made` before the lines below)
            yield one
    except (BrokenExecutor, PicklingError) as error:
        raise BrachisError(
            "the worker processes cannot run the plans",
            found=str(error).partition("\n")[0].rstrip("."),
            hint="Set search.jobs: 1, or put your own limit or closed form in a module that the workers can import",
        ) from error
    finally:
        with (
            interrupts.defer(),
            warnings.catch_warnings(),
        ):  # that work is thrown away is meant
            warnings.simplefilter("ignore")
            if made is not None:
                made.close()


def process_count(jobs: int | str, deadline: Deadline = NEVER) -> int:
    """Return the number of processes that is used where a task asks for `jobs`, a number or ``auto``.

    Never more than there are processors; only this one if the others would not have started by the deadline.
    """
    most = os.cpu_count() or 1
    wanted = most if isinstance(jobs, str) else min(jobs, most)
    return 1 if deadline.left < _START else wanted


def _within_a_worker() -> bool:
    """Tell whether this is somebody's worker process: processes of processes would multiply."""
    from joblib.parallel import get_active_backend

    return (
        bool(get_active_backend()[0].nesting_level)
        or multiprocessing.current_process().name != _MAIN
    )


def _apart(function: Callable[..., _Made], *arguments: object) -> _Made:
    """Run in a process of its own: one thread for linear algebra, nobody listening."""
    with ThreadpoolController().limit(limits=1, user_api="blas"):
        return function(*arguments, ignore)
