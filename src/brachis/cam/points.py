"""Points that a path is to follow, in SI units, with what messages need to name them."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Any

import numpy as np
import numpy.typing as npt

from brachis.errors import TaskError

Array = npt.NDArray[np.float64]
Indices = npt.NDArray[np.intp]

QUATERNION = 4


@dataclass(frozen=True, eq=False)
class Points:
    """Points in the order in which the tool passes them.

    Attributes
    ----------
    position : (n, p) ndarray
        m.
    turning : (n, q) ndarray
        Unit quaternions w, x, y, z whose signs make neighbours close (q = 4), yaw in rad (q = 1), or nothing (q = 0).
    speed : (n,) ndarray or None
        Speed of the tool on the way to each point, m/s; NaN where it is not prescribed.
    rows : (n,) int ndarray
        Lines of a file, or indices of an array.
    source : str
        File or argument, for messages.
    row : str
        What `rows` counts: ``line`` or ``row``.
    """

    position: Array
    turning: Array
    speed: Array | None
    rows: Indices
    source: str
    row: str = "line"

    def __len__(self) -> int:
        """Return the number of points, n."""
        return len(self.position)

    @property
    def columns(self) -> Array:
        """Position and turning side by side, (n, p + q)."""
        return np.hstack([self.position, self.turning])

    def only(self, chosen: Any) -> Points:  # noqa: ANN401  (whatever NumPy takes as an index)
        """Return some of the points."""
        speed = None if self.speed is None else self.speed[chosen]
        parts = {"position": self.position[chosen], "turning": self.turning[chosen], "rows": self.rows[chosen]}
        return replace(self, **parts, speed=speed)

    def named(self, i: int) -> str:
        """Name the row of a point."""
        return f"{self.row} {self.rows[i]}"

    def described(self, i: int) -> str:
        """Name the row and the position of a point."""
        place = ", ".join(f"{value:.6g}" for value in self.position[i])
        return f"{self.named(i)}, [{place}] m"

    def wrong(self, i: int, problem: str, *, found: str, allowed: str, hint: str | None = None) -> TaskError:
        """Return the error that something is wrong with a point."""
        return TaskError(problem, found=found, allowed=allowed, where=f"{self.source}: {self.named(i)}", hint=hint)


def angles_between(one: Array, other: Array) -> Array:
    """Return the angles, (n,), rad, between what `Points.turning` holds, (n, q) both; zero where it holds nothing."""
    if one.shape[1] != QUATERNION:
        return np.asarray(np.abs(one - other).sum(axis=1))
    unit = one / np.linalg.norm(one, axis=1)[:, None]
    apart = np.minimum(np.linalg.norm(unit - other, axis=1), np.linalg.norm(unit + other, axis=1))
    return np.asarray(4.0 * np.arcsin(np.minimum(apart / 2.0, 1.0)))
