"""Seeded seams as CAM gives them, on the TX90L and its rail: read, fitted, planned and verified.

Usage: python benchmarks/cam_seams.py [FIRST_SEED] [COUNT]

A seam has 1,000 to 50,000 points in mm along 0.6 to 1.4 m, which scatter by 0.005 to 0.05 mm, one to three corners of 20
to 60 degrees, and orientations that turn by up to 20 degrees. Position and corners have one tolerance, six times the
scatter, 0.05 mm at least. Counted are seconds, the knot intervals of the fit, and the largest distance of a point from
the path that was planned, blends included: by drawing that path as a polygon, and looking for each point's nearest side.
"""

from __future__ import annotations

import sys
import tempfile
import time
from pathlib import Path

import numpy as np
from scipy.spatial import cKDTree
from scipy.spatial.transform import Rotation

import brachis
from brachis.path import path_of
from brachis.robot import bind

ROOT = Path(__file__).parents[1]
ROBOT = ROOT / "robots/tx90l_rail/robot.urdf"
MIDDLE = np.array([800.0, 0.0, 600.0])  # mm
DOWN = Rotation.from_euler("xyz", [np.pi, 0.0, 0.0])
DRAWN = 400_000
ALLOWED_S = 30.0


def seam(seed: int) -> tuple[np.ndarray, np.ndarray, float]:
    """Positions, mm, rotation vectors, deg, and scatter, mm."""
    rng = np.random.default_rng(seed)
    count, scatter = int(np.exp(rng.uniform(np.log(1e3), np.log(5e4)))), rng.uniform(0.005, 0.05)
    corners, length = rng.integers(1, 4), rng.uniform(600.0, 1400.0)
    t = np.linspace(0.0, 1.0, count)
    at = (np.arange(corners) + rng.uniform(0.7, 1.3, corners)) / (corners + 1.0)
    turns = np.deg2rad(rng.uniform(20.0, 60.0, corners)) * (-1.0) ** np.arange(corners)
    heading = np.sum(np.where(t[:, None] > at, turns, 0.0), axis=1)
    heading += 0.4 * np.sin(2.0 * np.pi * rng.uniform(0.5, 1.5) * t + rng.uniform(0.0, 6.0))
    heading -= heading.mean()
    step = length / count * np.column_stack([np.sin(heading), np.cos(heading), 0.0 * t])
    position = np.cumsum(step, axis=0)
    position += MIDDLE - (position.max(axis=0) + position.min(axis=0)) / 2.0
    position[:, 2] += 40.0 * np.sin(2.0 * np.pi * (t + rng.uniform()))
    tilt = np.deg2rad(rng.uniform(5.0, 20.0)) * np.column_stack([np.sin(np.pi * t), np.cos(np.pi * t), 0.0 * t])
    rotations = (Rotation.from_rotvec(tilt) * DOWN).as_rotvec(degrees=True)
    return position + rng.normal(size=position.shape) * scatter, rotations, scatter


def write(path: Path, position: np.ndarray, rotations: np.ndarray) -> None:
    header = "x_mm,y_mm,z_mm,rx_deg,ry_deg,rz_deg"
    np.savetxt(path, np.hstack([position, rotations]), fmt="%.6f", delimiter=",", header=header, comments="")


def farthest(task: brachis.Task, position: np.ndarray) -> float:
    """Largest distance of a point, mm, from the path that was planned, mm."""
    robot, task_map = bind(brachis.Robot.from_urdf(ROBOT), task.task_space)
    del robot
    drawn = 1e3 * path_of(task_map, task).sample(np.linspace(0.0, 1.0, DRAWN)).target[:, :3]
    _, nearest = cKDTree(drawn).query(position)
    best = np.full(len(position), np.inf)
    for offset in (-1, 0):
        first = np.clip(nearest + offset, 0, DRAWN - 2)
        side = drawn[first + 1] - drawn[first]
        share = np.clip(np.sum((position - drawn[first]) * side, axis=1) / np.sum(side**2, axis=1), 0.0, 1.0)
        best = np.minimum(best, np.linalg.norm(position - drawn[first] - share[:, None] * side, axis=1))
    return float(best.max())


def run(seed: int, folder: Path) -> bool:
    """Plan along one seam and print its line; tell whether all is as it should be."""
    position, rotations, scatter = seam(seed)
    write(folder / "seam.csv", position, rotations)
    allowed = max(0.05, 6.0 * scatter)
    content = {
        "brachis": 1,
        "robot": {"urdf": str(ROBOT)},
        "start": "free",
        "task_space": "pose",
        "path": [{"csv": {"file": str(folder / "seam.csv"), "tolerance": {"position": f"{allowed:.6f} mm"}}}],
        "spline": {"intervals": "auto"},
    }
    start, wall = time.process_time(), time.perf_counter()
    line = f"{seed:5d} {len(position):7d} {scatter:8.4f} {allowed:8.4f} "
    try:
        task = brachis.load_task(content)
        loaded = time.process_time() - start
        result = brachis.plan(None, task)
    except brachis.BrachisError as error:
        print(line, error, flush=True)
        return False
    seconds, wall, fit = time.process_time() - start, time.perf_counter() - wall, task.fits[0]
    off = farthest(task, position)
    good = result.verified and off <= allowed and seconds < ALLOWED_S
    figures = f"{off:8.4f} {fit.intervals:9d} {len(fit.corners):7d} {loaded:8.2f} {seconds:8.1f} {wall:8.1f}"
    print(f"{line}{figures} {result.t_end:9.4f} {'yes' if result.verified else 'NO'}", flush=True)
    return good


def main(first: int = 1, count: int = 10) -> int:
    print(" seed  points  scatter  allowed farthest intervals corners   load_s    cpu_s   wall_s     t_end verified")
    with tempfile.TemporaryDirectory() as folder:
        good = [run(seed, Path(folder)) for seed in range(first, first + count)]
    print(f"{sum(good)} of {count} verified, within the tolerance everywhere, in less than {ALLOWED_S:g} s; lengths in mm")
    return 0 if all(good) else 1


if __name__ == "__main__":
    raise SystemExit(main(*map(int, sys.argv[1:3])))
