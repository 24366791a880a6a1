"""Joint motion along a path of the tool as a function of y = (s, sigma).

The self-motion of the arm is measured by r functions of the joints, which are linear at every s:

    sigma = C(s) q - p(s).

J_aug = [J; C], with the task Jacobian J, has to be regular. With xi = dz/ds and derivatives by s alone, e = C' q - p'
and e' = C'' q - p'':

    G = dq/dy       = J_aug^-1 [xi, 0; -e, I]
    qdot            = G ydot
    qddot           = G yddot + J_aug^-1 (xi_ds sdot^2 - Jdot qdot;  -2 C' qdot sdot - e' sdot^2)

and, by differentiating J_aug qdot and J_aug qddot,

    dqdot/dydot     = dqddot/dyddot = G
    dqdot/dy        = J_aug^-1 (-V_q G + [xi_ds sdot, 0];  -C' G sdot - [C' qdot + e' sdot, 0])
    dqddot/dydot    = J_aug^-1 (-A_v G + [2 xi_ds sdot, 0];  -2 C' G sdot - [2 C' qdot + 2 e' sdot, 0])
    dqddot/dy       = J_aug^-1 (-A_q G - A_v dqdot/dy + [xi_dds sdot^2 + xi_ds sddot, 0];
                                -2 C' sdot dqdot/dy - (C'' sdot^2 + C' sddot) G
                                - [C' qddot + 2 C'' qdot sdot + e'' sdot^2 + e' sddot, 0])

with V_q, A_q, A_v the derivatives of task velocity and acceleration (`TaskMap`). Where C is constant the lower parts
vanish. The decomposition of the paper is the case of rows of C that each select a joint (`closed_form`): then
G_nr = J_nr^-1 [xi, -J_r], and so on.
"""

from __future__ import annotations

from abc import abstractmethod
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from brachis.errors import UnreachableError
from brachis.kinematics.joint_map import (
    JointDerivatives,
    JointMap,
    JointState,
    apply_each,
)
from brachis.path import Path, PathSample
from brachis.robot import TaskMap


@dataclass(frozen=True)
class Bend:
    """How the linear functions of the joints change along the path.

    Attributes
    ----------
    rows : (3, K, r, n) ndarray
        C', C'' and C'''.
    drift : (3, K, r) ndarray
        e, e' and e''.
    """

    rows: np.ndarray
    drift: np.ndarray


@dataclass(frozen=True)
class PathState(JointState):
    """Motion of all joints along a path at K times.

    Attributes
    ----------
    path : PathSample
    twists : (6, K, n) ndarray
        Columns of the tool frame's Jacobian; see `TaskMap.twists`.
    inverse : (K, n, n) ndarray
        J_aug^-1.
    bend : Bend or None
        None where C is constant and p = 0.
    """

    path: PathSample
    twists: np.ndarray
    inverse: np.ndarray
    bend: Bend | None

    @cached_property
    def least_singular(self) -> tuple[np.ndarray, np.ndarray]:
        """Least singular values (K,) of J_aug, and their right singular vectors (K, n)."""
        values, vectors = np.linalg.eigh(self.inverse @ np.swapaxes(self.inverse, 1, 2))
        return 1.0 / np.sqrt(values[:, -1]), vectors[:, :, -1]


class PathMap(JointMap):
    """A path of the tool and a measure of self-motion as a `JointMap`.

    Attributes
    ----------
    task_map : TaskMap
        Of the robot.
    no_posture : str
        The message where a posture does not exist.
    """

    path: Path
    task_map: TaskMap
    no_posture: str

    @abstractmethod
    def postures(
        self,
        y: np.ndarray,
        sample: PathSample | None = None,
        *,
        near: np.ndarray | None = None,
    ) -> np.ndarray:
        """Joint positions, (K, n), where the curves are y, (K, 1 + r).

        Parameters
        ----------
        y : (K, 1 + r) ndarray
        sample : PathSample, optional
            The path at ``y[:, 0]`` if already known.
        near : (K, n) ndarray, optional
            Postures known to be near; the times may then be any.

        Returns
        -------
        (K, n) ndarray
            NaN where the curves cannot be met.
        """

    @abstractmethod
    def invert(self, s: np.ndarray, jacobian: np.ndarray) -> np.ndarray:
        """Return J_aug^-1, (K, n, n); raises UnreachableError where it is singular, or changes its sign."""

    def bend(self, _s: np.ndarray, _q: np.ndarray) -> Bend | None:
        """Return how C changes along the path; None where it does not."""
        return None

    def choose_turns(
        self,
        q: np.ndarray,
        qdot: np.ndarray,
        qddot: np.ndarray,
        t: np.ndarray | None,
        near: np.ndarray | None,
    ) -> np.ndarray:
        """Return postures (K, n) with their angles in the turns that they should be in; see `JointMap.state`."""
        return q

    def state(
        self,
        y: np.ndarray,
        ydot: np.ndarray,
        yddot: np.ndarray,
        ydddot: np.ndarray,
        *,
        t: np.ndarray | None = None,
        near: np.ndarray | None = None,
    ) -> PathState:
        """Joint motion at K times; see `JointMap.state` and the module's formulas.

        Without `t` and `near`, successive times must be so close that no joint turns by pi in between.
        """
        s = y[:, 0]
        sample = self.path.sample(s)
        q = self.postures(y, sample, near=near)
        if not np.isfinite(q).all():
            raise UnreachableError(self.no_posture)
        twists = self.task_map.twists(q)
        inverse = self.invert(s, self.task_map.jacobian(twists))
        m = self.task_map.m
        sdot = ydot[:, :1]
        bend = self.bend(s, q)
        gradient = np.empty((len(q), self.robot.n, 1 + self.r))
        gradient[:, :, 0] = apply_each(inverse[:, :, :m], sample.xi)
        gradient[:, :, 1:] = inverse[:, :, m:]
        if bend:
            gradient[:, :, 0] -= apply_each(inverse[:, :, m:], bend.drift[0])
        qdot = apply_each(gradient, ydot)
        wanted = sample.xi_ds * sdot**2 - self.task_map.bias(twists, qdot)
        qddot = apply_each(gradient, yddot) + apply_each(inverse[:, :, :m], wanted)
        if bend:
            turned = 2.0 * sdot * apply_each(bend.rows[0], qdot)
            turned += bend.drift[1] * sdot**2
            qddot -= apply_each(inverse[:, :, m:], turned)
        q = self.choose_turns(q, qdot, qddot, t, near)
        motion = (y, ydot, yddot, ydddot, q, qdot, qddot, gradient)
        return PathState(self, *motion, sample, twists, inverse, bend)

    def derivatives(self, state: PathState) -> JointDerivatives:
        """Exact derivatives of a state; see the module's formulas."""
        task = self.task_map.derivatives(state.twists, state.qdot, state.qddot)
        path = state.path
        gradient = state.gradient
        sdot = state.ydot[:, :1]
        sddot = state.yddot[:, :1]
        inverse = state.inverse[:, :, : self.task_map.m]
        rows_inverse = state.inverse[:, :, self.task_map.m :]
        bend = state.bend

        right = -task.velocity_q @ gradient
        right[:, :, 0] += path.xi_ds * sdot
        qdot_y = inverse @ right
        right = -task.acceleration_qdot @ gradient
        right[:, :, 0] += 2.0 * path.xi_ds * sdot
        qddot_ydot = inverse @ right
        if bend:
            first, second, _ = bend.rows
            _, e_ds, e_dds = bend.drift
            along = sdot[:, :, None]
            rows = first @ gradient * along
            rows[:, :, 0] += apply_each(first, state.qdot) + e_ds * sdot
            lower = rows_inverse @ rows
            qdot_y -= lower
            qddot_ydot -= 2.0 * lower
        right = -task.acceleration_q @ gradient - task.acceleration_qdot @ qdot_y
        right[:, :, 0] += path.xi_dds * sdot**2 + path.xi_ds * sddot
        qddot_y = inverse @ right
        if bend:
            rows = 2.0 * along * (first @ qdot_y)
            rows += (second * along**2 + first * sddot[:, :, None]) @ gradient
            rows[:, :, 0] += apply_each(first, state.qddot)
            rows[:, :, 0] += 2.0 * sdot * apply_each(second, state.qdot)
            rows[:, :, 0] += e_dds * sdot**2 + e_ds * sddot
            qddot_y -= rows_inverse @ rows
        return JointDerivatives(qdot_y, qddot_y, qddot_ydot)
