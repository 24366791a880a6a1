"""The check of a closed form before it is used: its solutions, and the slopes of its margins, in random postures."""

from __future__ import annotations

import numpy as np

from brachis.ik.protocol import (
    FormulaMargins,
    FormulaSolver,
    IKSolver,
    NotApplicableError,
)
from brachis.ik.snapping import PolishedSolver
from brachis.robot import Robot, TaskMap
from brachis.robot.joints import complement, difference

_SLOPES = 10
"""Number of postures inside each branch in which the slopes of its margins are checked."""


def _compute_margins(solver: IKSolver, q: np.ndarray, branch: int) -> np.ndarray:
    """Compute branch margins, (K, k), without recording a formula, which is faster for a single call.

    Raises
    ------
    NotApplicableError
        The margins have the wrong shape.
    """
    if isinstance(solver, FormulaMargins):
        return solver.margins(q) * solver.margin_signs(branch)
    margins = solver.branch_margins(q, branch)
    if np.ndim(margins) != 2 or len(margins) != len(q):
        raise NotApplicableError(
            f"its branch_margins have the shape {np.shape(margins)}, not ({len(q)}, k)"
        )
    return margins


def _compute_answers(
    solver: IKSolver, targets: np.ndarray, q_r: np.ndarray
) -> np.ndarray:
    """Compute the solutions of all branches, (K, B, A, m), without recording a formula."""
    if not isinstance(solver, FormulaSolver):
        return solver.solve(targets, q_r)
    with np.errstate(invalid="ignore", divide="ignore"):
        return solver.answers(targets, q_r)


def check_answers(
    robot: Robot,
    task_map: TaskMap,
    redundant: tuple[int, ...],
    solver: IKSolver,
) -> None:
    """Check a solver's solutions for random postures with Pinocchio's forward kinematics.

    Postures next to the boundary of a branch are left out: there, rounding decides whether a solution exists.

    Parameters
    ----------
    robot, task_map : Robot, TaskMap
    redundant : tuple of int
        Indices of the redundant joints.
    solver : IKSolver

    Raises
    ------
    NotApplicableError
        Two branches have the same label, a solution misses its target by more than 1e-8 m or rad, none of the solutions
        is the posture itself, or the slopes of the branch margins are wrong.
    """
    if not isinstance(solver, IKSolver):
        raise NotApplicableError(f"it returned {solver!r:.60}, not an IKSolver")
    if len(set(solver.branches)) < len(solver.branches):
        raise NotApplicableError(
            f"two of its branches have the same label: {', '.join(solver.branches)}"
        )
    q = _postures_inside(robot, solver)
    non_redundant = complement(robot.n, redundant)
    targets = task_map.of_placements(*robot.tool_placements(q))
    answers = _compute_answers(solver, targets, q[:, list(redundant)])
    expected = (len(q), len(solver.branches), solver.alternatives, len(non_redundant))
    if answers.shape != expected:
        raise NotApplicableError(
            f"its solutions have the shape {answers.shape}, not {expected}"
        )
    turning = robot.revolute[non_redundant]
    off = np.abs(difference(answers, q[:, None, None, non_redundant], turning)).max(
        axis=3
    )
    if not np.all(np.nanmin(np.where(np.isnan(off), np.inf, off), axis=(1, 2)) < 1e-6):
        raise NotApplicableError(
            "its solutions do not contain all postures that reach the target"
        )
    exists = np.isfinite(answers).all(axis=3)
    sample = np.nonzero(exists)[0]
    reached = q[sample]
    reached[:, non_redundant] = answers[exists]
    placed = task_map.of_placements(*robot.tool_placements(reached))
    miss = np.abs(task_map.difference(placed, targets[sample])).max()
    if not miss < 1e-8:
        raise NotApplicableError(
            f"its solutions miss the target by {miss:.1e} m or rad; allowed: less than 1e-8"
        )
    _check_slopes(solver, q)


def _check_slopes(solver: IKSolver, q: np.ndarray) -> None:
    """Compare the slopes of the branch margins with central differences, in postures, (K, n).

    Slopes that are derived from formulas are not checked: they need no check, and recording them takes time.

    Raises
    ------
    NotApplicableError
        The slopes have the wrong shape, or are wrong in most postures inside a branch.
    """
    if isinstance(solver, PolishedSolver):
        solver = solver.ideal
    if type(solver).margin_gradient is FormulaMargins.margin_gradient:
        return
    n = q.shape[1]
    step = 1e-5
    for branch, label in enumerate(solver.branches):
        margins = _compute_margins(solver, q, branch)
        inside = q[margins.min(axis=1, initial=np.inf) > 1e-2][:_SLOPES]
        if not len(inside):
            continue
        slopes = solver.margin_gradient(inside, branch)
        expected = (len(inside), margins.shape[1], n)
        if np.shape(slopes) != expected:
            raise NotApplicableError(
                f"its margin_gradient has the shape {np.shape(slopes)}, not {expected}"
            )
        rises = [
            _compute_margins(solver, inside + move, branch)
            - _compute_margins(solver, inside - move, branch)
            for move in step * np.eye(n)
        ]
        differences = np.stack(rises, axis=2) / (2.0 * step)
        largest = np.abs(differences).max(axis=(1, 2), initial=0.0)
        miss = np.abs(slopes - differences).max(axis=(1, 2), initial=0.0)
        is_wrong = ~(miss <= 1e-3 * largest + 1e-6)
        if 2 * is_wrong.sum() > len(inside):
            raise NotApplicableError(
                f"its margin_gradient contradicts differences of its branch_margins in branch {label}, by up to "
                f"{miss.max():.1e}; margins must be analytic, without abs or comparisons"
            )


def _postures_inside(robot: Robot, solver: IKSolver) -> np.ndarray:
    """Return random postures, (K, n), that lie well inside a branch.

    Raises
    ------
    NotApplicableError
        No posture lies inside a branch.
    """
    low, high = ranges_to_check(robot)
    q = np.random.default_rng(1).uniform(low, high, (100, robot.n))
    margins = [
        _compute_margins(solver, q, b).min(axis=1, initial=np.inf)
        for b in range(len(solver.branches))
    ]
    q = q[np.max(margins, axis=0) > 1e-2]
    if not len(q):
        raise NotApplicableError(
            "none of 100 random postures lies inside a branch, so the solver was not checked"
        )
    return q


def ranges_to_check(robot: Robot) -> tuple[np.ndarray, np.ndarray]:
    """Return whole turns for angles, and ranges for slides, because a boom need not be defined for negative lengths.

    Large ranges are cut to 20 m around zero, because positions in kilometres are not accurate to the tolerances.
    """
    lower = robot.limits.position_lower
    upper = robot.limits.position_upper
    ranged = ~robot.revolute & np.isfinite(lower) & np.isfinite(upper)
    near = np.clip(0.0, lower, upper)
    lower = np.maximum(lower, near - 20.0)
    upper = np.minimum(upper, near + 20.0)
    return np.where(ranged, lower, -np.pi), np.where(ranged, upper, np.pi)
