"""Where plans are made: processes of this machine or a Dask cluster.

A pool takes plans and gives each back with its outcome, as soon as there is one, in any order.
"""

from __future__ import annotations

import itertools
import os
import threading
import time
from collections import deque
from collections.abc import Callable, Generator, Iterable, Iterator, Sequence
from concurrent.futures import (
    FIRST_COMPLETED,
    BrokenExecutor,
    CancelledError,
    Future,
    wait,
)
from functools import partial

from brachis.apps.export.rows import require_library
from brachis.apps.sweeps.plans import Outcome, Plan, run_plan
from brachis.common import interrupts
from brachis.common.arguments import count
from brachis.common.files import is_file
from brachis.common.progress import Listener
from brachis.errors import BrachisError, ClusterError, InputError

Outcomes = Generator[tuple[Plan, Outcome], None, None]
Pool = Callable[[Sequence[Plan]], Outcomes]

AHEAD = 2
"""Plans that are handed out for each process, so that none waits for the next one."""
HEARTBEAT = 1.0
"""Time until Ctrl-C, or the end of the parent process, is noticed, s."""
_CONNECTING = 10.0
"""Time in which a scheduler has to answer, s."""
_ENDED = "each worker process ended during this plan: a crash, or too little memory"
_ONE_THREAD = dict.fromkeys(
    (
        "OMP_NUM_THREADS",
        "OPENBLAS_NUM_THREADS",
        "MKL_NUM_THREADS",
        "VECLIB_MAXIMUM_THREADS",
        "NUMEXPR_NUM_THREADS",
    ),
    "1",
)
"""Environment of worker processes."""


def pool_for(jobs: int | None, scheduler: str | None, listener: Listener) -> Pool:
    """Choose where plans are made.

    Parameters
    ----------
    jobs : int or None
        Processes on this machine; None: as many as it has processors.
    scheduler : str or None
        Address of a Dask scheduler (``tcp://host:8786``) or its scheduler file (``scheduler.json``); None: processes on
        this machine.
    listener : callable
        Called with messages about a cluster.

    Raises
    ------
    InputError
        Both are given, or one is wrong.
    """
    if scheduler is None:
        wanted = None if jobs is None else count(jobs, "jobs")
        return lambda plans: in_processes(plans, wanted)
    if jobs is not None:
        raise InputError(
            "jobs cannot be set for a cluster, which runs one process per worker",
            where="jobs",
            found=jobs,
            allowed="jobs or scheduler, not both",
        )
    return lambda plans: on_dask(plans, scheduler, listener)


def as_completed(
    plans: Iterable[Plan],
    submit: Callable[[Plan], Future[Outcome]],
    width: Callable[[], int],
    lost: tuple[type[Exception], ...] = (),
) -> Iterator[tuple[Plan, Outcome]]:
    """Hand out plans to an executor, a few more than it has workers, and yield what comes back.

    Plans that were under way when a process ended are made again, one at a time, so that the one that ends it is known.

    Parameters
    ----------
    plans : iterable of Plan
    submit : callable
    width : callable
        How many plans may be under way.
    lost : tuple of exception types
        With which the executor says that a plan ended its worker time and again.
    """
    waiting = iter(plans)
    suspects = deque[Plan]()
    tested: Plan | None = None
    running: dict[Future[Outcome], Plan] = {}
    while True:
        if not suspects:
            free = max(0, width() - len(running))
            running |= {submit(plan): plan for plan in itertools.islice(waiting, free)}
        elif not running:
            tested = suspects.popleft()
            running[submit(tested)] = tested
        if not running:
            return
        done, _ = wait(running, HEARTBEAT, FIRST_COMPLETED)
        interrupts.check()
        for future in done:
            plan = running.pop(future)
            if isinstance(future.exception(), BrokenExecutor) and plan is not tested:
                suspects.append(plan)
            else:
                yield plan, _outcome_of(future, lost)


def _outcome_of(future: Future[Outcome], lost: tuple[type[Exception], ...]) -> Outcome:
    error = future.exception()
    if error is None:
        return future.result()
    if isinstance(error, (BrokenExecutor, *lost)):
        return Outcome.of_error(error, message=_ENDED)
    if isinstance(error, BrachisError) or not isinstance(error, Exception):
        raise error
    found = f"{type(error).__name__}: {error}"
    raise ClusterError("workers failed to make plans", found=found) from error


def on_dask(plans: Iterable[Plan], address: str, listener: Listener) -> Outcomes:
    """Make plans on a Dask cluster; workers may come and go meanwhile.

    Parameters
    ----------
    plans : iterable of Plan
    address : str
        Of the scheduler, or its scheduler file.
    listener : callable

    Yields
    ------
    Plan, Outcome

    Raises
    ------
    NotInstalledError
        Dask is not installed.
    ClusterError
        The scheduler does not answer, or was lost.
    """
    dask = require_library("dask.distributed", "a Dask cluster", extra="cluster")
    where = {"scheduler_file" if is_file(address) else "address": address}
    try:
        client = dask.Client(**where, timeout=_CONNECTING, set_as_default=False)
    except (OSError, ValueError, TypeError) as error:
        raise ClusterError(
            "no Dask scheduler answers", where=address, found=str(error)
        ) from error
    try:
        with client:
            threads = client.nthreads()
            if not threads:
                listener(f"waiting for workers of {address}")
            if any(number > 1 for number in threads.values()):
                listener(
                    "workers with several threads are slower than workers with one thread; start them with --nthreads 1"
                )
            executor = client.get_executor(pure=False)
            yield from as_completed(
                plans,
                lambda plan: executor.submit(run_plan, plan),
                lambda: AHEAD * max(1, sum(client.nthreads().values())),
                (dask.KilledWorker,),
            )
    except (OSError, CancelledError) as error:
        raise ClusterError(
            "the connection to the Dask scheduler was lost",
            where=address,
            found=str(error),
            hint="Finished plans are stored: run the same sweep again when the scheduler runs, and it continues",
        ) from error


def in_processes(plans: Sequence[Plan], jobs: int | None) -> Outcomes:
    """Make plans in processes of this machine.

    A plan that ends its process (memory, a crash) fails; those that were made beside it are made again.

    Parameters
    ----------
    plans : sequence of Plan
    jobs : int or None
        Number of processes, if there are as many processors and plans; None: as many as possible.

    Yields
    ------
    Plan, Outcome
    """
    from joblib import cpu_count
    from joblib.externals.loky import ProcessPoolExecutor

    processors = cpu_count()
    width = min(jobs or processors, processors, max(len(plans), 1))

    executor = partial(
        ProcessPoolExecutor,
        width,
        env=_ONE_THREAD,
        initializer=_end_with_parent,
        initargs=(os.getpid(),),
    )
    processes = executor()

    def submit(plan: Plan) -> Future[Outcome]:
        """Hand out a plan, to new processes if the old ones ended."""
        nonlocal processes
        with interrupts.block_in_children():  # this may start processes
            try:
                return processes.submit(run_plan, plan)
            except BrokenExecutor:
                processes = executor()
                return processes.submit(run_plan, plan)

    try:
        yield from as_completed(plans, submit, lambda: AHEAD * width)
    finally:
        with interrupts.defer():
            processes.shutdown(wait=True, kill_workers=True)


def _end_with_parent(parent: int) -> None:
    """End this worker process soon after its parent: a parent that was killed cannot end its workers."""

    def watch() -> None:
        """Wait for the end of the parent."""
        while os.getppid() == parent:
            time.sleep(HEARTBEAT)
        os._exit(1)

    interrupts.ignore()
    threading.Thread(target=watch, daemon=True).start()
