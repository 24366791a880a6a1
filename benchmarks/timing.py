"""How exact the phase plane is, and how near plans come to it: analytic cases, toppra, random walks, seams.

Usage: python benchmarks/timing.py [accuracy walks seams] [--save]

- accuracy: the least time of a joint path by `brachis.timing` against formulas, and against toppra on a grid of 10,000
  places along seeded paths of the iiwa 14, with limits on velocity and acceleration, and on torque.
- walks: random walks of the Panda (of the iiwa 14 where it is not installed) through ever more waypoints, planned and
  verified.
- seams: the seeded seams of studies/cam_seams.py, corners rounded within 5, 1, 0.3 and 0.1 mm.
"""

from __future__ import annotations

import argparse
import importlib.util
import itertools
import tempfile
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any

import numpy as np

import brachis
from brachis.limits import limits_of
from brachis.path import path_of
from brachis.problem.problem import Problem
from brachis.robot import dynamics
from brachis.timing import JointPath, PhasePlane
from committed import processor_time, save

ROOT = Path(__file__).parents[1]
PLACES = 10_000
LENGTH = 0.5  # m
WALKS = (5, 20, 100, 500, 2000)
WITHOUT_TORQUE = {"torque": None, "acceleration": 8.0}
"""Limits of walks: the URDF's velocities, and an acceleration, rad/s^2."""
SEAMS = range(10)
CORNERS = (5.0, 1.0, 0.3, 0.1)  # mm
COLUMNS = ("case", "found", "compared with", "difference", "processor time")
Row = tuple[str, ...]


def load(path: Path) -> Any:
    """Import a script by its file."""
    spec = importlib.util.spec_from_file_location(path.stem, path)
    assert spec is not None and spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


def least_time(robot: brachis.Robot, path: JointPath) -> tuple[float, float]:
    """Least time of a joint path under the robot's limits, s, and the processor time that it took, s."""
    task = brachis.load_task(brachis.examples.scara_line)
    bare = task.model_copy(update={"tool_limits": type(task.tool_limits)()})
    began = processor_time()
    timing = PhasePlane(limits_of(robot, bare), path).solve()
    assert timing is not None
    return timing.t_end, processor_time() - began


def slide(**settings: Any) -> brachis.Robot:
    """The gantry without gravity; only what is given is limited."""
    limits = {"torque": None, "velocity": None, "acceleration": None}
    limits |= settings.pop("limits")
    return brachis.Robot.from_urdf(
        ROOT / "robots/gantry2/robot.urdf",
        gravity=[0, 0, 0],
        limits=limits,
        **settings,
    )


def analytic() -> Iterator[tuple[str, brachis.Robot, float]]:
    """Cases with known least times, s: name, robot, time for LENGTH along the first joint from rest to rest."""
    yield (
        "acceleration 3 m/s^2",
        slide(limits={"acceleration": 3.0}),
        2.0 * np.sqrt(LENGTH / 3.0),
    )
    yield (
        "acceleration 3 m/s^2, velocity 0.5 m/s",
        slide(limits={"acceleration": 3.0, "velocity": 0.5}),
        LENGTH / 0.5 + 0.5 / 3.0,
    )
    robot = slide(limits={"torque": 20.0})
    still = np.zeros((1, 2))
    mass = float(dynamics.torque(robot, still, still, np.array([[1.0, 0.0]]))[0, 0])
    yield "force 20 N", robot, 2.0 * np.sqrt(LENGTH * mass / 20.0)
    rubbing = 5.0
    # The slide accelerates with 20 - 5 N and brakes with 20 + 5 N.
    ways = np.array([mass / (20.0 - rubbing), mass / (20.0 + rubbing)])
    speed = np.sqrt(2.0 * LENGTH / ways.sum())
    yield (
        "force 20 N, Coulomb friction 5 N",
        slide(
            limits={"torque": 20.0},
            friction={"coulomb": rubbing},
        ),
        float(speed * ways.sum()),
    )


def accuracy() -> list[Row]:
    """Compare the phase plane with formulas and with toppra."""
    rows = []
    p = np.linspace(0.0, 1.0, PLACES + 1)
    for name, robot, known in analytic():
        q = np.outer(p, [LENGTH, 0.0])
        found, seconds = least_time(robot, JointPath.through(p, q))
        rows.append(_row(name, found, known, "formula", seconds))
    try:
        example = load(ROOT / "examples/11_from_toppra.py")
        paths = load(ROOT / "benchmarks/joint_paths.py")
        example.by_toppra(*example_points(paths, 0)[:3], intervals=100)
    except ImportError:
        print("toppra is not installed: pip install toppra")
        return rows
    for seed in range(5):
        robot, s, q, path = example_points(paths, seed)
        sample = path.sample(s)
        own = JointPath(s, s, sample.target, sample.xi, sample.xi_ds)
        found, seconds = least_time(robot, own)
        known = example.by_toppra(robot, s, q, intervals=PLACES)
        rows.append(_row(f"iiwa 14, path {seed}", found, known, "toppra", seconds))
    return rows


def example_points(
    paths: Any, seed: int
) -> tuple[brachis.Robot, np.ndarray, np.ndarray, Any]:
    """Robot, path coordinates, (P,), postures there, (P, n), and path of a seeded case of joint_paths.py."""
    task = paths.case(seed, "auto")
    problem = Problem.of(
        brachis.Robot.from_urdf(paths.URDF, limits=task.robot.limits), task
    )
    s = np.linspace(0.0, 1.0, PLACES + 1)
    path = path_of(problem.task_map, task)
    return problem.robot, s, path.sample(s).target, path


def _row(name: str, found: float, known: float, what: str, seconds: float) -> Row:
    off = 100.0 * (found / known - 1.0)
    return (
        name,
        f"{found:.5f} s",
        f"{known:.5f} s ({what})",
        f"{off:+.4f} %",
        f"{seconds:.2f} s",
    )


def walk(count: int, limits: Mapping[str, Any]) -> dict[str, Any]:
    """Return a task of a random walk of a seven-joint arm through so many waypoints."""
    urdf = ROOT / "robots/iiwa14/robot.urdf"
    robot = brachis.Robot.from_urdf(urdf)
    low = np.maximum(robot.limits.position_lower, -2.5) * 0.8
    high = np.minimum(robot.limits.position_upper, 2.5) * 0.8
    rng = np.random.default_rng(count)
    q = [rng.uniform(low, high)]
    for _ in range(count - 1):
        q.append(np.clip(q[-1] + rng.normal(0.0, 0.35, robot.n), low, high))
    return {
        "brachis": 1,
        "robot": {"urdf": str(urdf), "limits": dict(limits)},
        "start": {"joints": q[0].tolist()},
        "task_space": "joints",
        "path": [{"spline": {"through": np.array(q[1:]).tolist()}}],
        "search": {"least_motion": False},
    }


def walks() -> list[Row]:
    """Plan random walks."""
    rows = []
    for count, with_torque in itertools.product(WALKS, (False, True)):
        task = walk(count, {} if with_torque else WITHOUT_TORQUE)
        began = processor_time()
        result = brachis.plan(task)
        seconds = processor_time() - began
        kind = "torque" if with_torque else "velocity, acceleration"
        rows.append(_planned(f"{count} waypoints, {kind}", result, seconds))
    return rows


def seam(seed: int, corner: float, folder: Path) -> tuple[str, dict[str, Any]]:
    """Return name and task of a seam whose corners are rounded within a tolerance, mm; its points go into a folder."""
    cam = load(ROOT / "studies/cam_seams.py")
    file = folder / f"seam-{seed}.csv"
    position, rotations, scatter = cam.seam(seed)
    cam.write(file, position, rotations)
    allowed = max(0.05, 6.0 * scatter)
    points = {
        "file": str(file),
        "orientation": "rotation_vector",
        "tolerance": {
            "position": f"{allowed:.6f} mm",
            "corner": f"{max(corner, allowed):.6f} mm",
        },
        "corner": "blend",
    }
    task = {
        "brachis": 1,
        "robot": {"urdf": str(ROOT / "robots/tx90l_rail/robot.urdf")},
        "path": [{"csv": points}],
        "start": "free",
        "task_space": "pose",
        "search": {"least_motion": False},
    }
    return f"seam {seed}, {len(position)} points, corners {corner:g} mm", task


def seams() -> list[Row]:
    """Plan seams with corners that are rounded within ever smaller tolerances."""
    rows = []
    with tempfile.TemporaryDirectory() as folder:
        for seed, corner in itertools.product(SEAMS, CORNERS):
            name, task = seam(seed, corner, Path(folder))
            began = processor_time()
            try:
                result = brachis.plan(task)
            except brachis.BrachisError as error:
                row = name, f"refused: {str(error)[:60]}", "", "", ""
            else:
                row = _planned(name, result, processor_time() - began)
            rows.append(row)
            print(" | ".join(row), flush=True)
    return rows


def _planned(name: str, result: brachis.Result, seconds: float) -> Row:
    gap = result.timing_gap
    known = "none" if gap is None else f"{gap.least_time:.4f} s (own joint path)"
    off = "" if gap is None else f"{100.0 * gap.gap:+.3f} %"
    verified = "" if result.verified else ", NOT verified"
    return name, f"{result.t_end:.4f} s{verified}", known, off, f"{seconds:.1f} s"


PARTS = {"accuracy": accuracy, "walks": walks, "seams": seams}


def main() -> None:
    """Print a line a case."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("parts", nargs="*", default=["accuracy", "walks"])
    parser.add_argument("--save", action="store_true", help="into benchmarks/results")
    given = parser.parse_args()
    rows: list[Row] = []
    print(" | ".join(COLUMNS))
    for part in given.parts:
        for row in PARTS[part]():
            print(" | ".join(row), flush=True)
            rows.append(row)
    about = (
        "Least times of joint paths by the phase plane, and plans beside the least times of their own joint paths. "
        f"The phase plane and toppra have {PLACES} places where they are compared."
    )
    save("Timings", COLUMNS, rows, about)


if __name__ == "__main__":
    main()
