"""A table of end times of the TX90L on its rail, for redundant joints with closed forms and 10 to 40 intervals."""

from __future__ import annotations

import time
from pathlib import Path

import brachis

HERE = Path(__file__).parent
TASK = HERE / "03_tx90l_rail_line.yaml"
JOINTS = ("rail", "joint_1", "joint_2", "joint_3")
INTERVALS = (10, 20, 40)


def plan_all() -> dict[tuple[str, int], brachis.Result]:
    """Plan all motions; keys are the redundant joint and the number of intervals."""
    results = {}
    for joint in JOINTS:
        for intervals in INTERVALS:
            task = brachis.load_task(TASK).to_dict()
            task["redundant_joints"] = [joint]
            task["spline"]["intervals"] = intervals
            results[joint, intervals] = brachis.plan(task)
    return results


def markdown_table(results: dict[tuple[str, int], brachis.Result]) -> str:
    """Return a table of end times in seconds, with a line for each redundant joint; unverified plans are marked."""
    lines = [
        f"| redundant joint | {' | '.join(f'{intervals} intervals' for intervals in INTERVALS)} |",
        "|---|" + "---|" * len(INTERVALS),
    ]
    for joint in JOINTS:
        row = [results[joint, intervals] for intervals in INTERVALS]
        cells = [
            f"{result.t_end:.4f} s" + ("" if result.verified else " (unverified)")
            for result in row
        ]
        lines.append(f"| {joint} | {' | '.join(cells)} |")
    return "\n".join(lines)


def main() -> dict[tuple[str, int], brachis.Result]:
    """Print the table."""
    began = time.perf_counter()
    results = plan_all()
    print(markdown_table(results))
    print(f"{len(results)} plans in {time.perf_counter() - began:.1f} s")
    return results


if __name__ == "__main__":
    main()
