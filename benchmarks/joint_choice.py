"""Whether the quick search finds the best joint motion where the arm has much choice, beside slow searches.

Usage: python benchmarks/joint_choice.py [--tasks COUNT] [--only WORD ...] [--fast] [--seconds S] [--out FILE] [--save]

Forty tasks with several redundant joints or a free start posture: random ones of `mixed_cases`, lines on two rails, and
the circle of a planar arm with four joints from the literature on dynamic programming. Each is planned with
``effort: fast``, with ``effort: exhaustive`` for no more than --seconds, and from forty random joint paths: each is
improved over the path, and the best three are finished like any plan. The loss of ``fast`` is its end time beside the
least of all.

--fast plans with ``effort: fast`` alone; best end times come from the file of --out where they stand there. Every task
is a line of JSON in that file.
"""

from __future__ import annotations

import argparse
import json
import warnings
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

import brachis
import mixed_cases
from ablation_tasks import ROOT, folder, iiwa_position, mixed
from brachis.common.deadline import NEVER
from brachis.common.progress import ignore
from brachis.errors import BrachisError, BrachisWarning
from brachis.kinematics import Newton
from brachis.optimise.backends import solvers_for
from brachis.optimise.retiming import ROUGH
from brachis.problem.problem import Problem
from brachis.robot.from_task import robot_for
from brachis.search import guesses, pipeline, screening
from brachis.search.joint_path import PosturePath, sampling_box
from brachis.search.over_path import CHARTS
from brachis.search.stages import Marks, RankedCandidate
from brachis.search.stations import spread_stations
from brachis.task import Task, load_task
from committed import processor_time, save
from mixed_robots import planar_chain

SETTINGS = {
    "search.least_motion": False,
    "search.time_limit": 3600.0,
    "spline.intervals": "auto",
    "spline.rest": "velocity",
}
RESTARTS = 40
FINISHED = 3
"""Random joint paths that are finished."""
LEANING = 2.0
"""rad or m: how far a random joint path leans to a side, from end to end, as a standard deviation."""
TWO_RAILS = [0.5, 0.3, 0.0, 0.5, 0.0, 1.4, 0.0, 0.8, 0.0]
GOOD = 0.3
"""Loss, %, that is allowed in nearly all tasks."""


def circle(*, free: bool) -> dict[str, Any]:
    """Return the circle of 4 m around (6, 4) of a planar arm with links of 7, 7, 4 and 1.5 m."""
    urdf = folder() / "circle4.urdf"
    urdf.write_text(planar_chain((7.0, 7.0, 4.0, 1.5)), encoding="utf-8")
    limits = {"torque": None, "velocity": 2.5, "acceleration": 7.5}
    path = [{"arc": {"center": [6.0, 4.0], "angle_deg": 360.0}}]
    task = {"brachis": 1, "robot": {"urdf": str(urdf), "limits": limits}, "path": path}
    start: Any = {"joints": [1.60374529, -1.42733406, -1.20251457, 0.460776]}
    if free:
        start = "free"
        task |= {"path_start": [10.0, 4.0]}
    return {**task, "task_space": ["x", "y"], "start": start}


def two_rails(number: int) -> dict[str, Any]:
    """Return a random line of an arm on two rails."""
    rng = np.random.default_rng([number, 11])
    by = rng.normal(size=3)
    by *= rng.uniform(0.2, 0.6) / np.linalg.norm(by)
    return {
        "brachis": 1,
        "robot": {"urdf": str(ROOT / "robots/gen3_rails/robot.urdf")},
        "start": {"joints": TWO_RAILS},
        "task_space": ("pose", "position")[number % 2],
        "path": [{"line": {"by": by.round(3).tolist()}}],
    }


def is_open(task: Task) -> bool:
    """Tell whether a task leaves several joints or its start posture open."""
    return task.start == "free" or Problem.of(robot_for(None, task.robot), task).r >= 2


def every_task() -> dict[str, Any]:
    """Return forty tasks by their names."""
    tasks = {
        f"circle, {'free' if free else 'given'}": circle(free=free)
        for free in (False, True)
    }
    tasks |= {f"iiwa position {number}": iiwa_position(number) for number in range(2)}
    tasks |= {f"two rails {number}": two_rails(number) for number in range(2)}
    for robot in mixed_cases.ROBOTS:
        content = (mixed(robot, number) for number in range(24))
        chosen = [each for each in content if is_open(load_task(each))]
        tasks |= {each.stem: each for each in chosen[:5]}
    return dict(list(tasks.items())[:40])


def plan(content: Any, effort: str, seconds: float) -> tuple[float, float]:
    """Plan a task; return its end time, infinite without a plan, and the processor time, s."""
    changes = {**SETTINGS, "search.effort": effort, "search.time_limit": seconds}
    began = processor_time()
    t_end = np.inf
    try:
        result = brachis.plan(load_task(content, changes=changes), check_advice=False)
        t_end = result.t_end if result.verified else np.inf
    except BrachisError as error:
        print(f"  {effort}: {type(error).__name__}: {error}")
    return t_end, processor_time() - began


def random_joint_paths(problem: Problem, rng: np.random.Generator) -> list[PosturePath]:
    """Carry random postures along the path, each leaning to a side of its own; no more than RESTARTS."""
    newton = Newton(problem.task_map)
    s = spread_stations(problem, 97)
    targets = problem.path.sample(s).target
    low, high = sampling_box(problem.robot)
    limits = problem.robot.limits
    count = 20 * RESTARTS
    if problem.start is None:
        first = rng.uniform(low, high, (count, len(low)))
    else:
        first = np.repeat(problem.start[None], count, axis=0)
    lean = rng.normal(0.0, LEANING, first.shape) * rng.uniform(0.0, 1.0, (count, 1))
    postures = [newton.nearest(targets[:1].repeat(count, axis=0), first)]
    for k in range(1, len(s)):
        moved = postures[-1] + (s[k] - s[k - 1]) * lean
        if problem.end is not None:
            homing = (problem.end - postures[-1]) / (1.0 - s[k - 1])
            moved += (s[k] - s[k - 1]) * (homing - s[k] * lean)
        moved = np.clip(moved, limits.position_lower, limits.position_upper)
        postures.append(newton.nearest(targets[k : k + 1].repeat(count, axis=0), moved))
    q = np.swapaxes(postures, 0, 1)
    is_within = (q >= limits.position_lower) & (q <= limits.position_upper)
    good = np.flatnonzero(np.isfinite(q).all(axis=(1, 2)) & is_within.all(axis=(1, 2)))
    return [PosturePath(problem, s, q[k], 0.0) for k in good]


def restart(content: Any) -> tuple[float, list[float]]:
    """Plan from random joint paths; return the best end time, and those over the path, s."""
    task = load_task(content, changes=SETTINGS)
    problem = Problem.of(robot_for(None, task.robot), task)
    newton = Newton(problem.task_map)
    improved = []
    for joint_path in random_joint_paths(problem, np.random.default_rng(1)):
        guess = guesses.guess_in_chart(newton, joint_path, "random")
        if guess is None:
            continue
        improved.append(screening.improve_quickly(guess, NEVER, ROUGH, CHARTS, ignore))
        if len(improved) == RESTARTS:
            break
    improved.sort(key=lambda improved_guess: improved_guess.estimate)
    best = np.inf
    solver = solvers_for(task.solver.name)[0].name
    for improved_guess in improved[:FINISHED]:
        guess = replace(improved_guess, solver=solver)
        candidate = pipeline.rank_candidate(guess, NEVER, ignore)
        if isinstance(candidate, RankedCandidate):
            outcome = pipeline.finish_candidate(candidate, Marks(), NEVER, ignore)
            if outcome.is_settled:
                best = min(best, outcome.t_end)
    return best, [improved_guess.estimate for improved_guess in improved]


def main() -> None:
    """Plan all tasks, and print a line for each."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--tasks", type=int, default=40, help="so many, spread evenly")
    parser.add_argument("--only", nargs="+", default=[""], metavar="WORD")
    parser.add_argument("--fast", action="store_true")
    parser.add_argument("--seconds", type=float, default=60.0)
    parser.add_argument("--out", type=Path)
    parser.add_argument("--save", action="store_true")
    given = parser.parse_args()
    warnings.simplefilter("ignore", BrachisWarning)
    tasks = every_task()
    names = [name for name in tasks if any(word in name for word in given.only)]
    spread = np.linspace(0, len(names) - 1, min(given.tasks, len(names)))
    names = [names[int(k)] for k in spread.round()]
    known = {}
    if given.out and given.out.exists():
        lines = map(json.loads, given.out.read_text(encoding="utf-8").splitlines())
        known = {line["task"]: line for line in lines}
    plan(ROOT / "examples/01_scara_line.yaml", "fast", 60.0)
    rows = []
    for name in names:
        line = known.get(name, {"task": name})
        line["fast"], line["fast_seconds"] = plan(tasks[name], "fast", 3600.0)
        if not given.fast and given.seconds and "exhaustive" not in line:
            line["exhaustive"], _ = plan(tasks[name], "exhaustive", given.seconds)
        if not given.fast and "random" not in line:
            line["random"], line["estimates"] = restart(tasks[name])
        best = min(line.get(key, np.inf) for key in ("fast", "exhaustive", "random"))
        loss = 100.0 * (line["fast"] / best - 1.0)
        times = [
            f"{line.get(key, np.nan):.4f} s" for key in ("fast", "exhaustive", "random")
        ]
        row = (name, *times, f"{loss:.2f} %", f"{line['fast_seconds']:.2f} s")
        print(" | ".join(row), flush=True)
        rows.append((row, loss, line["fast_seconds"]))
        known[name] = line
        if given.out:
            text = "".join(json.dumps(each) + "\n" for each in known.values())
            given.out.write_text(text, encoding="utf-8")
    losses = np.array([loss for _, loss, _ in rows])
    seconds = np.array([second for _, _, second in rows])
    about = (
        f"{np.sum(losses <= GOOD)} of {len(rows)} within {GOOD:g} %, the worst loses {losses.max():.2f} %; processor "
        f"time of fast: {np.exp(np.log(seconds).mean()):.2f} s in the geometric mean, {seconds.max():.1f} s at worst."
    )
    print(about)
    columns = (
        "task",
        "fast",
        "exhaustive",
        "random",
        "loss of fast",
        "processor time of fast",
    )
    save("The quick search beside slow ones", columns, [row for row, *_ in rows], about)


if __name__ == "__main__":
    main()
