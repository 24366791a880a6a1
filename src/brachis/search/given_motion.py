"""The initial guess from a motion that is already known, of the same task or of a similar one.

Only curves of the motion are used: the postures over the path coordinate, which are brought onto the path if it has
changed, and the time law. So limits, splines, coordinates and the path may differ from those with which the motion was
planned.
"""

from __future__ import annotations

import itertools
from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import TypeVar

import numpy as np

from brachis.common import tolerances
from brachis.errors import UnreachableError
from brachis.ik import Family
from brachis.kinematics import (
    CHART,
    ChartMap,
    ChartRows,
    JointSpaceMap,
    Newton,
    chart_around,
    transversality,
)
from brachis.optimise.backends import solvers_for
from brachis.problem.chain import ProblemChain
from brachis.problem.problem import Decomposition, Decompositions, Problem
from brachis.robot import Robot, TaskMap, bind
from brachis.robot.from_task import lock_joints
from brachis.robot.task_map import JointSpace
from brachis.search.guesses import FAMILY, bring_onto_path
from brachis.search.joint_choice import SELECTABLE
from brachis.search.least_motion import LeastMotion
from brachis.search.moves import guess_along
from brachis.search.schedule import has_charts
from brachis.search.stages import (
    ChainGuess,
    FinishedCandidate,
    InitialGuess,
    SearchMap,
)
from brachis.task import Posture, Task, Tolerances
from brachis.trajectory import Trajectory
from brachis.verify import verify_trajectory

_STATIONS_OF_MOVES = 97
"""Number of postures along the joint path of a move."""
GIVEN = "given motion"
EXACT = "from the plan without tolerances"
"""Origins of guesses."""
Planned = TypeVar("Planned", FinishedCandidate, LeastMotion)


def given_guess(
    problem: Problem,
    decompositions: Sequence[Decomposition],
    motion: Trajectory,
    origin: str,
) -> InitialGuess:
    """Turn a known motion into an initial guess.

    Parameters
    ----------
    problem : Problem
    decompositions : sequence of Decomposition
    motion : Trajectory
        A motion whose task may have different tolerances, or none.
    origin : str

    Returns
    -------
    InitialGuess
        A guess that names the solver that is tried first.

    Raises
    ------
    UnreachableError
        The motion cannot be used; the text says why, in plain words.
    """
    if isinstance(problem, ProblemChain):
        families = getattr(decompositions, "families", ())
        return _given_chain_guess(problem, families, motion, origin)
    joints = problem.robot.urdf_joints
    motion_joints = motion.robot.urdf_joints
    if not set(joints) <= set(motion_joints):
        raise UnreachableError(
            f"its joints are {', '.join(motion_joints)}, but the robot's are {', '.join(joints)}"
        )
    # The postures over s, and the time law on every leg.
    splits = [leg.end for leg in problem.legs[:-1]]
    t = np.linspace(0.0, motion.t_end, 4001)
    passed = np.clip(motion.path_coordinate(t), 0.0, 1.0)
    ends = np.concatenate([[0.0], np.interp(splits, passed, t), [motion.t_end]])
    times = [np.linspace(*pair, 401) for pair in itertools.pairwise(ends)]
    s_by_leg = []
    for leg, leg_times in zip(problem.legs, times, strict=True):
        s = np.clip(motion.path_coordinate(leg_times), leg.begin, leg.end)
        s[[0, -1]] = [leg.begin, leg.end]
        s_by_leg.append(s)
    t = np.concatenate(times)
    s = np.concatenate(s_by_leg)
    joint_map, curves, family = _in_coordinates(
        problem, decompositions, motion, s, _positions(problem, motion, t)
    )
    if not np.isfinite(joint_map.postures(curves)).all():
        raise UnreachableError("its postures cannot be brought onto the path")
    return InitialGuess(
        problem,
        joint_map,
        curves,
        motion.t_end,
        origin,
        family,
        solvers_for(problem.task.solver.name)[0].name,
        durations=tuple(np.diff(ends).tolist()),
    )


def _given_chain_guess(
    problem: ProblemChain, families: Sequence[Family], motion: Trajectory, origin: str
) -> ChainGuess:
    """Turn the known motion of a program into an initial guess; the moves are bent so that they meet the paths."""
    parts = problem.parts
    motions = [component for _, component in motion.components]
    if len(motions) != len(parts):
        raise UnreachableError("it has not the parts of this program")
    if problem.task.order == "free" or any(part.variants for part in parts):
        raise UnreachableError("the order of the parts, or their travel, is free")
    of_paths = {
        number: given_guess(part, Decompositions(part, families), known, origin)
        for number, (part, known) in enumerate(zip(parts, motions, strict=True))
        if part.task_map.m
    }
    ends = {
        number: guess.postures_at(np.array([0.0, 1.0]))[:, : problem.robot.n]
        for number, guess in of_paths.items()
    }
    guesses = []
    for number, (part, known) in enumerate(zip(parts, motions, strict=True)):
        if number in of_paths:
            guesses.append(of_paths[number])
            continue
        fraction = np.linspace(0.0, 1.0, _STATIONS_OF_MOVES)
        q = _positions(part, known, fraction * known.t_end)
        before = ends.get(number - 1 if number else len(parts) - 1)
        after = ends.get((number + 1) % len(parts))
        first, last = q[[0, -1]]
        if part.start is None and before is not None:
            first = before[1]
        if part.end is None and after is not None:
            last = after[0]
        q = (
            q
            + np.outer(1.0 - fraction, first - q[0])
            + np.outer(fraction, last - q[-1])
        )
        guesses.append(guess_along(part, q, origin))
    guesses = [
        replace(guess, solver=solvers_for(problem.task.solver.name)[0].name)
        for guess in guesses
    ]
    guess = ChainGuess.of_parts(problem, guesses, motion.t_end)
    return replace(guess, origin=origin)


def without_tolerances(task: Task) -> Task:
    """Return the task for a tool that stays exactly on the path."""
    return task.model_copy(update={"tolerances": Tolerances()})


def lock_idle(
    robot: Robot, task: Task, task_map: TaskMap, postures: Mapping[str, np.ndarray]
) -> tuple[Robot, Task] | None:
    """Lock the joints on which no row of the task space depends, in robot and task; return None if none is idle.

    Parameters
    ----------
    robot : Robot
        A robot without the virtual joints of tolerances.
    task : Task
    task_map : TaskMap
    postures : mapping of str to (n,) ndarray
        The given postures, by the names ``start`` and ``end``. Joints whose positions differ between these are not
        idle.
    """
    count = len(robot.urdf_joints)
    moves = np.abs(task_map.sample_jacobians()).max(axis=(0, 1)) > tolerances.ANGLE
    still = stand_still(task_map.robot, postures)
    for posture in postures.values():
        moves |= np.abs(posture - still) > tolerances.COORDINATE
    idle = np.flatnonzero(~moves[:count])
    if not len(idle):
        return None
    positions = {robot.joint_names[i]: float(still[i]) for i in idle}
    robot = lock_joints(robot, positions)

    def narrow(posture: np.ndarray) -> tuple[float, ...]:
        return tuple(np.delete(posture[:count], idle).tolist())

    named = {
        name: narrow(task_map.robot.posture(joints, f"postures.{name}"))
        for name, joints in task.postures.items()
    }
    changes: dict[str, object] = {"robot": robot.settings, "postures": named}
    for key, posture in postures.items():
        if getattr(task, key) != "free":
            changes[key] = Posture(joints=narrow(posture))
    if task.redundant_joints != "auto":
        moving = [name for name in task.redundant_joints if name not in positions]
        changes["redundant_joints"] = tuple(moving) or "auto"
    return robot, task.model_copy(update=changes)


def stand_still(robot: Robot, postures: Mapping[str, np.ndarray]) -> np.ndarray:
    """Return the positions, (n,), at which idle joints stand still: those of a given posture, or else zero."""
    limits = robot.limits
    nearest = np.clip(np.zeros(robot.n), limits.position_lower, limits.position_upper)
    return next(iter(postures.values()), nearest)


def widen_plan(planned: Planned, problem: Problem) -> Planned:
    """Turn a plan with fewer joints (see `lock_idle` and `without_tolerances`) into a plan of the problem itself."""
    motion = planned.trajectory
    robot = problem.robot
    columns = [robot.joint_names.index(name) for name in motion.joint_names]

    def widen(values: np.ndarray) -> np.ndarray:
        wider = np.zeros((*values.shape[:-1], robot.n))
        wider[..., columns] = values
        return wider

    rows = motion.chart_rows
    if rows.size:
        rows = np.concatenate([widen(rows[..., :-1]), rows[..., -1:]], axis=-1)
    motion = replace(
        motion,
        task=problem.task,
        robot=robot,
        q=_positions(problem, motion, motion.times),
        qdot=widen(motion.qdot),
        qddot=widen(motion.qddot),
        qddot_before=widen(motion.qddot_before),
        chart_rows=rows,
    )
    verification = verify_trajectory(motion, own_limits=problem.own_limits)
    return replace(planned, trajectory=motion, verification=verification)


def narrow_motion(motion: Trajectory) -> Trajectory:
    """Undo `widen_plan`: return the motion of the simpler task for which it is optimal.

    A motion that has curves for idle joints, or for the virtual joints of tolerances, is returned unchanged. So is the
    motion of a program.
    """
    if motion.components:
        return motion
    wider = motion.robot
    _, task_map = bind(wider, motion.task.task_space, motion.task.tolerances)
    spline = motion.phase_splines[0]
    is_timed = motion.phases[0].speed is None
    curves = len(spline.control_points) - (1 if is_timed else 0)
    if curves == wider.n - task_map.m:
        return motion
    robot = Robot.from_settings(wider.settings, wider.source, wider.urdf)
    ends = {"start": motion.q[0], "end": motion.q[-1]}
    idle = lock_idle(robot, motion.task, task_map, ends)
    robot, task = idle or (robot, without_tolerances(motion.task))
    if task == motion.task:
        return motion
    robot, _ = bind(robot, task.task_space, task.tolerances)
    columns = [wider.joint_names.index(name) for name in robot.joint_names]
    rows = motion.chart_rows
    if rows.size:
        rows = rows[..., [*columns, wider.n]]
    narrower = replace(
        motion,
        task=task,
        robot=robot,
        q=motion.q[:, columns],
        qdot=motion.qdot[:, columns],
        qddot=motion.qddot[:, columns],
        qddot_before=motion.qddot_before[:, columns],
        chart_rows=rows,
    )
    return narrow_motion(narrower)


def _positions(problem: Problem, motion: Trajectory, t: np.ndarray) -> np.ndarray:
    """Return positions of the problem's joints at times, (K, n); joints that are not in the motion stand still."""
    robot = problem.robot
    motion_positions = dict(zip(motion.joint_names, motion.position(t).T, strict=True))
    still = stand_still(robot, problem.given_postures)
    columns = [
        motion_positions.get(name, np.full(len(t), value))
        for name, value in zip(robot.joint_names, still, strict=True)
    ]
    return np.column_stack(columns)


def _in_coordinates(
    problem: Problem,
    decompositions: Sequence[Decomposition],
    motion: Trajectory,
    s: np.ndarray,
    q: np.ndarray,
) -> tuple[SearchMap, np.ndarray, str]:
    """Return the joint map, its curves (S, 1 + r), and the family, for path coordinates (S,) and postures (S, n)."""
    if isinstance(problem.task_map, JointSpace):
        return JointSpaceMap(problem.robot, problem.path), s[:, None], FAMILY
    first = q[0] if problem.start is None else problem.start
    last = q[-1] if problem.end is None else problem.end
    q = q + np.outer(1.0 - s, first - q[0]) + np.outer(s, last - q[-1])
    newton = Newton(problem.task_map) if problem.r >= 0 else None
    q = bring_onto_path(problem, newton, s, q)
    if has_charts(problem, decompositions):
        chart = _lay_chart(problem, motion, s, q)
        return chart, chart.curves(s, q), CHART
    joints = motion.redundant_joints
    same = [
        decomposition
        for decomposition in decompositions
        if decomposition.match.redundant_joints == joints
    ]
    chosen = (same or decompositions)[0]
    labels = chosen.match.solver.branches
    branches = [branch for branch in chosen.branches if labels[branch] == motion.branch]
    branch = (branches or chosen.branches)[0]
    curves = np.column_stack([s, q[:, list(chosen.redundant)]])
    return chosen.joint_map(q[0], branch), curves, chosen.match.family


def _lay_chart(
    problem: Problem, motion: Trajectory, s: np.ndarray, q: np.ndarray
) -> ChartMap:
    """Lay a chart around postures, with the motion's own rows if these refer to the same joints and are transversal."""
    joints = [motion.joint_names.index(name) for name in motion.redundant_joints]
    rows = ChartRows.constant(np.eye(motion.robot.n)[joints])
    if len(motion.chart_rows):
        rows = ChartRows(motion.chart_rows, motion.chart_knots)
    task_map = problem.task_map
    newton = Newton(task_map)
    is_same = motion.joint_names == problem.robot.joint_names
    if is_same and rows.r == problem.r:
        scaled = rows.at(s)[0] * newton.scales
        scaled /= np.linalg.norm(scaled, axis=2, keepdims=True)
        if transversality(scaled, newton.self_motions(q)).min() >= SELECTABLE:
            return chart_around(task_map, problem.path, s, q, rows)
    return chart_around(task_map, problem.path, s, q)
