"""Short time limits on tasks of all kinds: a motion, or the message that the time was up, and how late either comes.

Usage: python benchmarks/time_limits.py [--limits 0.2 0.5 1 2] [--jobs 1] [--only NAME] [--wall] [--where]

No motion, no message that names the time limit, an exception that is not brachis' own, or an answer that comes more
than ALLOWED seconds after the limit, is a fault; the exit code is then 1. Counted are also the plans that gave a
verified motion. The time is the processor time of this process and of those that it started. The planner's clock is
set to it as well, also for solves in processes of their own, so that a busy machine changes nothing: it is what a free
machine takes. `--wall` leaves the clock as it is. `--where` prints the stack whenever an answer is late.
"""

from __future__ import annotations

import argparse
import contextlib
import faulthandler
import importlib.util
import math
import multiprocessing
import os
import signal
import sys
import tempfile
import time
import types
import warnings
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import brachis
import joint_paths
import mixed_cases
import process_tasks
from brachis.common import deadline
from brachis.errors import BrachisWarning
from brachis.optimise.backends import SolveStatus, child_process, monitor
from committed import processor_time
from mixed_robots import ROOT

ALLOWED = 1.5
"""s"""
MIXED = {
    "scara3": (0, 1),
    "planar4": (0, 1, 2),
    "panda": (0, 2),
    "iiwa14": (0, 1, 3),
    "xarm7": (2,),
}
MIXED |= {"tx90l_rail": (0, 2, 4), "ur10_rail": (1,)}
"""Numbers of mixed tasks."""
POSTURES = {
    "gen3": [0.0, 0.3, 0.0, -1.2, 0.0, 0.8, 0.0],
    "gen3_rails": [0.5, 0.3, 0.0, 0.5, 0.0, 1.4, 0.0, 0.8, 0.0],
    "arm8": [0.2, 0.5, 0.1, 0.9, 0.2, 0.8, 0.3, 0.4],
    "tx90l_rail": [0.0, 0.5, 0.4, 1.3, 0.0, 1.4415926535897932, 0.3],
}


def line(name: str, **more: Any) -> dict[str, Any]:
    """Return a task of a line of 0.3 m from a posture."""
    return {
        "brachis": 1,
        "robot": {"urdf": str(ROOT / f"robots/{name}/robot.urdf")},
        "start": {"joints": POSTURES[name]},
        "task_space": "pose",
        "path": [{"line": {"by": [-0.1, 0.25, -0.15]}}],
        **more,
    }


def tasks(folder: Path) -> Iterator[tuple[str, Any]]:
    """Names and tasks."""
    for robot, numbers in MIXED.items():
        for number in numbers:
            made = mixed_cases.case(robot, 0, number, folder)
            yield f"{made.name} {made.kind}", made.task
    for robot in ("gen3", "gen3_rails", "arm8"):
        yield f"{robot} line", line(robot)
    yield "gen3_rails position", line("gen3_rails", task_space="position")
    downwards = {"position": [0.8, 0.5, 0.7], "quaternion_wxyz": [0.0, 1.0, 0.0, 0.0]}
    yield (
        "gen3_rails free start",
        line("gen3_rails", start="free", path_start=downwards),
    )
    yield (
        "arm8 joints",
        line(
            "arm8",
            task_space="joints",
            path=[{"spline": {"through": [[0.5] * 8, [0.1] * 8]}}],
        ),
    )
    yield "tx90l_rail 300 intervals", line("tx90l_rail", spline={"intervals": 300})
    yield (
        "tx90l_rail, rail locked",
        line(
            "tx90l_rail",
            robot={
                "urdf": str(ROOT / "robots/tx90l_rail/robot.urdf"),
                "locked_joints": {"rail": 0.0},
            },
            start={"joints": POSTURES["tx90l_rail"][1:]},
        ),
    )
    for number in (
        "01_scara_line",
        "04_ur10_rail_weld",
        "06_free_roll",
        "09_payload_friction_jerk",
    ):
        yield number, ROOT / f"examples/{number}.yaml"
    spec = importlib.util.spec_from_file_location(
        "seam", ROOT / "examples/08_cam_seam.py"
    )
    seam = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(seam)
    seam.write(folder / "seam.csv")
    csv = {
        "csv": {
            "file": str(folder / "seam.csv"),
            "corner": "blend",
            "orientation": "rotation_vector",
            "tolerance": {
                "position": "0.15 mm",
                "orientation": "0.1 deg",
                "corner": "5 mm",
            },
        }
    }
    yield "seam", line("tx90l_rail", start="free", path=[csv])
    yield "joints, 150 intervals", joint_paths.case(0, 150)
    yield "weld", process_tasks.weld(folder)
    yield from process_tasks.seeded(folder)


def clock() -> float:
    """Return the processor time, s, of this process, and of all that it has started."""
    used = processor_time()
    for child in multiprocessing.active_children():
        # Its end takes its time into that of the ended ones.
        with contextlib.suppress(OSError):
            text = Path(f"/proc/{child.pid}/stat").read_text(encoding="utf-8")
            ticks = text.rpartition(")")[2].split()[11:13]
            used += sum(map(int, ticks)) / os.sysconf("SC_CLK_TCK")
    return used


def set_clocks() -> None:
    """Let the planner, and solves in processes of their own, take the processor time for the time."""
    deadline.time = types.SimpleNamespace(monotonic=clock)
    monitor.time = types.SimpleNamespace(perf_counter=clock)
    child_process.time = types.SimpleNamespace(monotonic=clock)
    timers = vars(signal) | {"ITIMER_REAL": signal.ITIMER_PROF}
    child_process.signal = types.SimpleNamespace(**timers)
    functions = vars(child_process)
    receive = functions["_receive"]

    def receive_until(receiver: Any, until: float, *more: Any) -> tuple[Any, Any]:
        """Receive until this time is over by the clock."""
        best = None
        while True:
            answer, better = receive(receiver, until, *more)
            best = best if better is None else better
            if answer is not SolveStatus.STALLED or clock() >= until:
                return answer, best

    functions["_receive"] = receive_until


def planned(task: Any, limit: float, jobs: int) -> str:
    """Plan and say what came out, in a few words; a fault begins with FAULT."""
    task = brachis.load_task(task)
    search = task.search.model_copy(update={"time_limit": limit, "jobs": jobs})
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore", BrachisWarning)
            result = brachis.plan(task.model_copy(update={"search": search}))
    except brachis.PlanningError as error:
        return (
            "time is up" if "within the time limit" in str(error) else f"FAULT {error}"
        )
    except brachis.BrachisError as error:
        return f"{type(error).__name__}: {error}"[:150]
    except Exception as error:  # noqa: BLE001  (what is looked for)
        return f"FAULT {type(error).__name__}: {error}"
    how = (
        "verified"
        if result.verified
        else f"unverified, {result.verification.worst_ratio:.3g}"
    )
    return f"{result.t_end:.3f} s, {how}{', interrupted' if result.interrupted else ''}"


def main() -> int:
    """Print a line for each plan, then the latest one."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--limits", type=float, nargs="+", default=[0.2, 0.5, 1.0, 2.0])
    parser.add_argument("--jobs", type=int, default=1)
    parser.add_argument("--only", default="")
    parser.add_argument("--wall", action="store_true")
    parser.add_argument("--where", action="store_true")
    given = parser.parse_args()
    now = time.monotonic if given.wall else clock
    if not given.wall:
        set_clocks()
    brachis.plan(
        ROOT / "examples/01_scara_line.yaml"
    )  # what is loaded on first use is not timed
    faults, latest = 0, -math.inf
    plans = verified = 0
    with tempfile.TemporaryDirectory() as folder:
        for name, task in tasks(Path(folder)):
            if given.only not in name:
                continue
            for limit in given.limits:
                if given.where:
                    faulthandler.dump_traceback_later(
                        limit + 0.5 * ALLOWED, repeat=True
                    )
                began, busy = time.perf_counter(), now()
                outcome = planned(task, limit, given.jobs)
                late = now() - busy - limit
                faulthandler.cancel_dump_traceback_later()
                faults += late > ALLOWED or outcome.startswith("FAULT")
                latest = max(latest, late)
                plans += 1
                verified += ", verified" in outcome
                took = time.perf_counter() - began
                mark = "LATE" if late > ALLOWED else ""
                print(
                    f"{name:45.45} {limit:4g} s {late:+6.2f} s, wall {took:6.2f} s {mark} {outcome}",
                    flush=True,
                )
    print(
        f"{faults} faults; {verified} of {plans} verified; the latest answer came {latest:+.2f} s after its limit"
    )
    return min(faults, 1)


if __name__ == "__main__":
    sys.exit(main())
