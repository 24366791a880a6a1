"""Where plans are made: processes of this machine, a Dask cluster, or Ray.

A pool takes plans and gives each back with its outcome, as soon as there is one, in any order: one function, and one
line in `pool_for`.
"""

from __future__ import annotations

import os
import threading
import time
from collections.abc import Callable, Generator, Iterable, Sequence
from concurrent.futures import BrokenExecutor, Future
from typing import Any

from brachis import interrupts
from brachis.arguments import count
from brachis.errors import InputError
from brachis.sweeps.clusters import on_dask, on_ray
from brachis.sweeps.completed import AHEAD, HEARTBEAT, as_completed
from brachis.sweeps.plans import Plan
from brachis.sweeps.worker import Outcome, planned

Pool = Callable[[Sequence[Plan]], Generator[tuple[Plan, Outcome], None, None]]

_ONE_THREAD = dict.fromkeys(
    ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS", "VECLIB_MAXIMUM_THREADS", "NUMEXPR_NUM_THREADS"), "1"
)
"""Environment of worker processes."""


def pool_for(jobs: int | None, scheduler: str | None, listener: Callable[[str], None]) -> Pool:
    """Choose where plans are made.

    Parameters
    ----------
    jobs : int or None
        Processes on this machine; None: as many as it has processors.
    scheduler : str or None
        Address of a Dask scheduler (``tcp://host:8786``), its scheduler file (``scheduler.json``), ``ray`` or
        ``ray://host:10001``; None: processes on this machine.
    listener : callable
        Told of what is odd about a cluster.

    Raises
    ------
    InputError
        Both are given, or one is wrong.
    """
    if scheduler is None:
        wanted = None if jobs is None else count(jobs, "jobs")
        processors = len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1
        return lambda plans: in_processes(plans, min(wanted or processors, processors, max(len(plans), 1)))
    if jobs is not None:
        raise InputError(
            "a cluster has as many processes as it has workers", where="jobs", found=jobs, allowed="jobs or scheduler"
        )
    if scheduler == "ray" or scheduler.startswith("ray://"):
        return lambda plans: on_ray(plans, None if scheduler == "ray" else scheduler)
    return lambda plans: on_dask(plans, scheduler, listener)


def in_processes(plans: Iterable[Plan], jobs: int) -> Generator[tuple[Plan, Outcome], None, None]:
    """Make plans in processes of this machine.

    A plan that ends its process (memory, a crash) fails; those that were made beside it are made again, one at a time.

    Parameters
    ----------
    plans : iterable of Plan
    jobs : int
        Number of processes.

    Yields
    ------
    Plan, Outcome
    """
    from joblib.externals.loky import ProcessPoolExecutor  # noqa: PLC0415  (a fifth of a second)

    def executor() -> Any:  # noqa: ANN401
        parent = (os.getpid(),)
        return ProcessPoolExecutor(jobs, env=_ONE_THREAD, initializer=_end_with_parent, initargs=parent)

    processes = executor()

    def submit(plan: Plan) -> Future[Outcome]:
        nonlocal processes
        with interrupts.blocked():  # processes are started here, which are not to hear Ctrl-C
            try:
                return processes.submit(planned, plan)
            except BrokenExecutor:
                processes = executor()
                return processes.submit(planned, plan)

    try:
        yield from as_completed(plans, submit, lambda: AHEAD * jobs)
    finally:
        with interrupts.postponed():
            processes.shutdown(wait=True, kill_workers=True)


def _end_with_parent(parent: int) -> None:
    """End this worker process soon after its parent: one that was killed cannot, and its workers would wait for it."""

    def watch() -> None:
        while os.getppid() == parent:
            time.sleep(HEARTBEAT)
        os._exit(1)

    threading.Thread(target=watch, daemon=True).start()
