"""Tables of samples in SI units: CSV, Parquet and JSON.

CSV has one row per sample, with the shortest digits that read back exactly. Parquet has
the same columns as doubles, with units and the robot's name as metadata. JSON names its
schema.
"""

from __future__ import annotations

import csv
import io
import json
from typing import Any, BinaryIO, Final

import numpy as np

from brachis.apps.export.rows import JointRows, require_library
from brachis.trajectory.samples import COLUMNS


def write_csv(rows: JointRows, stream: BinaryIO) -> None:
    """Write time, joint positions, velocities, accelerations and torques.

    The header is ``t``, then ``q_<joint>`` of all joints, ``qd_<joint>``, ``qdd_<joint>`` and ``tau_<joint>``, in
    s, rad (m), rad/s (m/s), rad/s^2 (m/s^2) and Nm (N). If a joint that moves is left out, a line that begins with
    ``#`` stands before the header.
    """
    names, values = zip(*rows.columns(), strict=True)
    text = io.TextIOWrapper(stream, encoding="utf-8", newline="")
    text.writelines(f"# brachis: {sentence}\n" for sentence in rows.left_out)
    writer = csv.writer(text, lineterminator="\n")
    writer.writerow(names)
    # Floats are written as repr: the shortest text that reads back the same.
    writer.writerows(np.column_stack(values).tolist())
    text.flush()
    text.detach()  # the caller closes the stream


def write_parquet(rows: JointRows, stream: BinaryIO) -> None:
    """Write the table of `write_csv` as Parquet.

    The file's metadata have a key ``brachis``: joints with their units, the end time in s, and sentences about joints
    that move and are left out.
    """
    pyarrow = require_library("pyarrow", "a Parquet file")
    parquet = require_library("pyarrow.parquet", "a Parquet file")
    units = dict(zip(rows.joints, rows.units, strict=True))
    about = {"joints": units, "t_end_s": rows.t_end, "left_out": rows.left_out}
    table = pyarrow.table(dict(rows.columns()))
    metadata = {"brachis": json.dumps(about)}
    parquet.write_table(table.replace_schema_metadata(metadata), stream)


SCHEMA_ID: Final = "urn:brachis:joint-trajectory:1"


def samples_schema() -> dict[str, Any]:
    """Return the JSON schema of exported trajectories, draft 2020-12; also ``brachis schema --of trajectory``."""
    text = {"type": "string"}
    number = {"type": "number"}
    positive = {**number, "exclusiveMinimum": 0}
    names = _array(text, 1)
    numbers = _array(number, 2)
    per_joint = _array(_array(number, 1), 2)
    samples = {
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
    properties = _describe(
        {
            "joint_names": ("Joints in the order of the columns.", names),
            "position_units": (
                "Unit of every joint's position.",
                _array({"enum": ["rad", "m"]}, 1),
            ),
            "t_end": ("End time, s.", positive),
            "dt": ("Period of the samples, s.", positive),
            "warnings": ("Joints that move and are left out.", _array(text, 0)),
        }
    )
    return {
        "$schema": "https://json-schema.org/draft/2020-12/schema",
        "$id": SCHEMA_ID,
        "title": "A joint trajectory written by brachis",
        **_object(
            {
                "$schema": {"const": SCHEMA_ID},
                **properties,
                "samples": _object(_describe(samples)),
            }
        ),
    }


def _array(items: dict[str, Any], least: int) -> dict[str, Any]:
    """Return the schema of an array of at least so many items."""
    return {"type": "array", "items": items} | ({"minItems": least} if least else {})


def _describe(entries: dict[str, tuple[str, dict[str, Any]]]) -> dict[str, Any]:
    """Return schemas with their descriptions."""
    return {
        name: {**schema, "description": text}
        for name, (text, schema) in entries.items()
    }


def _object(properties: dict[str, Any]) -> dict[str, Any]:
    """Return the schema of an object with these properties and no others."""
    return {
        "type": "object",
        "properties": properties,
        "required": list(properties),
        "additionalProperties": False,
    }


def write_json(rows: JointRows, stream: BinaryIO) -> None:
    """Write samples as JSON that fulfils `samples_schema`."""
    names = ("t", "s", *COLUMNS.values())
    content = {
        "$schema": SCHEMA_ID,
        "joint_names": rows.joints,
        "position_units": rows.units,
        "t_end": rows.t_end,
        "dt": rows.dt,
        "warnings": rows.left_out,
        "samples": {name: getattr(rows, name).tolist() for name in names},
    }
    lines = (
        f"  {json.dumps(key)}: {json.dumps(value, allow_nan=False)}"
        for key, value in content.items()
    )
    stream.write(("{\n" + ",\n".join(lines) + "\n}\n").encode())
