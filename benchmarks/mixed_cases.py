"""Random tasks of mixed kinds, each with a joint motion that is known to do it; see `mixed_tasks`.

A task begins as a random smooth joint motion within the ranges. Its tool path gives the waypoints of splines and CSV
files and the ends of lines, arcs and blended corners. The prescribed path is then followed from the motion's start
posture by damped least squares, which knows nothing of closed forms, branches or the search, and which leans towards
the joint motion where the path leaves a choice. The task is drawn again where the joint path leaves a joint's range,
jumps, or comes to a posture that the drives cannot hold. Slow enough, it is a solution: velocities, accelerations and
the torques beyond the static ones go to zero.
"""

from __future__ import annotations

import zlib
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import pinocchio as pin
import yaml

from brachis.errors import BrachisError
from brachis.path import path_of
from brachis.robot import Robot, TaskMap, bind, dynamics
from brachis.robot.from_task import robot_for
from brachis.task import Task, load_task
from mixed_paths import CLOSED, SHAPES, place_of, random_path
from mixed_robots import ROBOTS, SPATIAL, TOOLS, urdf_of

STEPS = 200
CLEARANCE = 0.02  # of a range, at both of its ends
HOLDING = 0.85  # of the torque limits, friction included
FASTEST = (
    0.08  # rad and m a step: faster joints mean that the path passes a singular posture
)
EXACT = 1e-9  # m and rad, off the path
LEAST_LENGTH = 0.05  # m


@dataclass(frozen=True)
class Case:
    """A task and the joint path that is known to do it.

    Attributes
    ----------
    name : str
        Robot, seed and number.
    kind : str
        Task space and shape of the path.
    task : path
        The task file.
    """

    name: str
    kind: str
    task: Path

    @property
    def joint_path(self) -> np.ndarray:
        """Postures, (STEPS + 1, n), at equal steps of s, from the file beside the task."""
        return np.loadtxt(self.task.with_suffix(".joints"), ndmin=2)


def case(robot: str, seed: int, number: int, folder: Path) -> Case:
    """Make a task file in a folder, with the CSV file and the URDF that it needs; one that is there stays as it is."""
    shape = SHAPES[number % len(SHAPES)]
    space = ROBOTS[robot][(number + number // len(SHAPES)) % len(ROBOTS[robot])]
    name = f"{robot}-{seed}-{number}"
    made = Case(
        name,
        f"{space if isinstance(space, str) else ' '.join(space)} | {shape}",
        folder / f"{name}.yaml",
    )
    if made.task.exists():
        return made
    folder.mkdir(parents=True, exist_ok=True)
    urdf = urdf_of(robot, folder)
    rng = np.random.default_rng([seed, zlib.crc32(robot.encode()), number])
    while True:
        found = _drawn(rng, urdf, TOOLS.get(robot), space, shape, made)
        if found is not None:
            task, joint_path = found
            np.savetxt(made.task.with_suffix(".joints"), joint_path, fmt="%.17g")
            made.task.write_text(
                yaml.safe_dump(task, sort_keys=False), encoding="utf-8"
            )
            return made


def _drawn(
    rng: np.random.Generator,
    urdf: Path,
    tool: str | None,
    space: object,
    shape: str,
    made: Case,
) -> tuple[dict[str, object], np.ndarray] | None:
    """Draw a task and its joint path; None where it is not known to have a solution."""
    plain = Robot.from_urdf(urdf, tool_frame=tool)
    settings = _settings(
        rng,
        plain,
        urdf,
        tool,
        planar=space not in SPATIAL,
        locked=str(space).endswith("locked"),
    )
    space = "position" if str(space).startswith("position") else space
    task: dict[str, object] = {
        "brachis": 1,
        "robot": settings,
        "start": "free",
        "task_space": space,
        "path": [],
    }
    task["spline"] = {
        "degree": int(rng.integers(3, 6)),
        "intervals": int(rng.choice([12, 20, 20, 30])),
        "rest": str(rng.choice(["full", "full", "velocity"])),
    }
    free_start, given_end = rng.random() < 0.3, rng.random() < 0.4
    if rng.random() < 0.15:
        task["tool_limits"] = {"speed": float(rng.uniform(0.3, 1.5))}
    start = {
        "start": {"joints": [0.0] * plain.n},
        "path": [{"line": {"to": [0.0, 0.0, 0.0]}}],
        "task_space": "position",
    }
    robot = robot_for(None, load_task({**task, **start}).robot)
    robot, task_map = bind(robot, space)
    motion = random_motion(rng, robot)
    task["start"] = {"joints": (motion[0, : len(robot.urdf_joints)]).tolist()}
    task["path"] = random_path(
        rng, task_map, motion, shape, made.task.with_suffix(".csv")
    )
    joint_path = known_joint_path(
        task,
        task_map,
        motion[:1].repeat(len(motion), 0) if shape in CLOSED else motion,
        made,
    )
    if joint_path is None:
        return None
    if free_start:
        task |= {"start": "free", "path_start": place_of(task_map, motion[0])}
    if given_end:
        task["end"] = {"joints": joint_path[-1].tolist()}
    return task, joint_path


def _settings(
    rng: np.random.Generator,
    robot: Robot,
    urdf: Path,
    tool: str | None,
    *,
    planar: bool,
    locked: bool,
) -> dict[str, object]:
    """Draw the task's robot part: gravity, limits and friction, and a joint that is locked."""
    tilt = rng.uniform(-0.6, 0.6, 2) * (rng.random() < 0.5)
    upright = np.array(
        [0.0, 0.0, -9.81]
    )  # weak drives of a planar arm bear a little of a slope alone
    gravity = (
        upright + 0.1 * np.append(tilt, 0.0)
        if planar
        else pin.exp3(np.append(tilt, 0.0)) @ upright
    )
    names, torque = robot.joint_names, robot.limits.torque
    scale = {
        kind: float(np.exp(rng.uniform(np.log(0.3), np.log(2.0))))
        for kind in ("torque", "velocity")
    }
    limits: dict[str, object] = {"scale": scale}
    if rng.random() < 0.3:
        limits["acceleration"] = dict(
            zip(names, rng.uniform(3.0, 30.0, len(names)).tolist(), strict=True)
        )
    settings: dict[str, object] = {
        "urdf": str(urdf),
        "gravity": gravity.tolist(),
        "limits": limits,
    }
    if tool:
        settings["tool_frame"] = tool
    if rng.random() < 0.4:
        parts = {"armature": 0.005, "viscous": 0.01, "coulomb": 0.05}
        drawn = {
            key: (rng.uniform(0.0, part, len(names)) * torque).tolist()
            for key, part in parts.items()
        }
        settings["friction"] = {
            key: dict(zip(names, value, strict=True)) for key, value in drawn.items()
        }
    if locked:
        joint = int(rng.integers(len(names)))
        low, high = (
            np.maximum(robot.limits.position_lower, -2.0),
            np.minimum(robot.limits.position_upper, 2.0),
        )
        settings["locked_joints"] = {
            names[joint]: float(rng.uniform(low[joint], high[joint]))
        }
        for part in (
            settings.get("friction", {}),
            {"acceleration": limits.get("acceleration", {})},
        ):
            for values in part.values():
                values.pop(names[joint], None)
    return settings


def random_motion(rng: np.random.Generator, robot: Robot) -> np.ndarray:
    """Random smooth joint motion, (STEPS + 1, n), within the ranges."""
    lower, upper = (
        np.maximum(robot.limits.position_lower, -np.pi),
        np.minimum(robot.limits.position_upper, np.pi),
    )
    middle, half = 0.5 * (lower + upper), 0.45 * (upper - lower)
    free = np.arange(robot.n) < len(robot.urdf_joints)
    s = np.linspace(0.0, 1.0, STEPS + 1)[:, None]
    while True:
        first = middle + half * rng.uniform(-0.7, 0.7, robot.n)
        way, bow, wave = (rng.uniform(-size, size, robot.n) for size in (0.7, 0.2, 0.1))
        first[~free] = 0.0  # a start posture without the virtual joint has it at zero
        motion = (
            first + way * s + bow * np.sin(np.pi * s) + wave * np.sin(2.0 * np.pi * s)
        )
        if np.all(np.abs(motion - middle) <= half):
            return motion


def known_joint_path(
    task: Mapping[str, object], task_map: TaskMap, wish: np.ndarray, made: Case
) -> np.ndarray | None:
    """Follow the path of a task with a start posture; None where there is no path, or no joint path within limits."""
    made.task.write_text(yaml.safe_dump(dict(task), sort_keys=False), encoding="utf-8")
    try:
        loaded: Task = load_task(made.task)
        path = path_of(task_map, loaded)
    except BrachisError:
        return None
    finally:
        made.task.unlink()
    if path.length < LEAST_LENGTH:
        return None
    targets = path.sample(np.linspace(0.0, 1.0, len(wish))).target
    return followed(task_map, targets, wish)


def corrected(
    task_map: TaskMap, q: np.ndarray, target: np.ndarray, wanted: np.ndarray
) -> tuple[np.ndarray, bool]:
    """Move from a posture, (n,), to a target nearby, (c,), a little towards `wanted`, (n,); tell whether it is met."""
    for correction in range(8):
        miss = task_map.difference(target, task_map.value(q))
        if correction and np.abs(miss).max() < EXACT:
            return q, True
        jacobian = task_map.jacobian(task_map.twists(q[None]))[0]
        inverse = jacobian.T @ np.linalg.inv(
            jacobian @ jacobian.T + 1e-8 * np.eye(len(miss))
        )
        pull = 0.1 * (wanted - q) if correction == 0 else np.zeros_like(q)
        q = q + inverse @ (miss - jacobian @ pull) + pull
    return q, False


def followed(
    task_map: TaskMap, targets: np.ndarray, wish: np.ndarray
) -> np.ndarray | None:
    """Follow targets, (K, c), from the first posture of `wish`, (K, n), as near to it as they allow.

    Returns
    -------
    (K, n) ndarray or None
        None where a joint leaves its range or jumps, where a target is not met, or the drives cannot hold the arm.
    """
    robot, limits, q = task_map.robot, task_map.robot.limits, wish[0]
    clear = CLEARANCE * (limits.position_upper - limits.position_lower)
    clear = np.where(np.isfinite(clear), clear, 0.0)
    joint_path = []
    for target, wanted in zip(targets, wish, strict=True):
        before = q
        q, met = corrected(task_map, q, target, wanted)
        if not met:
            return None
        inside = np.all(
            (q >= limits.position_lower + clear) & (q <= limits.position_upper - clear)
        )
        if not inside or np.abs(q - before).max() > FASTEST:
            return None
        joint_path.append(q)
    postures = np.array(joint_path)
    still = np.zeros_like(postures)
    held = (
        np.abs(dynamics.torque(robot, postures, still, still)) + robot.friction.coulomb
        <= HOLDING * limits.torque
    )
    return postures if held.all() else None
