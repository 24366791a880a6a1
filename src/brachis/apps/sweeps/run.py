"""Running a sweep: what is stored is kept, the rest is planned, and every plan is stored as soon as it is finished."""

from __future__ import annotations

import math
import os
import time
from collections.abc import Mapping
from contextlib import closing
from pathlib import Path
from typing import Any

import brachis
from brachis.apps.sweeps.plans import Plan, SweepPlan, load_sweep
from brachis.apps.sweeps.pools import FAILED, Outcome, pool_for
from brachis.apps.sweeps.result import COLUMNS, Store, SweepResult
from brachis.common import interrupts
from brachis.common.arguments import check_callable
from brachis.common.progress import Listener, report_progress
from brachis.errors import write_count

_MINUTE, _HOUR = 60, 3600
"""Seconds."""


def sweep(
    source: str | os.PathLike[str] | Mapping[str, Any],
    out: str | os.PathLike[str] | None = None,
    *,
    jobs: int | None = None,
    scheduler: str | None = None,
    retry: bool = False,
    listener: Listener | None = None,
    progress: bool | None = None,
) -> SweepResult:
    """Plan a task many times, with other values of its keys.

    Every finished plan is stored at once. A sweep that was killed goes on where it was: run it again with the same
    folder. A plan is known by its task with all defaults, its URDF's text and the version of brachis, not by its place
    in the sweep: where the sweep was changed meanwhile, plans that it still has are kept, new ones are made, and the
    table is of the sweep as it is now.

    Parameters
    ----------
    source : path or mapping
        A sweep file, or its content; see `SweepSettings`.
    out : path, optional
        Folder; by default one in the current folder, named as the file without its suffix, or ``sweep``.
    jobs : int, optional
        Processes on this machine, no more than it has processors, which is also the default.
    scheduler : str, optional
        Where plans are made instead: address of a Dask scheduler, such as ``tcp://host:8786``, or its scheduler file.
        The workers need brachis, and no files.
    retry : bool, optional
        Whether stored failures are planned again.
    listener : callable, optional
        Told how far the sweep is, and how much time is left.
    progress : bool, optional
        Whether to show that, as `plan` does.

    Returns
    -------
    SweepResult
        One row for each plan. Plans that failed are rows with the error's class and message.

    Raises
    ------
    TaskError
        The sweep is wrong, or a key is refused in all plans that set it; nothing was run.
    InputError
        The folder is not a sweep's; or a library is missing.
    ClusterError
        The cluster does not answer, or was lost; what was finished is stored.

    Examples
    --------
    >>> import tempfile
    >>> import brachis
    >>> found = brachis.sweep(
    ...     {
    ...         "sweep": 1,
    ...         "task": "examples/01_scara_line.yaml",
    ...         "fixed": {"spline.intervals": 6, "search.effort": "single"},
    ...         "grid": {"path.0.line.angle_deg": [90, 270]},
    ...     },
    ...     tempfile.mkdtemp(),
    ...     jobs=1,
    ... )
    >>> found.table.column("status").to_pylist()
    ['verified', 'verified']
    """
    check_callable(listener, "listener")
    with report_progress(listener, progress) as tell:
        return _sweep(source, out, jobs, scheduler, retry=retry, listener=tell)


def _sweep(
    source: str | os.PathLike[str] | Mapping[str, Any],
    out: str | os.PathLike[str] | None,
    jobs: int | None,
    scheduler: str | None,
    *,
    retry: bool,
    listener: Listener,
) -> SweepResult:
    """Plan what is not stored yet; see `sweep`."""
    listener("checking the sweep")
    planned = load_sweep(source)
    pool = pool_for(jobs, scheduler, listener)
    store = Store(Path(out) if out is not None else _folder_for(source))
    settings = planned.settings.model_dump(mode="json", exclude_defaults=True)
    store.describe(
        {"version": brachis.__version__, "settings": settings, "task": planned.base}
    )
    plans = {
        row.plan.digest: row.plan for row in planned.rows if isinstance(row.plan, Plan)
    }
    found = {
        digest: facts for digest in plans if (facts := store.read(digest)) is not None
    }
    if retry:
        found = {
            digest: facts
            for digest, facts in found.items()
            if facts["status"] != FAILED
        }
    progress = _Progress(len(plans), found, listener)
    try:
        with closing(
            pool([plan for digest, plan in plans.items() if digest not in found])
        ) as made:
            for (
                plan,
                outcome,
            ) in (
                made
            ):  # workers end with the block, even where an outcome cannot be stored
                found[plan.digest] = store.write(plan.digest, outcome)
                progress.tell()
    except KeyboardInterrupt as interrupt:
        interrupts.clear()
        told = f"{len(found)} of {len(plans)} plans are stored in {store.folder}; the same sweep goes on from there"
        raise KeyboardInterrupt(told) from interrupt
    return _result(planned, store, found)


def _folder_for(source: str | os.PathLike[str] | Mapping[str, Any]) -> Path:
    return Path("sweep" if isinstance(source, Mapping) else Path(source).stem)


def _result(
    planned: SweepPlan, store: Store, found: Mapping[str, Mapping[str, Any]]
) -> SweepResult:
    rows = [
        (
            row.changes,
            found[row.plan.digest]
            if isinstance(row.plan, Plan)
            else {**dict.fromkeys(COLUMNS), **Outcome.of_error(row.plan).facts},
        )
        for row in planned.rows
    ]
    table = store.table(planned.settings.keys, rows)
    store.write_table(table)
    return SweepResult(store.folder, planned.settings.keys, table)


class _Progress:
    """Says how far a sweep is.

    Parameters
    ----------
    total : int
        Number of plans.
    found : mapping
        Finished ones, those of earlier runs at first; it grows.
    listener : callable
    """

    def __init__(
        self, total: int, found: Mapping[str, Mapping[str, Any]], listener: Listener
    ) -> None:
        self._total, self._found, self._listener = total, found, listener
        self._before, self._began = len(found), time.monotonic()
        listener(
            f"{len(found)} of {write_count(total, 'plan')}{' are stored already' if found else ''}"
        )

    def tell(self) -> None:
        """Say it."""
        done, failed = (
            len(self._found),
            sum(facts["status"] == FAILED for facts in self._found.values()),
        )
        each = (time.monotonic() - self._began) / (done - self._before)
        text = f"{done} of {write_count(self._total, 'plan')}"
        text += f", {failed} failed" if failed else ""
        self._listener(f"{text}; {write_duration(each * (self._total - done))} left")


def write_duration(seconds: float) -> str:
    """Write a duration as people say it.

    Examples
    --------
    >>> write_duration(4.2), write_duration(130.0), write_duration(7500.0)
    ('5 s', '2 min 10 s', '2 h 05 min')
    """
    whole = math.ceil(seconds)
    if whole < _MINUTE:
        return f"{whole} s"
    if whole < _HOUR:
        return f"{whole // _MINUTE} min {whole % _MINUTE:02d} s"
    return f"{whole // _HOUR} h {whole % _HOUR // _MINUTE:02d} min"
