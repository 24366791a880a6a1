"""How a whole plan grows with the number of intervals: ``python benchmarks/growth_plans.py [--save]``.

The TX90L on its rail along the line of examples/03, ``effort: single``, refined and verified. Each plan has a process
of its own, which has planned once before.
"""

from __future__ import annotations

import math
import multiprocessing
import warnings
from pathlib import Path

import brachis
from committed import peak_memory, processor_time, save

ROOT = Path(__file__).parents[1]
INTERVALS = (10, 20, 50, 100, 200)
COLUMNS = ("N", "t_E", "processor time", "largest memory", "grows as N to the")


def measure_plan(intervals: int) -> tuple[float, float, float]:
    """Plan once to import all, then again: end time, s; processor time, s; largest memory, MB."""
    task = brachis.load_task(ROOT / "examples/03_tx90l_rail_line.yaml")
    warnings.simplefilter("ignore", brachis.SlowTimingWarning)
    brachis.plan(task, effort="single", intervals=10)
    began = processor_time()
    result = brachis.plan(
        task, effort="single", intervals=intervals, least_motion=False
    )
    used = processor_time() - began
    assert result.verified
    return result.t_end, used, peak_memory()


def main() -> None:
    """Print one line for every number of intervals."""
    rows = []
    before = (0, 0.0)
    context = multiprocessing.get_context("spawn")
    for intervals in INTERVALS:
        with context.Pool(1) as pool:
            t_end, used, memory = pool.apply(measure_plan, (intervals,))
        growth = ""
        if before[0]:
            power = math.log(used / before[1]) / math.log(intervals / before[0])
            growth = f"{power:.2f}"
        before = (intervals, used)
        row = (
            str(intervals),
            f"{t_end:.4f} s",
            f"{used:.2f} s",
            f"{memory:.0f} MB",
            growth,
        )
        print(" | ".join(row), flush=True)
        rows.append(row)
    save("Growth of a plan", COLUMNS, rows)


if __name__ == "__main__":
    main()
