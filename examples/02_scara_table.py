"""The paper's eight lines, planned with each of the three redundant joints, as a table and a figure.

Usage: python examples/02_scara_table.py [FIGURE.png]
"""

from __future__ import annotations

import math
import sys
import time
from pathlib import Path

import brachis

HERE = Path(__file__).parent
ANGLES_DEG = tuple(range(0, 360, 45))
JOINTS = ("j1", "j2", "j3")
PUBLISHED_S = {(90, "j3"): 2.51}
"""End times that the paper prints."""


def robot_and_task(
    angle_deg: int, joint: str, intervals: int = 20
) -> tuple[brachis.Robot, dict[str, object]]:
    """Return the paper's arm and one of its lines; `joint` is the redundant joint, or auto."""
    limits = brachis.LimitSpec(torque=10.0, velocity=None)
    robot = brachis.Robot.from_urdf(
        HERE.parent / "robots/scara3/robot.urdf", gravity=[0, 0, 0], limits=limits
    )
    task = {
        "brachis": 1,
        "start": {"joints": [math.pi / 6, -2 * math.pi / 3, 2 * math.pi / 3]},
        "task_space": ["x", "y"],
        "path": [{"line": {"length": 1.0, "angle_deg": angle_deg}}],
        "redundant_joints": "auto" if joint == "auto" else [joint],
        "spline": {"degree": 3, "intervals": intervals, "rest": "full"},
    }
    return robot, task


def plan_all(intervals: int = 20) -> dict[tuple[int, str], brachis.Result]:
    """Plan the 24 motions; keys are the angle in degrees and the redundant joint."""
    cases = [(angle, joint) for angle in ANGLES_DEG for joint in JOINTS]
    return {case: brachis.plan(*robot_and_task(*case, intervals)) for case in cases}


def markdown_table(results: dict[tuple[int, str], brachis.Result]) -> str:
    """Return a table of end times in seconds, with a line for each angle; unverified plans are marked."""
    lines = [
        "| angle | q_r = j1 | q_r = j2 | q_r = j3 | the paper |",
        "|---|---|---|---|---|",
    ]
    for angle in ANGLES_DEG:
        cells = [
            f"{results[angle, joint].t_end:.3f} s"
            + ("" if results[angle, joint].verified else " (unverified)")
            for joint in JOINTS
        ]
        published = "; ".join(
            f"{PUBLISHED_S[key]:.2f} s (q_r = {key[1]})"
            for key in PUBLISHED_S
            if key[0] == angle
        )
        lines.append(f"| {angle} deg | {' | '.join(cells)} | {published} |")
    return "\n".join(lines)


def main() -> None:
    """Print the table, and draw the figure if a file is named."""
    began = time.perf_counter()
    results = plan_all()
    print(markdown_table(results))
    verified = sum(result.verified for result in results.values())
    print(
        f"\n{verified} of {len(results)} plans verified, {time.perf_counter() - began:.1f} s in all"
    )
    if len(sys.argv) > 1:
        from brachis.apps.plots import plot_comparison, save_figure

        rows = [
            (float(angle), joint, result.t_end)
            for (angle, joint), result in results.items()
        ]
        save_figure(
            plot_comparison(rows, "direction of the path", "\N{DEGREE SIGN}"),
            sys.argv[1],
        )
        print(f"wrote {sys.argv[1]}")
    if verified < len(results):
        sys.exit(1)


if __name__ == "__main__":
    main()
