"""The evaluator turns curves y(t) into the joint motion, the values of the limits, and their slopes.

A limit with partials (p_q, p_v, p_a) has d/dy = p_q G + p_v dqdot/dy + p_a dqddot/dy, d/dydot = p_v G + p_a
dqddot/dydot and d/dyddot = p_a G, where G = dq/dy and the other derivatives come from the joint map. A limit that
depends on the jerk also has slopes with respect to ydddot (see `joint_map`).
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from brachis.kernel import ValueGroups, VariableSlopes, differentiate
from brachis.kinematics import JointMap, JointState
from brachis.limits import Limit, Partials


class Evaluator:
    """Values and slopes of all limits along curves y(t).

    Each phase has an evaluator. The phase uses it for the rows of the program, for their Jacobian, and for the checks
    between collocation points.

    Parameters
    ----------
    joint_map : JointMap
    limits : sequence of Limit

    Attributes
    ----------
    joint_map, limits
        As given.
    is_mean : (c,) bool ndarray
        True for each value of the limits whose mean over the motion is limited.
    """

    def __init__(self, joint_map: JointMap, limits: Sequence[Limit]) -> None:
        self.joint_map = joint_map
        self.limits = tuple(limits)
        counts = [len(limit.lower) for limit in self.limits]
        means = [limit.guarantee.is_mean for limit in self.limits]
        self.is_mean = np.repeat(np.array(means, dtype=bool), counts)
        chain = joint_map.robot.dynamic_chain
        quantities = [limit.kernel_quantity(chain) for limit in self.limits]
        self._groups = ValueGroups(quantities, counts)

    def evaluate(
        self,
        *curves: np.ndarray,
        t: np.ndarray | None = None,
        near: np.ndarray | None = None,
    ) -> Evaluation:
        """Evaluate joint motion and limits at K times.

        Parameters
        ----------
        *curves : (K, 1 + r) ndarray
            y, ydot, yddot and ydddot.
        t : (K,) ndarray, optional
            Times in s, ascending from the start. They are used to count turns.
        near : (K, n) ndarray, optional
            Known postures close to those at these times. They determine the turns, so the times may be in any order.

        Raises
        ------
        UnreachableError
            The joint map has no posture at one of the times.
        """
        motion = self.joint_map.state(*curves, t=t, near=near)
        return Evaluation(self.limits, motion, self._groups)


@dataclass(frozen=True, eq=False)
class Evaluation:
    """Joint motion and limits at K times. Values are computed once, when they are first needed.

    Attributes
    ----------
    limits : tuple of Limit
        The limits, with c values together.
    motion : JointState
        Joint motion: q, qdot, qddot and qdddot, (K, n), and the gradient dq/dy.
    groups : ValueGroups
        The values of the limits in the form that the kernel needs.
    """

    limits: tuple[Limit, ...]
    motion: JointState
    groups: ValueGroups

    @cached_property
    def by_limit(self) -> tuple[np.ndarray, ...]:
        """Values of each limit, (K, number of values) for each limit."""
        motion = self.motion
        values = motion.values_of(self.groups)
        for number in self.groups.with_partials:
            values[number] = self.limits[number].values(motion)
        return tuple(values)

    @cached_property
    def values(self) -> np.ndarray:
        """Values of all limits, (K, c)."""
        return np.concatenate(self.by_limit, axis=1)

    def differentiate(
        self, variables: VariableSlopes | None = None
    ) -> tuple[np.ndarray, np.ndarray]:
        """Differentiate `values`; see `brachis.kernel.differentiate`.

        Returns
        -------
        slopes : (3 or 4, K, c, 1 + r) ndarray
            Slopes with respect to y, ydot and yddot, and also to ydddot if a limit depends on the jerk.
        entries : (z, c) ndarray
            Entries of the Jacobian with respect to the variables, if variables are given.
        """
        limits = (self.limits[number] for number in self.groups.with_partials)
        partials = [limit.partials(self.motion) for limit in limits]
        return self._differentiate(self.groups, partials, variables)

    def chain(self, partials: Partials) -> np.ndarray:
        """Return slopes by y, ydot, yddot and, if needed, ydddot, of functions that are given by their partials."""
        return self._differentiate(ValueGroups([None], [partials.size]), [partials])[0]

    def _differentiate(
        self,
        groups: ValueGroups,
        partials: list[Partials],
        variables: VariableSlopes | None = None,
    ) -> tuple[np.ndarray, np.ndarray]:
        """Differentiate the values of groups. `partials` are those of the groups that have partials."""
        motion = self.motion
        slopes = motion.slopes
        if groups.has_jerk or any(
            derivatives.qdddot is not None for derivatives in partials
        ):
            slopes = replace(slopes, qdddot_y=motion.qdddot_y)
        states = (motion.q, motion.qdot, motion.qddot)
        arrays = [(derivatives.by_joints, derivatives.s) for derivatives in partials]
        return differentiate(groups, slopes, states, arrays, variables)

    def violation(self, counts: Callable[[Limit], bool]) -> np.ndarray:
        """Return violations of the limits that `counts` accepts, (K, number of values); negative if a limit is met."""
        pairs = zip(self.limits, self.by_limit, strict=True)
        violations = [
            limit.violation(values) for limit, values in pairs if counts(limit)
        ]
        return np.concatenate([np.empty((len(self.motion.y), 0)), *violations], axis=1)
