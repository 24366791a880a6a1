"""Running a sweep: stored plans are kept, the others are made, and each is stored as soon as it is finished."""

from __future__ import annotations

import math
import os
import time
from collections.abc import Mapping
from contextlib import closing
from pathlib import Path
from typing import Any

import brachis
from brachis.apps.sweeps.plans import FAILED, Outcome, Plan, SweepPlan, load_sweep
from brachis.apps.sweeps.pools import Pool, pool_for
from brachis.apps.sweeps.result import Store, SweepResult
from brachis.common import interrupts
from brachis.common.arguments import check_callable
from brachis.common.progress import Listener, report_progress
from brachis.common.words import write_count


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
        A sweep file, or its content as in `SweepSettings`.
    out : path, optional
        Folder; by default one in the current folder, named as the file without its suffix, or ``sweep``.
    jobs : int, optional
        Processes on this machine, no more than it has processors, which is also the default.
    scheduler : str, optional
        Makes the plans on a cluster: address of a Dask scheduler, such as ``tcp://host:8786``, or its scheduler file.
        The workers need brachis, and no files.
    retry : bool, optional
        Whether stored failures are planned again.
    listener : callable, optional
        Called with how far the sweep is, and how much time is left.
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
        tell("checking the sweep")
        planned = load_sweep(source)
        pool = pool_for(jobs, scheduler, tell)
        name = "sweep" if isinstance(source, Mapping) else Path(source).stem
        store = Store(Path(name if out is None else out))
        settings = planned.settings.model_dump(mode="json", exclude_defaults=True)
        store.describe(
            {"version": brachis.__version__, "settings": settings, "task": planned.base}
        )
        found = _run(planned, store, pool, retry=retry, tell=tell)
    rows = []
    for changes, plan in planned.rows:
        facts = (
            found[plan.digest]
            if isinstance(plan, Plan)
            else Outcome.of_error(plan).facts
        )
        rows.append((changes, facts))
    keys = planned.settings.keys
    return SweepResult(store.folder, keys, store.write_table(keys, rows))


def _run(
    planned: SweepPlan, store: Store, pool: Pool, *, retry: bool, tell: Listener
) -> dict[str, dict[str, Any]]:
    """Make the plans that are not stored yet, and return the columns of all, by digest."""
    plans = {plan.digest: plan for _, plan in planned.rows if isinstance(plan, Plan)}
    found = {}
    for digest in plans:
        facts = store.read(digest)
        if facts is not None and not (retry and facts["status"] == FAILED):
            found[digest] = facts
    stored = len(found)
    began = time.monotonic()
    every = write_count(len(plans), "plan")
    tell(f"{stored} of {every}{' are stored already' if stored else ''}")
    missing = [plan for digest, plan in plans.items() if digest not in found]
    try:
        # Workers end with this block, even if an outcome cannot be stored.
        with closing(pool(missing)) as outcomes:
            for plan, outcome in outcomes:
                found[plan.digest] = store.write(plan.digest, outcome)
                done = len(found)
                failed = sum(facts["status"] == FAILED for facts in found.values())
                each = (time.monotonic() - began) / (done - stored)
                left = write_duration(each * (len(plans) - done))
                failures = f", {failed} failed" if failed else ""
                tell(f"{done} of {every}{failures}; {left} left")
    except KeyboardInterrupt as interrupt:
        interrupts.clear()
        message = f"{len(found)} of {len(plans)} plans are stored in {store.folder}; the same sweep goes on from there"
        raise KeyboardInterrupt(message) from interrupt
    return found


def write_duration(seconds: float) -> str:
    """Write a duration as people say it.

    Examples
    --------
    >>> write_duration(4.2), write_duration(130.0), write_duration(7500.0)
    ('5 s', '2 min 10 s', '2 h 05 min')
    """
    minutes, whole = divmod(math.ceil(seconds), 60)
    hours, minutes = divmod(minutes, 60)
    if hours:
        return f"{hours} h {minutes:02d} min"
    return f"{minutes} min {whole:02d} s" if minutes else f"{whole} s"
