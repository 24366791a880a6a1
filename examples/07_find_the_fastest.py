"""The paper's eight lines, planned with each redundant joint, with the default search, and with a free start posture.

Usage: python examples/07_find_the_fastest.py [FIGURE.png]
"""

from __future__ import annotations

import sys
import time
from pathlib import Path

import brachis

TASK = Path(__file__).with_suffix(".yaml")
ANGLES_DEG = tuple(range(0, 360, 45))
JOINTS = ("j1", "j2", "j3")
USUAL = {"effort": "single", "guesses": "numeric"}
"""One initial guess, by numeric inverse kinematics from the start posture, as in the paper."""


def variants(angle_deg: int) -> dict[str, dict[str, object]]:
    """Return all tasks of one line, by name."""
    task = brachis.load_task(TASK).to_dict()
    task["path"][0]["line"]["angle_deg"] = angle_deg
    usual = {
        joint: {**task, "redundant_joints": [joint], "search": USUAL}
        for joint in JOINTS
    }
    free = {**task, "start": "free", "path_start": [3.0**0.5, 0.0]}
    return {**usual, "auto": task, "free start": free}


def plan_all() -> dict[tuple[int, str], brachis.Result]:
    """Plan all variants of all lines; keys are the angle in degrees and the name of the variant."""
    return {
        (angle, name): brachis.plan(task)
        for angle in ANGLES_DEG
        for name, task in variants(angle).items()
    }


def markdown_table(results: dict[tuple[int, str], brachis.Result]) -> str:
    """Return a table of end times in seconds, with a line for each angle."""
    lines = [
        "| angle | q_r = j1, one guess | j2, one guess | j3, one guess | auto | start free as well |",
        "|---|---|---|---|---|---|",
    ]
    for angle in ANGLES_DEG:
        cells = []
        for name in (*JOINTS, "auto", "free start"):
            result = results[angle, name]
            note = (
                ""
                if name in JOINTS
                else f" ({', '.join(result.trajectory.redundant_joints) or 'chart'})"
            )
            cells.append(
                f"{result.t_end:.3f} s{note}"
                + ("" if result.verified else " (unverified)")
            )
        lines.append(f"| {angle} deg | {' | '.join(cells)} |")
    return "\n".join(lines)


def main() -> None:
    """Print the table, and draw the candidates of the line at 180 degrees if a file is named."""
    began = time.perf_counter()
    results = plan_all()
    print(markdown_table(results))
    verified = sum(result.verified for result in results.values())
    longest = max(results[angle, "auto"].timing["total"] for angle in ANGLES_DEG)
    print(
        f"\n{verified} of {len(results)} plans verified, {time.perf_counter() - began:.1f} s in all"
    )
    print(f"longest auto plan: {longest:.2f} s")
    if len(sys.argv) > 1:
        from brachis.apps.plots import plot_candidates, save_figure

        save_figure(plot_candidates(results[180, "auto"].candidates), sys.argv[1])
        print(f"wrote {sys.argv[1]}")
    if verified < len(results):
        sys.exit(1)


if __name__ == "__main__":
    main()
