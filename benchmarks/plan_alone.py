"""Plan one task file in this process, and print what it took as JSON: ``python benchmarks/plan_alone.py TASK``.

`work.py` starts it for every plan, so that memory and processor time are those of one plan, with the processes that it
starts. A plan before it, and some imports, load what is loaded on first use.
"""

from __future__ import annotations

import json
import sys
import warnings
from pathlib import Path

import scipy.interpolate
import scipy.linalg
import scipy.optimize
import scipy.sparse.linalg
import scipy.spatial  # noqa: F401  (the same is loaded whatever a plan needs of it)

import brachis
from brachis.errors import BrachisWarning
from committed import peak_memory, processor_time

EXAMPLE = Path(__file__).parents[1] / "examples/01_scara_line.yaml"
UNHURRIED = 600.0
"""s of wall time: no busy machine ends a search early."""


def plan_alone(file: Path) -> dict[str, object]:
    """Plan, and measure.

    Returns
    -------
    dict of str to object
        ``cpu``: processor time, s; ``first``: that until the first verified motion, s; ``memory``: the largest, MB;
        ``t_end``: of a verified motion, s; ``message``: what went wrong. What is not known is None.
    """
    warnings.simplefilter("ignore", BrachisWarning)
    brachis.plan(EXAMPLE)
    first: list[float] = []
    t_end = None
    message = None
    began = processor_time()

    def listen(text: str) -> None:
        if text.endswith(", verified"):
            first.append(processor_time() - began)

    try:
        task = brachis.load_task(file)
        search = task.search.model_copy(update={"time_limit": UNHURRIED})
        task = task.model_copy(update={"search": search})
        result = brachis.plan(task, strict=False, listener=listen, check_advice=False)
        if result.verified:
            t_end = result.t_end
        else:
            message = f"unverified, {result.verification.worst_ratio:.3g}"
    except brachis.BrachisError as error:
        message = f"{type(error).__name__}: {error}"
    return {
        "cpu": processor_time() - began,
        "first": first[0] if first else None,
        "memory": peak_memory(),
        "t_end": t_end,
        "message": message,
    }


if __name__ == "__main__":
    print(json.dumps(plan_alone(Path(sys.argv[1]))))
