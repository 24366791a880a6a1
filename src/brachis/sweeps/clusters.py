"""Plans made on a Dask cluster, or through Ray."""

from __future__ import annotations

import itertools
from collections.abc import Callable, Generator, Iterable, Iterator
from concurrent.futures import CancelledError
from contextlib import contextmanager
from typing import Any

from brachis import interrupts
from brachis.errors import ClusterError, InputError, NotInstalledError
from brachis.files import is_file
from brachis.sweeps.completed import AHEAD, as_completed
from brachis.sweeps.plans import Plan
from brachis.sweeps.worker import Outcome, planned

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
        from dask.distributed import Client, KilledWorker  # noqa: PLC0415  (an extra)
    except ImportError as error:
        raise NotInstalledError("a Dask cluster", "dask", "cluster") from error
    where: dict[str, Any] = {"scheduler_file": address} if is_file(address) else {"address": address}
    try:
        client: Any = Client(**where, timeout=_CONNECTING, set_as_default=False)  # type: ignore[no-untyped-call]
    except (OSError, ValueError, TypeError) as error:
        raise ClusterError("no Dask scheduler answers", where=address, found=str(error)) from error
    with _answering(address), client:
        threads = client.nthreads()
        if not threads:
            listener(f"waiting for workers of {address}")
        if any(number > 1 for number in threads.values()):
            listener("workers with several threads plan slower than as many workers with one: --nthreads 1")
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
        raise ClusterError("the Dask scheduler was lost", where=address, found=str(error), hint=hint) from error


def on_ray(plans: Iterable[Plan], address: str | None) -> Generator[tuple[Plan, Outcome], None, None]:
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
        waiting, width = iter(plans), AHEAD * max(1, int(ray.cluster_resources().get("CPU", 1)))
        with parallel_config(backend="ray", n_jobs=-1), Parallel() as parallel:
            while batch := list(itertools.islice(waiting, width)):
                interrupts.check()
                yield from zip(batch, parallel(delayed(planned)(plan) for plan in batch), strict=True)
    except (ray.exceptions.RayError, OSError, RuntimeError, ValueError) as error:
        raise ClusterError("Ray does not answer, or was lost", where=address or "ray", found=str(error)) from error
    finally:
        if started:
            ray.shutdown()
