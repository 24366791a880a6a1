"""Time that a plan takes from a known motion and from scratch, with ``python studies/known_motions.py``.

Processor time, so that it matters little what else the machine does. The motion known is that of the task itself; what
is planned has the changes that the rows name.
"""

from __future__ import annotations

import sys
from pathlib import Path
from typing import Any

import brachis

ROOT = Path(__file__).parents[1]
sys.path.append(str(ROOT / "benchmarks"))

from committed import processor_time  # noqa: E402

TASKS = {
    "planar arm": "01_scara_line.yaml",
    "TX90L on its rail": "03_tx90l_rail_line.yaml",
}
CHANGES: dict[str, dict[str, Any]] = {
    "the same task": {},
    "torque limits + 10 %": {"limits": {"scale": {"torque": 1.1}}},
    "40 intervals": {"intervals": 40},
}


def timed(task: brachis.Task, **keywords: Any) -> tuple[brachis.Result, float]:
    began = processor_time()
    return brachis.plan(task, **keywords), processor_time() - began


def main() -> None:
    print("| task | change | from scratch | from the known motion |\n|---|---|---|---|")
    for name, file in TASKS.items():
        known = brachis.plan(ROOT / "examples" / file, redundant_joints="auto")
        for change, keywords in CHANGES.items():
            (cold, searched), (warm, continued) = (
                timed(known.task, **keywords, start_from=motion)
                for motion in (None, known)
            )
            times = f"{cold.t_end:.4f} s in {searched:.1f} s | {warm.t_end:.4f} s in {continued:.1f} s"
            print(f"| {name} | {change} | {times} |", flush=True)


if __name__ == "__main__":
    main()
