"""Tables of samples in SI units: CSV, Parquet and JSON.

CSV has one row per sample, with the shortest digits that read back exactly. Parquet has
the same columns as doubles, with units and the robot's name as metadata. JSON names its
schema.
"""

from __future__ import annotations

import csv
import io
import json
from typing import Annotated, Any, BinaryIO, Final, Literal

import numpy as np
from pydantic import BaseModel, Field, PositiveFloat

from brachis.apps.export.rows import JointRows, require_library


def write_csv(rows: JointRows, stream: BinaryIO) -> None:
    """Write time, joint positions, velocities, accelerations and torques.

    The header is ``t``, then ``q_<joint>`` of all joints, ``qd_<joint>``, ``qdd_<joint>`` and ``tau_<joint>``, in
    s, rad (m), rad/s (m/s), rad/s^2 (m/s^2) and Nm (N); torques are left out if the URDF has no masses. If a joint
    that moves is left out, a line that begins with ``#`` stands before the header.
    """
    columns = rows.columns()
    text = io.StringIO()
    text.writelines(f"# brachis: {sentence}\n" for sentence in rows.left_out)
    writer = csv.writer(text, lineterminator="\n")
    writer.writerow(columns)
    # Floats are written as repr: the shortest text that reads back the same.
    writer.writerows(np.column_stack([*columns.values()]).tolist())
    stream.write(text.getvalue().encode())


def write_parquet(rows: JointRows, stream: BinaryIO) -> None:
    """Write the table of `write_csv` as Parquet.

    The file's metadata have a key ``brachis``: joints with their units, the end time in s, and sentences about joints
    that move and are left out.
    """
    pyarrow = require_library("pyarrow", "a Parquet file")
    parquet = require_library("pyarrow.parquet", "a Parquet file")
    units = dict(zip(rows.joints, rows.units, strict=True))
    about = {"joints": units, "t_end_s": rows.t_end, "left_out": rows.left_out}
    table = pyarrow.table(rows.columns())
    metadata = {"brachis": json.dumps(about)}
    parquet.write_table(table.replace_schema_metadata(metadata), stream)


SCHEMA_ID: Final = "urn:brachis:joint-trajectory:1"


_Numbers = Annotated[list[float], Field(min_length=2)]
_Rows = Annotated[
    list[Annotated[list[float], Field(min_length=1)]], Field(min_length=2)
]


class _Samples(BaseModel, extra="forbid", title="samples"):
    """Motion at the times of an exported file."""

    t: _Numbers = Field(description="s")
    s: _Numbers = Field(description="path coordinate, 0 to 1")
    q: _Rows = Field(
        description="positions, rad or m, a row for each t, a column for each joint"
    )
    qdot: _Rows = Field(description="velocities, rad/s or m/s")
    qddot: _Rows = Field(description="accelerations, rad/s^2 or m/s^2")
    tau: _Rows = Field(
        default=[],
        description="torques, Nm, or forces, N; absent if the URDF has no masses",
    )


class _JointTrajectory(BaseModel, extra="forbid", title="A joint trajectory"):
    """A joint trajectory written by brachis."""

    schema_id: Literal["urn:brachis:joint-trajectory:1"] = Field(alias="$schema")
    joint_names: list[str] = Field(
        min_length=1, description="Joints in the order of the columns."
    )
    position_units: list[Literal["rad", "m"]] = Field(
        min_length=1, description="Unit of every joint's position."
    )
    t_end: PositiveFloat = Field(description="End time, s.")
    dt: PositiveFloat = Field(description="Period of the samples, s.")
    warnings: list[str] = Field(description="Joints that move and are left out.")
    samples: _Samples


def samples_schema() -> dict[str, Any]:
    """Return the JSON schema of exported trajectories, draft 2020-12; also ``brachis schema --of trajectory``."""
    draft = "https://json-schema.org/draft/2020-12/schema"
    return {"$schema": draft, "$id": SCHEMA_ID, **_JointTrajectory.model_json_schema()}


def write_json(rows: JointRows, stream: BinaryIO) -> None:
    """Write samples as JSON that fulfils `samples_schema`."""
    names = ("t", "s", *rows.samples.columns.values())
    content = {
        "$schema": SCHEMA_ID,
        "joint_names": rows.joints,
        "position_units": rows.units,
        "t_end": rows.t_end,
        "dt": rows.dt,
        "warnings": rows.left_out,
        "samples": {name: getattr(rows.samples, name).tolist() for name in names},
    }
    lines = (
        f"  {json.dumps(key)}: {json.dumps(value, allow_nan=False)}"
        for key, value in content.items()
    )
    stream.write(("{\n" + ",\n".join(lines) + "\n}\n").encode())
