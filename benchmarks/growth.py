"""How time and end time grow with the number of intervals, for uno and ipopt: ``python3 tasks.py bench``.

The planar 3R of the paper, 90 degrees, redundant joint j1, one solve without refinement.
"""

from __future__ import annotations

import math
from pathlib import Path

from brachis import LimitSpec, Robot, load_task, transcribe
from brachis.nlp.differential_ik import differential_ik_paths
from brachis.nlp.guess import starting_point
from brachis.solvers import SolverOptions, solver_named

ROOT = Path(__file__).parents[1]
INTERVALS = (10, 20, 50, 100, 200)


def first_point(program):
    """Start from the first joint path of numeric inverse kinematics."""
    return starting_point(program, [next(differential_ik_paths(program.phases[0].joint_map))])


def main() -> None:
    """Print one line for every number of intervals and solver."""
    robot = Robot.from_urdf(
        ROOT / "robots/scara3/robot.urdf", gravity=[0, 0, 0], limits=LimitSpec(torque=10.0, velocity=None)
    )
    print("| N | variables | rows | solver | t_E | iterations | evaluations | time | status |")
    print("|---|---|---|---|---|---|---|---|---|")
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
            counts = program.phases[0].evaluations
            before = counts["states"]
            report = solver_named(name)[0].solve(program, x, SolverOptions(time_limit=120.0), None)
            print(
                f"| {intervals} | {program.variables} | {len(program.lower)} | {name} | {report.objective:.4f} s "
                f"| {report.iterations} | {counts['states'] - before} | {1e3 * report.wall_time:.0f} ms "
                f"| {report.status.name.lower()} |",
                flush=True,
            )


if __name__ == "__main__":
    main()
