"""Seeded seams as CAM gives them, on the TX90L and its rail: read, fitted, planned and verified.

Usage: python studies/cam_seams.py [FIRST_SEED] [COUNT] [CORNER] [--save]

A seam has 1,000 to 50,000 points in mm along 0.6 to 1.4 m, which scatter by 0.005 to 0.05 mm, one to three corners of
20 to 60 degrees, and orientations that turn by up to 20 degrees. The tolerance of positions is six times the scatter,
0.05 mm at least; corners may be rounded within CORNER mm (1 unless given). Counted are seconds of processor time, the
knot intervals of the fit, and the largest distance of a point from the path that was planned, blends included, beside
corners and near them: that path is drawn as a polygon, and the nearest of its sides is looked for.
"""

from __future__ import annotations

import sys
import tempfile
from pathlib import Path

import numpy as np
from scipy.spatial import cKDTree
from scipy.spatial.transform import Rotation

import brachis
from brachis.path import path_of
from brachis.robot import bind

ROOT = Path(__file__).parents[1]
sys.path.append(str(ROOT / "benchmarks"))

from committed import processor_time, save  # noqa: E402

ROBOT = ROOT / "robots/tx90l_rail/robot.urdf"
MIDDLE = np.array([800.0, 0.0, 600.0])  # mm
DOWN = Rotation.from_euler("xyz", [np.pi, 0.0, 0.0])
DRAWN = 400_000
ALLOWED_S = 30.0
ALLOWED_LOAD_S = 5.0
COLUMNS = (
    "seed",
    "points",
    "scatter",
    "allowed",
    "farthest",
    "at corners",
    "intervals",
    "corners",
)
COLUMNS += "read and fitted", "in all", "end time", "verified"


def seam(seed: int) -> tuple[np.ndarray, np.ndarray, float]:
    """Positions, mm, rotation vectors, deg, and scatter, mm."""
    rng = np.random.default_rng(seed)
    count, scatter = (
        int(np.exp(rng.uniform(np.log(1e3), np.log(5e4)))),
        rng.uniform(0.005, 0.05),
    )
    corners, length = rng.integers(1, 4), rng.uniform(600.0, 1400.0)
    t = np.linspace(0.0, 1.0, count)
    at = (np.arange(corners) + rng.uniform(0.7, 1.3, corners)) / (corners + 1.0)
    turns = np.deg2rad(rng.uniform(20.0, 60.0, corners)) * (-1.0) ** np.arange(corners)
    heading = np.sum(np.where(t[:, None] > at, turns, 0.0), axis=1)
    heading += 0.4 * np.sin(
        2.0 * np.pi * rng.uniform(0.5, 1.5) * t + rng.uniform(0.0, 6.0)
    )
    heading -= heading.mean()
    step = length / count * np.column_stack([np.sin(heading), np.cos(heading), 0.0 * t])
    position = np.cumsum(step, axis=0)
    position += MIDDLE - (position.max(axis=0) + position.min(axis=0)) / 2.0
    position[:, 2] += 40.0 * np.sin(2.0 * np.pi * (t + rng.uniform()))
    tilt = np.deg2rad(rng.uniform(5.0, 20.0)) * np.column_stack(
        [np.sin(np.pi * t), np.cos(np.pi * t), 0.0 * t]
    )
    rotations = (Rotation.from_rotvec(tilt) * DOWN).as_rotvec(degrees=True)
    return position + rng.normal(size=position.shape) * scatter, rotations, scatter


def write(path: Path, position: np.ndarray, rotations: np.ndarray) -> None:
    header = "x_mm,y_mm,z_mm,rx_deg,ry_deg,rz_deg"
    np.savetxt(
        path,
        np.hstack([position, rotations]),
        fmt="%.6f",
        delimiter=",",
        header=header,
        comments="",
    )


def farthest(task: brachis.Task, position: np.ndarray) -> tuple[float, float]:
    """Largest distance of a point, mm, from the path that was planned: beside blends, and at them."""
    _, task_map = bind(brachis.Robot.from_urdf(ROBOT), task.task_space)
    path, s = path_of(task_map, task), np.linspace(0.0, 1.0, DRAWN)
    drawn = 1e3 * path.sample(s).target[:, :3]
    _, nearest = cKDTree(drawn).query(position)
    best = np.full(len(position), np.inf)
    for offset in (-1, 0):
        first = np.clip(nearest + offset, 0, DRAWN - 2)
        side = drawn[first + 1] - drawn[first]
        share = np.clip(
            np.sum((position - drawn[first]) * side, axis=1) / np.sum(side**2, axis=1),
            0.0,
            1.0,
        )
        best = np.minimum(
            best,
            np.linalg.norm(position - drawn[first] - share[:, None] * side, axis=1),
        )
    blended = np.searchsorted(path.breaks, s[nearest], side="right") % 2 == 0
    return float(best[~blended].max()), float(best[blended].max(initial=0.0))


def run(seed: int, folder: Path, corner: float) -> tuple[bool, tuple[str, ...]]:
    """Plan along one seam and print its line; tell whether all is as it should be."""
    position, rotations, scatter = seam(seed)
    write(folder / "seam.csv", position, rotations)
    allowed = max(0.05, 6.0 * scatter)
    tolerance = {
        "position": f"{allowed:.6f} mm",
        "corner": f"{max(corner, allowed):.6f} mm",
    }
    content = {
        "brachis": 1,
        "robot": {"urdf": str(ROBOT)},
        "start": "free",
        "task_space": "pose",
        "path": [
            {
                "csv": {
                    "file": str(folder / "seam.csv"),
                    "orientation": "rotation_vector",
                    "tolerance": tolerance,
                }
            }
        ],
        "spline": {"intervals": 20},
        "search": {"time_limit": 300.0},
    }
    start = processor_time()
    cells = [f"{seed}", f"{len(position)}", f"{scatter:.4f} mm", f"{allowed:.4f} mm"]
    try:
        task = brachis.load_task(content)
        loaded = processor_time() - start
        result = brachis.plan(task)
    except brachis.BrachisError as error:
        print(*cells, error, sep=" | ", flush=True)
        return False, (*cells, *["-"] * (len(COLUMNS) - 5), "no motion")
    seconds, fit = processor_time() - start, task.fits[0]
    off, at_corners = farthest(task, position)
    good = (
        result.verified
        and off <= allowed
        and at_corners <= max(corner, allowed)
        and seconds < ALLOWED_S
    )
    cells += [
        f"{off:.4f} mm",
        f"{at_corners:.4f} mm",
        f"{fit.intervals}",
        f"{len(fit.corners)}",
        f"{loaded:.2f} s",
    ]
    cells += [
        f"{seconds:.1f} s",
        f"{result.t_end:.4f} s",
        "yes" if result.verified else "NO",
    ]
    print(*cells, sep=" | ", flush=True)
    return good, tuple(cells)


def many(folder: Path, count: int = 100_000) -> bool:
    """Read, fit and check 100,000 poses, and print how long that takes."""
    t = np.linspace(0.0, 1.0, count)
    position = np.column_stack(
        [800.0 + 50.0 * np.sin(9.0 * t), 1000.0 * t, 600.0 + 30.0 * np.cos(5.0 * t)]
    )
    position[:, 0] += 300.0 * np.abs(t - 0.5)
    rotations = (
        Rotation.from_rotvec(0.3 * np.column_stack([t, t**2, 0.0 * t])) * DOWN
    ).as_rotvec(degrees=True)
    write(
        folder / "many.csv",
        position + np.random.default_rng(0).normal(size=position.shape) * 0.02,
        rotations,
    )
    file = {"file": str(folder / "many.csv"), "orientation": "rotation_vector"}
    segment = {"csv": {**file, "tolerance": {"position": "0.15 mm"}}}
    start = processor_time()
    task = brachis.load_task(
        {"brachis": 1, "start": "free", "task_space": "pose", "path": [segment]}
    )
    seconds = processor_time() - start
    print(
        f"read, fitted and checked in {seconds:.1f} s of processor time: {task.fits[0]}",
        flush=True,
    )
    return seconds < ALLOWED_LOAD_S


def main(first: int = 1, count: int = 10, corner: float = 1.0) -> int:
    with tempfile.TemporaryDirectory() as folder:
        quick = many(Path(folder))
        print(*COLUMNS, sep=" | ")
        found = [
            run(seed, Path(folder), corner) for seed in range(first, first + count)
        ]
    good = sum(each for each, _ in found)
    told = f"{good} of {count} verified, within the tolerance everywhere, in less than {ALLOWED_S:g} s"
    print(told)
    about = "Seams of 1,000 to 50,000 points that scatter, with corners; distances of points from the path planned. "
    save(
        "Seams as CAM gives them",
        COLUMNS,
        [row for _, row in found],
        f"{about}{told} of processor time.",
    )
    return 0 if good == count and quick else 1


if __name__ == "__main__":
    given = [argument for argument in sys.argv[1:] if argument != "--save"]
    raise SystemExit(main(*map(int, given[:2]), *map(float, given[2:])))
