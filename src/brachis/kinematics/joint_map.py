"""What a joint map is: curves y(t) in, joint motion and its exact derivatives out.

With qddot = f(y, ydot, yddot) the third order needs no formulas of its own. Where D is d/dt along the motion,
d(D f)/dy = D(df/dy) and d(D f)/dydot = D(df/dydot) + df/dy, and so on; hence

    qdddot            = f_y ydot + f_ydot yddot + G ydddot
    dqdddot/dydddot   = G
    dqdddot/dyddot    = 3 dqdot/dy
    dqdddot/dydot     = 3 dqddot/dy
    dqdddot/dy        = D(dqddot/dy)

of which only the last is new; it is taken by differences along the motion.

Along a path of the tool y = (s, q_r), and the closed form gives the other joints (`closed_form`), or y = (s, sigma)
(`chart`); along a path of all joints y = (s), and without a path y = q. Everything that lays down, solves and refines
a program takes any of them.
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
        That gave it.
    y, ydot, yddot, ydddot : (K, c) ndarray
        The c curves that are chosen freely, and their time derivatives.
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
        """Value y and three time derivatives of the curves, each (K, c)."""
        return self.y, self.ydot, self.yddot, self.ydddot

    @cached_property
    def derivatives(self) -> JointDerivatives:
        """Exact derivatives."""
        return self.joint_map.derivatives(self)

    @property
    def slopes(self) -> MotionSlopes:
        """The exact derivatives as the kernel takes them, but for those of the jerk."""
        return MotionSlopes(self.gradient, *self.derivatives)

    def values_of(self, groups: ValueGroups) -> list[np.ndarray]:
        """Compute values of limits, (K, size) of each group; nothing is set where a group has partials."""
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
        """Differentiate the jerk by y, (K, n, c): the rate of dqddot/dy; raises UnreachableError as `state` does."""
        near = np.tile(self.q, (2, 1))

        def slopes(*curves: np.ndarray) -> tuple[np.ndarray]:
            """Return dqddot/dy, (2 K, n, c), at moments nearby."""
            return (self.joint_map.state(*curves, near=near).derivatives.qddot_y,)

        return rates(slopes, self.curves)[0]


class JointDerivatives(NamedTuple):
    """Derivatives of a `JointState`, each (K, n, c); dqdot/dydot = dqddot/dyddot = G are not repeated.

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
        Posture at, or near, the beginning; it decides about turns of 2 pi.
    path : Path or None
        The path along which y[0] is the path coordinate s; None without a path: then y has no s.
    r : int
        Number of joints that are chosen freely.
    redundant_joints : tuple of str
        Names of the joints that are curves themselves.
    branch_label : str
        What the branch is called whose margins `margins` gives; empty without margins.
    """

    robot: Robot
    start: np.ndarray
    path: Path | None = None
    r: int = 0
    redundant_joints: tuple[str, ...] = ()
    branch_label: str = ""

    @property
    def curve_names(self) -> tuple[str, ...]:
        """Names of the curves: s along a path, then the redundant joints, or sigma_1, sigma_2, ... of a chart."""
        if self.path is None:
            return self.redundant_joints
        sigma = (f"sigma_{number}" for number in range(1, 1 + self.r))
        return ("s", *(self.redundant_joints or sigma))

    @abstractmethod
    def coordinates(self, s: float, q: np.ndarray) -> np.ndarray:
        """Value of the curves, (c,), in a posture, (n,), at path coordinate s; NaN stays NaN."""

    @abstractmethod
    def postures(self, y: np.ndarray) -> np.ndarray:
        """Joint positions, (K, n), at successive times with curves (K, c); NaN where the curves cannot be met."""

    @abstractmethod
    def state(
        self,
        *curves: np.ndarray,
        t: np.ndarray | None = None,
        near: np.ndarray | None = None,
    ) -> JointState:
        """Joint motion at K times.

        Parameters
        ----------
        *curves : (K, c) ndarray
            y, ydot, yddot and ydddot.
        t : (K,) ndarray, optional
            The times, ascending from the start on, s; by them turns are counted.
        near : (K, n) ndarray, optional
            Postures known to be near, which decide about turns; the times may then be any.

        Raises
        ------
        UnreachableError
            The curves cannot be met at one of the times.
        """

    @abstractmethod
    def derivatives(self, state: Any) -> JointDerivatives:
        """Exact derivatives of a state that this map gave."""

    def along(self, path: Path, start: np.ndarray) -> Self:
        """Return the same map for a part of its path that begins at, or near, a posture, (n,)."""
        submap = copy.copy(self)
        submap.path = path
        submap.start = start
        return submap

    def start_margins(self) -> np.ndarray:
        """Margins, (b,), of the start to where the map ends to be computable; b = 0 where it never does."""
        return np.empty(0)

    def margins(self, state: Any) -> np.ndarray:
        """Margins, (K, b), of a state that this map gave; see `start_margins`."""
        return np.empty((len(state.q), 0))

    def margin_quantity(self) -> FormulaQuantity | None:
        """Return the margins as the kernel computes them by itself; None where it does not."""
        return None

    def margin_gradient(self, state: Any) -> tuple[np.ndarray, np.ndarray | None]:
        """Differentiate `margins` with respect to q, (K, b, n), and to s, (K, b); None where it vanishes."""
        return np.empty((len(state.q), 0, self.robot.n)), None


@dataclass(frozen=True)
class JointSpaceState(JointState):
    """Joint motion at K times, and the path there."""

    path: PathSample


class JointSpaceMap(JointMap):
    """A path of all joints, q = q(s), as a `JointMap`: only s(t) is chosen, y = (s).

    With q_ds, q_dds and q_ddds the path's derivatives by s,

        G = q_ds,    qdot = q_ds sdot,    qddot = q_ds sddot + q_dds sdot^2
        dqdot/ds = q_dds sdot,    dqddot/dsdot = 2 q_dds sdot,    dqddot/ds = q_dds sddot + q_ddds sdot^2

    Parameters
    ----------
    robot : Robot
    path : Path
        Its target are the joint positions.
    """

    path: Path

    def __init__(self, robot: Robot, path: Path) -> None:
        self.robot = robot
        self.path = path
        self.start = path.sample(np.zeros(1)).target[0]

    def coordinates(self, s: float, _q: np.ndarray) -> np.ndarray:
        """Return s as the only curve."""
        return np.array([s])

    def postures(self, y: np.ndarray) -> np.ndarray:
        """Return the path's target."""
        return self.path.sample(y[:, 0]).target

    def state(self, *curves: np.ndarray, **_options: object) -> JointSpaceState:
        """Return the motion along the path; in which turns joints are, it says itself."""
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
