"""Joint motion along a path as a function of y = (s, q_r): the joint space decomposition.

The non-redundant joints follow from the closed form, q_nr = IK(z(s), q_r). With J = [J_r | J_nr] the task Jacobian
and xi = dz/ds, the formulas of `path_map` become

    G = dq/dy:        G_r = (0, I),  G_nr = J_nr^-1 [xi, -J_r]
    qdot            = G ydot
    qddot_nr        = J_nr^-1 (xi_ds sdot^2 + xi sddot - J_r qddot_r - Jdot qdot)
    dqdot_nr/dy     = J_nr^-1 ([xi_ds sdot, 0] - V_q G)
    dqddot_nr/dydot = J_nr^-1 ([2 xi_ds sdot, 0] - A_v G)
    dqddot_nr/dy    = J_nr^-1 ([xi_dds sdot^2 + xi_ds sddot, 0] - A_q G - A_v dqdot/dy)

Rows of redundant joints are constant: their derivatives vanish.
"""

from __future__ import annotations

import numpy as np

from brachis.errors import UnreachableError
from brachis.ik import IKSolver
from brachis.kernel import Conditions, PathMotion, follow_turns, pick_nearest, set_turns
from brachis.kinematics.joint_map import JointState
from brachis.kinematics.path_map import PathMap
from brachis.path import Path, PathSample
from brachis.robot import TaskMap
from brachis.robot.joints import complement, in_turn_of


class ClosedFormMap(PathMap):
    """Robot, path, closed form and branch, put together: the `JointMap` with y = (s, q_r).

    Parameters
    ----------
    task_map : TaskMap
        Of the robot.
    path : Path
    solver : IKSolver
    redundant : tuple of int
        Indices of the redundant joints, ascending.
    branch : int
        Index into ``solver.branches``.
    start : (n,) ndarray
        Start posture; turns of its angles by 2 pi are chosen to begin nearest to it.
    """

    no_posture = "the target is out of the branch's reach"

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
        self._conditions = Conditions(np.eye(robot.n)[self.redundant])
        self._turning = robot.revolute[self.nonredundant].astype(float)
        self._turns = np.isin(np.arange(robot.n), self.nonredundant) & robot.revolute
        limits = robot.limits
        ends = limits.position_lower, limits.position_upper
        self._ranged = self._turns & np.isfinite(ends).any(axis=0)

    def branch_margins(self, q: np.ndarray) -> np.ndarray:
        """Margins of the branch, (K, b), in postures (K, n)."""
        return self.solver.branch_margins(q, self.branch)

    def start_margins(self) -> np.ndarray:
        """Margins of the branch at the start."""
        return self.branch_margins(self.start[None])[0]

    def margins(self, state: JointState) -> np.ndarray:
        """Margins of the branch."""
        return self.branch_margins(state.q)

    def margin_gradient(self, state: JointState) -> tuple[np.ndarray, None]:
        """Differentiate the margins of the branch; they do not depend on s."""
        return self.solver.margin_gradient(state.q, self.branch), None

    def coordinates(self, s: float, q: np.ndarray) -> np.ndarray:
        """Value of y = (s, q_r), (1 + r,), in a posture, (n,)."""
        return np.append(s, q[self.redundant])

    def postures(
        self,
        y: np.ndarray,
        sample: PathSample | None = None,
        *,
        near: np.ndarray | None = None,
    ) -> np.ndarray:
        """Joint positions at K successive times, continuous from the start posture on.

        Of the alternatives in the branch the one nearest to its predecessor is taken, or to `near` if that is given.
        Redundant joints are never NaN.
        """
        sample = sample or self.path.sample(y[:, 0])
        answers = self.solver.solve_branch(sample.target, y[:, 1:], self.branch)
        if self.solver.alternatives == 1:
            answers = answers[:, 0]
        else:
            reference = self.start[None] if near is None else near
            answers = pick_nearest(
                answers,
                self._turning,
                reference[:, self.nonredundant],
                follows=near is None,
            )
        q = np.empty((len(y), self.robot.n))
        q[:, self.redundant] = y[:, 1:]
        q[:, self.nonredundant] = answers
        follow_turns(q, self._turns, self.start)
        return q

    def conditions(self, _s: np.ndarray, _q: np.ndarray) -> Conditions:
        """Return rows that each select a redundant joint."""
        return self._conditions

    def choose_turns(
        self,
        q: np.ndarray,
        motion: PathMotion,
        t: np.ndarray | None,
        near: np.ndarray | None,
    ) -> np.ndarray:
        """Choose turns that follow `near`, or the angles' own velocities; the quintic's rule predicts each step."""
        if near is not None:
            return in_turn_of(q, near, self._turns)
        if t is None or not self._ranged.any():
            return q  # no limit asks which turn an angle is in
        masks = self._turns, self._ranged
        rates = motion.qdot, motion.qddot
        if not set_turns(q, rates, t, self.start, *masks):
            raise UnreachableError(
                "a joint turns too far between collocation points to count its turns"
            )
        return q
