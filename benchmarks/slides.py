"""Slides whose least time has a formula, over five decades of the drive's force.

Usage: python benchmarks/slides.py [--save]

A slide of MASS moves DISTANCE from rest to rest by a force of no more than F, at no more than V. With constant
acceleration F / MASS, constant speed and the same ramp down, the least time is

    T = DISTANCE / V + V MASS / F          where the speed is reached: F DISTANCE >= MASS V^2,
    T = 2 sqrt(DISTANCE MASS / F)          elsewhere.

Each row goes through the forces with one velocity limit, degree of the splines and kind of `rest`. All else is left at
its default. Motions are to be within ALLOWED of the least time, and shorter with each larger force.
"""

from __future__ import annotations

import argparse
import itertools
import tempfile
import warnings
from pathlib import Path

import numpy as np

import brachis
from brachis.errors import BrachisWarning
from committed import save

MASS = 2.0  # kg
DISTANCE = 1.0  # m
FORCES = np.geomspace(0.5, 50_000.0, 11)  # N
SPEEDS = (0.1, 0.5, 5.0)  # m/s
DEGREES = (3, 4, 5)
RESTS = ("full", "velocity")
ALLOWED = 1e-3
URDF = f"""\
<robot name="slide"><link name="base"/>
<link name="cart"><inertial><mass value="{MASS}"/>
<inertia ixx="0.1" iyy="0.1" izz="0.1" ixy="0" ixz="0" iyz="0"/></inertial></link>
<joint name="x" type="prismatic"><parent link="base"/><child link="cart"/>
<axis xyz="1 0 0"/><limit lower="-5" upper="5" effort="50" velocity="0.5"/></joint></robot>
"""
COLUMNS = (
    "velocity limit",
    "degree",
    "rest",
    "verified",
    "largest excess, and the force",
    "not shorter than at the force before",
    "but longer by",
)


def least_time(force: float, speed: float) -> float:
    """Return the least time from rest to rest, s."""
    if force * DISTANCE < MASS * speed**2:
        return 2.0 * np.sqrt(DISTANCE * MASS / force)
    return DISTANCE / speed + speed * MASS / force


def plan(urdf: Path, force: float, speed: float, degree: int, rest: str) -> float:
    """Return the end time of a plan, s; infinite if it is not verified."""
    result = brachis.plan(
        urdf,
        gravity=[0.0, 0.0, 0.0],
        limits={"torque": force, "velocity": speed},
        start=[0.0],
        task_space=["x"],
        path=[{"line": {"by": [DISTANCE]}}],
        degree=degree,
        rest=rest,
        strict=False,
    )
    return result.t_end if result.verified else np.inf


def main() -> None:
    """Plan, and print a row for each velocity limit, degree and kind of rest."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--save", action="store_true")
    parser.parse_args()
    warnings.simplefilter("ignore", BrachisWarning)
    print(" | ".join(COLUMNS))
    rows = []
    excesses: list[float] = []
    rises: list[float] = []
    with tempfile.TemporaryDirectory() as folder:
        urdf = Path(folder) / "slide.urdf"
        urdf.write_text(URDF, encoding="utf-8")
        for speed, degree, rest in itertools.product(SPEEDS, DEGREES, RESTS):
            times = np.array([plan(urdf, F, speed, degree, rest) for F in FORCES])
            least = np.array([least_time(force, speed) for force in FORCES])
            excess = times / least - 1.0
            rise = times[1:] / times[:-1] - 1.0
            longer = rise >= 0.0
            cells = (
                f"{speed:g} m/s",
                f"{degree}",
                rest,
                f"{np.isfinite(times).sum()} of {len(FORCES)}",
                f"{100.0 * excess.max():+.4f} %, {FORCES[excess.argmax()]:.4g} N",
                ", ".join(f"{force:.4g} N" for force in FORCES[1:][longer]) or "",
                f"{100.0 * rise.max():+.5f} %" if longer.any() else "",
            )
            print(" | ".join(cells), flush=True)
            rows.append(cells)
            excesses.extend(excess)
            rises.extend(rise)
    above = sum(excess > ALLOWED for excess in excesses)
    longer = sum(rise >= 0.0 for rise in rises)
    about = (
        f"{len(excesses)} motions of a {MASS:g} kg slide over {DISTANCE:g} m. {len(excesses) - above} end within "
        f"{100.0 * ALLOWED:g} % of the least time, the worst {100.0 * max(excesses):.3f} % above it. In {longer} of "
        f"{len(rises)} steps to a larger force, the motion is not shorter, but up to {100.0 * max(rises):.4f} % longer."
    )
    print(about)
    save("Slides with a known least time", COLUMNS, rows, about)


if __name__ == "__main__":
    main()
