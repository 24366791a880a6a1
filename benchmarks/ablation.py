"""What each mechanism of the planner gains: tasks of all kinds, planned with one mechanism at a time switched off.

Usage: python benchmarks/ablation.py [--without NAME ...] [--tasks COUNT] [--only WORD ...]
       [--seconds S] [--out FILE] [--save]

    python benchmarks/ablation.py --without near_rows --tasks 20
    python benchmarks/ablation.py --without near_rows+follow_again --only rms tolerance

Mechanisms and how they are switched off stand in `ablation_mechanisms`, tasks in `ablation_tasks`. --without takes
names of mechanisms, several of them joined by + for all of them at once; if it is left out, all are tried one by one.
--tasks takes so many tasks, spread evenly over the list, --only those whose names contain one of the words. Tasks whose
first plan takes more than --seconds of processor time are not planned again. Every plan runs in this process, and no
limit on time decides.

A task is planned with everything first, which tells which mechanisms it uses, and then again, to be timed. A mechanism
that a task does not use would make the same plan, and is left out. Every plan is a line of JSON in the file of --out;
plans that stand there are not made again.

The table says how many tasks use a mechanism, and for these: end times and processor times without it, as ratios to
those with it. A mechanism is to go if it gains less than 0.1 % of the end time on every task, no plan fails without
it, and it gains less than a tenth of the processor time, in the sum and in the geometric mean. That is said by these
figures alone: guards (`child_process`) and what a task asks for (`idle_joints`, `hopeless`) stay for other reasons.
"""

from __future__ import annotations

import argparse
import json
import math
import warnings
from collections.abc import Iterable, Sequence
from pathlib import Path
from typing import Any

import numpy as np

import brachis
from ablation_mechanisms import MECHANISMS, Mechanism, find, record_uses
from ablation_tasks import AblationTask, every_task, example
from brachis.errors import BrachisError
from committed import processor_time, save

COLUMNS = (
    "without",
    "tasks that use it",
    "end time, geometric mean",
    "worst loss",
    "largest gain",
    "plans lost, won",
    "processor time, sum",
    "processor time, geometric mean",
    "verdict",
)
LEAST_GAIN = 1e-3
"""Part of the end time that a mechanism gains on some task, or it goes."""
LEAST_TIME = 1.1
"""Factor on the processor time without a mechanism below which it goes."""
WITH_ALL = ""
"""Stands for the name of a mechanism in the line of the first plan, with everything."""
TIMED = "nothing"
"""The mechanism that is none: the plan with everything, which is timed."""

Line = dict[str, Any]
Key = tuple[str, str]


def plan_once(task: AblationTask) -> Line:
    """Plan a task, and return what is kept of the plan."""
    line: Line = {"task": task.name, "verified": False}
    began = processor_time()
    try:
        content = task.load()
        motion = task.motion
        began = processor_time()
        result = brachis.plan(content, start_from=motion, check_advice=False)
        line |= {"t_end": result.t_end, "verified": result.verified}
    except BrachisError as error:
        line |= {"message": f"{type(error).__name__}: {error}"}
    except Exception as error:  # noqa: BLE001  (what a patch breaks is a result too)
        line |= {"message": f"FAULT {type(error).__name__}: {error}"}
    line["processor_time"] = round(processor_time() - began, 3)
    return line


def plan_with_all(task: AblationTask) -> Line:
    """Plan a task with everything, and tell which mechanisms it uses."""
    with record_uses(MECHANISMS) as uses:
        line = plan_once(task)
    return {**line, "without": WITH_ALL, "uses": sorted(uses)}


def plan_without(task: AblationTask, mechanism: Mechanism) -> Line:
    """Plan a task with a mechanism switched off."""
    with mechanism.off():
        line = plan_once(task)
    return {**line, "without": mechanism.name}


def run(
    tasks: Iterable[AblationTask],
    mechanisms: Sequence[Mechanism],
    out: Path,
    most: float,
) -> dict[Key, Line]:
    """Make the plans that are not in the file yet, and return all of its lines.

    Parameters
    ----------
    tasks, mechanisms
    out : path
    most : float
        Processor time of a task's first plan above which it is not planned again, s.
    """
    lines = read(out)

    def keep(line: Line) -> None:
        """Keep a line, and show it."""
        lines[line["task"], line["without"]] = line
        print(json.dumps(line), file=file, flush=True)
        figures = {key: value for key, value in line.items() if key != "uses"}
        print(figures, flush=True)

    with out.open("a", encoding="utf-8") as file:
        for task in tasks:
            if (task.name, WITH_ALL) not in lines:
                keep(plan_with_all(task))
            first = lines[task.name, WITH_ALL]
            if first["processor_time"] > most:
                continue
            for mechanism in mechanisms:
                is_made = (task.name, mechanism.name) in lines
                if not is_made and mechanism.is_any_in(first["uses"]):
                    keep(plan_without(task, mechanism))
    return lines


def read(out: Path) -> dict[Key, Line]:
    """Read the plans of earlier runs."""
    if not out.exists():
        return {}
    rows = map(json.loads, out.read_text(encoding="utf-8").splitlines())
    return {(row["task"], row["without"]): row for row in rows}


def summarise(
    lines: dict[Key, Line], name: str, tasks: Sequence[str]
) -> tuple[str, ...] | None:
    """Return a mechanism's row of the table; None if no plan was made without it."""
    ends: list[tuple[float, str]] = []
    lost: list[str] = []
    won: list[str] = []
    times = []
    for task in tasks:
        line = lines.get((task, name))
        usual = lines.get((task, TIMED))
        if line is None or usual is None:
            continue
        times.append((line["processor_time"], usual["processor_time"]))
        if line["verified"] and usual["verified"]:
            ends.append((line["t_end"] / usual["t_end"], task))
        elif usual["verified"]:
            lost.append(task)
        elif line["verified"]:
            won.append(task)
    if not times:
        return None
    without, usual_times = np.maximum(np.array(times), 1e-3).T
    total = float(without.sum() / usual_times.sum())
    mean = math.exp(float(np.log(without / usual_times).mean()))
    ends.sort()
    ratios = np.array([ratio for ratio, _ in ends] or [1.0])
    is_needed = lost or ratios.max() > 1.0 + LEAST_GAIN or max(total, mean) > LEAST_TIME
    return (
        name,
        f"{len(times)} of {len(tasks)}",
        f"{np.exp(np.log(ratios).mean()):.5f}",
        write_change(*ends[-1]) if ends and ends[-1][0] > 1.0 else "none",
        write_change(*ends[0]) if ends and ends[0][0] < 1.0 else "none",
        f"{', '.join(lost) or 'none'}; {', '.join(won) or 'none'}",
        f"{total:.2f}",
        f"{mean:.2f}",
        "stays" if is_needed else "to go",
    )


def write_change(ratio: float, task: str) -> str:
    """Write by how much an end time changes, and for which task; nothing if it hardly does."""
    if abs(ratio - 1.0) < 1e-5:
        return "none"
    return f"{100.0 * (ratio - 1.0):+.3f} % ({task})"


def choose_tasks(count: int | None, words: Sequence[str]) -> list[AblationTask]:
    """Choose the tasks that the command line asks for."""
    tasks = every_task()
    tasks = [task for task in tasks if any(word in task.name for word in words)]
    if count is None or count >= len(tasks):
        return tasks
    numbers = np.linspace(0, len(tasks) - 1, count).round().astype(int)
    return [tasks[number] for number in numbers]


def main() -> None:
    """Plan, and print a table."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--without", nargs="+", metavar="NAME")
    parser.add_argument("--tasks", type=int, metavar="COUNT")
    parser.add_argument("--only", nargs="+", default=[""], metavar="WORD")
    parser.add_argument("--seconds", type=float, default=4.0)
    parser.add_argument("--out", type=Path, default=Path("ablation.jsonl"))
    parser.add_argument("--save", action="store_true")
    given = parser.parse_args()
    warnings.simplefilter("ignore")
    names = given.without or [mechanism.name for mechanism in MECHANISMS]
    mechanisms = [find(name) for name in dict.fromkeys([TIMED, *names])]
    tasks = choose_tasks(given.tasks, given.only)
    brachis.plan(example(1))  # what is loaded on first use is not timed
    lines = run(tasks, mechanisms, given.out, given.seconds)
    timed = [task.name for task in tasks if (task.name, TIMED) in lines]
    rows = []
    for mechanism in mechanisms[1:]:
        row = summarise(lines, mechanism.name, timed)
        if row is not None:
            rows.append(row)
    print(f"| {' | '.join(COLUMNS)} |\n{'|---' * len(COLUMNS)}|")
    for row in rows:
        print(f"| {' | '.join(row)} |")
    about = (
        f"{len(timed)} tasks; ratios are those of plans without a mechanism to plans with it, over the tasks that use "
        "it. Processor times scatter by 5 to 7 %."
    )
    save("What mechanisms gain", COLUMNS, rows, about)


if __name__ == "__main__":
    main()
