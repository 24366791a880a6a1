"""Where plans are made: processes of this machine, a Dask cluster, or Ray.

A pool takes plans and gives each back with its outcome, as soon as there is one, in any order. A pool is one function
here and one line in `pool_for`.
"""

from __future__ import annotations

import itertools
import os
import threading
import time
from collections import deque
from collections.abc import Callable, Iterable, Iterator
from concurrent.futures import FIRST_COMPLETED, BrokenExecutor, Future, wait
from pathlib import Path
from typing import Any

from brachis import interrupts
from brachis.arguments import count
from brachis.errors import BrachisError, ClusterError, InputError, NotInstalledError
from brachis.sweeps.plans import Plan
from brachis.sweeps.worker import Outcome, planned

_ENDED = "the plan ended its worker process each time: a crash, or too little memory"
Pool = Callable[[Iterable[Plan]], Iterator[tuple[Plan, Outcome]]]
Submit = Callable[[Plan], "Future[Outcome]"]

_ONE_THREAD = dict.fromkeys(
    ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS", "VECLIB_MAXIMUM_THREADS", "NUMEXPR_NUM_THREADS"), "1"
)
"""Environment of worker processes."""
_AHEAD = 2
"""Plans that are handed out for each process, so that none waits for the next one."""
_HEARTBEAT = 1.0
"""Seconds after which Ctrl-C, or a parent that was killed, is noticed at the latest."""
_CONNECTING = 10.0
"""Seconds within which a scheduler answers."""


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
        return lambda plans: in_processes(plans, min(wanted or processors, processors))
    if jobs is not None:
        raise InputError(
            "a cluster has as many processes as it has workers", where="jobs", found=jobs, allowed="jobs or scheduler"
        )
    if scheduler == "ray" or scheduler.startswith("ray://"):
        return lambda plans: on_ray(plans, None if scheduler == "ray" else scheduler)
    return lambda plans: on_dask(plans, scheduler, listener)


def in_processes(plans: Iterable[Plan], jobs: int) -> Iterator[tuple[Plan, Outcome]]:
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
        yield from _as_completed(plans, submit, lambda: _AHEAD * jobs)
    finally:
        with interrupts.postponed():
            processes.shutdown(wait=True, kill_workers=True)


def _end_with_parent(parent: int) -> None:
    """End this worker process soon after its parent: one that was killed cannot, and its workers would wait for it."""

    def watch() -> None:
        while os.getppid() == parent:
            time.sleep(_HEARTBEAT)
        os._exit(1)

    threading.Thread(target=watch, daemon=True).start()


def on_dask(plans: Iterable[Plan], address: str, listener: Callable[[str], None]) -> Iterator[tuple[Plan, Outcome]]:
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
        Dask is not.
    ClusterError
        The scheduler does not answer, or was lost.
    """
    try:
        from dask.distributed import Client, KilledWorker  # noqa: PLC0415  (an extra)
    except ImportError as error:
        raise NotInstalledError("a Dask cluster", "dask", "cluster") from error
    where: dict[str, Any] = {"scheduler_file": address} if Path(address).is_file() else {"address": address}
    try:
        client: Any = Client(**where, timeout=_CONNECTING, set_as_default=False)  # type: ignore[no-untyped-call]
    except (OSError, ValueError, TypeError) as error:
        raise ClusterError("no Dask scheduler answers", where=address, found=str(error)) from error
    with client:
        threads = client.nthreads()
        if not threads:
            listener(f"waiting for workers of {address}")
        if any(number > 1 for number in threads.values()):
            listener("workers with several threads plan slower than as many workers with one: --nthreads 1")
        executor = client.get_executor(pure=False)
        yield from _as_completed(
            plans,
            lambda plan: executor.submit(planned, plan),
            lambda: _AHEAD * max(1, sum(client.nthreads().values())),
            (KilledWorker,),
        )


def on_ray(plans: Iterable[Plan], address: str | None) -> Iterator[tuple[Plan, Outcome]]:
    """Make plans through joblib's Ray backend, batch by batch.

    Parameters
    ----------
    plans : iterable of Plan
    address : str or None
        Of a Ray cluster; None: the one that Ray finds, or starts, here.

    Yields
    ------
    Plan, Outcome

    Raises
    ------
    InputError
        Ray is not installed.
    ClusterError
        The cluster does not answer, or was lost, with it the batch that was under way.
    """
    try:
        import ray  # noqa: PLC0415  (not a dependency)
        from ray.util.joblib import register_ray  # noqa: PLC0415
    except ImportError as error:
        raise InputError("Ray is not installed", found=str(error), hint="pip install ray") from error
    from joblib import Parallel, delayed, parallel_config  # noqa: PLC0415

    started = not ray.is_initialized()
    try:
        ray.init(address=address, ignore_reinit_error=True)
        register_ray()
        waiting, width = iter(plans), _AHEAD * max(1, int(ray.cluster_resources().get("CPU", 1)))
        with parallel_config(backend="ray", n_jobs=-1), Parallel() as parallel:
            while batch := list(itertools.islice(waiting, width)):
                interrupts.check()
                yield from zip(batch, parallel(delayed(planned)(plan) for plan in batch), strict=True)
    except (ray.exceptions.RayError, OSError, RuntimeError, ValueError) as error:
        raise ClusterError("Ray does not answer, or was lost", where=address or "ray", found=str(error)) from error
    finally:
        if started:
            ray.shutdown()


def _as_completed(
    plans: Iterable[Plan], submit: Submit, width: Callable[[], int], lost: tuple[type[Exception], ...] = ()
) -> Iterator[tuple[Plan, Outcome]]:
    """Hand out plans to an executor, a few more than it has workers, and yield what comes back.

    Parameters
    ----------
    plans : iterable of Plan
    submit : callable
    width : callable
        How many plans may be under way.
    lost : tuple of exception types
        With which the executor says that a plan ended its worker time and again.
    """
    waiting, suspects, tested = iter(plans), deque[Plan](), None
    running: dict[Future[Outcome], Plan] = {}
    while True:
        if not suspects:
            taken = list(itertools.islice(waiting, max(0, width() - len(running))))
        else:
            taken = [] if running else [suspects.popleft()]
            tested = taken[0] if taken else tested
        running |= {submit(plan): plan for plan in taken}
        if not running:
            return
        done, _ = wait(running, _HEARTBEAT, FIRST_COMPLETED)
        interrupts.check()
        for future in done:
            plan = running.pop(future)
            try:
                outcome = future.result()
            except BrokenExecutor as error:
                if plan is not tested:
                    suspects.append(plan)
                    continue
                outcome = Outcome.of_error(error, message=_ENDED)
            except lost as error:
                outcome = Outcome.of_error(error, message=_ENDED)
            except BrachisError:
                raise
            except Exception as error:
                found = f"{type(error).__name__}: {error}"
                raise ClusterError("plans cannot be made there", found=found) from error
            yield plan, outcome
