"""Where plans are made: processes of this machine or a Dask cluster.

A pool takes plans and gives each back with its outcome, as soon as there is one, in any order.
"""

from __future__ import annotations

import itertools
import os
import tempfile
import threading
import time
import warnings
from collections import deque
from collections.abc import Callable, Generator, Iterable, Iterator, Sequence
from concurrent.futures import (
    FIRST_COMPLETED,
    BrokenExecutor,
    CancelledError,
    Future,
    wait,
)
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import brachis
from brachis import planner
from brachis.apps.sweeps.plans import Plan, robot_of
from brachis.common import interrupts
from brachis.common.arguments import count
from brachis.common.files import is_file
from brachis.errors import BrachisError, ClusterError, InputError, NotInstalledError
from brachis.result import Result
from brachis.robot.plausibility import PlausibilityWarning

VERIFIED, UNVERIFIED, FAILED = "verified", "unverified", "failed"


@dataclass(frozen=True)
class Outcome:
    """What came of a plan.

    Attributes
    ----------
    facts : dict
        Values of `brachis.apps.sweeps.result.COLUMNS`; those that are left out are null.
    motion : bytes or None
        The saved trajectory, an npz archive.
    """

    facts: dict[str, Any]
    motion: bytes | None = None

    @classmethod
    def of_error(
        cls, error: BaseException, wall_time: float | None = None, *, message: str = ""
    ) -> Outcome:
        """Return the outcome of a plan that failed; the message is the error's own unless another is given."""
        message = message or str(error) or type(error).__name__
        return cls(
            {
                "status": FAILED,
                "error": type(error).__name__,
                "message": message,
                "wall_time_s": wall_time,
            }
        )


def planned(plan: Plan) -> Outcome:
    """Make a plan.

    Raises
    ------
    ClusterError
        This process has another version of brachis than the one that asks.
    """
    if plan.version != brachis.__version__:
        problem = "a worker has another version of brachis"
        raise ClusterError(
            problem,
            found=brachis.__version__,
            allowed=plan.version,
            hint="Install the same everywhere",
        )
    began = time.perf_counter()
    try:
        with warnings.catch_warnings():
            warnings.simplefilter(
                "ignore", PlausibilityWarning
            )  # they are among the outcome's remarks
            result = planner.plan(
                robot_of(plan), plan.task, progress=False, check_advice=False
            )
        return Outcome(_facts(result, time.perf_counter() - began), _saved(result))
    except Exception as error:  # noqa: BLE001  (of thousands of plans one must not end the others, whatever it is)
        return Outcome.of_error(error, time.perf_counter() - began)


def _facts(result: Result, wall_time: float) -> dict[str, Any]:
    remarks = [
        *map(str, result.warnings),
        *(f"left undone: {each}" for each in result.not_completed),
    ]
    return {
        "status": VERIFIED if result.verified else UNVERIFIED,
        "t_end_s": result.t_end,
        "worst_ratio": result.verification.worst_ratio,
        "path_error": result.verification.path_error,
        "chosen_joints": ", ".join(result.trajectory.redundant_joints),
        "chosen_branch": result.trajectory.branch,
        "chosen_solver": result.solver_report.solver,
        "iterations": sum(report.iterations for report in result.candidate.reports),
        "wall_time_s": wall_time,
        "remarks": "; ".join(remarks) or None,
    }


def _saved(result: Result) -> bytes:
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "motion.npz"
        result.trajectory.save(path)
        return path.read_bytes()


Submit = Callable[[Plan], "Future[Outcome]"]
AHEAD = 2
"""Plans that are handed out for each process, so that none waits for the next one."""
HEARTBEAT = 1.0
"""Seconds after which Ctrl-C, or a parent that was killed, is noticed at the latest."""
_ENDED = "the plan ended its worker process each time: a crash, or too little memory"


def as_completed(
    plans: Iterable[Plan],
    submit: Submit,
    width: Callable[[], int],
    lost: tuple[type[Exception], ...] = (),
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
        done, _ = wait(running, HEARTBEAT, FIRST_COMPLETED)
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
            except (
                BrachisError,
                CancelledError,
            ):  # of the connection, in whose words the caller speaks
                raise
            except Exception as error:
                found = f"{type(error).__name__}: {error}"
                raise ClusterError("plans cannot be made there", found=found) from error
            yield plan, outcome


_CONNECTING = 10.0
"""Seconds within which a scheduler answers."""


def on_dask(
    plans: Iterable[Plan], address: str, listener: Callable[[str], None]
) -> Generator[tuple[Plan, Outcome], None, None]:
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
        from dask.distributed import Client, KilledWorker
    except ImportError as error:
        raise NotInstalledError("a Dask cluster", "dask", "cluster") from error
    where: dict[str, Any] = (
        {"scheduler_file": address} if is_file(address) else {"address": address}
    )
    try:
        client: Any = Client(**where, timeout=_CONNECTING, set_as_default=False)  # type: ignore[no-untyped-call]
    except (OSError, ValueError, TypeError) as error:
        raise ClusterError(
            "no Dask scheduler answers", where=address, found=str(error)
        ) from error
    with _answering(address), client:
        threads = client.nthreads()
        if not threads:
            listener(f"waiting for workers of {address}")
        if any(number > 1 for number in threads.values()):
            listener(
                "workers with several threads plan slower than as many workers with one: --nthreads 1"
            )
        executor = client.get_executor(pure=False)
        yield from as_completed(
            plans,
            lambda plan: executor.submit(planned, plan),
            lambda: AHEAD * max(1, sum(client.nthreads().values())),
            (KilledWorker,),
        )


@contextmanager
def _answering(address: str) -> Iterator[None]:
    """Say that the scheduler was lost where the client says how its connection ended."""
    try:
        yield
    except (OSError, CancelledError) as error:
        hint = "Finished plans are stored: the same sweep goes on once the scheduler runs again"
        raise ClusterError(
            "the Dask scheduler was lost", where=address, found=str(error), hint=hint
        ) from error


Pool = Callable[[Sequence[Plan]], Generator[tuple[Plan, Outcome], None, None]]

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


def pool_for(
    jobs: int | None, scheduler: str | None, listener: Callable[[str], None]
) -> Pool:
    """Choose where plans are made.

    Parameters
    ----------
    jobs : int or None
        Processes on this machine; None: as many as it has processors.
    scheduler : str or None
        Address of a Dask scheduler (``tcp://host:8786``) or its scheduler file (``scheduler.json``); None: processes on
        this machine.
    listener : callable
        Told of what is odd about a cluster.

    Raises
    ------
    InputError
        Both are given, or one is wrong.
    """
    if scheduler is None:
        wanted = None if jobs is None else count(jobs, "jobs")
        processors = (
            len(os.sched_getaffinity(0))
            if hasattr(os, "sched_getaffinity")
            else os.cpu_count() or 1
        )
        return lambda plans: in_processes(
            plans, min(wanted or processors, processors, max(len(plans), 1))
        )
    if jobs is not None:
        raise InputError(
            "a cluster has as many processes as it has workers",
            where="jobs",
            found=jobs,
            allowed="jobs or scheduler",
        )
    return lambda plans: on_dask(plans, scheduler, listener)


def in_processes(
    plans: Iterable[Plan], jobs: int
) -> Generator[tuple[Plan, Outcome], None, None]:
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
    from joblib.externals.loky import ProcessPoolExecutor

    def executor() -> Any:
        parent = (os.getpid(),)
        return ProcessPoolExecutor(
            jobs, env=_ONE_THREAD, initializer=_end_with_parent, initargs=parent
        )

    processes = executor()

    def submit(plan: Plan) -> Future[Outcome]:
        nonlocal processes
        with (
            interrupts.block_in_children()
        ):  # processes are started here, which are not to hear Ctrl-C
            try:
                return processes.submit(planned, plan)
            except BrokenExecutor:
                processes = executor()
                return processes.submit(planned, plan)

    try:
        yield from as_completed(plans, submit, lambda: AHEAD * jobs)
    finally:
        with interrupts.defer():
            processes.shutdown(wait=True, kill_workers=True)


def _end_with_parent(parent: int) -> None:
    """End this worker process soon after its parent: one that was killed cannot, and its workers would wait for it."""

    def watch() -> None:
        while os.getppid() == parent:
            time.sleep(HEARTBEAT)
        os._exit(1)

    threading.Thread(target=watch, daemon=True).start()
