"""Random scenes around known motions: how many end in a verified plan that keeps clear, and how fast.

Usage: python benchmarks/scenes.py [--blocked] [--robot NAME] [--seed 0] [--count 10] [--save]

A scene begins as a task of `mixed_cases`, with a joint path that is known to do it. The task is planned quickly
without obstacles. One obstacle then stands where a link of the plan passes, and keeps clear of the known joint path;
up to seven more stand anywhere, and keep clear of it too. So the plan without obstacles collides, and a motion is known
that does not. The known motion is timed by the phase plane: no plan should take longer.

With --blocked an obstacle stands on the path itself, as large as the way from the tool frame to the last body of the
arm: no posture there is free. The refusal should name this obstacle, and a place where it is.

An independent check looks at 2,000 instants of every plan, with Pinocchio's own kinematics and distances.
"""

from __future__ import annotations

import argparse
import tempfile
import time
import warnings
from pathlib import Path

import numpy as np
import pinocchio as pin

import brachis
import mixed_cases
from brachis.errors import BrachisError, BrachisWarning
from brachis.problem.problem import Problem
from brachis.robot.from_task import robot_for
from brachis.scene import Scene, scene_of
from brachis.scene.chain import Chain
from brachis.task import Task, load_task
from brachis.timing import JointPath, PhasePlane
from committed import processor_time, save

ROBOTS = ("scara3", "planar4", "iiwa14", "panda", "tx90l_rail", "ur10_rail")
PLANAR = ("scara3", "planar4")
SPARE = 0.02
"""By how much the known motion keeps farther away than the clearance, m."""
SIZES = (0.03, 0.15)
"""Smallest and largest radius of an obstacle, m."""
LIMIT = 60.0
"""Time that a plan may take, s."""
QUICK = {"spline.intervals": 20, "search.effort": "single"}
"""For the plan without obstacles."""
AUTO = {"spline.intervals": "auto", "spline.rest": "velocity"}


def obstacle(
    rng: np.random.Generator, centre: np.ndarray, radius: float, *, tall: bool
) -> dict[str, object]:
    """Draw an obstacle within a ball, or for an arm in the plane a tall one within a circle."""
    placed = {"position": centre.tolist()}
    if tall:
        shape = {"cylinder": {"radius": radius, "length": 4.0}}
        return {**shape, **placed}
    kind = rng.integers(3)
    if kind == 0:
        return {"sphere": radius, **placed}
    placed["rpy_deg"] = rng.uniform(-180.0, 180.0, 3).tolist()
    if kind == 1:
        return {"box": [1.15 * radius] * 3, **placed}
    return {"capsule": {"radius": 0.5 * radius, "length": radius}, **placed}


def distance_to(
    robot: brachis.Robot, task: Task, q: np.ndarray, body: dict[str, object]
) -> tuple[float, Scene]:
    """Least distance of a body from the robot in postures, (K, n), m, and the scene with it alone."""
    alone = {"scene": [body], "collisions.self_collision": False}
    scene = scene_of(robot, load_task(task, changes=alone))
    assert scene is not None
    last = len(scene.solids) - 1
    scene = scene.with_pairs(np.flatnonzero((scene.pairs == last).any(axis=1)))
    close = scene.find_close(Chain.of(robot.model).place(q), 1.0)
    return float(close.distance.min(initial=1.0)), scene


def draw(
    rng: np.random.Generator,
    task: Task,
    known: np.ndarray,
    planned: np.ndarray,
    *,
    tall: bool,
    on_path: bool = True,
) -> list[dict[str, object]] | None:
    """Draw the obstacles of a scene; None where the plan is everywhere too near to the known motion.

    Parameters
    ----------
    rng, task
    known, planned : (K, n) ndarray
        Postures that stay free, and those of the plan.
    tall : bool
        Whether obstacles are tall.
    on_path : bool, optional
        Whether the first one stands where the plan passes.
    """
    robot = robot_for(None, task.robot)
    clearance = task.collisions.clearance + SPARE
    bodies: list[dict[str, object]] = []
    wanted = int(rng.integers(1, 9))
    reach = 1.5 * np.abs(robot.tool_placements(known)[0]).max()
    for attempt in range(150):
        if not bodies and on_path and attempt == 60:
            break
        if not bodies and on_path:
            posture = planned[rng.integers(len(planned))]
            data = next(iter(robot.place_joints(posture[None])))
            joint = int(rng.integers(2, robot.n + 1))
            ends = data.oMi[joint].translation, data.oMf[robot.frame_id].translation
            part = rng.uniform()
            centre = part * ends[0] + (1.0 - part) * ends[1]
        else:
            centre = rng.uniform(-reach, reach, 3)
        if tall:
            centre[2] = 0.0
        point = obstacle(rng, centre, 1e-3, tall=tall)
        radius = min(distance_to(robot, task, known, point)[0] - clearance, SIZES[1])
        if radius < SIZES[0]:
            continue
        body = obstacle(rng, centre, radius, tall=tall)
        if distance_to(robot, task, known, body)[0] < task.collisions.clearance:
            continue
        if (
            not bodies
            and on_path
            and distance_to(robot, task, planned, body)[0] > -0.01
        ):
            continue
        bodies.append(body)
        if len(bodies) == wanted:
            break
    return bodies or None


def known_time(task: Task, s: np.ndarray, q: np.ndarray) -> float:
    """Least time of the known joint path, s."""
    problem = Problem.of(robot_for(None, task.robot), task)
    timing = PhasePlane(problem.limits, JointPath.through(s, q)).solve((0.0, 0.0))
    return np.inf if timing is None else timing.t_end


def find_smallest(task: Task, trajectory: brachis.Trajectory) -> float:
    """Smallest distance at 2,000 instants by Pinocchio, without the self-collisions, m."""
    robot = trajectory.robot
    scene = scene_of(robot, task)
    assert scene is not None
    model = robot.model
    geometry = pin.GeometryModel()
    for solid, joint, placed in zip(
        scene.solids, scene.joints, scene.placements, strict=True
    ):
        item = pin.GeometryObject(
            solid.name, int(joint), pin.SE3(placed), solid.geometry
        )
        geometry.addGeometryObject(item)
    for first, second in scene.pairs:
        geometry.addCollisionPair(pin.CollisionPair(int(first), int(second)))
    data = model.createData()
    found = geometry.createData()
    least = np.inf
    for q in trajectory.position(np.linspace(0.0, trajectory.t_end, 2000)):
        pin.computeDistances(model, data, geometry, found, q)
        least = min(least, *(each.min_distance for each in found.distanceResults))
    return least


def plan_scene(
    robot: str, seed: int, number: int, folder: Path
) -> tuple[str, ...] | None:
    """Plan one scene; None where none could be made."""
    made = mixed_cases.case(robot, seed, number, folder)
    task = load_task(made.task, changes=AUTO)
    task = load_task(task, changes={"search.least_motion": False})
    known = made.joint_path
    rng = np.random.default_rng([seed, number, ROBOTS.index(robot)])
    bare = robot_for(None, task.robot)
    arm = known[:, : bare.n]  # without a free roll
    if (
        distance_to(bare, task, arm, {"sphere": 0.01, "position": [50.0, 0.0, 0.0]})[0]
        < 1.0
    ):
        return None
    try:
        free = brachis.plan(load_task(task, changes=QUICK), strict=False)
    except BrachisError:
        return None
    q = free.trajectory.position(np.linspace(0.0, free.t_end, 60))
    bodies = draw(rng, task, arm, q[:, : bare.n], tall=robot in PLANAR)
    if bodies is None:
        return None
    task = load_task(task, changes={"scene": bodies})
    s = np.linspace(0.0, 1.0, len(known))
    least = known_time(task, s, known)
    task = load_task(task, changes={"search.time_limit": LIMIT})
    began, busy = time.perf_counter(), processor_time()
    name = f"{made.name}, {len(bodies)} obstacles"
    times = f"{least:.4f} s", f"{free.t_end:.4f} s"
    try:
        result = brachis.plan(task, strict=False)
    except BrachisError as error:
        seconds = f"{time.perf_counter() - began:.1f} s"
        return name, f"{type(error).__name__}: {str(error)[:200]}", *times, "", seconds
    seconds = f"{time.perf_counter() - began:.1f} s ({processor_time() - busy:.1f} s)"
    distance = f"{1e3 * find_smallest(task, result.trajectory):.2f} mm"
    verdict = f"{result.t_end:.4f} s" + ("" if result.verified else " NOT verified")
    if result.t_end > least:
        verdict += " SLOWER than known"
    return name, verdict, *times, distance, seconds


def block(
    rng: np.random.Generator, task: Task, known: np.ndarray, *, tall: bool
) -> tuple[list[dict[str, object]], tuple[float, float]] | None:
    """Put an obstacle on the path, clear of its ends, and more that are not in the way.

    Returns the bodies, and the part of the path where the first one leaves no posture; None where none fits.
    """
    robot = robot_for(None, task.robot)
    positions = robot.tool_placements(known)[0]
    clearance = task.collisions.clearance
    s = np.linspace(0.0, 1.0, len(known))
    for number in rng.permutation(np.flatnonzero((s > 0.2) & (s < 0.8))).tolist():
        centre = positions[number].copy()
        if tall:
            centre[2] = 0.0
        point = obstacle(rng, centre, 1e-3, tall=True) if tall else {"sphere": 1e-3}
        point["position"] = centre.tolist()
        to_arm = distance_to(robot, task, known[number : number + 1], point)[0] + 1e-3
        radius = max(to_arm + 0.03, SIZES[0])
        body = {**point, "name": "blocker"}
        if tall:
            body["cylinder"] = {"radius": radius, "length": 4.0}
        else:
            body["sphere"] = radius
        ends = [distance_to(robot, task, known[[end]], body)[0] for end in (0, -1)]
        if min(ends) < clearance + SPARE:
            continue
        away = np.linalg.norm(
            (positions - positions[number])[:, : 2 if tall else 3], axis=1
        )
        blocked = s[away < 2.0 * radius + clearance]
        others = draw(rng, task, known, known, tall=tall, on_path=False)
        return [body, *(others or [])], (float(blocked[0]), float(blocked[-1]))
    return None


def plan_blocked(
    robot: str, seed: int, number: int, folder: Path
) -> tuple[str, ...] | None:
    """Plan a scene that has no solution; None where none could be made."""
    made = mixed_cases.case(robot, seed, number, folder)
    task = load_task(made.task, changes=AUTO)
    rng = np.random.default_rng([seed, number, ROBOTS.index(robot), 1])
    bare = robot_for(None, task.robot)
    found = block(rng, task, made.joint_path[:, : bare.n], tall=robot in PLANAR)
    if found is None:
        return None
    bodies, (first, last) = found
    task = load_task(task, changes={"scene": bodies, "search.time_limit": LIMIT})
    began = time.perf_counter()
    try:
        result = brachis.plan(task, strict=False)
        said = f"a motion, verified: {result.verified}"
        is_right = False
    except BrachisError as error:
        said = f"{type(error).__name__}: {str(error)[:300]}"
        at = getattr(error, "s_interval", None)
        is_there = at is not None and at[0] <= last and at[1] >= first
        is_right = "blocker" in str(error) and is_there
        said += f" at {at}"
    seconds = f"{time.perf_counter() - began:.1f} s"
    name = f"{made.name}, {len(bodies)} obstacles"
    where = f"s in [{first:.3f}, {last:.3f}]"
    return name, "right" if is_right else "WRONG", where, said, seconds


def main() -> None:
    """Print a row for every scene."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--robot", choices=ROBOTS)
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--count", type=int, default=10, help="scenes of each robot")
    parser.add_argument("--blocked", action="store_true", help="without a solution")
    parser.add_argument("--save", action="store_true")
    given = parser.parse_args()
    warnings.simplefilter("ignore", BrachisWarning)
    rows = []
    plan = plan_blocked if given.blocked else plan_scene
    with tempfile.TemporaryDirectory() as folder:
        for robot in [given.robot] if given.robot else ROBOTS:
            made = 0
            for number in range(6 * given.count):
                row = plan(robot, given.seed, number, Path(folder))
                if row is None:
                    continue
                rows.append(row)
                print(" | ".join(row), flush=True)
                made += 1
                if made == given.count:
                    break
    columns = ("scene", "plan", "known", "without obstacles", "distance", "time")
    if given.blocked:
        columns = ("scene", "refusal", "blocked", "what was said", "time")
        save("Scenes without a solution", columns, rows, "An obstacle is on the path.")
    else:
        save("Random scenes", columns, rows, "Each scene has a known motion.")


if __name__ == "__main__":
    main()
