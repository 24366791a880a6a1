"""Quick turns of the tool within millimetres of its path: planned wherever an independent continuation follows them.

Usage: python benchmarks/tool_turns.py [--count 40] [--first 0] [--robot NAME] [--save]

The tool turns by 60 to 180 degrees within 5 to 100 mm of a line, about its own axis, about world z, or about an oblique
axis, with blends before and after. The path goes through the place of a random posture; start and end are free.

The judge is a continuation of its own, in Pinocchio and NumPy: from random postures at the path's beginning the arm
follows the path in small steps by damped least squares. Its self-motion goes to the middle of the ranges, or along
a random direction. It finds a joint path if one arrives without leaving the ranges and without a jump.
A plan that fails where the judge arrives is missing; "out of reach" is false there.
"""

from __future__ import annotations

import argparse
import time
import warnings
from collections import Counter
from pathlib import Path
from typing import Any

import numpy as np
import pinocchio as pin

import brachis
from brachis.errors import BrachisError, BrachisWarning
from brachis.path import path_of
from brachis.robot import bind
from brachis.task import Task
from committed import save

ROOT = Path(__file__).parents[1]
ROBOTS = ("tx90l_rail", "ur10_rail", "iiwa14")
AXES = ("tool", "world z", "oblique")
STARTS = 60
"""Random postures from which the judge follows the path."""
STEP = 0.02
"""Longest step of the judge, rad and 10 m."""
JUMP = 0.3
"""Largest step of a joint, rad or m."""


def case(number: int, robot: str | None = None) -> Task:
    """Return the task with this number."""
    rng = np.random.default_rng(number)
    name = robot or ROBOTS[number % len(ROBOTS)]
    arm = brachis.Robot.from_urdf(ROOT / f"robots/{name}/robot.urdf")
    low, high = arm.limits.position_lower, arm.limits.position_upper
    ends = np.clip(low, -2.0, 2.0), np.clip(high, -2.0, 2.0)
    q = rng.uniform(0.8 * ends[0], 0.8 * ends[1])
    data = arm.model.createData()
    pin.framesForwardKinematics(arm.model, data, q)
    middle = data.oMf[arm.model.getFrameId(arm.tool_frame)]
    kind = AXES[number // len(ROBOTS) % len(AXES)]
    angle = float(rng.choice([-1.0, 1.0]) * rng.uniform(60.0, 180.0))
    length = float(np.exp(rng.uniform(np.log(0.005), np.log(0.1))))
    straight = rng.uniform(0.03, 0.1, 2)
    slow = rng.uniform(-20.0, 20.0, 2)
    direction = rng.normal(size=3)
    direction /= np.linalg.norm(direction)
    axis = {
        "tool": middle.rotation[:, 2],
        "world z": np.array([0.0, 0.0, 1.0]),
        "oblique": rng.normal(size=3),
    }[kind]
    axis = axis / np.linalg.norm(axis)
    back = np.radians(slow[0] + 0.5 * angle)
    first = pin.exp3(-back * axis) @ middle.rotation
    begin = middle.translation - (straight[0] + 0.5 * length) * direction
    blend = float(rng.uniform(0.05, 0.4)) * min(length, *straight)
    segments = []
    for way, turn in ((straight[0], slow[0]), (length, angle), (straight[1], slow[1])):
        rotate = {"axis": axis.tolist(), "angle_deg": float(turn)}
        by = (way * direction).tolist()
        segments.append({"line": {"by": by}, "orientation": {"rotate": rotate}})
    for segment in segments[:-1]:
        segment["blend"] = blend
    content: dict[str, Any] = {
        "brachis": 1,
        "robot": {"urdf": str(ROOT / f"robots/{name}/robot.urdf")},
        "start": "free",
        "path_start": {
            "position": begin.tolist(),
            "quaternion_xyzw": pin.Quaternion(first).coeffs().tolist(),
        },
        "task_space": "pose",
        "path": segments,
        "search": {"effort": "single", "least_motion": False},
    }
    return brachis.load_task(content)


class Judge:
    """Joint paths by continuation, without a search of brachis; it gives the model, and the places on the path."""

    def __init__(self, task: Task) -> None:
        robot = brachis.Robot.from_urdf(task.robot.urdf)
        self.model, self.limits = robot.model, robot.limits
        self.data = self.model.createData()
        self.frame = self.model.getFrameId(robot.tool_frame)
        path = path_of(bind(robot, task.task_space)[1], task)
        s = np.linspace(0.0, 1.0, 20_001)
        targets = path.sample(s).target
        turns = targets[:, 3:].reshape(-1, 3, 3)
        relative = np.einsum("kji,kjl->kil", turns[:-1], turns[1:])
        cosines = (np.trace(relative, axis1=1, axis2=2) - 1.0) / 2.0
        way = np.linalg.norm(np.diff(targets[:, :3], axis=0), axis=1)
        steps = np.arccos(np.clip(cosines, -1.0, 1.0)) + 10.0 * way
        done = np.append(0.0, np.cumsum(steps))
        kept = np.searchsorted(done, np.arange(0.0, done[-1], STEP))
        self.targets = targets[np.append(kept, -1)]
        self.rng = np.random.default_rng(0)

    def error(self, q: np.ndarray, target: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """How far the tool is off its place, (6,), in its own axes, and the Jacobian, (6, n)."""
        pin.computeJointJacobians(self.model, self.data, q)
        pin.updateFramePlacement(self.model, self.data, self.frame)
        jacobian = pin.getFrameJacobian(self.model, self.data, self.frame, pin.LOCAL)
        wanted = pin.SE3(target[3:].reshape(3, 3), target[:3])
        return pin.log6(self.data.oMf[self.frame].actInv(wanted)).vector, jacobian

    def meet(self, q: np.ndarray, target: np.ndarray, count: int) -> np.ndarray | None:
        """Return the posture near q, (n,), in which the tool is at its place."""
        for _ in range(count):
            miss, jacobian = self.error(q, target)
            if np.abs(miss).max() < 1e-7:
                return q
            square = jacobian @ jacobian.T + 1e-8 * np.eye(6)
            q = q + jacobian.T @ np.linalg.solve(square, miss)
        return None

    def is_allowed(self, q: np.ndarray) -> bool:
        """Tell whether a posture is within the ranges, and the torques hold it."""
        if not np.all(
            (q >= self.limits.position_lower) & (q <= self.limits.position_upper)
        ):
            return False
        torque = pin.computeGeneralizedGravity(self.model, self.data, q)
        return bool(np.all(np.abs(torque) <= self.limits.torque))

    def follows(self, q: np.ndarray, drift: np.ndarray, centre: float) -> bool:
        """Tell whether a joint path from q, (n,), arrives."""
        low, high = self.limits.position_lower, self.limits.position_upper
        closed = np.isfinite(low) & np.isfinite(high)
        middle = np.where(closed, 0.5 * (low + high), 0.0)
        half = np.where(closed, 0.5 * (high - low), np.inf)
        for target in self.targets[1:]:
            _, jacobian = self.error(q, target)
            wish = drift - centre * (q - middle) / half**2
            inverse = np.linalg.pinv(jacobian, rcond=1e-4)
            aside = wish - inverse @ (jacobian @ wish)
            aside *= min(1.0, 0.05 / max(np.abs(aside).max(), 1e-12))
            moved = self.meet(q + aside, target, 8)
            if (
                moved is None
                or np.abs(moved - q).max() > JUMP
                or not self.is_allowed(moved)
            ):
                return False
            q = moved
        return True

    def finds(self) -> int:
        """Count the starts from which a joint path arrives."""
        low = np.clip(self.limits.position_lower, -np.pi, None)
        high = np.clip(self.limits.position_upper, None, np.pi)
        arrived = 0
        for number in range(STARTS):
            begun = self.meet(self.rng.uniform(low, high), self.targets[0], 60)
            if begun is None or not self.is_allowed(begun):
                continue
            drift = self.rng.normal(0.0, 0.01, len(low)) * (number % 2)
            arrived += self.follows(begun, drift, (0.0, 0.02, 0.1)[number % 3])
        return arrived


def planned(task: Task) -> tuple[str, float]:
    """Plan a task: "planned", or the message."""
    began = time.perf_counter()
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore", BrachisWarning)
            outcome = (
                "planned"
                if brachis.plan(task, strict=False).verified
                else "not verified"
            )
    except BrachisError as error:
        outcome = str(error)
    return outcome, time.perf_counter() - began


def main() -> None:
    """Print every task that is not planned, and a line for every robot."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--count", type=int, default=40)
    parser.add_argument("--first", type=int, default=0)
    parser.add_argument("--robot", choices=ROBOTS)
    parser.add_argument("--save", action="store_true", help="into benchmarks/results")
    given = parser.parse_args()
    counts: dict[str, Counter[str]] = {name: Counter() for name in ROBOTS}
    for number in range(given.first, given.first + given.count):
        task = case(number, given.robot)
        name = Path(str(task.robot.urdf)).parent.name
        outcome, seconds = planned(task)
        arrived = Judge(task).finds()
        own = counts[name]
        own["tasks"] += 1
        own["planned"] += outcome == "planned"
        own["judge"] += arrived > 0
        own["missing"] += arrived > 0 and outcome != "planned"
        own["false"] += arrived > 0 and "out of reach" in outcome
        own["slow"] += seconds > 10.0
        print(
            f"{number} {name}: {outcome}, {seconds:.1f} s; judge: {arrived} of {STARTS}",
            flush=True,
        )
    columns = (
        "robot",
        "tasks",
        "planned",
        "judge finds a joint path",
        "not planned where it does",
        'false "out of reach"',
    )
    keys = ("tasks", "planned", "judge", "missing", "false")
    rows = [
        (name, *(str(own[key]) for key in keys)) for name, own in counts.items() if own
    ]
    for row in (columns, *rows):
        print(" | ".join(row))
    save(
        "Quick turns of the tool",
        columns,
        rows,
        "Turns of 60 to 180 degrees within 5 to 100 mm of a line; start and end are free.",
    )


if __name__ == "__main__":
    main()
