"""Where the paper's one published end time lies: 90 degrees, redundant joint j3, by number of intervals: [--save]."""

from __future__ import annotations

import math
import sys
from pathlib import Path

from brachis import LimitSpec, Robot, plan

ROOT = Path(__file__).parents[1]
PUBLISHED_S = 2.51


def end_time(intervals: int) -> float:
    """Verified end time, s."""
    limits = LimitSpec(torque=10.0, velocity=None)
    robot = Robot.from_urdf(
        ROOT / "robots/scara3/robot.urdf", gravity=[0, 0, 0], limits=limits
    )
    result = plan(
        robot,
        {
            "brachis": 1,
            "start": {"joints": [math.pi / 6, -2 * math.pi / 3, 2 * math.pi / 3]},
            "task_space": ["x", "y"],
            "path": [{"line": {"length": 1.0, "angle_deg": 90}}],
            "redundant_joints": ["j3"],
            "spline": {"intervals": intervals},
        },
    )
    return result.t_end if result.verified else math.nan


def main() -> None:
    """Print one line for every number of intervals."""
    sys.path.append(str(ROOT / "benchmarks"))
    from committed import save

    rows = [
        (str(intervals), f"{end_time(intervals):.3f} s")
        for intervals in (10, 15, 16, 17, 18, 20, 50)
    ]
    for intervals, t_end in rows:
        print(f"N = {intervals}: {t_end} (the paper: {PUBLISHED_S} s)")
    about = f"Line at 90 degrees, redundant joint j3, degree 3, torque limits 10 Nm; the paper prints {PUBLISHED_S} s."
    save(
        "The paper's published end time, by number of intervals",
        ("knot intervals", "end time"),
        rows,
        about,
    )


if __name__ == "__main__":
    main()
