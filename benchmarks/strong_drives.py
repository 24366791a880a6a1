"""Lines of real arms whose drives are strong beside their speeds: how near plans come to the least time of their path.

Usage: python benchmarks/strong_drives.py [--seed 0] [--count 60] [--number K] [--save]

The velocity limits of the arms are scaled by 0.03 to 0.3, so that an arm comes to its speed within a few hundredths of
a motion. Lines, start postures and scales are drawn; every third task limits accelerations too. Robots and both kinds
of `rest` go round with the number of the task. Everything else is left at its default.

Beside the reported timing gap stands that of a phase plane of this file, which shares no code with the planner: the
squared speed sdot^2 over PLACES steps along the motion's joint path, bounded by velocity limits, integrated
backward and forward under limits on accelerations and torques (Pinocchio's RNEA). It starts and ends at rest, and its
accelerations may jump, so that it is a lower bound with `rest: full`. The reported gap is that of the fastest motion;
the motion that is returned may be a smoother one, as late as 1e-4 of the end time and on another joint path, so that
both are timed here.
"""

from __future__ import annotations

import argparse
import warnings
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import pinocchio as pin

import brachis
from brachis.errors import BrachisError, BrachisWarning
from brachis.path import path_of
from brachis.robot import Robot, bind
from brachis.task import Task, load_task
from committed import processor_time, save
from mixed_cases import STEPS, followed

ROOT = Path(__file__).parents[1]
ROBOTS = ("iiwa14", "tx90l_rail", "ur10_rail", "gen3")
RESTS = ("full", "velocity")
PLACES = 8000
"""Steps of the phase plane."""
END_DENSITY = 10
"""How many times shorter steps are at the ends than they would be if all were equal: speeds are reached there."""
DENSITY = 10
"""Samples of the motion per step of the phase plane."""
END_STEPS = 5
"""Steps next to an end that take the curvature of the next one: at rest it is 0/0."""
ALLOWED = 1e-3
COLUMNS = (
    "task",
    "velocity scale",
    "end time",
    "reported gap",
    "gap of this file, fastest motion",
    "returned motion",
    "intervals",
    "processor time",
)


@dataclass(frozen=True)
class JointPath:
    """A joint path at PLACES + 1 places along its length.

    Attributes
    ----------
    steps : (PLACES,) ndarray
        Lengths of steps in joint space, rad and m.
    q, tangent, curvature : (PLACES, n) ndarray
        Joint positions in the middle of steps, and their first and second derivatives by the length.
    inner_tangent : (PLACES - 1, n) ndarray
        First derivatives at the places between two steps.
    """

    steps: np.ndarray
    q: np.ndarray
    tangent: np.ndarray
    curvature: np.ndarray
    inner_tangent: np.ndarray


def draw_task(seed: int, number: int) -> Task:
    """Draw a line that a robot can follow from its start posture."""
    name = ROBOTS[number % len(ROBOTS)]
    rng = np.random.default_rng([seed, number])
    urdf = ROOT / f"robots/{name}/robot.urdf"
    robot, task_map = bind(Robot.from_urdf(urdf), "pose")
    lower = np.maximum(robot.limits.position_lower, -np.pi)
    upper = np.minimum(robot.limits.position_upper, np.pi)
    limits: dict[str, Any] = {}
    scale = float(np.exp(rng.uniform(np.log(0.03), np.log(0.3))))
    limits["scale"] = {"velocity": round(scale, 4)}
    if number % 3 == 2:
        limits["acceleration"] = rng.uniform(5.0, 30.0, robot.n).round(2).tolist()
    rest = RESTS[number // len(ROBOTS) % len(RESTS)]
    while True:
        start = 0.5 * (lower + upper) + 0.35 * (upper - lower) * rng.uniform(
            -1.0, 1.0, robot.n
        )
        by = rng.normal(size=3)
        by *= rng.uniform(0.15, 0.6) / np.linalg.norm(by)
        content = {
            "brachis": 1,
            "robot": {"urdf": str(urdf), "limits": limits},
            "start": {"joints": start.tolist()},
            "task_space": "pose",
            "path": [{"line": {"by": by.tolist()}}],
            "spline": {"rest": rest},
        }
        task = load_task(content)
        targets = path_of(task_map, task).sample(np.linspace(0.0, 1.0, STEPS)).target
        if followed(task_map, targets, np.tile(start, (STEPS, 1))) is not None:
            return task


def joint_path_of(trajectory: brachis.Trajectory) -> JointPath:
    """Return the joint path of a motion.

    With the speed v = |qdot|, the tangent is qdot / v, and the curvature is the acceleration across it over v^2.
    """
    angle = np.linspace(0.0, np.pi, DENSITY * PLACES + 1)
    t = 0.5 * trajectory.t_end * (1.0 - np.cos(angle))  # dense at both ends
    moved = np.linalg.norm(np.diff(trajectory.position(t), axis=0), axis=1)
    length = np.append(0.0, np.cumsum(moved))
    u = np.linspace(0.0, 1.0, PLACES + 1)
    share = 0.5 * (1.0 - np.cos(np.pi * u))
    places = length[-1] * (share + (u - share) / END_DENSITY)
    times = np.interp(0.5 * (places[1:] + places[:-1]), length, t)
    between = np.interp(places[1:-1], length, t)
    inner = trajectory.velocity(between)
    inner /= np.linalg.norm(inner, axis=1, keepdims=True)
    qdot = trajectory.velocity(times)
    qddot = trajectory.acceleration(times)
    speed = np.linalg.norm(qdot, axis=1, keepdims=True)
    tangent = qdot / speed
    along = np.sum(qddot * tangent, axis=1, keepdims=True)
    curvature = (qddot - along * tangent) / speed**2
    curvature[:END_STEPS] = curvature[END_STEPS]
    curvature[-END_STEPS:] = curvature[-END_STEPS - 1]
    q = trajectory.position(times)
    return JointPath(np.diff(places), q, tangent, curvature, inner)


def limit_rows(
    robot: Robot, path: JointPath
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return the rows a u + b X <= c of limits on torques and accelerations.

    u is the acceleration along the path and X the squared speed, both in the middle of a step.

    Returns
    -------
    a, b, c : (PLACES, m) ndarray
    """
    if robot.friction.coulomb.any() or robot.friction.viscous.any():
        raise ValueError("the phase plane of this benchmark knows no friction")
    model = robot.model
    data = model.createData()
    still = np.zeros(model.nv)
    gravity = np.empty_like(path.q)
    inertia = np.empty_like(path.q)
    centrifugal = np.empty_like(path.q)
    for k, (q, tangent, curvature) in enumerate(
        zip(path.q, path.tangent, path.curvature, strict=True)
    ):
        gravity[k] = pin.rnea(model, data, q, still, still)
        inertia[k] = pin.rnea(model, data, q, still, tangent) - gravity[k]
        centrifugal[k] = pin.rnea(model, data, q, tangent, curvature) - gravity[k]
    torque = robot.limits.torque
    acceleration = np.tile(robot.limits.acceleration, (PLACES, 1))
    a = [inertia, -inertia, path.tangent, -path.tangent]
    b = [centrifugal, -centrifugal, path.curvature, -path.curvature]
    c = [torque - gravity, torque + gravity, acceleration, acceleration]
    a, b, c = (np.hstack(rows) for rows in (a, b, c))
    is_limited = np.isfinite(c).all(axis=0)
    return a[:, is_limited], b[:, is_limited], c[:, is_limited]


def least_time(robot: Robot, path: JointPath) -> float:
    """Return the least time from rest to rest along a joint path, s.

    On a step from X to Y the acceleration is u = (Y - X) / (2 h), and the squared speed in its middle (X + Y) / 2. So
    a row a u + b X <= c bounds p X + r Y with p = b / 2 - a / (2 h) and r = b / 2 + a / (2 h).
    """
    a, b, c = limit_rows(robot, path)
    per_step = a / (2.0 * path.steps[:, None])
    p = 0.5 * b - per_step
    r = 0.5 * b + per_step
    with np.errstate(divide="ignore"):
        ratios = robot.limits.velocity / np.abs(path.inner_tangent)
    caps = np.zeros(PLACES + 1)
    caps[1:-1] = ratios.min(axis=1) ** 2
    for k in range(PLACES - 1, -1, -1):
        caps[k] = min(caps[k], _largest_first(p[k], r[k], c[k], caps[k + 1]))
    squares = np.zeros(PLACES + 1)
    for k in range(PLACES):
        is_upper = r[k] > 0.0
        bounds = (c[k] - p[k] * squares[k])[is_upper] / r[k][is_upper]
        squares[k + 1] = min(caps[k + 1], bounds.min(initial=np.inf))
    if (squares[1:-1] <= 0.0).any():
        raise ValueError("the phase plane of this benchmark came to a stop")
    speeds = np.sqrt(squares)
    return float(np.sum(2.0 * path.steps / (speeds[1:] + speeds[:-1])))


def _largest_first(p: np.ndarray, r: np.ndarray, c: np.ndarray, cap: float) -> float:
    """Return the largest X for which some Y from 0 to `cap` has p X + r Y <= c.

    Y is eliminated: every row that bounds it from below is combined with every row that bounds it from above, the cap
    among them.
    """
    is_lower = r < 0.0
    lower = np.append(p[is_lower] / r[is_lower], 0.0)
    lower_end = np.append(c[is_lower] / r[is_lower], 0.0)
    is_upper = r > 0.0
    upper = np.append(p[is_upper] / r[is_upper], 0.0)
    upper_end = np.append(c[is_upper] / r[is_upper], cap)
    # Y >= lower_end - lower X and Y <= upper_end - upper X
    slope = upper - lower[:, None]
    room = upper_end - lower_end[:, None]
    is_bound = slope > 0.0
    return float(np.min(room[is_bound] / slope[is_bound], initial=np.inf))


def measure(seed: int, number: int) -> tuple[tuple[str, ...], list[float]]:
    """Plan one task: its cells, then three gaps: reported, of the fastest motion, and of the returned one."""
    task = draw_task(seed, number)
    scale = task.robot.limits.scale.velocity
    accelerations = ", accelerations" if number % 3 == 2 else ""
    name = (
        f"{number}: {ROBOTS[number % len(ROBOTS)]}, {task.spline.rest}{accelerations}"
    )
    began = processor_time()
    try:
        result = brachis.plan(task, strict=False)
    except BrachisError as error:
        message = f"{type(error).__name__}: {error}"[:120]
        return (name, f"{scale:.3f}", message), [np.inf] * 3
    seconds = processor_time() - began
    gaps = [np.inf if result.timing_gap is None else result.timing_gap.gap]
    for motion in (result.candidate.trajectory, result.trajectory):
        shortest = least_time(motion.robot, joint_path_of(motion))
        gaps.append(motion.t_end / shortest - 1.0)
    verified = "" if result.verified else ", NOT verified"
    cells = (
        name,
        f"{scale:.3f}",
        f"{result.t_end:.4f} s{verified}",
        *(f"{100.0 * gap:+.4f} %" for gap in gaps),
        f"{len(np.unique(result.trajectory.knots)) - 1}",
        f"{seconds:.2f} s",
    )
    return cells, gaps


def main() -> None:
    """Print a line a task, then the worst gaps."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--count", type=int, default=60)
    parser.add_argument("--number", type=int, help="this task alone")
    parser.add_argument("--save", action="store_true", help="into benchmarks/results")
    chosen = parser.parse_args()
    warnings.simplefilter("ignore", BrachisWarning)
    is_single = chosen.number is not None
    numbers = [chosen.number] if is_single else range(chosen.count)
    rows = []
    gaps = []
    print(" | ".join(COLUMNS))
    for number in numbers:
        cells, gaps_of_task = measure(chosen.seed, number)
        print(" | ".join(cells), flush=True)
        rows.append(cells)
        gaps.append(gaps_of_task)
    worst = 100.0 * np.max(gaps, axis=0)
    above = np.sum(np.array(gaps) > ALLOWED, axis=0)
    about = (
        f"{len(rows)} lines. Largest timing gap, and number of lines above {100.0 * ALLOWED:g} %: as reported "
        f"{worst[0]:.4f} %, {above[0]}. By an independent phase plane with {PLACES} steps: fastest motions "
        f"{worst[1]:.4f} %, {above[1]}; returned motions {worst[2]:.4f} %, {above[2]}."
    )
    print(about)
    save("Strong drives beside slow joints", COLUMNS, rows, about)


if __name__ == "__main__":
    main()
