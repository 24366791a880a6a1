"""Pools that run plans: processes on this machine, or the executor of a cluster.

A pool receives plans, and yields each plan with its outcome as soon as the plan is finished, in any order.
"""

from __future__ import annotations

import itertools
import os
import threading
import time
from collections import deque
from collections.abc import Callable, Generator, Iterable, Iterator, Sequence
from concurrent.futures import BrokenExecutor, CancelledError, Executor, Future
from functools import partial

from brachis.apps.sweeps.plans import Plan, PlanOutcome, run_plan
from brachis.common import interrupts
from brachis.common.arguments import check_executor, count
from brachis.errors import BrachisError, ClusterError, InputError
from brachis.search.processes import process_count

Outcomes = Generator[tuple[Plan, PlanOutcome], None, None]
Pool = Callable[[Sequence[Plan]], Outcomes]

AHEAD = 2
"""Number of plans that are handed out for each process, so that no process waits for its next plan."""
HEARTBEAT = 1.0
"""Longest time until Ctrl-C or the end of the parent process is noticed, s."""
_POLL = 0.02
"""Time between two checks for finished plans, s. Plans take tenths of a second or more."""
_CONTINUES = "Finished plans are stored; run the same sweep again to run the others"
_ENDED = "every worker process ended during this plan: a crash, or too little memory"
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
"""Environment variables of worker processes."""


def pool_for(jobs: int | None, executor: Executor | None) -> Pool:
    """Return the pool that runs the plans.

    Parameters
    ----------
    jobs : int or None
        Number of processes on this machine. None means as many as the machine has processors.
    executor : Executor or None
        Executor that runs the plans instead of processes on this machine.

    Raises
    ------
    InputError
        Both are given, or one of them is invalid.
    """
    if executor is None:
        workers = None if jobs is None else count(jobs, "jobs")
        return lambda plans: in_processes(plans, workers)
    check_executor(executor)
    if jobs is not None:
        raise InputError(
            "jobs cannot be set for an executor, which has its own workers",
            where="jobs",
            found=jobs,
            allowed="jobs or executor, not both",
        )
    return lambda plans: on_executor(plans, executor)


def as_completed(
    plans: Iterable[Plan], submit: Callable[[Plan], Future[PlanOutcome]], width: int
) -> Iterator[tuple[Plan, PlanOutcome]]:
    """Hand out plans, up to `width` at a time, and yield their outcomes.

    Plans that were running when a process ended are run again, one at a time, to find out which plan ends its process.
    Futures of some clusters have only ``done``, ``exception``, ``result`` and ``cancel``.
    """
    waiting = iter(plans)
    suspects = deque[Plan]()
    tested: Plan | None = None
    running: dict[Future[PlanOutcome], Plan] = {}
    try:
        while True:
            if not suspects:
                free = itertools.islice(waiting, max(0, width - len(running)))
                running |= {submit(plan): plan for plan in free}
            elif not running:
                tested = suspects.popleft()
                running[submit(tested)] = tested
            if not running:
                return
            interrupts.check()
            done = [future for future in running if future.done()]
            if not done:
                time.sleep(_POLL)
            for future in done:
                plan = running.pop(future)
                if isinstance(_error_of(future), BrokenExecutor) and plan is not tested:
                    suspects.append(plan)
                else:
                    yield plan, _outcome_of(future)
    finally:
        for future in running:
            future.cancel()


def _error_of(future: Future[PlanOutcome]) -> BaseException | None:
    try:
        return future.exception()
    except CancelledError as error:
        return error


def _outcome_of(future: Future[PlanOutcome]) -> PlanOutcome:
    """Return the outcome of a plan. `run_plan` turns every error into an outcome, except errors of the worker."""
    error = _error_of(future)
    if error is None:
        return future.result()
    if isinstance(error, BrokenExecutor):
        return PlanOutcome.of_error(error, message=_ENDED)
    if isinstance(error, BrachisError) or not isinstance(error, Exception):
        raise error
    if isinstance(error, OSError | CancelledError | ImportError):
        raise ClusterError(
            "workers failed to make plans",
            found=f"{type(error).__name__}: {error}",
            hint=_CONTINUES,
        ) from error
    return PlanOutcome.of_error(error)


def on_executor(plans: Sequence[Plan], executor: Executor) -> Outcomes:
    """Run plans with an executor, which receives all of them at once.

    Yields
    ------
    Plan, PlanOutcome

    Raises
    ------
    ClusterError
        The workers have ended, cannot be reached, or cannot run brachis.
    """
    try:
        yield from as_completed(
            plans, lambda plan: executor.submit(run_plan, plan), len(plans)
        )
    except BrokenExecutor as error:
        raise ClusterError(
            "the executor's workers ended", found=str(error), hint=_CONTINUES
        ) from error


def in_processes(plans: Sequence[Plan], jobs: int | None) -> Outcomes:
    """Run plans in processes on this machine.

    A plan fails if it ends its process (by a crash, or for lack of memory). Plans that were running at the same time
    are run again.

    Parameters
    ----------
    plans : sequence of Plan
    jobs : int or None
        Maximum number of processes, which is also limited by the numbers of processors and plans. None means as many as
        possible.

    Yields
    ------
    Plan, PlanOutcome
    """
    from joblib.externals.loky import ProcessPoolExecutor

    width = min(process_count(jobs or "auto"), max(len(plans), 1))
    executor = partial(
        ProcessPoolExecutor,
        width,
        env=_ONE_THREAD,
        initializer=_end_with_parent,
        initargs=(os.getpid(),),
    )
    processes = executor()

    def submit(plan: Plan) -> Future[PlanOutcome]:
        """Hand out a plan, and start new processes if the old ones ended."""
        nonlocal processes
        with interrupts.block_in_children():  # submitting a plan may start processes
            try:
                return processes.submit(run_plan, plan)
            except BrokenExecutor:
                processes = executor()
                return processes.submit(run_plan, plan)

    try:
        yield from as_completed(plans, submit, AHEAD * width)
    finally:
        with interrupts.defer():
            processes.shutdown(wait=True, kill_workers=True)


def _end_with_parent(parent: int) -> None:
    """End this worker process soon after its parent ends, because a killed parent cannot end its workers."""

    def watch() -> None:
        """Wait for the end of the parent process."""
        while os.getppid() == parent:
            time.sleep(HEARTBEAT)
        os._exit(1)

    interrupts.ignore()
    threading.Thread(target=watch, daemon=True).start()
