"""How a path begins and ends: how fast it runs there per unit s, and whether it closes."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from brachis.errors import PathError

if TYPE_CHECKING:
    from brachis.path.protocol import Path
    from brachis.robot import TaskMap

_CLOSED = 1e-6
"""Largest gap of a closed path, m and rad, and of its derivatives by s, relative to their size."""
_STILL = 1e-9


def path_speed(task_map: TaskMap, path: Path, s: float) -> float:
    """Return how far the position moves per unit s, m; where it stands still, how far the angles turn, rad.

    Of a path of joints it is the norm of their derivatives.
    """
    position, angle = (float(size[0]) for size in task_map.norms(path.sample(np.array([s])).xi))
    return position if position > _STILL else angle


def check_closed(task_map: TaskMap, path: Path) -> None:
    """Refuse a path that does not end where, and as, it begins, to the second derivative.

    Raises
    ------
    PathError
    """
    ends = path.sample(np.array([0.0, 1.0]))
    gap = np.abs(task_map.difference(*ends.target))
    worst = int(np.argmax(gap))
    allowed = f"an end where the path begins, to {_CLOSED:g} m and rad"
    if gap[worst] > _CLOSED:
        found = f"{gap[worst]:.3g} {task_map.units[worst]} off in {task_map.rows[worst]}"
        raise PathError("the path does not close", found=found, allowed=allowed, where="boundary.periodic")
    for derivative, name in ((ends.xi, "tangent"), (ends.xi_ds, "curvature")):
        jump = float(np.linalg.norm(derivative[1] - derivative[0]))
        if jump > _CLOSED * max(float(np.linalg.norm(ends.xi[0])), float(np.linalg.norm(derivative))):
            raise PathError(
                f"the path's {name} jumps where it closes",
                found=f"a jump of {jump:.3g} in {np.linalg.norm(derivative[0]):.3g} (by s)",
                allowed="a path that continues where it closes, to the second derivative",
                where="boundary.periodic",
                hint="Begin within a segment, so that corners are blended",
            )
