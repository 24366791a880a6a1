"""Joint motion along a path as a function of y = (s, q_r): the joint space decomposition.

The non-redundant joints follow from the closed form, q_nr = IK(z(s), q_r). With the task Jacobian J = [J_r | J_nr] and
xi = dz/ds, the formulas of `path_map` become

    G = dq/dy:        G_r = (0, I),  G_nr = J_nr^-1 [xi, -J_r]
    qdot            = G ydot
    qddot_nr        = J_nr^-1 (xi_ds sdot^2 + xi sddot - J_r qddot_r - Jdot qdot)
    dqdot_nr/dy     = J_nr^-1 ([xi_ds sdot, 0] - V_q G)
    dqddot_nr/dydot = J_nr^-1 ([2 xi_ds sdot, 0] - A_v G)
    dqddot_nr/dy    = J_nr^-1 ([xi_dds sdot^2 + xi_ds sddot, 0] - A_q G - A_v dqdot/dy)

The rows of redundant joints are constant, so their derivatives vanish.
"""

from __future__ import annotations

from dataclasses import replace
from typing import ClassVar, Self

import numpy as np

from brachis.ik import IKSolver
from brachis.kernel import Branch, Fault, FormulaQuantity, PathMotion
from brachis.kinematics.joint_map import JointState
from brachis.kinematics.path_map import PathMap
from brachis.path import Path, PathSample
from brachis.robot import TaskMap
from brachis.robot.joints import complement


class ClosedFormMap(PathMap):
    """The `JointMap` of a robot, a path, a closed form and a branch, with y = (s, q_r).

    Parameters
    ----------
    task_map : TaskMap
        Task map of the robot.
    path : Path
    solver : IKSolver
    redundant : tuple of int
        Indices of the redundant joints, ascending.
    branch : int
        Index into ``solver.branches``.
    start : (n,) ndarray
        Start posture. Full turns are added to the angles so that the motion begins as close as possible to it.
    """

    branch_of: Branch
    faults: ClassVar = {
        Fault.NO_POSTURE: "the target is out of the branch's reach",
        Fault.SINGULAR: "the Jacobian of the non-redundant joints is singular",
        Fault.TURNS_TOO_FAR: "a joint turns so far between collocation points that its turns cannot be counted",
    }

    def __init__(
        self,
        task_map: TaskMap,
        path: Path,
        solver: IKSolver,
        redundant: tuple[int, ...],
        branch: int,
        start: np.ndarray,
    ) -> None:
        super().__init__(task_map, path, start)
        robot = self.robot
        self.solver = solver
        self.redundant = list(redundant)
        self.nonredundant = complement(robot.n, redundant)
        self.r = len(redundant)
        self.redundant_joints = tuple(robot.joint_names[i] for i in redundant)
        self.branch = branch
        self.branch_label = solver.branches[branch]
        self._rows = np.eye(robot.n, robot.n + 1)[self.redundant]
        turns = np.isin(np.arange(robot.n), self.nonredundant) & robot.revolute
        limits = robot.limits
        ends = limits.position_lower, limits.position_upper
        coordinates = task_map.prescribed.coordinates
        formula = solver.branch_formula(branch, coordinates, self.r)
        self.branch_of = Branch(
            np.array(self.redundant, dtype=int),
            np.array(self.nonredundant),
            turns,
            turns & np.isfinite(ends).any(axis=0),
            start,
            solver.alternatives,
            formula,
        )

    def along(self, path: Path, start: np.ndarray) -> Self:
        """Return the same map for a part of its path that begins at, or close to, a posture, (n,)."""
        submap = super().along(path, start)
        submap.branch_of = replace(self.branch_of, start=start)
        return submap

    def branch_margins(self, q: np.ndarray) -> np.ndarray:
        """Return the margins of the branch, (K, b), in postures, (K, n)."""
        return self.solver.branch_margins(q, self.branch)

    def start_margins(self) -> np.ndarray:
        """Return the margins of the branch in the start posture."""
        return self.branch_margins(self.start[None])[0]

    def margins(self, state: JointState) -> np.ndarray:
        """Return the margins of the branch, (K, b), for a state."""
        return self.branch_margins(state.q)

    def margin_gradient(self, state: JointState) -> tuple[np.ndarray, None]:
        """Differentiate the margins of the branch with respect to q. They do not depend on s."""
        return self.solver.margin_gradient(state.q, self.branch), None

    def margin_quantity(self) -> FormulaQuantity | None:
        """Return the margins of the branch in the form that the kernel needs."""
        return self.solver.margin_formulas(self.branch, self.robot.n)

    def self_motion_rows(self, _s: float) -> np.ndarray:
        """Return the rows, (r, n), that select the redundant joints."""
        return self._rows[:, :-1]

    def coordinates(self, s: float, q: np.ndarray) -> np.ndarray:
        """Return y = (s, q_r), (1 + r,), in a posture, (n,)."""
        return np.append(s, q[self.redundant])

    def kernel_inputs(
        self, _y: np.ndarray, sample: PathSample
    ) -> dict[str, np.ndarray]:
        """Return the targets and the rows. Each row selects a redundant joint."""
        return {"targets": sample.target, "rows": self._rows}

    def write_answers(self, motion: PathMotion) -> None:
        """Write the solutions if the kernel has no formula for computing them."""
        if self.branch_of.answers_of is None:
            targets = motion.inputs["targets"]
            q_r = motion.inputs["y"][:, 1:]
            answers = self.solver.solve_branch(targets, q_r, self.branch)
            if np.shape(answers) != motion.answers.shape:
                raise ValueError(
                    f"{type(self.solver).__name__}.solve_branch returned the shape {np.shape(answers)}; "
                    f"needed: {motion.answers.shape}"
                )
            motion.answers[:] = answers
