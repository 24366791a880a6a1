"""Putting a closed form to the test: no answer is believed."""

from __future__ import annotations

import numpy as np

from brachis.ik.protocol import IKSolver, NotApplicableError
from brachis.ik.screws import ChainGeometry
from brachis.robot import Robot, TaskMap
from brachis.robot.joints import complement, difference

_CHECKED_POSTURES = 100
_INSIDE = 1e-2
_POSE_TOLERANCE = 1e-8
_FAR = 20.0
"""m."""


def check_answers(
    robot: Robot,
    task_map: TaskMap,
    redundant: tuple[int, ...],
    solver: IKSolver,
    *,
    postures: int = _CHECKED_POSTURES,
) -> None:
    """Put a solver's answers for random postures into Pinocchio's forward kinematics.

    Postures beside a branch's boundary are left out: there it is a matter of rounding whether there is an answer.

    Parameters
    ----------
    robot, task_map : Robot, TaskMap
    redundant : tuple of int
        Indices of the redundant joints.
    solver : IKSolver
    postures : int, optional
        How many.

    Raises
    ------
    NotApplicableError
        Two branches have one label, an answer misses its target by more than 1e-8 m or rad, or none of the answers is
        the posture itself.
    """
    low, high = _checked_ranges(robot)
    q = np.random.default_rng(1).uniform(low, high, (postures, robot.n))
    if len(set(solver.branches)) < len(solver.branches):
        raise NotApplicableError(
            f"its branches share labels: {', '.join(solver.branches)}"
        )
    margins = [
        solver.branch_margins(q, b).min(axis=1, initial=np.inf)
        for b in range(len(solver.branches))
    ]
    q = q[np.max(margins, axis=0) > _INSIDE]
    if not len(q):
        raise NotApplicableError("no random posture is inside a branch")
    rest = complement(robot.n, redundant)
    targets = task_map.of_placements(*robot.tool_placements(q))
    answers = solver.solve(targets, q[:, list(redundant)])
    expected = (len(q), len(solver.branches), solver.alternatives, len(rest))
    if answers.shape != expected:
        raise NotApplicableError(
            f"its answers have the shape {answers.shape}, not {expected}"
        )
    turning = ChainGeometry.of(robot).revolute[rest]
    own = np.abs(difference(answers, q[:, None, None, rest], turning)).max(axis=3)
    if not np.all(
        np.nanmin(np.where(np.isnan(own), np.inf, own), axis=(1, 2))
        < _POSE_TOLERANCE * 100
    ):
        raise NotApplicableError("its answers leave out postures that reach the target")
    exists = np.isfinite(answers).all(axis=3)
    sample = np.nonzero(exists)[0]
    reached = q[sample]
    reached[:, rest] = answers[exists]
    miss = np.abs(
        task_map.difference(
            task_map.of_placements(*robot.tool_placements(reached)), targets[sample]
        )
    ).max()
    if not miss < _POSE_TOLERANCE:
        raise NotApplicableError(f"its answers miss the target by {miss:.1e}")


def _checked_ranges(robot: Robot) -> tuple[np.ndarray, np.ndarray]:
    """Whole turns of angles, and what prismatic joints can reach: a boom need not know what a negative length is.

    Of far ranges what is near zero: positions in kilometres are not precise to the tolerances.
    """
    lower = robot.limits.position_lower
    upper = robot.limits.position_upper
    ranged = (
        (np.array(robot.position_units) == "m")
        & np.isfinite(lower)
        & np.isfinite(upper)
    )
    near = np.clip(0.0, lower, upper)
    lower = np.maximum(lower, near - _FAR)
    upper = np.minimum(upper, near + _FAR)
    return np.where(ranged, lower, -np.pi), np.where(ranged, upper, np.pi)
