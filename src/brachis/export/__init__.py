"""Trajectories in the formats of other programs; a format is one file here and one line in `FORMATS`.

Examples
--------
>>> import brachis
>>> "csv" in brachis.export.FORMATS
True
"""

from __future__ import annotations

import os
from typing import Protocol

from brachis.export.csv_table import export_csv
from brachis.trajectory import Trajectory


class Exporter(Protocol):
    """Writes the samples of a trajectory every `dt` seconds to one file; for `last` see `Trajectory.sample`."""

    def __call__(self, trajectory: Trajectory, path: str | os.PathLike[str], dt: float, *, last: str) -> None:
        """Write the file."""
        ...


FORMATS: dict[str, Exporter] = {"csv": export_csv}
"""Exporters by file suffix without the dot."""

__all__ = ["FORMATS", "Exporter", "export_csv"]
