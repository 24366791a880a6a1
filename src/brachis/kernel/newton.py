"""Newton's method for finding postures; see `brachis.ik.newton`."""

from __future__ import annotations

import ctypes
from dataclasses import dataclass

import numpy as np

from brachis.kernel.chain import Chain
from brachis.kernel.library import (
    Structured,
    as_doubles_at_points,
    call_checked,
    declare_fields,
)


class _Prescribed(ctypes.Structure):
    """The structure `prescribed` of tool.h."""

    _fields_ = declare_fields(
        "l in_tool_axes rows first_axis second_axis third_axis turns tool_axis first second; d sign"
    )


@dataclass(frozen=True)
class Prescribed(Structured):
    """The prescribed part of the tool's pose: position rows, with an angle or the orientation, or the whole pose.

    Attributes
    ----------
    axes : tuple of int
        World axes of the position rows.
    turns : {0, 1, 3}
        Number of rotation rows: none, one for an angle about a world axis, or three for the orientation.
    in_tool_axes : bool
        Whether the rows are motions along and about the tool's axes. Only possible if the whole pose is prescribed.
    heading : tuple of int
        If an angle is prescribed: the tool's axis, and the two world axes of the plane in which the angle is measured.
    sign : float
        Sign of the component along the second world axis.
    """

    axes: tuple[int, ...]
    turns: int = 0
    in_tool_axes: bool = False
    heading: tuple[int, int, int] = (0, 0, 1)
    sign: float = 1.0

    @property
    def count(self) -> int:
        """Number of prescribed rows."""
        return len(self.axes) + self.turns

    @property
    def parts(self) -> list[int]:
        """Indices of the prescribed rows of the tool's twist (linear velocity first, then angular)."""
        turning = [3, 4, 5] if self.turns == 3 else [6 - sum(self.heading[1:])]
        return [*self.axes, *turning[: self.turns]]

    @property
    def coordinates(self) -> int:
        """Number of task coordinates. An orientation has nine: the entries of the rotation matrix."""
        return len(self.axes) + (9 if self.turns == 3 else self.turns)

    def _make_structure(self) -> _Prescribed:
        axes = (*self.axes, 0, 0, 0)[:3]
        count = len(self.axes)
        return _Prescribed(
            self.in_tool_axes, count, *axes, self.turns, *self.heading, self.sign
        )


def find_postures(
    chain: Chain,
    prescribed: Prescribed,
    targets: np.ndarray,
    starts: np.ndarray,
    conditions: tuple[np.ndarray, np.ndarray],
    *,
    beside: bool,
) -> np.ndarray:
    """Find postures, (K, n), that reach targets, (K, c), and satisfy linear conditions.

    The conditions are rows, (K, r, n), and their required values, (K, r). For the other parameters see
    `brachis.ik.newton.Newton.solve`.
    """
    rows, levels = conditions
    free = chain.n - prescribed.count
    table, step = as_doubles_at_points(rows, (len(starts), free, chain.n))
    postures: np.ndarray = call_checked(
        "brachis_newton",
        chain.address,
        prescribed.address,
        targets,
        starts,
        table,
        step,
        levels,
        beside,
        z=prescribed.coordinates,
        r=free,
        n=chain.n,
    )
    return postures
