"""The lines that all solve, what each gives back, and one checker for all."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import pinocchio as pin

from brachis import Robot, Task, load_task
from brachis.problem.problem import Problem
from brachis.robot.from_task import robot_for

ROOT = Path(__file__).parents[2]
INTERVALS = 20
"""Knot intervals of the cubic splines, which start and end at full rest."""
CHECKED = 5001
"""Times at which an answer is checked."""
LINES = {
    "planar 3R": ("01_scara_line", "j1"),
    "TX90L on a rail": ("03_tx90l_rail_line", "rail"),
}
"""Example, and the joint that is chosen freely."""


@dataclass(frozen=True)
class Line:
    """A line, its robot and its limits.

    Attributes
    ----------
    name : str
    task : Task
        As brachis takes it.
    problem : Problem
    redundant : int
        The joint that is chosen freely.
    """

    name: str
    task: Task
    problem: Problem
    redundant: int

    @classmethod
    def of(cls, name: str) -> Line:
        """Read one of the `LINES`."""
        example, joint = LINES[name]
        content = load_task(ROOT / f"examples/{example}.yaml").to_dict()
        content["redundant_joints"] = [joint]
        content["spline"] = {"degree": 3, "intervals": INTERVALS, "rest": "full"}
        task = load_task(content)
        problem = Problem.of(robot_for(None, task.robot), task)
        return cls(name, task, problem, problem.robot.joint_names.index(joint))

    @property
    def robot(self) -> Robot:
        """The robot."""
        return self.problem.robot

    @property
    def start(self) -> np.ndarray:
        """Posture at the start, (n,)."""
        start = self.problem.start
        assert start is not None
        return start

    def targets(self, s: np.ndarray) -> np.ndarray:
        """Task coordinates, (K, c), at path coordinates (K,)."""
        return self.problem.path.sample(s).target

    def joint_path(self, stations: int = 401) -> tuple[np.ndarray, np.ndarray]:
        """Follow the line with the least joint motion, by the pseudo-inverse of the Jacobian.

        Returns
        -------
        s : (stations,) ndarray
        q : (stations, n) ndarray
            On the line to 1e-10.
        """
        task_map = self.problem.task_map
        s = np.linspace(0.0, 1.0, stations)
        q = [self.start]
        for target in self.targets(s)[1:]:
            own = q[-1].copy()
            for _ in range(20):
                miss = task_map.difference(target, task_map.value(own))
                if np.abs(miss).max() < 1e-10:
                    break
                jacobian = task_map.jacobian(task_map.twists(own[None]))[0]
                own += np.linalg.pinv(jacobian) @ miss
            q.append(own)
        return s, np.array(q)


@dataclass(frozen=True)
class Answer:
    """What a solver gives: a motion, and how long it took.

    Attributes
    ----------
    set_up, solve : float
        Processor time, s.
    t_end : float
        s.
    sample : callable
        q, qdot and qddot, (K, n) each, at times (K,), s.
    """

    set_up: float
    solve: float
    t_end: float
    sample: Callable[[np.ndarray], tuple[np.ndarray, np.ndarray, np.ndarray]]


@dataclass(frozen=True)
class Findings:
    """What the checker finds at `CHECKED` times.

    Attributes
    ----------
    off_path : float
        Largest distance of the tool from the line, mm.
    worst : float
        Largest part of a torque or velocity limit that is used.
    """

    off_path: float
    worst: float


def check(line: Line, answer: Answer) -> Findings:
    """Put an answer into Pinocchio's forward kinematics and inverse dynamics."""
    robot = line.robot
    t = np.linspace(0.0, answer.t_end, CHECKED)
    q, qdot, qddot = answer.sample(t)
    data = robot.model.createData()
    # Joint by joint, as Pinocchio has it: none of brachis' own functions.
    torque = np.array(
        [
            pin.rnea(robot.model, data, *state)
            for state in zip(q, qdot, qddot, strict=True)
        ]
    )
    f = robot.friction
    torque += f.armature * qddot + f.viscous * qdot
    torque += f.coulomb * np.tanh(qdot / f.v_eps)
    worst = np.abs(torque / robot.limits.torque).max()
    if np.isfinite(robot.limits.velocity).all():
        worst = max(worst, np.abs(qdot / robot.limits.velocity).max())
    tool = []
    for posture in q:
        pin.framesForwardKinematics(robot.model, data, posture)
        tool.append(data.oMf[robot.frame_id].translation.copy())
    begin, end = (
        line.targets(np.array([s]))[0][: len(_axes(line))] for s in (0.0, 1.0)
    )
    points = np.array(tool)[:, _axes(line)]
    along = (end - begin) / np.linalg.norm(end - begin)
    away = points - begin
    off = away - np.outer(away @ along, along)
    return Findings(1e3 * float(np.linalg.norm(off, axis=1).max()), float(worst))


def _axes(line: Line) -> list[int]:
    return list(line.problem.task_map.axes) or [0, 1, 2]
