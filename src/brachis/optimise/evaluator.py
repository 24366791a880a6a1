"""The evaluator: curves y(t) in, joint motion, limits and their slopes out.

A limit with partials (p_q, p_v, p_a) has d/dy = p_q G + p_v dqdot/dy + p_a dqddot/dy,
d/dydot = p_v G + p_a dqddot/dydot and d/dyddot = p_a G, with G and the rest from the joint map. One that asks for the
jerk has likewise slopes by ydddot (see `joint_map`).
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from brachis.kernel import MotionSlopes, apply_chain_rule
from brachis.kinematics import JointMap, JointState
from brachis.limits import Limit, Partials


class Evaluator:
    """Values and slopes of all limits along curves y(t).

    A phase constructs one, and asks it alone: for the rows of the program, their Jacobian, and the checks between
    collocation points.

    Parameters
    ----------
    joint_map : JointMap
    limits : sequence of Limit

    Attributes
    ----------
    joint_map, limits
        As given.
    is_mean : (c,) bool ndarray
        Which of the limits' values are held as means over the motion.
    """

    def __init__(self, joint_map: JointMap, limits: Sequence[Limit]) -> None:
        self.joint_map = joint_map
        self.limits = tuple(limits)
        counts = [len(limit.lower) for limit in self.limits]
        means = [limit.guarantee.is_mean for limit in self.limits]
        self.is_mean = np.repeat(np.array(means, dtype=bool), counts)

    def evaluate(
        self,
        y: np.ndarray,
        ydot: np.ndarray,
        yddot: np.ndarray,
        ydddot: np.ndarray,
        *,
        t: np.ndarray | None = None,
        near: np.ndarray | None = None,
    ) -> Evaluation:
        """Evaluate joint motion and limits at K times.

        Parameters
        ----------
        y, ydot, yddot, ydddot : (K, 1 + r) ndarray
            The curves and their time derivatives.
        t : (K,) ndarray, optional
            The times, ascending from the start on, s; by them turns are counted.
        near : (K, n) ndarray, optional
            Postures known to be near, which decide about turns; the times may then be any.

        Raises
        ------
        UnreachableError
            The joint map has no posture at one of the times.
        """
        motion = self.joint_map.state(y, ydot, yddot, ydddot, t=t, near=near)
        return Evaluation(self.limits, motion)


@dataclass(frozen=True, eq=False)
class Evaluation:
    """Joint motion and limits at K times; values and slopes are computed when they are asked for, and once.

    Attributes
    ----------
    limits : tuple of Limit
        With c values in all.
    motion : JointState
        q, qdot, qddot, qdddot, (K, n), and the gradient dq/dy.
    """

    limits: tuple[Limit, ...]
    motion: JointState

    @cached_property
    def by_limit(self) -> tuple[np.ndarray, ...]:
        """Values of every limit, (K, its own c)."""
        return tuple(limit.values(self.motion) for limit in self.limits)

    @cached_property
    def values(self) -> np.ndarray:
        """Values of all limits, (K, c)."""
        return np.concatenate(self.by_limit, axis=1)

    @cached_property
    def slopes(self) -> np.ndarray:
        """Slopes of `values` by y, ydot, yddot and, where a limit asks for the jerk, ydddot, (3 or 4, K, c, 1 + r)."""
        return self.chain([limit.partials(self.motion) for limit in self.limits])

    def chain(self, partials: Sequence[Partials]) -> np.ndarray:
        """Differentiate functions with given partials by y, ydot, yddot and, if one asks for it, ydddot."""
        motion = self.motion
        exact = motion.derivatives
        jerk = None
        if any(own.qdddot is not None for own in partials):
            jerk = motion.qdddot_y
        by_curves = (exact.qdot_y, exact.qddot_y, exact.qddot_ydot, jerk)
        return apply_chain_rule(
            [(own.by_joints, own.s) for own in partials],
            [own.size for own in partials],
            MotionSlopes(motion.gradient, *by_curves),
        )

    def violation(self, counts: Callable[[Limit], bool]) -> np.ndarray:
        """How far the limits that count are violated, (K, their c); negative inside."""
        pairs = zip(self.limits, self.by_limit, strict=True)
        own = [limit.violation(values) for limit, values in pairs if counts(limit)]
        return np.concatenate([np.empty((len(self.motion.y), 0)), *own], axis=1)
