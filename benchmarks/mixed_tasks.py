"""Random tasks of mixed kinds on every robot, each with a known solution: how many end in a verified plan, how fast.

Usage: python benchmarks/mixed_tasks.py [--robot NAME] [--seed 0] [--count 24] [--number K] [--folder DIR]
       [--out FILE] [--compare FILE] [--time-limit S] [--save]

The shapes of the path (lines, arcs, circles, splines, blended corners, CSV files) and the task spaces of a robot
(poses, poses with free roll, positions, positions with a joint locked) go round with the number of the task; all else
is drawn: start and end posture given or free, turning of the tool, gravity, limits, friction, degree, intervals, rest.
How a task is made, and why it has a solution, says `mixed_cases`. `--number` makes and plans one task alone. Task
files that are in the folder already are planned as they are, so that two checkouts plan the very same tasks:

    python benchmarks/mixed_tasks.py --folder tasks --out before.jsonl
    python benchmarks/mixed_tasks.py --folder tasks --compare before.jsonl      # in the other checkout

The results, one line of JSON for a task, are those of the folder's `results.jsonl` unless `--out` says otherwise.
"""

from __future__ import annotations

import argparse
import json
import os
import tempfile
import time
import warnings
from pathlib import Path

import numpy as np

import mixed_cases
from brachis import plan
from brachis.errors import BrachisError, BrachisWarning
from brachis.task import load_task
from committed import save
from mixed_robots import ROBOTS, ROOT

SOON = 3.0
"""s; the share of plans that take no longer is printed."""


def planned(case: mixed_cases.Case, time_limit: float | None) -> dict[str, object]:
    """Plan a task; what came out as a line of the results."""
    task = load_task(case.task)
    if time_limit is not None:
        task = task.model_copy(
            update={"search": task.search.model_copy(update={"time_limit": time_limit})}
        )
    began, busy = time.perf_counter(), sum(os.times()[:4])
    t_end, message, search = None, "", {}
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore", BrachisWarning)  # limits are scaled at will
            result = plan(task, strict=False)
        t_end = result.t_end
        search = {"attempts": len(result.candidates), "interrupted": result.interrupted}
        failed = [
            check.name for check in result.verification.checks if not check.passed
        ]
        message = f"unverified: {', '.join(failed)}" if failed else ""
    except BrachisError as error:
        message = f"{type(error).__name__}: {error}"
    except Exception as error:  # noqa: BLE001  (a fault of the planner's counts like any other failure)
        message = f"FAULT {type(error).__name__}: {error}"
    seconds, cpu = time.perf_counter() - began, sum(os.times()[:4]) - busy
    return {
        "task": case.name,
        "kind": case.kind,
        "start": "free" if task.start == "free" else "given",
        "end": "free" if task.end == "free" else "given",
        "verified": not message,
        "t_end": t_end,
        "seconds": round(seconds, 3),
        "cpu": round(cpu, 3),
        **search,
        "message": message,
    }


def summary(robot: str, results: list[dict[str, object]]) -> tuple[str, ...]:
    """One robot's counts and times, as cells."""
    times = np.array([result["seconds"] for result in results])
    busy = np.array([result["cpu"] for result in results])
    verified = sum(bool(result["verified"]) for result in results)
    return (
        robot,
        f"{verified} of {len(results)}",
        f"{np.median(times):.2f} s",
        f"{np.median(busy):.2f} s",
        f"{times.max():.1f} s ({busy.max():.1f} s processor)",
        f"{np.mean(times <= SOON):.0%}",
    )


def compare(before: list[dict[str, object]], after: list[dict[str, object]]) -> None:
    """Print the ratios, after over before, of end times and of plan times."""
    known = {result["task"]: result for result in before}
    ends, times, lost, won = [], [], [], []
    for result in after:
        old = known.get(result["task"])
        if old is None:
            continue
        times.append(
            [result[clock] / max(old[clock], 1e-3) for clock in ("seconds", "cpu")]
        )
        if old["verified"] and result["verified"]:
            ends.append((result["t_end"] / old["t_end"], result["task"]))
        elif old["verified"] != result["verified"]:
            (won if result["verified"] else lost).append(result["task"])
    for ratio, name in sorted(ends):
        if abs(ratio - 1.0) > 1e-3:
            print(f"  {name}: t_end times {ratio:.4f}")
    if times:
        wall, busy = np.exp(np.mean(np.log(times), axis=0))
        print(
            f"compared: {len(times)} tasks; plan times times {wall:.3f} on average, processor times {busy:.3f}"
        )
    if ends:
        ratios = np.array([ratio for ratio, _ in ends])
        print(
            f"end times of {len(ratios)}: times {np.exp(np.mean(np.log(ratios))):.4f} on average, "
            f"from {ratios.min():.4f} to {ratios.max():.4f}"
        )
    print(
        f"verified now and not before: {', '.join(won) or 'none'}; before and not now: {', '.join(lost) or 'none'}"
    )


def read(path: Path) -> list[dict[str, object]]:
    """Results of a run."""
    return [json.loads(line) for line in path.read_text(encoding="utf-8").splitlines()]


def arguments() -> argparse.Namespace:
    """Read the command line."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--robot", choices=ROBOTS, help="all of them if left out")
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--count", type=int, default=24, help="tasks of each robot")
    parser.add_argument("--number", type=int, help="this task alone")
    parser.add_argument(
        "--folder",
        type=Path,
        help="where task files go; a new one under the temporary folder",
    )
    parser.add_argument("--out", type=Path, help="results, a line of JSON for a task")
    parser.add_argument("--compare", type=Path, help="results of an earlier run")
    parser.add_argument(
        "--save", action="store_true", help="the summary, into benchmarks/results"
    )
    parser.add_argument(
        "--time-limit",
        type=float,
        help="search.time_limit, s; the default of the task file",
    )
    return parser.parse_args()


def main() -> None:
    """Print every failure with its message, then a line for every robot."""
    given = arguments()
    folder = given.folder or Path(tempfile.mkdtemp(prefix="mixed-tasks-"))
    print(f"task files in {folder}", flush=True)
    numbers = range(given.count) if given.number is None else [given.number]
    plan(
        ROOT / "examples/01_scara_line.yaml"
    )  # what is loaded on first use is not timed
    everything, kept = [], []
    folder.mkdir(parents=True, exist_ok=True)
    with (given.out or folder / "results.jsonl").open("w", encoding="utf-8") as out:
        for robot in [given.robot] if given.robot else ROBOTS:
            results = []
            for number in numbers:
                result = planned(
                    mixed_cases.case(robot, given.seed, number, folder),
                    given.time_limit,
                )
                results.append(result)
                print(json.dumps(result), file=out, flush=True)
                if result["message"]:
                    print(
                        f"{result['task']} ({result['kind']}): {result['message']}",
                        flush=True,
                    )
            kept.append(summary(robot, results))
            print(", ".join(kept[-1]), flush=True)
            everything += results
    columns = (
        "robot",
        "verified",
        "plan time, median",
        "processor time, median",
        "longest",
        f"within {SOON:g} s",
    )
    save(
        "Random tasks of mixed kinds",
        columns,
        kept,
        "Each task has a known solution; everything is left open.",
    )
    if given.compare:
        compare(read(given.compare), everything)


if __name__ == "__main__":
    main()
