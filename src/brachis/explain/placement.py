"""How the end time changes with the placement of workpieces and base, and with the payload.

At an optimum dt_E is the change of the Lagrangian if the problem changes and the free variables stay the same (see
`task_figures`). If a workpiece moves, its paths and its bodies in the scene move with it. If the base moves by T, the
paths move by the inverse of T relative to the arm. The limits are those of the robot at its new place.

Without multipliers, dt_E is the change of the least time along the joint path, if the path determines all joints. If a
joint path is optimal, two limits may be active at once along all of it. With the same redundant joints, each change of
the path would then take more time, in both directions.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np

from brachis.errors import InputError, UnreachableError
from brachis.explain.task_figures import LeastTime, OptimalMotion
from brachis.path import Path
from brachis.path.sequence import PathFrame
from brachis.problem.problem import Problem
from brachis.robot.from_task import with_settings
from brachis.robot.task_map.protocol import AXES, position_rows
from brachis.task import Placement, Task
from brachis.task.settings import FramePlacement, Payload, place_frame
from brachis.trajectory.sensitivities import Gradient

if TYPE_CHECKING:
    from pinocchio import SE3

BASE = "base"
"""Name of the robot's mounting among what can be moved."""
PATH = "path"
"""Name of the paths that are given in the world, among what can be moved."""
COORDINATES = {
    "x": "m",
    "y": "m",
    "z": "m",
    "roll": "rad",
    "pitch": "rad",
    "yaw": "rad",
}
"""Coordinates of a change of a placement, and their units."""
_HELD = "a given posture holds the path in its place"
_KILOGRAMS = 10.0
"""Step of a mass, kg, as a multiple of the step of a placement, m. Torques are linear in the mass."""


def list_movable(problem: Problem) -> list[str]:
    """List what can be moved: frames that carry a path or a body of the scene, paths in the world, and the base."""
    used = {part.task.path_frame for part in problem.parts if _has_tool_path(part)}
    bodies = {body.frame for body in problem.task.scene if body.frame is not None}
    frames = problem.task.frames
    carrying = [
        name
        for name in frames
        if any(_is_carried(frames, inner, name) for inner in used | bodies)
    ]
    # Paths in the frame of a positioner move with its base.
    bases = [] if problem.robot.settings.workpiece_frame else [BASE]
    return [*carrying, *([PATH] if None in used else []), *bases]


def transform_about(change: Mapping[str, float], pivot: np.ndarray) -> SE3:
    """Return the transform of a change of a placement, by coordinate, with turns about a point, (3,)."""
    from pinocchio import SE3, rpy

    values = [change.get(name, 0.0) for name in COORDINATES]
    rotation = rpy.rpyToMatrix(*values[3:])
    return SE3(rotation, pivot + values[:3] - rotation @ pivot)


def pivot_of(problem: Problem, subject: str) -> np.ndarray:
    """Return the point about which something movable is turned, (3,), m.

    It is the origin of the base, or the mean of the points where the paths begin that move; without such a path, it is
    the origin of the frame. It moves with the subject, and does not depend on the order of the paths.
    """
    if subject == BASE:
        return np.array(problem.robot.settings.mounting.xyz)
    carried = [part for part in problem.parts if _moves_with(part, subject)]
    if not carried:
        return np.array(place_frame(problem.task.frames, subject).xyz)
    points = np.zeros((len(carried), 3))
    for point, part in zip(points, carried, strict=True):
        rows = position_rows(part.task_map.rows)
        target = part.path.sample([0.0]).target[0, : len(rows)]
        point[[AXES.index(row) for row in rows]] = target
    return np.asarray(points.mean(axis=0))


def move_in_task(task: Task, subject: str, transform: SE3) -> Task:
    """Return a task in which a frame or the base has been moved by a transform in the world."""
    if subject == BASE:
        mounting = Placement.model_validate(transform * task.robot.mounting.transform)
        robot = task.robot.model_copy(update={"mounting": mounting})
        return task.model_copy(update={"robot": robot})
    frame = task.frames[subject]
    world = transform * place_frame(task.frames, subject).transform
    outer = place_frame(task.frames, frame.frame).transform
    placement = Placement.model_validate(outer.inverse() * world)
    moved = FramePlacement(**placement.model_dump(), frame=frame.frame)
    return task.model_copy(update={"frames": {**task.frames, subject: moved}})


def find_obstacle(problem: Problem, subject: str) -> str:
    """Say why something cannot be moved; empty if it can."""
    for part in problem.parts:
        if _moves_with(part, subject):
            to_postures = (
                getattr(segment.shape, "to_posture", None) for segment in part.task.path
            )
            given = map(part.task.joints_at, ("start", "end"))
            if any(given) or any(to_postures):
                return _HELD
            if part.given_postures:
                return "the parts were planned one by one, between the postures in which they meet"
    return ""


def placement_gradients(
    motion: OptimalMotion, time_ratio: float
) -> tuple[Gradient, ...]:
    """Derive the gradients of the end time.

    Parameters
    ----------
    motion : OptimalMotion
    time_ratio : float
        Factor on all derivatives; see `explain_motion`.
    """
    gradients = []
    unknown = ""
    if isinstance(motion.value, LeastTime) and any(
        phase.joint_map.r for phase in motion.program.phases
    ):
        unknown = "the multipliers are not known"
    for subject in list_movable(motion.problem):
        note = find_obstacle(motion.problem, subject) or unknown
        if note:
            gradients.append(Gradient(subject, "pose", "m", None, note))
            continue
        for figure, unit in COORDINATES.items():
            derivative = _differentiate(motion, subject, figure)
            if derivative is not None:
                gradients.append(
                    Gradient(subject, figure, unit, time_ratio * derivative)
                )
    if motion.problem.robot.has_masses and not unknown:
        derivative = _by_mass(motion)
        if derivative is not None:
            gradients.append(Gradient("payload", "mass", "kg", time_ratio * derivative))
    return tuple(gradients)


def _differentiate(motion: OptimalMotion, subject: str, figure: str) -> float | None:
    """Differentiate t_E with respect to a coordinate of a placement; None if the task space does not allow a change."""
    pivot = pivot_of(motion.problem, subject)

    def change(step: float) -> Problem:
        """Return the problem after a step of the coordinate, m or rad."""
        transform = transform_about({figure: step}, pivot)
        return _with_parts(
            motion.problem, lambda part: _move_part(part, subject, transform)
        )

    return _central_difference(motion, change, motion.step)


def _by_mass(motion: OptimalMotion) -> float | None:
    """Differentiate t_E with respect to the mass of all payloads, or of a first payload at the tool frame."""
    step = _KILOGRAMS * motion.step

    def change(difference: float) -> Problem:
        """Return the problem with a heavier payload, kg."""
        # Both masses are above the present one, so that a first payload has a positive mass.
        added = difference + 1.001 * step
        return _with_parts(motion.problem, lambda part: _load_part(part, added))

    return _central_difference(motion, change, step)


def _central_difference(
    motion: OptimalMotion, change: Callable[[float], Problem], step: float
) -> float | None:
    """Return half the difference of both sides; None if the problem cannot be changed or its value is not known."""
    try:
        after = motion.value_of(change(step), has_new_limits=True)
        before = motion.value_of(change(-step), has_new_limits=True)
    except (InputError, UnreachableError):
        return None
    derivative = (after - before) / (2.0 * step)
    return derivative if np.isfinite(derivative) else None


def _with_parts(problem: Problem, change: Callable[[Problem], Problem]) -> Problem:
    """Return the problem with all of its parts changed."""
    for number, part in enumerate(problem.parts):
        problem = problem.with_part(number, change(part))
    return problem


def _has_tool_path(part: Problem) -> bool:
    """Tell whether the tool follows a path."""
    return bool(part.task_map.m and part.task_map.is_of_tool)


def _is_carried(
    frames: Mapping[str, FramePlacement], inner: str | None, outer: str
) -> bool:
    """Tell whether a frame moves with another frame."""
    while inner is not None and inner != outer:
        inner = frames[inner].frame
    return inner is not None


def _moves_with(part: Problem, subject: str) -> bool:
    """Tell whether the path of a part moves relative to the base if something moves."""
    if not _has_tool_path(part):
        return False
    if subject in (BASE, PATH):
        return subject == BASE or part.task.path_frame is None
    return _is_carried(part.task.frames, part.task.path_frame, subject)


def _move_part(part: Problem, subject: str, transform: SE3) -> Problem:
    """Return a part after something was moved by a transform in the world.

    Raises
    ------
    PathError
        The path would leave the rows of the task space.
    """
    relative = transform.inverse() if subject == BASE else transform
    if _moves_with(part, subject):
        path = _move_path(part, relative)
        part = replace(part, path=path)
    if subject == PATH:
        return part
    task = move_in_task(part.task, subject, transform)
    if subject == BASE:
        robot = with_settings(part.robot, mounting=task.robot.mounting)
        return replace(part, task=task, robot=robot)
    return replace(part, task=task)


def _move_path(part: Problem, transform: SE3) -> Path:
    """Return the path of a part, moved by a transform in the world."""
    placement = Placement.model_validate(transform)
    frame = PathFrame.of(placement, part.task_map.rows)
    before = part.path.frame
    if before is not None:
        frame = PathFrame(frame.turn @ before.turn, frame.to_world(before.origin))
    return replace(part.path, frame=frame)


def _load_part(part: Problem, mass: float) -> Problem:
    """Return a part with a payload that is heavier by a mass, kg; see `_by_mass`."""
    payload = part.robot.settings.payload or Payload(mass=mass)
    if part.robot.settings.payload is not None:
        payload = payload.model_copy(update={"mass": payload.mass + mass})
    return replace(part, robot=with_settings(part.robot, payload=payload))
