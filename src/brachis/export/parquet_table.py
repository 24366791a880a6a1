"""Parquet: the columns of the CSV table as doubles, with units and the robot's name as metadata."""

from __future__ import annotations

import json
import os
from collections.abc import Sequence

from brachis.export.optional import needed
from brachis.export.rows import rows_of
from brachis.files import atomic_write
from brachis.trajectory import Trajectory


def export_parquet(
    trajectory: Trajectory,
    path: str | os.PathLike[str],
    dt: float,
    *,
    last: str = "exact",
    joints: Sequence[str] | None = None,
) -> None:
    """Write the table of `export_csv` as Parquet; see `brachis.export.write` for the parameters.

    The file's metadata have a key ``brachis``: joints with their units, the end time in s, and sentences about joints
    that move and are left out.
    """
    pyarrow, parquet = needed("pyarrow", "a Parquet file"), needed("pyarrow.parquet", "a Parquet file")
    rows = rows_of(trajectory, dt, last, joints)
    units = dict(zip(rows.joints, rows.units, strict=True))
    about = {"joints": units, "t_end_s": trajectory.t_end, "left_out": rows.left_out}
    table = pyarrow.table(dict(rows.columns())).replace_schema_metadata({"brachis": json.dumps(about)})
    with atomic_write(path) as stream:
        parquet.write_table(table, stream)
