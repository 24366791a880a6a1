"""Paths of rows of a task space, where the tool's orientation is not prescribed."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from brachis.errors import PathError, UnknownNameError
from brachis.path.blend import blend_rows
from brachis.path.joins import row_corner
from brachis.path.shapes import curve_of
from brachis.path.site import Site
from brachis.robot.task_map.rows import ROWS, YAW
from brachis.task import TurnSegment

if TYPE_CHECKING:
    from brachis.path.protocol import Array, Curve
    from brachis.path.sequence import SequencePath
    from brachis.task import Segment


@dataclass(frozen=True)
class RowCoordinates:
    """Rows of a task space; see `Coordinates`."""

    rows: tuple[str, ...]
    corner = staticmethod(row_corner)
    blend = staticmethod(blend_rows)

    def checked(self, start: Array) -> Array:
        """See `Coordinates.checked`."""
        for row in self.rows:
            if row not in ROWS:
                raise UnknownNameError(kind="row of the task space", name=row, valid=ROWS, where="task_space")
        if start.shape != (len(self.rows),) or not np.all(np.isfinite(start)):
            problem = "the start of the path needs one finite coordinate for each row of the task space"
            raise PathError(problem, found=start.tolist(), allowed=f"[{', '.join(self.rows)}]", where="start")
        return start

    def curve(self, segment: Segment, index: int, start: Array) -> Curve:
        """See `Coordinates.curve`."""
        found, hint = f"task_space [{', '.join(self.rows)}]", "Set task_space: pose"
        if isinstance(segment, TurnSegment):
            problem = "a turn is for task spaces of poses"
            if YAW in self.rows:
                hint = "Use line: {by: [0, 0, ...]} to turn yaw"
            raise PathError(problem, found=found, where=f"path[{index}].turn", hint=hint)
        if segment.orientation is not None:
            problem = "an orientation along a segment is for task spaces of poses"
            raise PathError(problem, found=found, where=f"path[{index}].orientation", hint=hint)
        return curve_of(segment.shape, Site(f"path[{index}].{segment.kind}", start, self.rows))

    def path(self, sequence: SequencePath) -> SequencePath:
        """See `Coordinates.path`: the task velocity is the coordinates' own derivative."""
        return sequence
