"""Running a sweep: stored plans are kept, missing plans are run, and each plan is stored as soon as it is finished."""

from __future__ import annotations

import os
import re
import time
from collections.abc import Mapping, Sequence
from concurrent.futures import Executor
from contextlib import closing
from datetime import timedelta
from functools import partial
from pathlib import Path
from typing import Any

import brachis
from brachis.apps.sweeps.plans import FAILED, Plan, PlanOutcome, SweepPlan, load_sweep
from brachis.apps.sweeps.pools import Outcomes, Pool, pool_for
from brachis.apps.sweeps.result import TABLE, Store, SweepResult
from brachis.common import interrupts
from brachis.common.arguments import check_listener
from brachis.common.progress import Listener, report_progress
from brachis.common.words import name_first, write_count
from brachis.errors import InputError


def sweep(
    source: str | os.PathLike[str] | Mapping[str, Any],
    out: str | os.PathLike[str] | None = None,
    *,
    jobs: int | None = None,
    executor: Executor | None = None,
    part: str | None = None,
    merge: bool = False,
    retry: bool = False,
    listener: Listener | None = None,
    progress: bool | None = None,
) -> SweepResult:
    """Plan a task many times with different values of its keys.

    Every finished plan is stored immediately. If a sweep was killed, run it again with the same folder; it then
    continues where it stopped. A plan is recognised by its task with all defaults, the text of its URDF and the version
    of brachis, not by its place in the sweep. If the sweep was changed in the meantime, plans that it still contains
    are kept, new plans are run, and the table describes the current sweep.

    Parameters
    ----------
    source : path or mapping
        Sweep file, or its content as in `SweepSettings`.
    out : path, optional
        Folder of the sweep. Default: a subfolder of the current folder, named like the sweep file without its suffix,
        or ``sweep``.
    jobs : int, optional
        Number of processes on this machine. Maximum and default: the machine's number of processors.
    executor : Executor, optional
        Executor that runs the plans instead of processes on this machine: a Dask client or any
        ``concurrent.futures.Executor``, such as those of mpi4py and parsl. The executor's workers need brachis, but no
        files.
    part : str, optional
        ``"i/n"`` plans only the i-th of n parts of the sweep, counted from 1. Parts are meant for jobs of a cluster's
        scheduler that share the folder. Each part has its own table, such as ``table-2-of-8.csv``.
    merge : bool, optional
        Whether to only collect the plans of all parts in one table. No plan is run.
    retry : bool, optional
        Whether to run plans again that are stored as failed.
    listener : callable, optional
        Function that is called with a text on the progress of the sweep and the time left.
    progress : bool, optional
        Whether to show the progress, as `plan` does.

    Returns
    -------
    SweepResult
        One row for each plan. The row of a failed plan has the class and message of the error.

    Raises
    ------
    TaskError
        The sweep is invalid, or a key causes an error in all plans that set it. No plan was run.
    InputError
        The folder does not belong to a sweep; a library is missing; or, with `merge`, plans are missing.
    ClusterError
        The executor lost its workers, or the workers cannot run brachis. Finished plans are stored.

    Examples
    --------
    >>> import tempfile
    >>> import brachis
    >>> result = brachis.sweep(
    ...     {
    ...         "sweep": 1,
    ...         "task": "examples/01_scara_line.yaml",
    ...         "fixed": {"spline.intervals": 6, "search.effort": "single"},
    ...         "grid": {"path.0.line.angle_deg": [90, 270]},
    ...     },
    ...     tempfile.mkdtemp(),
    ...     jobs=1,
    ... )
    >>> result.table.column("status").to_pylist()
    ['verified', 'verified']
    """
    check_listener(listener)
    with report_progress(listener, progress) as tell:
        tell("checking the sweep")
        planned = load_sweep(source)
        numbers = range(len(planned.rows))
        table = TABLE
        if part is not None:
            first, part_count = _read_part(part, len(numbers))
            numbers = numbers[first - 1 :: part_count]
            table = f"{TABLE}-{first}-of-{part_count}"
        pool = pool_for(jobs, executor)
        if merge:
            pool = partial(_refuse_missing, planned)
        name = "sweep" if isinstance(source, Mapping) else Path(source).stem
        store = Store(Path(name if out is None else out))
        settings = planned.settings.model_dump(mode="json", exclude_defaults=True)
        store.describe(
            {"version": brachis.__version__, "settings": settings, "task": planned.base}
        )
        selected = {number: planned.rows[number] for number in numbers}
        plans = [plan for _, plan in selected.values() if isinstance(plan, Plan)]
        facts_by_digest = _run(plans, store, pool, retry=retry, tell=tell)
    rows = {}
    for number, (changes, plan) in selected.items():
        facts = (
            facts_by_digest[plan.digest]
            if isinstance(plan, Plan)
            else PlanOutcome.of_error(plan).facts
        )
        rows[number] = (changes, facts)
    keys = planned.settings.keys
    return SweepResult(store.folder, keys, store.write_table(keys, rows, table), table)


def _read_part(text: str, plans: int) -> tuple[int, int]:
    """Read a part of the sweep, ``i/n``, where n is at most the number of plans."""
    numbers = re.fullmatch(r"([0-9]+)/([0-9]+)", text)
    first, part_count = map(int, numbers.groups()) if numbers else (0, 0)
    if not 1 <= first <= part_count <= plans:
        raise InputError(
            "this is not a part of the sweep",
            where="part",
            found=text,
            allowed=f"i/n, such as 2/8: part i of n, 1 <= i <= n <= {plans}",
        )
    return first, part_count


def _refuse_missing(planned: SweepPlan, plans: Sequence[Plan]) -> Outcomes:
    """Run no plan, and raise an error if any plan is missing."""
    digests = {plan.digest for plan in plans}
    numbers = [
        str(number)
        for number, (_, plan) in enumerate(planned.rows)
        if isinstance(plan, Plan) and plan.digest in digests
    ]
    if numbers:
        raise InputError(
            "parts of the sweep are missing",
            where="merge",
            found=f"no result for {write_count(len(numbers), 'plan')}: {name_first(numbers, ', ')}",
            hint="Run the missing parts in the same folder, or run the sweep without merge",
        )
    yield from ()


def _run(
    selected: Sequence[Plan], store: Store, pool: Pool, *, retry: bool, tell: Listener
) -> dict[str, dict[str, Any]]:
    """Run the plans that are not stored yet, and return the columns of all plans by digest."""
    plans = {plan.digest: plan for plan in selected}
    facts_by_digest = {}
    for digest in plans:
        facts = store.read(digest)
        if facts is not None and not (retry and facts["status"] == FAILED):
            facts_by_digest[digest] = facts
    stored = len(facts_by_digest)
    began = time.monotonic()
    every = write_count(len(plans), "plan")
    tell(f"{stored} of {every}{' are stored already' if stored else ''}")
    missing = [plan for digest, plan in plans.items() if digest not in facts_by_digest]
    try:
        # Workers end with this block even if an outcome cannot be stored.
        with closing(pool(missing)) as outcomes:
            for plan, outcome in outcomes:
                facts_by_digest[plan.digest] = store.write(plan.digest, outcome)
                done = len(facts_by_digest)
                failed = sum(
                    facts["status"] == FAILED for facts in facts_by_digest.values()
                )
                period = (time.monotonic() - began) / (done - stored)
                remaining = timedelta(seconds=round(period * (len(plans) - done)))
                failures = f", {failed} failed" if failed else ""
                tell(f"{done} of {every}{failures}; {remaining} left")
    except KeyboardInterrupt as interrupt:
        interrupts.clear()
        counts = f"{len(facts_by_digest)} of {len(plans)} plans"
        raise KeyboardInterrupt(
            f"{counts} are stored in {store.folder}; run the same sweep again to continue from there"
        ) from interrupt
    return facts_by_digest
