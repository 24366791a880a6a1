"""How time and end time grow with the number of intervals, for uno and ipopt: ``python3 tasks.py bench``.

The planar 3R of the paper, 90 degrees, redundant joint j1, one solve without refinement.
"""

from __future__ import annotations

import math
import os
from pathlib import Path

from brachis import LimitSpec, Robot, load_task, transcribe
from brachis.optimise.backends import SolverOptions, solvers_for
from brachis.optimise.guess import starting_point
from brachis.search.differential_ik import differential_ik_paths
from committed import save

ROOT = Path(__file__).parents[1]
INTERVALS = (10, 20, 50, 100, 200)


def first_point(program):
    """Start from the first joint path of numeric inverse kinematics."""
    joint_path = next(differential_ik_paths(program.phases[0].joint_map))
    return starting_point(program, [joint_path], [None])


def main() -> None:
    """Print one line for every number of intervals and solver."""
    robot = Robot.from_urdf(
        ROOT / "robots/scara3/robot.urdf",
        gravity=[0, 0, 0],
        limits=LimitSpec(torque=10.0, velocity=None),
    )
    columns = (
        "N",
        "variables",
        "rows",
        "solver",
        "t_E",
        "iterations",
        "processor time",
        "status",
    )
    print(f"| {' | '.join(columns)} |")
    table = []
    for intervals in INTERVALS:
        task = load_task(
            {
                "brachis": 1,
                "start": {"joints": [math.pi / 6, -2 * math.pi / 3, 2 * math.pi / 3]},
                "task_space": ["x", "y"],
                "path": [{"line": {"length": 1.0, "angle_deg": 90}}],
                "redundant_joints": ["j1"],
                "spline": {"intervals": intervals},
            }
        )
        for name in ("uno", "ipopt"):
            program, _ = transcribe(robot, task)
            x = first_point(program)
            began = sum(os.times()[:4])
            report = solvers_for(name)[0].solve(
                program, x, SolverOptions(time_limit=120.0), None
            )
            took = (
                sum(os.times()[:4]) - began
            )  # of other processes too: large programs are solved in one
            sizes = (intervals, program.variables, len(program.lower))
            table.append(
                (
                    *map(str, sizes),
                    name,
                    f"{report.objective:.4f} s",
                    str(report.iterations),
                    f"{1e3 * took:.0f} ms",
                    report.status.name.lower(),
                )
            )
            print(f"| {' | '.join(table[-1])} |", flush=True)
    about = "The paper's arm at 90 degrees, redundant joint j1; one solve without refinement."
    save("Growth with the number of intervals", columns, table, about)


if __name__ == "__main__":
    main()
