"""Tables of samples in SI units: CSV, Parquet and JSON.

CSV has one row per sample, with the shortest digits that read back exactly. Parquet has
the same columns as doubles, with units and the robot's name as metadata. JSON names its
schema.
"""

from __future__ import annotations

import csv
import io
import json
import os
from collections.abc import Sequence
from typing import Any, Final

import numpy as np

from brachis.apps.export.rows import require_library, rows_of
from brachis.common.files import atomic_write
from brachis.trajectory import Trajectory
from brachis.trajectory.samples import COLUMNS


def export_csv(
    trajectory: Trajectory,
    path: str | os.PathLike[str],
    dt: float,
    *,
    last: str = "exact",
    joints: Sequence[str] | None = None,
) -> None:
    """Write time, joint positions, velocities, accelerations and torques.

    The header is ``t``, then ``q_<joint>`` of all joints, ``qd_<joint>``, ``qdd_<joint>`` and ``tau_<joint>``, in
    s, rad (m), rad/s (m/s), rad/s^2 (m/s^2) and Nm (N). Where `joints` leaves out a joint that moves, a line that
    begins with ``#`` stands before the header. See `brachis.export.write` for the parameters.

    Examples
    --------
    >>> from brachis import plan
    >>> from brachis.apps.export import export_csv
    >>> trajectory = plan("examples/01_scara_line.yaml").trajectory
    >>> export_csv(trajectory, "motion.csv", dt=0.004)  # doctest: +SKIP
    """
    rows = rows_of(trajectory, dt, last, joints)
    names, values = zip(*rows.columns(), strict=True)
    with atomic_write(path) as stream:
        text = io.TextIOWrapper(stream, encoding="utf-8", newline="")
        text.writelines(f"# brachis: {sentence}\n" for sentence in rows.left_out)
        writer = csv.writer(text, lineterminator="\n")
        writer.writerow(names)
        writer.writerows(
            np.column_stack(values).tolist()
        )  # floats as repr: the shortest text that reads back the same
        text.flush()
        text.detach()  # the stream is atomic_write's to close


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
    pyarrow = require_library("pyarrow", "a Parquet file")
    parquet = require_library("pyarrow.parquet", "a Parquet file")
    rows = rows_of(trajectory, dt, last, joints)
    units = dict(zip(rows.joints, rows.units, strict=True))
    about = {"joints": units, "t_end_s": trajectory.t_end, "left_out": rows.left_out}
    table = pyarrow.table(dict(rows.columns())).replace_schema_metadata(
        {"brachis": json.dumps(about)}
    )
    with atomic_write(path) as stream:
        parquet.write_table(table, stream)


SCHEMA_ID: Final = "urn:brachis:joint-trajectory:1"


def samples_schema() -> dict[str, Any]:
    """Return the JSON schema of exported trajectories, draft 2020-12; also ``brachis schema --of trajectory``."""
    names = {"type": "array", "items": {"type": "string"}, "minItems": 1}
    numbers = {"type": "array", "items": {"type": "number"}, "minItems": 2}
    per_joint = {
        "type": "array",
        "items": {"type": "array", "items": {"type": "number"}, "minItems": 1},
        "minItems": 2,
    }
    units = {"type": "array", "items": {"enum": ["rad", "m"]}, "minItems": 1}
    said = {
        "t": ("s", numbers),
        "s": ("path coordinate, 0 to 1", numbers),
        "q": (
            "positions, rad or m, a row for each t, a column for each joint",
            per_joint,
        ),
        "qdot": ("velocities, rad/s or m/s", per_joint),
        "qddot": ("accelerations, rad/s^2 or m/s^2", per_joint),
        "tau": ("torques, Nm, or forces, N", per_joint),
    }
    properties: dict[str, Any] = {
        "$schema": {"const": SCHEMA_ID},
        "joint_names": {**names, "description": "Joints in the order of the columns."},
        "position_units": {**units, "description": "Unit of every joint's position."},
        "t_end": {
            "type": "number",
            "exclusiveMinimum": 0,
            "description": "End time, s.",
        },
        "dt": {
            "type": "number",
            "exclusiveMinimum": 0,
            "description": "Period of the samples, s.",
        },
        "warnings": {
            "type": "array",
            "items": {"type": "string"},
            "description": "Joints that move and are left out.",
        },
        "samples": {
            "type": "object",
            "properties": {
                name: {**shape, "description": text}
                for name, (text, shape) in said.items()
            },
            "required": list(said),
            "additionalProperties": False,
        },
    }
    return {
        "$schema": "https://json-schema.org/draft/2020-12/schema",
        "$id": SCHEMA_ID,
        "title": "A joint trajectory written by brachis",
        "type": "object",
        "properties": properties,
        "required": list(properties),
        "additionalProperties": False,
    }


def export_json(
    trajectory: Trajectory,
    path: str | os.PathLike[str],
    dt: float,
    *,
    last: str = "exact",
    joints: Sequence[str] | None = None,
) -> None:
    """Write samples as JSON that fulfils `samples_schema`; see `brachis.export.write` for the parameters."""
    rows = rows_of(trajectory, dt, last, joints)
    content = {
        "$schema": SCHEMA_ID,
        "joint_names": rows.joints,
        "position_units": rows.units,
        "t_end": trajectory.t_end,
        "dt": dt,
        "warnings": rows.left_out,
        "samples": {
            name: getattr(rows, name).tolist() for name in ("t", "s", *COLUMNS.values())
        },
    }
    lines = (
        f"  {json.dumps(key)}: {json.dumps(value, allow_nan=False)}"
        for key, value in content.items()
    )
    with atomic_write(path) as stream:
        stream.write(("{\n" + ",\n".join(lines) + "\n}\n").encode())
