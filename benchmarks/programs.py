"""Random programs of seams: how fast as one, against one seam after the other; and how well a free order is chosen.

Usage: python benchmarks/programs.py [--robot NAME] [--seed 0] [--count 7] [--order 0] [--save]

A program leads from the home posture over three lines of the tool, whose roll is free, and back. One after the other,
each move is planned together with its seam from the posture in which the last seam ended: the planner knows what comes
next, but not what comes later. With ``--order N``, N sets of five seams are planned in all 120 orders, rather long.
"""

from __future__ import annotations

import argparse
import itertools
import warnings
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

import brachis
from brachis.errors import BrachisWarning, PathError
from committed import processor_time, save

HOMES = {
    "iiwa14": [0.0, 0.5, 0.0, -1.2, 0.0, 1.0, 0.3],
    "tx90l_rail": [0.0, 0.0, 0.4, 1.4, 0.0, 0.8, 0.0],
    "ur10_rail": [0.0, 0.0, -1.2, 1.6, -2.0, -1.57, 0.0],
}
BOXES = {
    "iiwa14": ([0.5, 0.0, 0.4], [0.06, 0.25, 0.08]),
    "tx90l_rail": ([0.65, 0.0, 0.5], [0.12, 0.8, 0.15]),
    "ur10_rail": ([0.6, 0.0, 0.4], [0.12, 0.8, 0.15]),
}
"""Middle and half size of the box, m, in which the middles of the seams are drawn."""
LENGTHS = (0.1, 0.35)
"""Shortest and longest seam, m."""
TILT = 25.0
"""Largest tilt of the tool, degrees."""


@dataclass(frozen=True)
class Outcome:
    """A program as one, and one seam after the other: end times, s, and processor time, s."""

    t_end: float
    one_by_one: float
    verified: bool
    seconds: float

    @property
    def gain(self) -> float:
        """Time saved, as a fraction."""
        return 1.0 - self.t_end / self.one_by_one


def draw_seams(robot: str, seed: int, count: int) -> list[dict[str, Any]]:
    """Draw lines of the tool with a random tilt."""
    rng = np.random.default_rng(seed)
    middle, half = BOXES[robot]
    seams = []
    for number in range(count):
        place = np.array(middle) + rng.uniform(-1.0, 1.0, 3) * half
        way = rng.normal(size=3) * [1.0, 1.0, 0.3]
        way *= 0.5 * rng.uniform(*LENGTHS) / np.linalg.norm(way)
        roll, pitch = rng.uniform(-TILT, TILT, 2)
        start = {
            "position": (place - way).round(4).tolist(),
            "rpy_deg": [180.0 + roll, pitch, 0.0],
        }
        line = {"line": {"to": (place + way).round(4).tolist()}}
        seams.append({"path": [line], "path_start": start, "name": f"seam {number}"})
    return seams


def task_of(robot: str, parts: Sequence[dict[str, Any]], **keys: Any) -> dict[str, Any]:
    """Return a task with a program from the home posture."""
    home = {"joints": HOMES[robot]}
    return {
        "brachis": 1,
        "robot": {"urdf": robot},
        "task_space": "pose_free_roll",
        "start": home,
        "program": list(parts),
        "search": {"jobs": 1},
        **keys,
    }


def in_order(robot: str, seams: Sequence[dict[str, Any]]) -> dict[str, Any]:
    """Return the task that visits seams in a given order, and leads back home."""
    parts = itertools.chain(*(({"move": "next"}, seam) for seam in seams))
    home = {"move": {"joints": HOMES[robot]}}
    return task_of(robot, [*parts, home])


def plan_one_by_one(robot: str, seams: Sequence[dict[str, Any]]) -> float:
    """Return the time of all seams, each planned with the move before it, s."""
    here = HOMES[robot]
    total = 0.0
    for seam in seams:
        task = task_of(robot, [{"move": "next"}, seam], start={"joints": here})
        result = brachis.plan(task)
        total += result.t_end
        here = result.trajectory.q[-1].tolist()
    home = HOMES[robot]
    keys: dict[str, Any] = {"search": {"jobs": 1}}
    back = brachis.plan(robot, task_space="free", start=here, end=home, **keys)
    return total + back.t_end


def plan_program(robot: str, seed: int) -> Outcome | None:
    """Plan a program both ways; None if a seam is out of reach."""
    seams = draw_seams(robot, seed, 3)
    began = processor_time()
    try:
        result = brachis.plan(in_order(robot, seams))
    except PathError:
        return None
    seconds = processor_time() - began
    one_by_one = plan_one_by_one(robot, seams)
    print(
        f"{robot} {seed} | {result.t_end:.4f} s | {one_by_one:.4f} s | {seconds:.1f} s",
        flush=True,
    )
    return Outcome(result.t_end, one_by_one, result.verified, seconds)


def compare_orders(robot: str, seed: int) -> None:
    """Plan a set of five seams in every order, and with a free one."""
    seams = draw_seams(robot, seed, 5)
    home = {"joints": HOMES[robot]}
    chosen = brachis.plan(task_of(robot, seams, order="free", end=home)).t_end
    orders = itertools.permutations(seams)
    best = min(brachis.plan(in_order(robot, order)).t_end for order in orders)
    lost = 100.0 * (chosen / best - 1.0)
    print(
        f"{robot} {seed} | free order {chosen:.4f} s | best {best:.4f} s | {lost:.2f} %"
    )


def summarise(robot: str, outcomes: Sequence[Outcome]) -> list[str]:
    """Return the row of a robot."""
    gains = [outcome.gain for outcome in outcomes]
    seconds = [outcome.seconds for outcome in outcomes]
    return [
        robot,
        str(len(outcomes)),
        str(sum(outcome.verified for outcome in outcomes)),
        str(sum(gain < -1e-3 for gain in gains)),
        f"{100.0 * np.mean(gains):.1f} %",
        f"{100.0 * min(gains):.1f} to {100.0 * max(gains):.1f} %",
        f"{np.median(seconds):.1f} s",
        f"{max(seconds):.1f} s",
    ]


def main() -> None:
    """Print a row for every program, and a table of the robots."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--robot", choices=HOMES)
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--count", type=int, default=7, help="programs of each robot")
    parser.add_argument("--order", type=int, default=0, help="sets in every order")
    parser.add_argument("--save", action="store_true")
    given = parser.parse_args()
    warnings.simplefilter("ignore", BrachisWarning)
    robots = [given.robot] if given.robot else list(HOMES)
    if given.order:
        for number in range(given.order):
            compare_orders(robots[number % len(robots)], given.seed + number)
        return
    rows = []
    every: list[Outcome] = []
    print("program | as one | one by one | processor time")
    for robot in robots:
        outcomes: list[Outcome] = []
        seed = given.seed
        while len(outcomes) < given.count:
            outcome = plan_program(robot, seed)
            seed += 1
            if outcome is not None:
                outcomes.append(outcome)
        rows.append(summarise(robot, outcomes))
        every += outcomes
    rows.append(summarise("all", every))
    columns = [
        "robot",
        "programs",
        "verified",
        "slower",
        "mean gain",
        "gains",
        "processor time, median",
        "longest",
    ]
    for row in (columns, *rows):
        print(" | ".join(row))
    _, count, verified, slower, gain, *_ = rows[-1]
    about = (
        f"{verified} of {count} programs of three seams are verified; {slower} are slower than one seam after the "
        f"other, and the mean gain is {gain}."
    )
    save("Programs", columns, rows, about)


if __name__ == "__main__":
    main()
