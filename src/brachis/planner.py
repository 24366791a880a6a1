"""The whole pipeline on one page: task -> robot -> path -> decomposition -> NLP -> solve and refine -> verify."""

from __future__ import annotations

import os
import time
from collections.abc import Mapping, Sequence

import numpy as np
from threadpoolctl import ThreadpoolController

from brachis import ik
from brachis.attempts import Listener, search
from brachis.bspline import clamped_uniform_knots
from brachis.errors import InputError
from brachis.feasibility import check_end_branch, check_start, start_branch
from brachis.kinematics import Decomposition, interpolate
from brachis.mesh import COARSE_INTERVALS
from brachis.nlp import Transcription
from brachis.path import path_of
from brachis.refine import Refined
from brachis.result import Result
from brachis.robot import ROLL_JOINT, Robot, TaskSpace, bind
from brachis.robot.from_task import robot_from_settings
from brachis.task import Task, load_task
from brachis.trajectory import CONTINUOUS_TORQUE, Trajectory
from brachis.verify import Verification, VerifyOptions, verify_trajectory

_SAME_TIME = 1e-7


def plan(
    robot: str | os.PathLike[str] | Robot | None,
    task: str | os.PathLike[str] | Mapping[str, object] | Task,
    *,
    families: Sequence[ik.Family] = (),
    listener: Listener | None = None,
) -> Result:
    """Plan the minimum-time motion of a robot along a path.

    Parameters
    ----------
    robot : path, Robot or None
        URDF file; None takes the one that the task names. A `Robot` is used as it is, with its own limits.
    task : path, mapping or Task
        Task file, or its content.
    families : sequence of Family, optional
        Closed forms to try before the built-in ones.
    listener : callable, optional
        Told what happens.

    Returns
    -------
    Result
        ``result.verified`` says whether the trajectory passed the verification.

    Raises
    ------
    InputError
        The task, URDF, path or start posture is wrong (`TaskError`, `UrdfError`, `LimitError`, `PathError`, ...).
    PlanningError
        No attempt gave a motion within the limits.

    Examples
    --------
    >>> import brachis
    >>> result = brachis.plan(None, "examples/01_scara_line.yaml")
    >>> result.verified, round(result.t_end, 2)
    (True, 2.48)
    """
    # Batches are small: a second BLAS thread costs up to twenty times what it gives where cores are busy.
    with ThreadpoolController().limit(limits=1, user_api="blas"):
        return _plan(robot, load_task(task), families, listener or (lambda _text: None))


def _plan(
    robot: str | os.PathLike[str] | Robot | None, task: Task, families: Sequence[ik.Family], listener: Listener
) -> Result:
    """Run the pipeline stage by stage."""
    clock = _Clock()
    robot = robot if isinstance(robot, Robot) else robot_from_settings(task.robot, urdf=robot)
    task = task.model_copy(update={"robot": robot.settings})
    clock.stage("load")
    problem, family = transcribe(robot, task, families=families)
    clock.stage("transcribe")
    options = VerifyOptions(ratio_tolerance=task.refinement.tolerance)

    def judge(refined: Refined) -> tuple[Trajectory, Verification]:
        """Make the trajectory of an answer and verify it."""
        clock.stage("solve")
        trajectory = _trajectory(problem.decomposition, refined, task)
        clock.stage("trajectory")
        verification = verify_trajectory(trajectory, options)
        clock.stage("verify")
        return trajectory, verification

    attempts, chosen, (trajectory, verification) = search(problem, task, judge, listener)
    return Result(task, trajectory, verification, family, attempts, chosen, clock.total())


def transcribe(robot: Robot, task: Task, *, families: Sequence[ik.Family] = ()) -> tuple[Transcription, str]:
    """Turn a task into an NLP that can be inspected and solved.

    Parameters
    ----------
    robot : Robot
    task : Task
    families : sequence of Family, optional
        Closed forms to try before the built-in ones.

    Returns
    -------
    problem : Transcription
    family : str
        Family of the closed form.

    Raises
    ------
    InputError
        See `plan`.
    """
    robot, task_space = bind(robot, task.task_space)
    if task.start == "free":
        raise InputError("a free start posture is not supported yet", where="start")
    start = robot.posture(task.start.joints, "start.joints")
    end = None if task.end == "free" else robot.posture(task.end.joints, "end.joints")
    path = path_of(robot, task_space, task)
    candidate = ik.find(robot, task_space, _redundant_joints(robot, task_space, task), families=families)
    redundant = tuple(robot.joint_names.index(name) for name in candidate.redundant_joints)
    check_start(robot, start, end, path, task_space)
    branch = start_branch(robot, task_space, candidate, start, task.branch)
    if end is not None:
        check_end_branch(robot, task_space, candidate, end, branch)
    decomposition = Decomposition(robot, task_space, path, candidate.solver, redundant, branch, start)
    spline = task.spline
    intervals = COARSE_INTERVALS if spline.intervals == "auto" else spline.intervals
    problem = Transcription(
        decomposition,
        degree=spline.degree,
        knots=clamped_uniform_knots(spline.degree, intervals),
        derivatives_at_rest=2 if spline.rest == "full" else 1,
        tau=np.linspace(0.0, 1.0, spline.points_per_interval * intervals + 1),
        end=end,
    )
    return problem, str(candidate.family)


def _redundant_joints(robot: Robot, task_space: TaskSpace, task: Task) -> tuple[str, ...]:
    """Return the task's redundant joints, and the free roll where it is the one that is left out."""
    if task.redundant_joints == "auto":
        candidates = ik.find_all(robot, task_space)
        return next((c.redundant_joints for c in candidates if c.solver is not None), ())
    names = task.redundant_joints
    missing = robot.n - task_space.m - len(names)
    return (*names, ROLL_JOINT) if robot.rolls_freely and missing == 1 and ROLL_JOINT not in names else names


def _trajectory(decomposition: Decomposition, refined: Refined, task: Task) -> Trajectory:
    """Turn the answer into a trajectory that can be evaluated without the closed form."""
    motion = refined.problem.motion(refined.x)
    joins = motion.times_of(decomposition.path.breaks[1:-1])
    gaps = np.abs(joins[:, None] - motion.breaks).min(axis=1, initial=np.inf)
    breaks = np.union1d(motion.breaks, joins[gaps > _SAME_TIME * motion.t_end])
    nodes = interpolate(decomposition, motion.at, breaks, jumps=motion.degree < CONTINUOUS_TORQUE)
    robot = decomposition.robot
    return Trajectory(
        task=task,
        urdf=robot.urdf,
        robot=robot,
        redundant_joints=tuple(robot.joint_names[i] for i in decomposition.redundant),
        branch=decomposition.solver.branches[decomposition.branch],
        times=nodes.times,
        q=nodes.q,
        qdot=nodes.qdot,
        qddot=nodes.qddot,
        qddot_before=nodes.qddot_before,
        knots=motion.knots,
        degree=motion.degree,
        control_points=motion.control_points,
    )


class _Clock:
    """Wall time of stages."""

    def __init__(self) -> None:
        self._began = self._last = time.perf_counter()
        self._stages: dict[str, float] = {}

    def stage(self, name: str) -> None:
        """End the current stage."""
        now = time.perf_counter()
        self._stages[name] = self._stages.get(name, 0.0) + now - self._last
        self._last = now

    def total(self) -> dict[str, float]:
        """Return the stages and their total, s."""
        return {**self._stages, "total": time.perf_counter() - self._began}
