"""Motions in phases: stops, dwells and given speeds of the tool, beside what is known of them.

Usage: python benchmarks/phases.py [--only slide gantry ...] [--save]

--only takes words: cases whose names contain one of them are planned. What is known is the shortest time by hand (slide
and gantry), or four plans in a row, each from where the last one ends (squares). The deviation from a given speed is
that of central differences (fourth order) of the tool's positions, by the forward kinematics along the saved motion. A
speed that is refused is planned again with the number in the error.
"""

from __future__ import annotations

import argparse
import tempfile
import warnings
from collections.abc import Callable, Sequence
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np

import brachis
from advice import ADVICE
from brachis.task import with_keys
from committed import processor_time, save

ROOT = Path(__file__).resolve().parents[1]
STEP = 1e-4
"""Step of the differences, s."""
RAIL = "examples/03_tx90l_rail_line.yaml"
WELD = "examples/04_ur10_rail_weld.yaml"
IIWA = [0.3, 0.6, 0.2, -1.3, 0.1, 1.0, 0.2]
"""rad: start posture of the iiwa."""
COLUMNS = (
    "case",
    "end time",
    "beside",
    "off the speed",
    "processor time",
    "verified",
)

Keys = dict[str, Any]
Row = tuple[str, str, str, str, str, str]


def example(name: str, **keys: Any) -> Keys:
    """Return an example's task with other keys."""
    return {**brachis.load_task(ROOT / name).to_dict(), **keys}


def speeds(*parts: tuple[float, float, float]) -> Keys:
    """Return tool limits with process speeds: speed, m/s, and where it begins and ends."""
    return {
        "process_speed": [
            {"speed": speed, "s": [begin, end]} for speed, begin, end in parts
        ]
    }


def sliding(path: Sequence[Keys], *, locked: bool, **keys: Any) -> Keys:
    """Return a task of the gantry, or of its x axis alone."""
    robot: Keys = {
        "urdf": str(ROOT / "robots/gantry2/robot.urdf"),
        "limits": {"velocity": None},
    }
    if locked:
        robot["locked_joints"] = {"y_axis": 0.0}
    return {
        "brachis": 1,
        "robot": robot,
        "start": {"joints": [-0.6] if locked else [-0.6, -0.45]},
        "task_space": ["x"] if locked else ["x", "y"],
        "path": path,
        "spline": {"rest": "velocity", "tolerance": 5e-4},
        "search": {"effort": "single", "least_motion": False},
        **keys,
    }


def to_speed(distance: float, speed: float, acceleration: float) -> float:
    """Least time, s, between rest and a speed, m/s, over a distance, m, by at most an acceleration, m/s^2."""
    top = (acceleration * distance + 0.5 * speed**2) ** 0.5
    return (2.0 * top - speed) / acceleration


def known() -> dict[str, tuple[Keys, float]]:
    """Tasks whose shortest times, s, are known by hand.

    The slide's 200 N push 25 kg. The gantry goes in x and y as 4 to 3, where its x axis limits it to 10 m/s^2.
    """
    first = {"line": {"by": [0.5]}}
    second = {"line": {"by": [0.7]}}
    shortest = to_speed(0.5, 0.0, 8.0) + to_speed(0.7, 0.0, 8.0)
    with_stop = sliding([{**first, "stop": True}, second], locked=True)
    with_dwell = sliding([{**first, "dwell": 0.5}, second], locked=True)
    cases = {
        "slide, stop": (with_stop, shortest),
        "slide, dwell": (with_dwell, shortest + 0.5),
    }
    for name, by, acceleration in (
        ("slide", [1.2], 8.0),
        ("gantry", [1.2, 0.9], 10.0),
    ):
        length = float(np.linalg.norm(by))
        for speed in (0.02, 0.1, 0.5, 1.0):
            limits = speeds((speed, 0.25, 0.75))
            path = [{"line": {"by": by}}]
            task = sliding(path, locked=len(by) == 1, tool_limits=limits)
            way = to_speed(0.25 * length, speed, acceleration)
            cases[f"{name}, {speed:g} m/s"] = (task, 2.0 * way + 0.5 * length / speed)
    return cases


def rail_locked(limits: Keys) -> Keys:
    """Return the line of the TX90L with its rail locked: to the other side, as 0.8 m this way is beyond its reach."""
    task = example(RAIL, path=[{"line": {"by": [0, -0.8, 0]}}], redundant_joints=[])
    task["robot"]["locked_joints"] = {"rail": 0.0}
    task["start"] = {"joints": task["start"]["joints"][1:]}
    return {**task, "tool_limits": limits}


def with_jerk(task: Keys) -> Keys:
    """Limit the jerk of every joint to 500 rad/s^3 or m/s^3."""
    task["robot"]["limits"]["jerk"] = 500.0
    return {**task, "spline": {"intervals": 20, "degree": 5, "rest": "jerk"}}


def iiwa(task_space: str, path: Sequence[Keys], **keys: Any) -> Keys:
    """Return a task of the iiwa."""
    return {
        "brachis": 1,
        "robot": {"urdf": str(ROOT / "robots/iiwa14/robot.urdf")},
        "start": {"joints": IIWA},
        "task_space": task_space,
        "path": path,
        "spline": {"intervals": 20},
        **keys,
    }


def arms() -> dict[str, Keys]:
    """Tasks of arms."""
    cases = {}
    for speed in (0.02, 0.05, 0.1, 0.3, 0.5):
        limits = speeds((speed, 0.2, 0.8))
        cases[f"TX90L on its rail, {speed:g} m/s"] = example(RAIL, tool_limits=limits)
    two = speeds((0.1, 0.1, 0.4), (0.3, 0.6, 0.9))
    cases["TX90L on its rail, 0.1 and 0.3 m/s"] = example(RAIL, tool_limits=two)
    slow = speeds((0.1, 0.2, 0.8))
    cases["TX90L, rail locked, 0.1 m/s"] = rail_locked(slow)
    cases["TX90L on its rail, 0.1 m/s, jerk"] = with_jerk(
        example(RAIL, tool_limits=slow)
    )
    for speed in (0.02, 0.1, 0.3):
        limits = speeds((speed, 0.2, 0.8))
        cases[f"UR10 seam, {speed:g} m/s"] = example(WELD, tool_limits=limits)
    center = brachis.robots.iiwa14.tool_placements(np.array([IIWA]))[0][0] - [0.1, 0, 0]
    circle = [{"circle": {"center": center.tolist(), "normal": [0, 0, 1]}}]
    for task_space in ("position", "pose"):
        limits = speeds((0.1, 0.1, 0.9))
        cases[f"iiwa circle, {task_space}, 0.1 m/s"] = iiwa(
            task_space, circle, tool_limits=limits
        )
    return cases


def squares() -> dict[str, Keys]:
    """Tasks of four sides of 0.2 m, with stops at the corners."""
    cases = {}
    for name, task, way in (
        ("TX90L on its rail", example(RAIL), 0.2),
        ("iiwa", iiwa("pose", []), -0.2),
    ):
        cases[f"square, {name}"] = {**task, "path": square_sides(way)}
    return cases


def square_sides(way: float) -> list[Keys]:
    """Return the sides of a square, the first one so far along y, m, with stops at the corners."""
    corners = ([0, way, 0], [0, 0, -way], [0, -way, 0], [0, 0, way])
    sides: list[Keys] = [{"line": {"by": by}, "stop": True} for by in corners]
    del sides[-1]["stop"]
    return sides


def refused() -> dict[str, Keys]:
    """Tasks of speeds that cannot be held."""
    cases = {
        "planar arm, 2 m/s": example(
            "examples/01_scara_line.yaml", tool_limits=speeds((2.0, 0.3, 0.7))
        ),
        "TX90L on its rail, 5 m/s": example(RAIL, tool_limits=speeds((5.0, 0.2, 0.8))),
        "TX90L, rail locked, 4 m/s": rail_locked(speeds((4.0, 0.2, 0.8))),
        "TX90L, rail locked, short run-up": rail_locked(speeds((1.5, 0.01, 0.8))),
    }
    return {f"refused: {name}": task for name, task in cases.items()}


def speed_deviation(result: brachis.Result) -> float | None:
    """Largest relative deviation of the saved motion from its given speeds; None where there are none."""
    with tempfile.TemporaryDirectory() as folder:
        file = Path(folder) / "result.npz"
        result.save(file)
        motion = brachis.Trajectory.load(file)
    worst = None
    for phase in motion.phases:
        if phase.speed is None:
            continue
        t = np.linspace(phase.begin + 2 * STEP, phase.end - 2 * STEP, 4001)
        places = [
            motion.robot.tool_placements(motion.position(t + steps * STEP))[0]
            for steps in (-2, -1, 1, 2)
        ]
        differences = places[0] - 8.0 * places[1] + 8.0 * places[2] - places[3]
        found = np.linalg.norm(differences, axis=1) / (12.0 * STEP)
        worst = max(worst or 0.0, float(np.abs(found / phase.speed - 1.0).max()))
    return worst


def planned(name: str, task: Keys, beside: Callable[[brachis.Result], str]) -> Row:
    """Plan a task and return its row."""
    began = processor_time()
    try:
        result = brachis.plan(task)
    except brachis.BrachisError as error:
        return name, "no plan", str(error), "", spent(began), "no"
    busy = spent(began)
    off = speed_deviation(result)
    return (
        name,
        f"{result.t_end:.4f} s",
        beside(result),
        "" if off is None else f"{off:.1e}",
        busy,
        "yes" if result.verified else "no",
    )


def spent(began: float) -> str:
    """Write the processor time since then."""
    return f"{processor_time() - began:.1f} s"


def above(fastest: float, result: brachis.Result) -> str:
    """Compare with a time that is known by hand, s."""
    return f"{100.0 * (result.t_end / fastest - 1.0):+.3f} % above {fastest:.4f} s"


def beside_a_row(task: Keys, result: brachis.Result) -> str:
    """Compare with plans of a square's sides one after the other, each from where the last one ends."""
    began = processor_time()
    start = task["start"]
    total = 0.0
    for side in task["path"]:
        path = [{"line": side["line"]}]
        alone = brachis.plan({**task, "path": path, "start": start})
        assert alone.verified
        total += alone.t_end
        start = {"joints": alone.trajectory.q[-1].tolist()}
    gain = 100.0 * (1.0 - result.t_end / total)
    return f"{gain:.1f} % faster than four plans in a row, {total:.4f} s (in {spent(began)})"


def refusal(name: str, task: Keys) -> Row:
    """Plan a task that asks for too much, then with the number that the error names."""
    began = processor_time()
    try:
        result = brachis.plan(task)
    except brachis.PlanningError as error:
        busy = spent(began)
        advice = ADVICE.search(error.hint or "")
        if advice is None:
            return name, "refused", "no number", "", busy, ""
        key, value = advice[2], float(advice[3])
        row = planned(name, with_keys(task, {key: value}), lambda _: f"{value:g} m/s")
        return (*row[:4], f"{busy} to refuse, {row[4]}", row[5])
    return name, f"{result.t_end:.4f} s", "not refused", "", spent(began), ""


def main() -> None:
    """Plan, and print a table."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--only", nargs="+", default=[""])
    parser.add_argument("--save", action="store_true")
    arguments = parser.parse_args()
    warnings.simplefilter("ignore")
    jobs: dict[str, Callable[[], Row]] = {}
    for name, (task, fastest) in known().items():
        jobs[name] = partial(planned, name, task, partial(above, fastest))
    for name, task in arms().items():
        jobs[name] = partial(planned, name, task, lambda _: "")
    for name, task in squares().items():
        jobs[name] = partial(planned, name, task, partial(beside_a_row, task))
    for name, task in refused().items():
        jobs[name] = partial(refusal, name, task)
    print(f"| {' | '.join(COLUMNS)} |\n{'|---' * len(COLUMNS)}|")
    rows = []
    for name, job in jobs.items():
        if any(word in name for word in arguments.only):
            rows.append(job())
            print(f"| {' | '.join(rows[-1])} |", flush=True)
    about = (
        "Stops, dwells and given speeds of the tool. Beside the end time: the shortest time by hand, or four plans in "
        "a row; for refused speeds, the speed that the error names, with which the task is planned again. Off the "
        "speed: by central differences of the tool's positions along the saved motion."
    )
    save("Stops and given speeds", COLUMNS, rows, about)


if __name__ == "__main__":
    main()
