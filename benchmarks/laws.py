"""Pairs of plans that keep laws: what allows more motions is never slower, what allows fewer is never faster.

Usage: python benchmarks/laws.py [--seed 0] [--count 300] [--kind WORDS] [--number K] [--folder DIR] [--save]

A task of `mixed_cases` is planned, then it is planned with one change. Some changes make it harder: a lower limit on
torques, the tool's speed or jerks, narrower joint ranges round a joint path that is known to do it, narrower
tolerances. Others make it easier: higher limits, twice as many intervals, a posture that is free, tolerances, more
effort. The violation of a pair is by how much the plan of the easier task is slower, as a fraction. Kinds of changes,
robots, and `intervals` of 10 and `auto` go round with the number of the pair. The tasks are those that are planned
quickly: with two redundant joints and 10 intervals, or with one.

Plans scatter: a limit counts as met within 1e-4, and `auto` may lose 1e-3. A pair whose harder task alone is planned
violates its law too. Both task files of every pair that is more than `SMALL` beyond its law go into the folder.
"""

from __future__ import annotations

import argparse
import itertools
import tempfile
import time
import warnings
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import yaml

import brachis
import mixed_cases
from brachis.errors import BrachisError, BrachisWarning
from brachis.problem.problem import Problem
from brachis.robot import bind
from brachis.robot.from_task import robot_for
from brachis.task import Task, load_task
from committed import save
from mixed_paths import place_of
from tolerances import RANGES

ROBOTS = ("scara3", "planar4", "iiwa14", "tx90l_rail", "ur10_rail")
WITH_POSES = ROBOTS[2:]
INTERVALS = (10, "auto")
SETTINGS = {
    "search.least_motion": False,
    "search.time_limit": 3600.0,
    "solver.time_limit": 3600.0,
}
"""Of all tasks: a smoother motion may be slower, and no busy machine ends a search early."""
MOST_REDUNDANT = {10: 2, "auto": 1}
"""Largest number of redundant joints, by the intervals."""
SMALL, LARGE = 1e-3, 2e-3
"""Violations from which on pairs are counted; the smaller one is the default of `spline.tolerance`."""
COLUMNS = (
    "change",
    "pairs",
    "worst violation",
    f"above {100 * SMALL:g} %",
    f"above {100 * LARGE:g} %",
    "harder task alone planned",
    "not planned without the change",
)
Changes = Mapping[str, Any]


@dataclass(frozen=True)
class Drawn:
    """What a change is drawn from.

    Attributes
    ----------
    number : int
        Of the pair.
    rng : Generator
    task : Task
        Without the change.
    joint_path : (K, n) ndarray
        A joint path that is known to do the task.
    motion : Trajectory
        The plan of the task.
    """

    number: int
    rng: np.random.Generator
    task: Task
    joint_path: np.ndarray
    motion: brachis.Trajectory


@dataclass(frozen=True)
class Change:
    """One kind of change.

    Attributes
    ----------
    words : str
    makes_harder : bool
        Whether the task with the change is the harder one.
    draw : callable
        Returns keys of the task that are changed.
    before : callable
        Returns keys of the task without the change, by its number and a joint path that is known to do it.
    robots : tuple of str
    intervals : tuple
        Values of spline.intervals that go round.
    """

    words: str
    makes_harder: bool
    draw: Callable[[Drawn], Changes]
    before: Callable[[int, np.ndarray], Changes] = lambda _number, _joint_path: {}
    robots: tuple[str, ...] = ROBOTS
    intervals: tuple[int | str, ...] = INTERVALS


@dataclass(frozen=True)
class Pair:
    """Two plans beside each other.

    Attributes
    ----------
    name : str
    words : str
        The change.
    harder, easier : Task
    end_times : tuple of float
        Of the harder and the easier task, s; infinite where no plan was verified.
    messages : tuple of str
        Why not.
    """

    name: str
    words: str
    harder: Task
    easier: Task
    end_times: tuple[float, float]
    messages: tuple[str, str]

    @property
    def violation(self) -> float:
        """By how much the plan of the easier task is slower, as a fraction; infinite if that alone failed."""
        slower, quicker = self.end_times
        if np.isinf(slower):
            return -np.inf
        return quicker / slower - 1.0


def draw_scale(kind: str, low: float, high: float) -> Callable[[Drawn], Changes]:
    """Return what scales limits of one kind by a factor from `low` to `high`."""

    def draw(drawn: Drawn) -> Changes:
        scale = getattr(drawn.task.robot.limits.scale, kind)
        factor = scale * drawn.rng.uniform(low, high)
        return {f"robot.limits.scale.{kind}": float(factor)}

    return draw


def draw_tool_speed(drawn: Drawn) -> Changes:
    """Limit the tool's speed below the largest one of the motion."""
    motion = drawn.motion
    speed = motion.at(np.linspace(0.0, motion.t_end, 500)).tool_speed.max()
    return {"tool_limits.speed": float(drawn.rng.uniform(0.5, 0.95) * speed)}


def draw_jerk(drawn: Drawn) -> Changes:
    """Limit jerks such that the largest accelerations of the motion take some 7 to 30 % of its time to build up."""
    motion = drawn.motion
    names = motion.robot.urdf_joints
    largest = np.abs(motion.node_accelerations).max(axis=0)[: len(names)]
    largest = np.maximum(largest, 0.05 * largest.max())  # also of joints that rest
    jerk = drawn.rng.uniform(3.0, 15.0) * largest / motion.t_end
    return {"robot.limits.jerk": dict(zip(names, jerk.tolist(), strict=True))}


def draw_ranges(drawn: Drawn) -> Changes:
    """Narrow joint ranges around the known joint path."""
    robot = drawn.motion.robot
    ranges = {}
    for joint, name in enumerate(robot.urdf_joints):
        q = drawn.joint_path[:, joint]
        low, high = (
            robot.limits.position_lower[joint],
            robot.limits.position_upper[joint],
        )
        low = max(low, q.min() - np.pi)
        high = min(high, q.max() + np.pi)
        below, above = drawn.rng.uniform(0.02, 0.4, 2)
        ends = q.min() - below * (q.min() - low), q.max() + above * (high - q.max())
        ranges[name] = [float(end) for end in ends]
    return {"robot.limits.position": ranges}


def draw_free_start(drawn: Drawn) -> Changes:
    """Free the start posture."""
    robot = robot_for(None, drawn.task.robot)
    _, task_map = bind(robot, drawn.task.task_space)
    return {"start": "free", "path_start": place_of(task_map, drawn.joint_path[0])}


def halve(ranges: Any) -> Any:
    """Halve all numbers of a mapping."""
    if isinstance(ranges, Mapping):
        return {key: halve(value) for key, value in ranges.items()}
    return [0.5 * end for end in ranges] if isinstance(ranges, list) else 0.5 * ranges


def with_ranges(number: int, _joint_path: np.ndarray) -> Changes:
    """Return tolerances of the tool, one kind after the other; no posture at the end, which would leave them."""
    return {"tolerances": RANGES[number % len(RANGES)], "end": "free"}


def draw_half_ranges(drawn: Drawn) -> Changes:
    """Halve tolerances."""
    return {"tolerances": halve(RANGES[drawn.number % len(RANGES)])}


def draw_ranges_of_tool(drawn: Drawn) -> Changes:
    """Let the tool leave its path."""
    return {"tolerances": RANGES[int(drawn.rng.integers(len(RANGES)))]}


CHANGES = (
    Change(
        "torque limits, lower", makes_harder=True, draw=draw_scale("torque", 0.87, 0.97)
    ),
    Change("tool speed limited", makes_harder=True, draw=draw_tool_speed),
    Change(
        "jerks limited",
        makes_harder=True,
        draw=draw_jerk,
        before=lambda _number, _joint_path: {"spline.rest": "full"},
    ),
    Change("joint ranges, narrower", makes_harder=True, draw=draw_ranges),
    Change(
        "tolerances halved",
        makes_harder=True,
        draw=draw_half_ranges,
        before=with_ranges,
        robots=WITH_POSES,
        intervals=(10,),
    ),
    Change(
        "torque limits, higher",
        makes_harder=False,
        draw=draw_scale("torque", 1.05, 1.5),
    ),
    Change(
        "velocity limits, higher",
        makes_harder=False,
        draw=draw_scale("velocity", 1.05, 1.5),
    ),
    Change(
        "intervals doubled",
        makes_harder=False,
        draw=lambda _drawn: {"spline.intervals": 20},
        intervals=(10,),
    ),
    Change(
        "end posture freed",
        makes_harder=False,
        draw=lambda _drawn: {"end": "free"},
        before=lambda _number, joint_path: {"end": {"joints": joint_path[-1].tolist()}},
    ),
    Change("start posture freed", makes_harder=False, draw=draw_free_start),
    Change(
        "tolerances allowed",
        makes_harder=False,
        draw=draw_ranges_of_tool,
        before=lambda _number, _joint_path: {"end": "free"},
        robots=WITH_POSES,
        intervals=(10,),
    ),
    Change(
        "effort fast, not single",
        makes_harder=False,
        draw=lambda _drawn: {"search.effort": "fast"},
        before=lambda _number, _joint_path: {"search.effort": "single"},
    ),
    Change(
        "effort thorough, not fast",
        makes_harder=False,
        draw=lambda _drawn: {"search.effort": "thorough"},
    ),
)


def find_case(
    change: Change, seed: int, number: int, folder: Path
) -> tuple[mixed_cases.Case, int | str]:
    """Return the case of a pair, and its intervals: the `number`-th case of its robot that is planned quickly.

    Every kind of change has its own seed of cases. A change of tolerances needs a pose.
    """
    case_seed = seed * len(CHANGES) + CHANGES.index(change)
    robot = change.robots[number % len(change.robots)]
    turn = number // len(change.robots)
    intervals = change.intervals[turn % len(change.intervals)]
    quick_count = 0
    for index in itertools.count():
        case = mixed_cases.case(robot, case_seed, index, folder)
        task = load_task(case.task)
        if change.robots == WITH_POSES and task.task_space != "pose":
            continue
        problem = Problem.of(robot_for(None, task.robot), task)
        if problem.r > MOST_REDUNDANT[intervals]:
            continue
        if quick_count == turn:
            break
        quick_count += 1
    return case, intervals


def plan_task(task: Task) -> tuple[brachis.Trajectory | None, str]:
    """Plan a task; its motion if that is verified, or why there is none."""
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", BrachisWarning)  # limits are scaled at will
        try:
            result = brachis.plan(task, strict=False)
        except BrachisError as error:
            return None, f"{type(error).__name__}: {error}"
    if not result.verified:
        checks = result.verification.checks
        failed = [check.name for check in checks if not check.passed]
        return None, f"unverified: {', '.join(failed)}"
    return result.trajectory, ""


def plan_pair(change: Change, seed: int, number: int, folder: Path) -> Pair:
    """Plan the pair of a change with this number.

    Raises
    ------
    BrachisError
        The task without the change is not planned, so that the change is not known.
    """
    case, intervals = find_case(change, seed, number, folder)
    joint_path = case.joint_path
    robot_joints = len(robot_for(None, load_task(case.task).robot).urdf_joints)
    before = {
        **SETTINGS,
        "start": {"joints": joint_path[0, :robot_joints].tolist()},
        "spline.intervals": intervals,
        **change.before(number, joint_path),
    }
    task = load_task(case.task, changes=before)
    motion, message = plan_task(task)
    if motion is None:
        raise brachis.PlanningError(f"{case.name} without the change: {message}")
    rng = np.random.default_rng([seed, number, CHANGES.index(change)])
    changes = change.draw(Drawn(number, rng, task, joint_path, motion))
    changed = load_task(task, changes=changes)
    other, other_message = plan_task(changed)
    end_times = motion.t_end, np.inf if other is None else other.t_end
    tasks, messages = (task, changed), (message, other_message)
    if change.makes_harder:
        tasks, end_times, messages = tasks[::-1], end_times[::-1], messages[::-1]
    name = f"{case.name}, {intervals} intervals"
    return Pair(name, change.words, *tasks, end_times, messages)


def write_tasks(pair: Pair, folder: Path) -> None:
    """Write both task files of a pair."""
    name = f"{pair.words} {pair.name}".replace(", ", "-").replace(" ", "-")
    for word, task in (("harder", pair.harder), ("easier", pair.easier)):
        content = yaml.safe_dump(task.to_dict(), sort_keys=False)
        (folder / f"{name}-{word}.yaml").write_text(content, encoding="utf-8")


def summarise(words: str, pairs: list[Pair], unknown: list[str]) -> tuple[str, ...]:
    """Return the cells of one kind of change."""
    finite = [pair.violation for pair in pairs if np.isfinite(pair.violation)]
    above = [
        f"{pair.name}: +{100.0 * pair.violation:.2f} %"
        for pair in pairs
        if SMALL < pair.violation < np.inf
    ]
    lost = [pair.name for pair in pairs if np.isposinf(pair.violation)]
    large = sum(violation > LARGE for violation in finite)
    return (
        words,
        str(len(pairs)),
        f"{100.0 * max(finite):+.3f} %" if finite else "",
        f"{len(above)} ({'; '.join(above)})" if above else "0",
        str(large),
        f"{len(lost)} ({'; '.join(lost)})" if lost else "0",
        f"{len(unknown)} ({'; '.join(unknown)})" if unknown else "0",
    )


def main() -> None:
    """Print a line a pair, the violations sorted, then a line for every kind of change."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--count", type=int, default=300, help="pairs of all kinds")
    parser.add_argument("--kind", default="", help="changes with these words alone")
    parser.add_argument("--number", type=int, help="this pair of each kind alone")
    parser.add_argument("--folder", type=Path, help="where task files go")
    parser.add_argument("--save", action="store_true", help="into benchmarks/results")
    chosen = parser.parse_args()
    folder = chosen.folder or Path(tempfile.mkdtemp(prefix="laws-"))
    folder.mkdir(parents=True, exist_ok=True)
    print(f"task files in {folder}", flush=True)
    changes = [change for change in CHANGES if chosen.kind in change.words]
    pairs: dict[str, list[Pair]] = {change.words: [] for change in changes}
    unknown: dict[str, list[str]] = {change.words: [] for change in changes}
    for index in range(chosen.count):
        change = changes[index % len(changes)]
        number = index // len(changes)
        if chosen.number is not None and number != chosen.number:
            continue
        began = time.perf_counter()
        try:
            pair = plan_pair(change, chosen.seed, number, folder)
        except BrachisError as error:
            unknown[change.words].append(str(error)[:100])
            print(f"{change.words} {number}: {error}", flush=True)
            continue
        pairs[change.words].append(pair)
        seconds = time.perf_counter() - began
        slower, quicker = pair.end_times
        print(
            f"{change.words} {number} ({pair.name}): {slower:.5f} s, easier {quicker:.5f} s, "
            f"{100.0 * pair.violation:+.4f} %, {seconds:.1f} s; {' '.join(pair.messages)}",
            flush=True,
        )
        if pair.violation > SMALL:
            write_tasks(pair, folder)
    everything = [pair for entries in pairs.values() for pair in entries]
    everything.sort(key=lambda pair: -pair.violation)
    for pair in everything[:20]:
        print(f"{100.0 * pair.violation:+.4f} %: {pair.words}, {pair.name}")
    rows = [
        summarise(words, entries, unknown[words]) for words, entries in pairs.items()
    ]
    for row in rows:
        print(" | ".join(row))
    violations = np.array([pair.violation for pair in everything])
    about = (
        f"{len(everything)} pairs of an easier and a harder task. A violation says by how much the plan of the easier "
        f"one is slower; {np.sum(violations > SMALL)} exceed {100.0 * SMALL:g} %, "
        f"{np.sum(violations > LARGE)} exceed {100.0 * LARGE:g} %."
    )
    print(about)
    save("Laws of pairs of plans", COLUMNS, rows, about)


if __name__ == "__main__":
    main()
