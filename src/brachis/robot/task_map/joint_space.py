"""The joints themselves as task coordinates: what a path prescribes is the motion of every joint."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import NoReturn

import numpy as np
import pinocchio as pin

from brachis.robot.task_map.protocol import TaskDerivatives, TaskMap
from brachis.robot.task_map.rows import joint_rows


@dataclass(frozen=True, eq=False, repr=False)
class JointSpace(TaskMap):
    """All n joint positions; the Jacobian is the identity."""

    frame = pin.ReferenceFrame.LOCAL

    rows: tuple[str, ...] = field(init=False)

    def __post_init__(self) -> None:
        """Name the rows after the joints."""
        object.__setattr__(self, "rows", joint_rows(self.robot.joint_names))
        super().__post_init__()

    @property
    def units(self) -> tuple[str, ...]:
        """See `TaskMap.units`."""
        return self.robot.position_units

    def values(self, q: np.ndarray) -> np.ndarray:
        """See `TaskMap.values`."""
        return q

    def difference(self, first: np.ndarray, second: np.ndarray) -> np.ndarray:
        """See `TaskMap.difference`; whole turns count, since the path says in which turn a joint is."""
        return np.asarray(first - second, dtype=float)

    def jacobian(self, twists: np.ndarray) -> np.ndarray:
        """See `TaskMap.jacobian`."""
        return np.broadcast_to(np.eye(self.m), (twists.shape[1], self.m, self.m))

    def bias(self, twists: np.ndarray, qdot: np.ndarray) -> np.ndarray:  # noqa: ARG002
        """See `TaskMap.bias`."""
        return np.zeros_like(qdot)

    def velocity_slopes(self, twists: np.ndarray, qdot: np.ndarray) -> np.ndarray:  # noqa: ARG002
        """See `TaskMap.velocity_slopes`."""
        return np.zeros((len(qdot), self.m, self.m))

    def derivatives(self, twists: np.ndarray, qdot: np.ndarray, qddot: np.ndarray) -> TaskDerivatives:  # noqa: ARG002
        """See `TaskMap.derivatives`."""
        zeros = np.zeros((len(qdot), self.m, self.m))
        return TaskDerivatives(zeros, zeros, zeros)

    def of_placements(self, positions: np.ndarray, rotations: np.ndarray) -> NoReturn:
        """Refuse: placements of the tool do not say where the joints are."""
        raise NotImplementedError

    def rates(self, twists: np.ndarray) -> NoReturn:
        """Refuse: twists of the tool do not say how the joints move."""
        raise NotImplementedError
