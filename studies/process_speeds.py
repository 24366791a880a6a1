"""A constant process speed on the gantry against the analytic optimum.

Usage: python studies/process_speeds.py [--intervals auto] [--speeds 1.0 0.3 0.1]

The gantry's tool goes 1.2 m along x from rest to rest, by at most 200 N on 25 kg; between a quarter and three quarters
of the way it has a given speed. At the optimum full force accelerates and brakes on the way to that part and from it.
"""

from __future__ import annotations

import argparse
import sys
from pathlib import Path

import brachis

ROOT = Path(__file__).resolve().parents[1]
sys.path.append(str(ROOT / "benchmarks"))

from committed import processor_time  # noqa: E402

LENGTH, BEGIN, END, ACCELERATION = 1.2, 0.25, 0.75, 200.0 / 25.0


def leg(way: float, speed: float) -> float:
    """Least time, s, between rest and a speed over a way."""
    top = (ACCELERATION * way + 0.5 * speed**2) ** 0.5
    return (2.0 * top - speed) / ACCELERATION


def task(speed: float, intervals: str) -> dict[str, object]:
    """Task of a process speed, m/s."""
    mesh = (
        {"intervals": "auto", "tolerance": 5e-4}
        if intervals == "auto"
        else {"intervals": int(intervals)}
    )
    return {
        "brachis": 1,
        "robot": {
            "urdf": str(ROOT / "robots/gantry2/robot.urdf"),
            "limits": {"velocity": None},
        },
        "start": {"joints": [-0.6, 0.0]},
        "task_space": ["x", "y"],
        "path": [{"line": {"by": [LENGTH, 0.0]}}],
        "tool_limits": {
            "process_speed": [{"speed": speed, "s": [BEGIN, END]}],
        },
        "spline": {"rest": "velocity", **mesh},
        "search": {"effort": "single", "least_motion": False},
    }


def main() -> None:
    """Plan, and print how far the end times are above the optimum."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--intervals", default="auto")
    parser.add_argument("--speeds", type=float, nargs="+", default=[1.0, 0.3, 0.1])
    arguments = parser.parse_args()
    for speed in arguments.speeds:
        began = processor_time()
        result = brachis.plan(task(speed, arguments.intervals))
        fastest = (
            leg(BEGIN * LENGTH, speed)
            + (END - BEGIN) * LENGTH / speed
            + leg((1.0 - END) * LENGTH, speed)
        )
        above = 100.0 * (result.t_end / fastest - 1.0)
        busy = processor_time() - began
        print(
            f"{speed:g} m/s: {result.t_end:.5f} s, {above:.3f} % above {fastest:.5f} s, {busy:.1f} s processor time"
        )


if __name__ == "__main__":
    main()
