"""Random reachable pose lines for every spatial robot: how many end in a verified plan.

Usage: python benchmarks/random_poses.py [ROBOT|all] [SEED] [COUNT] [roomiest|in_turn]

A task starts in a random posture (a tenth of every range is kept clear at both ends), and its path leads straight, the
orientation turning at a constant rate, to the pose of another posture whose joints are up to 0.5 rad or 0.5 m away. It
counts as reachable if a damped least-squares inverse kinematics, which knows nothing of the planner, follows the path
within the joint ranges and with torques that hold the arm at rest. The redundant joint is the one whose closed form
keeps farthest from singularity along this joint path (the largest least branch margin), or goes round all closed forms
in turn, which counts those as well whose branch ends along the path.
"""

from __future__ import annotations

import sys
import time
from collections.abc import Iterator, Sequence
from pathlib import Path

import numpy as np
import pinocchio as pin

from brachis import BrachisError, Robot, ik, plan
from brachis.robot import dynamics, task_map_of

ROOT = Path(__file__).parents[1]
PANDA = "panda_description/urdf/panda.urdf"
REACH = 0.5  # rad and m
STEPS = 200
DAMPING = 1e-4


def stored_urdf(place: str) -> Path:
    """URDF in the package example-robot-data, by its path there."""
    for folder in map(Path, sys.path):
        found = folder / "cmeel.prefix/share/example-robot-data/robots" / place
        if found.is_file():
            return found
    raise SystemExit("the package example-robot-data is not installed")


def robots() -> dict[str, Robot]:
    """Every spatial robot, and the Panda where its URDF is installed."""
    folders = {
        name: ROOT / f"robots/{name}/robot.urdf"
        for name in ("tx90l_rail", "ur10_rail", "iiwa14")
    }
    return {name: Robot.from_urdf(path) for name, path in folders.items()} | {
        "panda": Robot.from_urdf(stored_urdf(PANDA), tool_frame="panda_hand_tcp")
    }


def closed_forms(robot: Robot) -> list[ik.TriedDecomposition]:
    """Choices of redundant joints that have a closed form for poses."""
    found = ik.find_all(robot, task_map_of(robot, "pose"))
    return [c for c in found if c.solver is not None]


def room(joint_path: np.ndarray, candidate: ik.TriedDecomposition) -> float:
    """Least branch margin along a joint path of postures (K, n), on the branch where it is largest."""
    solver = candidate.solver
    return max(
        float(solver.branch_margins(joint_path, b).min())
        for b in range(len(solver.branches))
    )


def random_tasks(
    robot: Robot,
    seed: int,
    count: int,
    choices: Sequence[ik.TriedDecomposition],
    *,
    in_turn: bool = False,
) -> Iterator[dict[str, object]]:
    """Yield task mappings."""
    rng = np.random.default_rng(seed)
    lower = np.where(
        np.isfinite(robot.limits.position_lower), robot.limits.position_lower, -np.pi
    )
    upper = np.where(
        np.isfinite(robot.limits.position_upper), robot.limits.position_upper, np.pi
    )
    clear = 0.1 * (upper - lower)
    for number in range(count):
        while True:
            start = rng.uniform(lower + clear, upper - clear)
            end = np.clip(
                start + rng.uniform(-REACH, REACH, robot.n),
                lower + clear,
                upper - clear,
            )
            joint_path = followed(
                robot, start, robot.tool_placement(start), robot.tool_placement(end)
            )
            if joint_path is not None:
                break
        goal = robot.tool_placement(end)
        turn = pin.log3(goal.rotation @ robot.tool_placement(start).rotation.T)
        angle = float(np.linalg.norm(turn))
        choice = (
            choices[number % len(choices)]
            if in_turn
            else max(choices, key=lambda c: room(joint_path, c))
        )
        yield {
            "brachis": 1,
            "start": {"joints": start},
            "task_space": "pose",
            "path": [
                {
                    "line": {"to": list(goal.translation)},
                    "orientation": {
                        "rotate": {
                            "axis": list(turn / angle),
                            "angle_deg": float(np.rad2deg(angle)),
                        }
                    },
                }
            ],
            "redundant_joints": list(choice.redundant_joints),
            "spline": {"intervals": 20},
        }


def followed(
    robot: Robot, start: np.ndarray, first: pin.SE3, last: pin.SE3
) -> np.ndarray | None:
    """Follow the straight line by damped least squares; None where ranges or static torques do not allow it."""
    q, zero = start.copy(), np.zeros((1, robot.n))
    data, frame, limits = robot.model.createData(), robot.frame_id, robot.limits
    turn = pin.log3(first.rotation.T @ last.rotation)
    middle = 0.5 * (limits.position_lower + limits.position_upper)
    middle = np.where(np.isfinite(middle), middle, start)
    joint_path = []
    for s in np.linspace(0.0, 1.0, STEPS + 1):
        target = pin.SE3(
            first.rotation @ pin.exp3(s * turn),
            (1.0 - s) * first.translation + s * last.translation,
        )
        for _ in range(3):
            jacobian = pin.computeFrameJacobian(robot.model, data, q, frame, pin.LOCAL)
            pin.framesForwardKinematics(robot.model, data, q)
            miss = pin.log6(data.oMf[frame].actInv(target)).vector
            inverse = jacobian.T @ np.linalg.inv(
                jacobian @ jacobian.T + DAMPING * np.eye(6)
            )
            q = (
                q
                + inverse @ miss
                + (np.eye(robot.n) - inverse @ jacobian) @ (0.02 * (middle - q))
            )
        inside = np.all((q >= limits.position_lower) & (q <= limits.position_upper))
        held = np.all(
            np.abs(dynamics.torque(robot, q[None], zero, zero)[0]) <= limits.torque
        )
        if not (inside and held and np.abs(miss).max() < 1e-3):
            return None
        joint_path.append(q)
    return np.array(joint_path)


def tried(robot: Robot, task: dict[str, object]) -> str:
    """Plan a task; say why there is no verified plan, or nothing."""
    try:
        result = plan(robot, task)
    except BrachisError as error:
        return f"{type(error).__name__}: {error}"
    return "" if result.verified else "unverified"


def main() -> None:
    """Print every failure with its reason, then the count."""
    chosen = sys.argv[1] if len(sys.argv) > 1 else "all"
    seed, count = (
        int(value) for value in (*sys.argv[2:4], *("0", "100")[len(sys.argv[2:4]) :])
    )
    rule = sys.argv[4] if len(sys.argv) > 4 else "roomiest"
    for name, robot in robots().items():
        if chosen not in ("all", name):
            continue
        choices = closed_forms(robot)
        verified, times = 0, []
        for number, task in enumerate(
            random_tasks(robot, seed, count, choices, in_turn=rule == "in_turn")
        ):
            began = time.perf_counter()
            reason = tried(robot, task)
            times.append(time.perf_counter() - began)
            verified += not reason
            if reason:
                print(f"{name} {number} {task['redundant_joints']}: {reason}")
        print(
            f"{name}: {verified} of {count} verified; median {np.median(times):.2f} s, longest {max(times):.1f} s; "
            f"redundant joint ({rule}) out of {', '.join('+'.join(c.redundant_joints) for c in choices)}"
        )


if __name__ == "__main__":
    main()
