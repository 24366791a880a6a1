"""Tasks as a cell has them: process speeds, stops and dwells beside limits of every kind.

`seeded` takes random tasks of mixed kinds (`mixed_cases`) and adds two of `EXTRAS` to each, so that every pair occurs;
a task is drawn again if no joint motion is known to do it, and process speeds are such that the drives can hold them
along that joint path. Every tenth task is a joint path through waypoints.
"""

from __future__ import annotations

import itertools
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import numpy as np
import yaml

import joint_paths
import mixed_cases
from brachis import load_task
from brachis.path import path_of
from brachis.robot import Robot, bind, dynamics
from brachis.robot.from_task import robot_for
from mixed_robots import ROBOTS, ROOT

COUNT = 60
SEED = 53
HELD = 0.95
"""Part of the limits within which the known joint path can be passed at the process speed."""
SLOWER = 0.8
"""Factor on a process speed that is too high for that."""
DOWNWARDS = [0, 1, 0, 0]
"""Quaternion, w first, of a tool that points down."""
Keys = dict[str, Any]


def process_speed(rng: np.random.Generator, task: Keys, length: float) -> None:
    """Give a speed to the middle of the path, such that the whole length, m, would take 2 to 10 s."""
    limits = task.setdefault("tool_limits", {})
    speed = min(length / rng.uniform(2.0, 10.0), 0.8 * limits.get("speed", np.inf))
    limits["process_speed"] = {"speed": float(speed), "s": [0.3, 0.7]}


def stop(rng: np.random.Generator, task: Keys, _length: float) -> None:
    """Stop at the corner in place of a blend; or at the end of the path, from where the tool then moves on."""
    first, *others = task["path"]
    if not others:
        task.pop("end", None)
        away = rng.normal(size=3 if isinstance(task["task_space"], str) else 2)
        away *= rng.uniform(0.05, 0.1) / np.linalg.norm(away)
        turning = [0.0] * ("yaw" in task["task_space"])
        task["path"].append({"line": {"by": [*away.tolist(), *turning]}})
    first.pop("blend", None)
    first["stop"] = True


def dwell(rng: np.random.Generator, task: Keys, length: float) -> None:
    """Wait where `stop` stops."""
    if "stop" not in task["path"][0]:
        stop(rng, task, length)
    task["path"][0].pop("stop")
    task["path"][0]["dwell"] = float(rng.uniform(0.1, 1.0))


def jerk(rng: np.random.Generator, task: Keys, _length: float) -> None:
    """Limit the jerk of every joint."""
    task["robot"]["limits"]["jerk"] = float(np.exp(rng.uniform(*np.log([200, 2000]))))
    task["spline"]["rest"] = "full"


def tool_limits(rng: np.random.Generator, task: Keys, length: float) -> None:
    """Limit speed, acceleration and, of poses, angular speed of the tool."""
    limits = task.setdefault("tool_limits", {})
    limits["speed"] = float(length / rng.uniform(0.5, 1.0))
    if "process_speed" in limits:
        limits["speed"] = max(limits["speed"], 1.25 * limits["process_speed"]["speed"])
    limits["acceleration"] = float(limits["speed"] / rng.uniform(0.05, 0.2))
    if str(task["task_space"]).startswith("pose"):
        limits["angular_speed"] = float(rng.uniform(1.0, 3.0))


def payload(rng: np.random.Generator, task: Keys, _length: float) -> None:
    """Carry something."""
    task["robot"]["payload"] = {
        "mass": float(rng.uniform(0.3, 2.0)),
        "com": [0.0, 0.0, 0.05],
    }


EXTRAS: tuple[Callable[[np.random.Generator, Keys, float], None], ...] = (
    process_speed,
    dwell,
    stop,
    jerk,
    tool_limits,
    payload,
)


def seeded(folder: Path, numbers: range = range(COUNT)) -> Iterator[tuple[str, Path]]:
    """Write task files into a folder, and yield names and files."""
    pairs = list(itertools.combinations(EXTRAS, 2))
    robots = list(ROBOTS)
    for number in numbers:
        file = folder / f"process-{number}.yaml"
        if number % 10 == 9:
            task = joint_paths.case(SEED + number, "auto").to_dict()
            file.write_text(yaml.safe_dump(task, sort_keys=False), encoding="utf-8")
            yield f"process {number}: iiwa14, waypoints", file
            continue
        extras = pairs[number % len(pairs)]
        for attempt in itertools.count():
            robot = robots[number % len(robots)]
            draw = number + COUNT * attempt
            made = mixed_cases.case(robot, SEED, draw, folder)
            changed = _with_extras(made, extras, number, file)
            if changed is not None:
                break
        if number % 2:
            changed["spline"]["intervals"] = "auto"
        file.write_text(yaml.safe_dump(changed, sort_keys=False), encoding="utf-8")
        names = ", ".join(extra.__name__.replace("_", " ") for extra in extras)
        kind = made.kind.replace(" | ", ", ")
        yield f"process {number}: {robot}, {kind}, {names}", file


def _with_extras(
    made: mixed_cases.Case, extras: tuple[Callable, ...], number: int, file: Path
) -> Keys | None:
    """Return a task with extras; None if no joint motion is known to do it."""
    task = yaml.safe_load(made.task.read_text(encoding="utf-8"))
    loaded = load_task(made.task)
    robot = robot_for(None, loaded.robot)
    length = path_of(bind(robot, loaded.task_space)[1], loaded).length
    rng = np.random.default_rng([SEED, number])
    for extra in extras:
        extra(rng, task, length)
    robot = robot_for(None, load_task({**task, "path": loaded.to_dict()["path"]}).robot)
    robot, task_map = bind(robot, loaded.task_space)
    case = mixed_cases.Case(file.stem, made.kind, file)
    known = mixed_cases.known_joint_path(task, task_map, made.joint_path, case)
    if known is None:
        return None
    held = task.get("tool_limits", {}).get("process_speed")
    while held and not _can_hold(robot, known, held["speed"]):
        held["speed"] *= SLOWER
    return task


def _can_hold(robot: Robot, joint_path: np.ndarray, speed: float) -> bool:
    """Tell whether the drives can pass the middle of a joint path, (K, n), at a speed of the tool, m/s."""
    step = 1.0 / (len(joint_path) - 1)
    positions, _ = robot.tool_placements(joint_path)
    slope = np.linalg.norm(np.gradient(positions, step, axis=0), axis=1)
    rate = (speed / slope)[:, None]
    by_s = np.gradient(joint_path, step, axis=0)
    by_s2 = np.gradient(by_s, step, axis=0)
    qdot = by_s * rate
    qddot = by_s2 * rate**2 + by_s * rate * np.gradient(rate, step, axis=0)
    torque = np.abs(dynamics.torque(robot, joint_path, qdot, qddot))
    torque += robot.friction.coulomb
    is_held = (torque <= HELD * robot.limits.torque) & (
        np.abs(qdot) <= HELD * robot.limits.velocity
    )
    return bool(is_held[int(0.25 / step) : int(0.75 / step)].all())


def weld(folder: Path) -> dict[str, Any]:
    """Return the task of a welding cell; the points of its seam go into a folder.

    A six-axis arm on a rail comes down to a seam of 0.31 m, welds it at 0.02 m/s and goes up again, among five bodies.
    Its posture is free, and so is the roll of its torch; its jerk is limited, and it carries a payload.
    """
    s = np.linspace(0.0, 1.0, 63)
    points = np.column_stack(
        [
            0.75 + 0.02 * np.sin(2.0 * np.pi * s),
            0.31 * s - 0.15,
            0.35 + 0.01 * np.sin(np.pi * s),
        ]
    )
    rows = np.hstack([points, np.tile(DOWNWARDS, (len(s), 1))])
    np.savetxt(
        folder / "weld.csv",
        rows,
        fmt="%.6f",
        delimiter=",",
        header="x,y,z,qw,qx,qy,qz",
        comments="",
    )
    tolerance = {"position": "0.1 mm", "orientation": "0.1 deg"}
    seam = {"csv": {"file": str(folder / "weld.csv"), "tolerance": tolerance}}
    bodies = {
        "table": ([0.4, 0.8, 0.05], [0.8, 0.0, 0.25]),
        "part": ([0.2, 0.5, 0.04], [0.75, 0.0, 0.295]),
        "fixture": ([0.05, 0.05, 0.2], [0.95, 0.3, 0.4]),
        "fixture 2": ([0.05, 0.05, 0.2], [0.95, -0.35, 0.4]),
        "cabinet": ([0.5, 0.5, 1.5], [-1.0, 0.9, 0.75]),
    }
    return {
        "brachis": 1,
        "robot": {
            "urdf": str(ROOT / "robots/tx90l_rail/robot.urdf"),
            "payload": {"mass": 3.0, "com": [0.0, 0.0, 0.1]},
            "limits": {"jerk": [100, 300, 300, 300, 500, 500, 800]},
        },
        "start": "free",
        "task_space": "pose_free_roll",
        "path_start": {
            "position": (points[0] + [0.0, 0.0, 0.1]).tolist(),
            "quaternion_wxyz": DOWNWARDS,
        },
        "path": [
            {"line": {"by": [0.0, 0.0, -0.1]}, "stop": True},
            {**seam, "speed": 0.02, "stop": True},
            {"line": {"by": [0.0, 0.0, 0.1]}},
        ],
        "scene": [
            {"name": name, "box": size, "position": position}
            for name, (size, position) in bodies.items()
        ],
        "collisions": {"clearance": 0.01},
    }
