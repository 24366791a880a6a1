"""The interface of joint maps, which turn curves y(t) into joint motion and its exact derivatives.

With qddot = f(y, ydot, yddot), the third order needs no separate formulas. Let D be d/dt along the motion. Then d(D
f)/dy = D(df/dy), d(D f)/dydot = D(df/dydot) + df/dy, and so on. Hence

    qdddot            = f_y ydot + f_ydot yddot + G ydddot
    dqdddot/dydddot   = G
    dqdddot/dyddot    = 3 dqdot/dy
    dqdddot/dydot     = 3 dqddot/dy
    dqdddot/dy        = D(dqddot/dy)

Only the last line is a new quantity. It is computed by differences along the motion.

Along a path of the tool, either y = (s, q_r) and the closed form gives the other joints (`closed_form`), or y = (s,
sigma) (`chart`). Along a path of all joints, y = (s). Without a path, y = q. The code that builds, solves and refines
programs accepts any of these maps.
"""

from __future__ import annotations

import copy
from abc import ABC, abstractmethod
from dataclasses import dataclass
from functools import cached_property
from typing import Any, NamedTuple, Self

import numpy as np

from brachis.common.arrays import apply_each, rates
from brachis.kernel import FormulaQuantity, MotionSlopes, ValueGroups
from brachis.path import Path, PathSample
from brachis.robot import Robot
from brachis.robot.dynamics import SharedTorques


@dataclass(frozen=True)
class JointState(SharedTorques):
    """Motion of all joints at K times.

    Attributes
    ----------
    joint_map : JointMap
        The map that computed the motion.
    y, ydot, yddot, ydddot : (K, c) ndarray
        The c freely chosen curves and their time derivatives.
    q, qdot, qddot : (K, n) ndarray
    gradient : (K, n, c) ndarray
        G = dq/dy.
    """

    joint_map: JointMap
    y: np.ndarray
    ydot: np.ndarray
    yddot: np.ndarray
    ydddot: np.ndarray
    q: np.ndarray
    qdot: np.ndarray
    qddot: np.ndarray
    gradient: np.ndarray

    @property
    def s(self) -> np.ndarray:
        """Path coordinate, (K,); NaN without a path."""
        if self.joint_map.path is None:
            return np.full(len(self.y), np.nan)
        return self.y[:, 0]

    @property
    def curves(self) -> tuple[np.ndarray, ...]:
        """The curves y and their first three time derivatives, (K, c) each."""
        return self.y, self.ydot, self.yddot, self.ydddot

    @cached_property
    def derivatives(self) -> JointDerivatives:
        """Exact derivatives of the joint motion with respect to the curves."""
        return self.joint_map.derivatives(self)

    @property
    def slopes(self) -> MotionSlopes:
        """The exact derivatives except those of the jerk, in the form that the kernel needs."""
        return MotionSlopes(self.gradient, *self.derivatives)

    def values_of(self, groups: ValueGroups) -> list[np.ndarray]:
        """Compute the values of limits, (K, size) for each group. They are not set for a group with partials."""
        states = [self.q, self.qdot, self.qddot]
        if groups.has_jerk:
            states.append(self.qdddot)
        torque = None if groups.chain is None else self.torque_of(groups.chain)
        return groups.values(states, torque)

    @cached_property
    def qdddot(self) -> np.ndarray:
        """Jerk of all joints, (K, n)."""
        exact = self.derivatives
        return (
            apply_each(exact.qddot_y, self.ydot)
            + apply_each(exact.qddot_ydot, self.yddot)
            + apply_each(self.gradient, self.ydddot)
        )

    @cached_property
    def qdddot_y(self) -> np.ndarray:
        """The derivative of the jerk with respect to y, (K, n, c). Raises UnreachableError as `JointMap.state` does."""
        near = np.tile(self.q, (2, 1))

        def slopes(*curves: np.ndarray) -> tuple[np.ndarray]:
            """Return dqddot/dy, (2 K, n, c), at neighbouring instants."""
            return (self.joint_map.state(*curves, near=near).derivatives.qddot_y,)

        return rates(slopes, self.curves)[0]


class JointDerivatives(NamedTuple):
    """Derivatives of a `JointState`, (K, n, c) each, except dqdot/dydot = dqddot/dyddot = G.

    Attributes
    ----------
    qdot_y, qddot_y, qddot_ydot : (K, n, c) ndarray
    """

    qdot_y: np.ndarray
    qddot_y: np.ndarray
    qddot_ydot: np.ndarray


class JointMap(ABC):
    """Joint motion as a function of curves y, with c = 1 + r along a path, and c = n without one.

    Attributes
    ----------
    robot : Robot
    start : (n,) ndarray
        Posture at, or close to, the beginning. It determines the number of full turns of each angle.
    path : Path or None
        Path whose path coordinate s is y[0]. None without a path, in which case y does not contain s.
    r : int
        Number of freely chosen joints.
    redundant_joints : tuple of str
        Names of the joints that are themselves among the curves.
    branch_label : str
        Label of the branch to which `margins` belong; empty if there are no margins.
    """

    robot: Robot
    start: np.ndarray
    path: Path | None = None
    r: int = 0
    redundant_joints: tuple[str, ...] = ()
    branch_label: str = ""

    @property
    def curve_names(self) -> tuple[str, ...]:
        """Names of the curves: s along a path, then the redundant joints, or sigma_1, sigma_2, ... in a chart."""
        if self.path is None:
            return self.redundant_joints
        sigma = (f"sigma_{number}" for number in range(1, 1 + self.r))
        return ("s", *(self.redundant_joints or sigma))

    @property
    def is_move(self) -> bool:
        """Whether all joints are chosen freely."""
        return self.r == self.robot.n

    def self_motion_rows(self, _s: float) -> np.ndarray:
        """Return the linear combinations of the joints, (r, n), whose values are the redundant curves at s."""
        return np.empty((0, self.robot.n))

    @abstractmethod
    def coordinates(self, s: float, q: np.ndarray) -> np.ndarray:
        """Return the values of the curves, (c,), in a posture, (n,), at path coordinate s; NaN for a posture of NaN."""

    @abstractmethod
    def postures(self, y: np.ndarray) -> np.ndarray:
        """Return joint positions, (K, n), for curves, (K, c), at successive times; NaN if there is no posture."""

    @abstractmethod
    def state(
        self,
        *curves: np.ndarray,
        t: np.ndarray | None = None,
        near: np.ndarray | None = None,
    ) -> JointState:
        """Return the joint motion at K times.

        Parameters
        ----------
        *curves : (K, c) ndarray
            y, ydot, yddot and ydddot.
        t : (K,) ndarray, optional
            Times in s, ascending from the start. They are used to count turns.
        near : (K, n) ndarray, optional
            Postures known to be close. They determine the turns, so the times may be arbitrary.

        Raises
        ------
        UnreachableError
            There is no posture for the curves at one of the times.
        """

    @abstractmethod
    def derivatives(self, state: Any) -> JointDerivatives:
        """Return the exact derivatives of a state that this map computed."""

    def along(self, path: Path, start: np.ndarray) -> Self:
        """Return the same map for a part of its path that begins at, or close to, a posture, (n,)."""
        submap = copy.copy(self)
        submap.path = path
        submap.start = start
        return submap

    def start_margins(self) -> np.ndarray:
        """Return the margins, (b,), at the start. Margins vanish where the map ends; b = 0 if it ends nowhere."""
        return np.empty(0)

    def margins(self, state: Any) -> np.ndarray:
        """Return the margins, (K, b), of a state that this map computed; see `start_margins`."""
        return np.empty((len(state.q), 0))

    def margin_quantity(self) -> FormulaQuantity | None:
        """Describe the margins as a quantity of the kernel; None if the kernel does not compute them."""
        return None

    def margin_gradient(self, state: Any) -> tuple[np.ndarray, np.ndarray | None]:
        """Differentiate `margins` with respect to q, (K, b, n), and s, (K, b); None stands for zeros."""
        return np.empty((len(state.q), 0, self.robot.n)), None


@dataclass(frozen=True)
class JointSpaceState(JointState):
    """Joint motion at K times, together with the path at these times."""

    path: PathSample


class JointSpaceMap(JointMap):
    """The `JointMap` of a path of all joints, q = q(s). Only s(t) is free: y = (s).

    With the derivatives q_ds, q_dds and q_ddds of the path with respect to s,

        G = q_ds,    qdot = q_ds sdot,    qddot = q_ds sddot + q_dds sdot^2
        dqdot/ds = q_dds sdot,    dqddot/dsdot = 2 q_dds sdot,    dqddot/ds = q_dds sddot + q_ddds sdot^2

    Parameters
    ----------
    robot : Robot
    path : Path
        Path whose targets are joint positions.
    """

    path: Path

    def __init__(self, robot: Robot, path: Path) -> None:
        self.robot = robot
        self.path = path
        self.start = path.sample(np.zeros(1)).target[0]

    def coordinates(self, s: float, _q: np.ndarray) -> np.ndarray:
        """Return y = (s), because s is the only curve."""
        return np.array([s])

    def postures(self, y: np.ndarray) -> np.ndarray:
        """Return the targets of the path."""
        return self.path.sample(y[:, 0]).target

    def state(self, *curves: np.ndarray, **_options: object) -> JointSpaceState:
        """Return the motion along the path. The path also prescribes the turns of the joints."""
        y, ydot, yddot, ydddot = curves
        path = self.path.sample(y[:, 0])
        qdot = path.xi * ydot
        qddot = path.xi * yddot + path.xi_ds * ydot**2
        gradient = path.xi[:, :, None]
        motion = (path.target, qdot, qddot, gradient)
        return JointSpaceState(self, y, ydot, yddot, ydddot, *motion, path)

    def derivatives(self, state: JointSpaceState) -> JointDerivatives:
        """Return the exact derivatives; see the formulas above."""
        path = state.path
        qdot_y = path.xi_ds * state.ydot
        qddot_y = path.xi_dds * state.ydot**2 + path.xi_ds * state.yddot
        slopes = (qdot_y, qddot_y, 2.0 * qdot_y)
        return JointDerivatives(*(slope[:, :, None] for slope in slopes))
