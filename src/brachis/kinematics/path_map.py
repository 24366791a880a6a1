"""Joint motion along a path of the tool as a function of y = (s, sigma).

The self-motion of the arm is measured by r functions of the joints. At every s they are linear:

    sigma = C(s) q - p(s).

J_aug = [J; C], with the task Jacobian J, must be regular. With xi = dz/ds, and primes for derivatives with respect to s
alone, e = C' q - p' and e' = C'' q - p'':

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

with the derivatives V_q, A_q, A_v of task velocity and acceleration (`TaskMap`). If C is constant, the lower parts
vanish. In the decomposition of the paper, each row of C selects a joint (`closed_form`). In this case G_nr = J_nr^-1
[xi, -J_r], and so on.
"""

from __future__ import annotations

from abc import abstractmethod
from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property
from typing import ClassVar, Self

import numpy as np

from brachis.common.arrays import LastCall
from brachis.errors import UnreachableError
from brachis.kernel import (
    Branch,
    Fault,
    PathMotion,
    find_least_singular,
)
from brachis.kinematics.joint_map import JointDerivatives, JointMap, JointState
from brachis.path import Path, PathSample
from brachis.robot import TaskMap


@dataclass(frozen=True)
class PathState(JointState):
    """Motion of all joints along a path at K times.

    Attributes
    ----------
    motion : PathMotion
    """

    motion: PathMotion

    @cached_property
    def least_singular(self) -> tuple[np.ndarray, np.ndarray]:
        """The smallest singular value of J_aug at each point, (K,), and its right singular vector, (K, n)."""
        return find_least_singular(self.motion.inverse)


class PathMap(JointMap):
    """The `JointMap` of a path of the tool and a measure of self-motion.

    Parameters
    ----------
    task_map : TaskMap
        Task map of the robot.
    path : Path
    start : (n,) ndarray
        Posture at, or close to, the beginning.

    Attributes
    ----------
    branch_of : Branch or None
        Description of the branch for the kernel; None in a chart.
    side : float
        Required sign of det J_aug; 0 if both are allowed.
    faults : dict of Fault to str
        Text of the message for each fault.
    sample_at : LastCall
        Function that samples the path and caches its last result, because all iterates of a program over the path have
        the same s.
    """

    path: Path
    branch_of: Branch | None = None
    side: float = 0.0
    faults: ClassVar[Mapping[Fault, str]]
    sample_at: LastCall[PathSample]

    def __init__(self, task_map: TaskMap, path: Path, start: np.ndarray) -> None:
        self.robot = task_map.robot
        self.task_map = task_map
        self.path = path
        self.start = start
        self.sample_at = LastCall(path.sample)

    @abstractmethod
    def kernel_inputs(self, y: np.ndarray, sample: PathSample) -> dict[str, np.ndarray]:
        """Return the arrays from which the kernel computes postures; see `PathMotion`.

        Parameters
        ----------
        y : (K, 1 + r) ndarray
        sample : PathSample
            The path, sampled at these points.
        """

    def write_answers(self, motion: PathMotion) -> None:
        """Write into a prepared motion the solutions that the kernel cannot compute."""

    def postures(self, y: np.ndarray) -> np.ndarray:
        """Return joint positions, (K, n), for curves y, (K, 1 + r), at successive times.

        Parameters
        ----------
        y : (K, 1 + r) ndarray

        Returns
        -------
        (K, n) ndarray
            Joint positions; NaN if there is no posture for the curves.
        """
        sample = self.path.sample(y[:, 0])
        return self._prepare({"y": y}, sample).find_postures().copy()

    def _prepare(
        self,
        inputs: dict[str, np.ndarray],
        sample: PathSample,
    ) -> PathMotion:
        """Prepare a motion from inputs such as curves and times, and from samples of the path."""
        motion = PathMotion.prepare(
            self.robot.chain,
            self.task_map.prescribed,
            inputs | self.kernel_inputs(inputs["y"], sample),
            branch=self.branch_of,
            side=self.side,
        )
        self.write_answers(motion)
        return motion

    def along(self, path: Path, start: np.ndarray) -> Self:
        """Return the same map for a part of its path that begins at, or close to, a posture, (n,)."""
        submap = super().along(path, start)
        submap.sample_at = LastCall(path.sample)
        return submap

    def state(
        self,
        *curves: np.ndarray,
        t: np.ndarray | None = None,
        near: np.ndarray | None = None,
    ) -> PathState:
        """Return the joint motion at K times; see `JointMap.state` and the formulas of the module.

        Without `t` and `near`, successive times must be so close that no joint turns by more than pi between them.
        """
        y, ydot, yddot, ydddot = curves
        sample = self.sample_at(y[:, 0])
        inputs = {
            "y": y,
            "ydot": ydot,
            "yddot": yddot,
            "xi": sample.xi,
            "xi_ds": sample.xi_ds,
            "xi_dds": sample.xi_dds,
        }
        branch = self.branch_of
        if near is not None:
            inputs["near"] = near
        elif t is not None and branch is not None and branch.ranged.any():
            inputs["t"] = t
        motion = self._prepare(inputs, sample)
        fault = motion.evaluate()
        if fault is not None:
            raise UnreachableError(self.faults[fault])
        joint_motion = (motion.q, motion.qdot, motion.qddot, motion.gradient)
        return PathState(self, y, ydot, yddot, ydddot, *joint_motion, motion)

    def derivatives(self, state: PathState) -> JointDerivatives:
        """Return the exact derivatives of a state; see the formulas of the module."""
        return JointDerivatives(*state.motion.derivatives())
