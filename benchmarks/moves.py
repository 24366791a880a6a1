"""Random moves round bodies: how fast, against the joint paths of the library OMPL timed by the phase plane.

Usage: python benchmarks/moves.py [--robot NAME] [--seed 0] [--count 10] [--effort fast] [--save]

A move joins two random postures. One body stands in the way of the straight joint path; up to four more stand
anywhere clear of both postures. OMPL is used on its own: RRT-Connect with four seeds, each joint path simplified
and smoothed by OMPL as far as it can. The fastest of these eight joint paths is what a plan has to beat.

MuJoCo measures the distances at 2,000 instants of every plan, with its own kinematics and from the same URDF.
"""

from __future__ import annotations

import argparse
import re
import warnings
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

import brachis
import random_poses
from brachis.common.files import mesh_file
from brachis.errors import BrachisError, BrachisWarning
from brachis.problem.problem import Problem
from brachis.robot.from_task import robot_for
from brachis.scene import scene_of
from brachis.search.phase_plane import least_time
from brachis.task import Task, task_with
from committed import processor_time, save
from scenes import distance_to

ROOT = Path(__file__).parents[1]
ROBOTS = ("iiwa14", "ur10_rail", "panda")
KINDS = ("sphere", "box", "capsule", "cylinder")
SIZES = (0.04, 0.15)
"""Smallest and largest radius of a body, m."""
SPARE = 0.02
"""Distance of every body from both postures, m."""
SEEDS = (1, 2, 3, 4)
"""Seeds with which OMPL is used on its own."""
SAMPLES = 20_000
"""Number of samples after which OMPL gives up."""
INSTANTS = 2000
"""Number of instants at which MuJoCo measures distances."""
COMPILER = (
    '<mujoco><compiler discardvisual="true" fusestatic="false" inertiafromgeom="false" '
    'balanceinertia="true" strippath="false"/></mujoco>'
)


@dataclass(frozen=True)
class Move:
    """A random move, and the joint paths that OMPL finds for it."""

    name: str
    task: Task
    problem: Problem
    library_paths: list[np.ndarray]


def robot_settings(robot: str) -> dict[str, Any]:
    """Return the robot part of a task."""
    if robot == "panda":
        urdf = random_poses.stored_urdf(random_poses.PANDA)
        return {"urdf": str(urdf), "tool_frame": "panda_hand_tcp"}
    return {"urdf": str(ROOT / f"robots/{robot}/robot.urdf")}


def draw_body(rng: np.random.Generator, centre: np.ndarray) -> dict[str, Any]:
    """Draw a body around a point."""
    radius = float(rng.uniform(*SIZES))
    kind = KINDS[rng.integers(len(KINDS))]
    shapes = {
        "sphere": radius,
        "box": (radius * rng.uniform(0.6, 2.0, 3)).tolist(),
        "capsule": {"radius": 0.5 * radius, "length": 2.0 * radius},
        "cylinder": {"radius": 0.6 * radius, "length": 2.0 * radius},
    }
    turned = rng.uniform(-180.0, 180.0, 3).tolist()
    return {kind: shapes[kind], "position": centre.tolist(), "rpy_deg": turned}


def bind(robot: str, bodies: list[dict[str, Any]], ends: np.ndarray) -> Problem | None:
    """Return the problem of a move; None where a posture at its end is not allowed."""
    settings = robot_settings(robot)
    task = task_with(
        robot=settings,
        start=ends[0].tolist(),
        end=ends[1].tolist(),
        task_space="free",
        scene=bodies,
        intervals="auto",
    )
    try:
        return Problem.of(robot_for(None, task.robot), task)
    except BrachisError:
        return None


def is_free(problem: Problem, q: np.ndarray) -> bool:
    """Tell whether the limits allow postures, (K, n), at rest."""
    return all(
        limit.holds_at_rest(q, 1e-9).all()
        for limit in problem.limits
        if limit.at_rest != "nothing"
    )


def draw_bodies(
    rng: np.random.Generator, model: brachis.Robot, task: Task, ends: np.ndarray
) -> list[dict[str, Any]]:
    """Draw bodies clear of both ends, (2, n): first one in the straight way; none where that fails."""
    straight = np.linspace(*ends, 60)
    wanted = int(rng.integers(1, 6))
    bodies: list[dict[str, Any]] = []
    for _ in range(60):
        if bodies:
            centre = model.tool_placements(ends)[0].mean(axis=0)
            centre = centre + rng.uniform(-1.0, 1.0, 3)
        else:
            posture = straight[rng.integers(15, 45)]
            data = next(iter(model.place_joints(posture[None])))
            joint = int(rng.integers(2, model.n + 1))
            places = data.oMi[joint].translation, data.oMf[model.frame_id].translation
            centre = places[0] + rng.uniform() * (places[1] - places[0])
        body = draw_body(rng, centre)
        if distance_to(model, task, ends, body)[0] < SPARE:
            continue
        if not bodies and distance_to(model, task, straight, body)[0] > 0.0:
            continue
        bodies.append(body)
        if len(bodies) == wanted:
            break
    return bodies


def draw_move(robot: str, seed: int, number: int) -> Move | None:
    """Draw a move; None where nothing is in the way, or OMPL finds no way round."""
    rng = np.random.default_rng([77, seed, number, ROBOTS.index(robot)])
    model = load(robot)
    limits = model.limits.both_ways("position")
    low, high = np.where(np.isfinite(limits), limits, [[-2.0], [2.0]])
    for _ in range(100):
        ends = low + rng.uniform(0.15, 0.85, (2, model.n)) * (high - low)
        alone = bind(robot, [], ends)
        if alone is not None:
            break
    else:
        return None
    bodies = draw_bodies(rng, model, alone.task, ends)
    problem = bind(robot, bodies, ends) if bodies else None
    if problem is None:
        return None
    paths = [path for seed in SEEDS for path in library_paths(problem, seed)]
    if not paths:
        return None
    name = f"{robot} {number}, {len(bodies)} bodies"
    return Move(name, problem.task, problem, paths)


def load(robot: str) -> brachis.Robot:
    """Return a robot."""
    settings = robot_settings(robot)
    return brachis.Robot.from_urdf(settings.pop("urdf"), **settings)


def library_paths(problem: Problem, seed: int) -> list[np.ndarray]:
    """Find a joint path by OMPL alone: simplified, and smoothed as well."""
    from ompl import base, geometric, util

    util.setLogLevel(util.LogLevel.LOG_NONE)
    util.RNG.setSeed(seed)
    n = problem.robot.n
    space = base.RealVectorStateSpace(n)
    bounds = base.RealVectorBounds(n)
    limits = problem.robot.limits.both_ways("position")
    ends = np.where(np.isfinite(limits), limits, [[-np.pi], [np.pi]])
    for joint, (low, high) in enumerate(ends.T.tolist()):
        bounds.setLow(joint, low)
        bounds.setHigh(joint, high)
    space.setBounds(bounds)
    setup = geometric.SimpleSetup(space)
    setup.setStateValidityChecker(
        lambda state: is_free(problem, np.array([state[0:n]]))
    )
    information = setup.getSpaceInformation()
    information.setStateValidityCheckingResolution(0.002)
    states = space.allocState(), space.allocState()
    for state, q in zip(states, (problem.start, problem.end), strict=True):
        state[0:n] = q.tolist()
    setup.setStartAndGoalStates(*states)
    setup.setPlanner(geometric.RRTConnect(information))
    count = 0

    def is_over() -> bool:
        nonlocal count
        count += 1
        return count > SAMPLES

    setup.solve(base.PlannerTerminationCondition(is_over))
    if not setup.haveExactSolutionPath():
        return []
    path = setup.getSolutionPath()
    simplifier = geometric.PathSimplifier(information)
    found = []
    for improve in (simplifier.simplifyMax, simplifier.smoothBSpline):
        improve(path)
        found.append(np.array([state[0:n] for state in path.getStates()]))
    return found


def library_time(move: Move) -> float:
    """Return the least time along the library's joint paths, s."""
    times = []
    for q in move.library_paths:
        steps = np.append(0.0, np.cumsum(np.abs(np.diff(q, axis=0)).max(axis=1)))
        times.append(least_time(move.problem, steps / steps[-1], q))
    return min(times)


def find_smallest(
    task: Task, trajectory: brachis.Trajectory, count: int = INSTANTS
) -> float:
    """Return the smallest distance of the pairs of the scene along a motion, by MuJoCo, m."""
    import mujoco

    robot = trajectory.robot
    scene = scene_of(robot, task)
    assert scene is not None
    folder = Path(robot.source).absolute().parent
    text = re.sub(
        'filename="([^"]+)"',
        lambda name: f'filename="{mesh_file(name[1], folder)}"',
        robot.urdf.replace("</robot>", COMPILER + "</robot>"),
    )
    spec = mujoco.MjSpec.from_string(text)
    for body in task.scene:
        add_body(mujoco, spec, body)
    model = spec.compile()
    data = mujoco.MjData(model)
    geoms: dict[str, list[int]] = {}
    for geom in range(model.ngeom):
        carrier = model.body(model.geom_bodyid[geom]).name
        geoms.setdefault(model.geom(geom).name or carrier, []).append(geom)
    counts: dict[str, int] = {}
    numbers = []
    root = geoms.get("world", [])
    for solid in scene.solids:
        key = solid.link or solid.name
        mine = geoms.get(key, root)
        numbers.append(mine[counts.get(key, 0)])
        counts[key] = counts.get(key, 0) + 1
    order = [model.joint(name).qposadr[0] for name in robot.joint_names]
    least = np.inf
    for q in trajectory.position(np.linspace(0.0, trajectory.t_end, count)):
        data.qpos[order] = q
        mujoco.mj_kinematics(model, data)
        for first, second in scene.pairs:
            pair = numbers[first], numbers[second]
            apart = mujoco.mj_geomDistance(model, data, *pair, 0.05, None)
            least = min(least, apart)
    return float(least)


def add_body(mujoco: Any, spec: Any, body: Any) -> None:
    """Add a body of a task to a model of MuJoCo."""
    kinds = mujoco.mjtGeom
    roll, pitch, yaw = np.deg2rad(body.rpy_deg)
    quaternion = np.zeros(4)
    mujoco.mju_euler2Quat(quaternion, [yaw, pitch, roll], "zyx")
    sizes = {
        "sphere": (kinds.mjGEOM_SPHERE, [body.sphere, 0, 0]),
        "box": (kinds.mjGEOM_BOX, [0.5 * side for side in body.box or (0, 0, 0)]),
    }
    for name, kind in (
        ("capsule", kinds.mjGEOM_CAPSULE),
        ("cylinder", kinds.mjGEOM_CYLINDER),
    ):
        shape = getattr(body, name)
        if shape is not None:
            sizes[name] = kind, [shape.radius, 0.5 * shape.length, 0]
    kind, size = sizes[body.shape]
    spec.worldbody.add_geom(
        name=str(body.name), type=kind, size=size, pos=body.position, quat=quaternion
    )


@dataclass(frozen=True)
class Outcome:
    """A plan of a move beside the library's joint path: times, s, smallest distance, m, and processor time, s."""

    library: float
    t_end: float
    is_verified: bool
    distance: float
    seconds: float

    @property
    def gain(self) -> float:
        """Fraction of the library's time that the plan saves."""
        return 1.0 - self.t_end / self.library


def plan_move(move: Move, effort: str) -> Outcome:
    """Plan a move, print a row, and return the outcome."""
    library = library_time(move)
    busy = processor_time()
    try:
        result = brachis.plan(move.task, effort=effort, strict=False)
    except BrachisError as error:
        print(f"{move.name} | {type(error).__name__}: {str(error)[:200]}", flush=True)
        return Outcome(library, np.inf, is_verified=False, distance=-1.0, seconds=0.0)
    outcome = Outcome(
        library,
        result.t_end,
        result.verified,
        find_smallest(move.task, result.trajectory),
        processor_time() - busy,
    )
    cells = (
        move.name,
        f"{library:.4f} s",
        f"{result.t_end:.4f} s" + ("" if result.verified else " NOT verified"),
        f"{100.0 * outcome.gain:.1f} %",
        f"{1e3 * outcome.distance:.2f} mm",
        f"{outcome.seconds:.1f} s",
    )
    print(" | ".join(cells), flush=True)
    return outcome


def summarise(name: str, outcomes: list[Outcome]) -> tuple[str, ...]:
    """Return a row of the table."""
    gains = [outcome.gain for outcome in outcomes]
    return (
        name,
        str(len(outcomes)),
        str(sum(outcome.is_verified for outcome in outcomes)),
        str(sum(gain < 0.0 for gain in gains)),
        f"{100.0 * np.mean(gains):.1f} %",
        f"{1e3 * min(outcome.distance for outcome in outcomes):.2f} mm",
        f"{np.median([outcome.seconds for outcome in outcomes]):.1f} s",
    )


def main() -> None:
    """Print a row for every move, and a table of the robots."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--robot", choices=ROBOTS)
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--count", type=int, default=10, help="moves of each robot")
    parser.add_argument("--effort", default="fast")
    parser.add_argument("--save", action="store_true")
    given = parser.parse_args()
    warnings.simplefilter("ignore", BrachisWarning)
    rows = []
    every: list[Outcome] = []
    print("move | OMPL, timed | plan | gain | least distance | processor time")
    for robot in [given.robot] if given.robot else ROBOTS:
        outcomes: list[Outcome] = []
        number = 0
        while len(outcomes) < given.count:
            move = draw_move(robot, given.seed, number)
            number += 1
            if move is not None:
                outcomes.append(plan_move(move, given.effort))
        rows.append(summarise(robot, outcomes))
        every += outcomes
    rows.append(summarise("all", every))
    columns = [
        "robot",
        "moves",
        "verified",
        "slower",
        "mean gain",
        "least distance",
        "processor time, median",
    ]
    for row in (columns, *rows):
        print(" | ".join(row))
    _, count, verified, slower, gain, _, _ = rows[-1]
    about = (
        f"{verified} of {count} moves round one to five bodies are verified; {slower} are slower than the fastest of "
        f"eight joint paths by OMPL, and the mean gain is {gain}."
    )
    save("Moves", columns, rows, about)


if __name__ == "__main__":
    main()
