"""The table of work: what plans of all kinds take, a line for each kind.

Usage: python benchmarks/work.py [--only NAME ...] [--runs 1] [--beside SRC] [--folder DIR] [--save]

Every plan has a new process (`plan_alone`). Processor times and memory include the processes that it starts; of several
runs, times are medians. A line's own time is the median of its tasks, its end time their geometric mean. `--only` takes
words: lines whose names contain one of them are run. `--beside SRC` plans the same tasks with the sources of another
checkout, in turn, run for run, and prints this one's times and end times over the other's. `--folder` keeps the task
files.

Joint paths beside toppra: `joint_paths.py`; lines of the planar arm beside CasADi, Drake and toppra: `peers/run.py`.
"""

from __future__ import annotations

import argparse
import json
import os
import subprocess
import sys
import tempfile
from collections.abc import Iterable, Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import yaml

import brachis
import mixed_cases
import phases
import process_tasks
import timing
from committed import save
from mixed_robots import ROBOTS, ROOT, TOOLS, urdf_of
from random_poses import stored_urdf
from time_limits import line

SPEEDS = (0.02, 0.05, 0.1, 0.2, 0.5)
"""m/s"""
WAYPOINTS = (500, 2000)
CORNER = 1.0
"""mm"""
SEAMS = range(1, 11)
MIXED_SEED = 71
MIXED = range(6)
"""Numbers of mixed tasks of each robot: one of each shape of the path."""
RAIL_START = {"joints": [0.0, 0.3, 0.2, 1.5, 0.2, 1.2, 0.1]}
PANDA_START = {"joints": [0.3, -0.5, 0.2, -2.2, 0.3, 1.9, 0.8]}
JACO = "kinova_description/robots/kinova.urdf"
UR10 = "ur_description/urdf/ur10_robot.urdf"
DETAILED = 5
"""Tasks of a line, no more, that have rows of their own in the table."""
COLUMNS = (
    "line",
    "verified",
    "processor time",
    "longest",
    "first verified motion",
    "end time",
    "largest memory",
)
RATIOS = ("line", "processor time", "worst", "end time", "worst")

Keys = dict[str, Any]
Tasks = Iterator[tuple[str, Keys]]


def weld(folder: Path) -> Tasks:
    """Yield the seam of a welding cell."""
    yield "weld", process_tasks.weld(folder)


def process_speeds(_: Path, **robot: Any) -> Tasks:
    """Yield a line of an arm on its rail, of which the middle is passed at a given speed."""
    path = [{"line": {"by": [0.0, 0.8, 0.0]}}]
    for speed in SPEEDS:
        limits = phases.speeds((speed, 0.2, 0.8))
        task = line("tx90l_rail", start=RAIL_START, path=path, tool_limits=limits)
        task["robot"].update(robot)
        yield f"{speed:g} m/s", task


def process_speeds_with_jerk(folder: Path) -> Tasks:
    """Yield the same with a limit on the jerk of every joint, rad/s^3 and m/s^3."""
    return process_speeds(folder, limits={"jerk": 500.0})


def four_free_joints(_: Path) -> Tasks:
    """Yield a line of positions with a seven-joint arm."""
    path = [{"line": {"by": [-0.1, 0.25, -0.15]}}]
    yield "iiwa", phases.iiwa("position", path, spline={})


def three_free_joints(_: Path) -> Tasks:
    """Yield lines and circles of positions with six-joint arms, and lines over the axis of joint 1."""
    tx90l = {
        "urdf": str(ROOT / "robots/tx90l_rail/robot.urdf"),
        "locked_joints": {"rail": 0.0},
    }
    jaco = {"urdf": str(stored_urdf(JACO)), "tool_frame": "j2s6s200_end_effector"}
    ur10 = {"urdf": str(stored_urdf(UR10)), "tool_frame": "tool0"}
    arms = {
        "TX90L": (tx90l, [0.3, 0.3, 1.3, 0.2, 1.0, 0.1]),
        "Jaco": (jaco, [0.0, 2.8, 1.6, 0.0, 1.5, 0.0]),
        "UR10": (ur10, [0.4, -1.3, 1.5, -1.7, -1.4, 0.3]),
    }
    straight = {"line": {"by": [-0.1, 0.25, -0.15]}}
    task = {"brachis": 1, "task_space": "position"}
    for name, (robot, q) in arms.items():
        settings = {key: value for key, value in robot.items() if key != "urdf"}
        arm = brachis.Robot.from_urdf(robot["urdf"], **settings)
        center = arm.tool_placements(np.array([q]))[0][0] - [0.1, 0.0, 0.0]
        circle = {"circle": {"center": center.tolist(), "normal": [0, 0, 1]}}
        for shape, segment in (("line", straight), ("circle", circle)):
            given = {"robot": robot, "start": {"joints": q}, "path": [segment]}
            yield f"{name}, {shape}", {**task, **given}
    for name, robot, half, height in (
        ("TX90L", tx90l, 0.3, 1.3),
        ("Jaco", jaco, 0.2, 0.8),
    ):
        yield (
            f"{name}, over the axis",
            {
                **task,
                "robot": robot,
                "start": "free",
                "path_start": [half, -0.5 * half, height],
                "path": [{"line": {"by": [-2.0 * half, half, 0.0]}}],
            },
        )


def square(folder: Path) -> Tasks:
    """Yield the sides of a square, with stops at its corners."""
    robot = {"urdf": str(urdf_of("panda", folder)), "tool_frame": TOOLS["panda"]}
    sides = phases.square_sides(-0.2)
    yield (
        "Panda",
        {
            "brachis": 1,
            "robot": robot,
            "start": PANDA_START,
            "task_space": "pose",
            "path": sides,
        },
    )


def waypoints(_: Path) -> Tasks:
    """Yield random walks of a seven-joint arm."""
    for count in WAYPOINTS:
        yield f"{count:,} waypoints", timing.walk(count, timing.WITHOUT_TORQUE)


def seams(folder: Path) -> Tasks:
    """Yield seams as CAM gives them."""
    for seed in SEAMS:
        yield timing.seam(seed, CORNER, folder)


def mixed(folder: Path, **keys: Any) -> Tasks:
    """Yield random tasks of mixed kinds."""
    for robot in ROBOTS:
        for number in MIXED:
            made = mixed_cases.case(robot, MIXED_SEED, number, folder)
            task = yaml.safe_load(made.task.read_text(encoding="utf-8"))
            task["spline"].update(keys)
            yield f"{made.name} {made.kind.replace(' | ', ', ')}", task


def mixed_auto(folder: Path) -> Tasks:
    """Yield them with as many intervals as the planner finds necessary."""
    return mixed(folder, intervals="auto")


LINES = {
    "weld": weld,
    "process speeds": process_speeds,
    "process speeds, jerk": process_speeds_with_jerk,
    "positions, four free joints": four_free_joints,
    "positions, three free joints": three_free_joints,
    "square with stops": square,
    "joint paths": waypoints,
    "CAM seams": seams,
    "mixed tasks, intervals given": mixed,
    "mixed tasks, auto": mixed_auto,
}


@dataclass(frozen=True)
class Work:
    """What the runs of one task took."""

    task: str
    runs: tuple[Keys, ...]

    def of(self, key: str) -> float:
        """Return the median of a figure; NaN if it is not known of a run."""
        return float(np.median([run[key] or np.nan for run in self.runs]))

    @property
    def message(self) -> str:
        """Return what went wrong; empty if all went well."""
        return next((run["message"] for run in self.runs if run["message"]), "")


def run(file: Path, src: Path) -> Keys:
    """Plan a task file in a process of its own with the sources of a checkout."""
    script = Path(__file__).with_name("plan_alone.py")
    ended = subprocess.run(
        [sys.executable, str(script), str(file)],
        env={**os.environ, "PYTHONPATH": str(src)},
        capture_output=True,
        text=True,
        check=False,
    )
    if ended.returncode == 0:
        return json.loads(ended.stdout.splitlines()[-1])
    last = (ended.stderr.splitlines() or [f"exit code {ended.returncode}"])[-1]
    return {"message": f"FAULT {last}"} | dict.fromkeys(
        ("cpu", "first", "memory", "t_end")
    )


def measure(
    name: str,
    tasks: Iterable[tuple[str, Keys]],
    folder: Path,
    given: argparse.Namespace,
) -> list[list[Work]]:
    """Plan the tasks of a line and print what each took; a list for every checkout."""
    sources = [ROOT / "src"] + [given.beside] * (given.beside is not None)
    lists: list[list[Work]] = [[] for _ in sources]
    for number, (task_name, task) in enumerate(tasks):
        file = folder / f"{name.replace(' ', '-')}-{number}.yaml"
        file.write_text(yaml.safe_dump(task, sort_keys=False), encoding="utf-8")
        runs = [[run(file, src) for src in sources] for _ in range(given.runs)]
        for work, of_source in zip(lists, zip(*runs, strict=True), strict=True):
            work.append(Work(task_name, of_source))
            print("   ", " | ".join(row(task_name, work[-1:])), flush=True)
    return lists


def row(name: str, works: list[Work]) -> tuple[str, ...]:
    """Return the cells of a line."""
    cpu = np.array([work.of("cpu") for work in works])
    first = np.array([work.of("first") for work in works])
    t_end = np.array([work.of("t_end") for work in works])
    done = np.isfinite(t_end)
    message = " ".join(work.message for work in works if work.message)
    longest = int(np.argmax(np.nan_to_num(cpu, nan=np.inf)))
    return (
        name,
        f"{done.sum()} of {len(works)}" + f" ({message[:150]})" * bool(message),
        f"{np.median(cpu):.2f} s",
        f"{cpu[longest]:.2f} s ({works[longest].task})" if len(works) > 1 else "",
        f"{np.median(first[done]):.2f} s" if done.any() else "",
        f"{geometric_mean(t_end[done]):.4f} s" if done.any() else "",
        f"{max(work.of('memory') for work in works):.0f} MB",
    )


def geometric_mean(values: np.ndarray) -> float:
    """Return the geometric mean; NaN without values."""
    return float(np.exp(np.mean(np.log(values)))) if len(values) else np.nan


def ratios(name: str, works: list[Work], others: list[Work]) -> tuple[str, ...]:
    """Return the cells of a line beside another checkout."""
    cells = [name]
    for key in ("cpu", "t_end"):
        ratio = np.array(
            [
                own.of(key) / other.of(key)
                for own, other in zip(works, others, strict=True)
            ]
        )
        known = ratio[np.isfinite(ratio)]
        cells.append(f"{geometric_mean(known):.4f} ({len(known)} tasks)")
        if len(known):
            worst = int(np.nanargmax(ratio))
            cells.append(f"{ratio[worst]:.4f} ({works[worst].task})")
        else:
            cells.append("")
    return tuple(cells)


def main() -> None:
    """Print a line for every task and for every kind of tasks."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--only", nargs="+", default=[""])
    parser.add_argument("--runs", type=int, default=1)
    parser.add_argument("--beside", type=Path, metavar="SRC")
    parser.add_argument("--folder", type=Path)
    parser.add_argument("--save", action="store_true", help="into benchmarks/results")
    given = parser.parse_args()
    folder = given.folder or Path(tempfile.mkdtemp(prefix="work-"))
    folder.mkdir(parents=True, exist_ok=True)
    rows = []
    compared = []
    for name, tasks in LINES.items():
        if not any(word in name for word in given.only):
            continue
        works, *others = measure(name, tasks(folder.absolute()), folder, given)
        rows.append(row(name, works))
        print(" | ".join(rows[-1]), flush=True)
        if 1 < len(works) <= DETAILED:
            rows += [row(f"{name}: {work.task}", [work]) for work in works]
        for other in others:
            print(" | ".join(row(f"{name}, {given.beside}", other)), flush=True)
            compared.append(ratios(name, works, other))
    print("\n" + "\n".join(" | ".join(cells) for cells in (COLUMNS, *rows)))
    if compared:
        print("\n" + "\n".join(" | ".join(cells) for cells in (RATIOS, *compared)))
    about = (
        "Every plan runs in its own process. Processor times include the processes that it starts. They are the median "
        "and the longest over the tasks of a line. End times are geometric means over these tasks."
    )
    save("The table of work", COLUMNS, rows, about)


if __name__ == "__main__":
    main()
