"""Tables of samples in SI units: CSV, Parquet and JSON.

CSV has one row per sample, with numbers as short as exact reading allows. Parquet has the same columns as doubles, with
units and the name of the robot as metadata. JSON names its schema.
"""

from __future__ import annotations

import csv
import io
import json
from typing import Any, BinaryIO, Final

import numpy as np

from brachis.apps.export.rows import JointRows, require_library


def write_csv(rows: JointRows, stream: BinaryIO) -> None:
    """Write a CSV table of time, joint positions, velocities, accelerations and torques.

    The header is ``t``, then ``q_<joint>`` of all joints, ``qd_<joint>``, ``qdd_<joint>`` and ``tau_<joint>``, in
    s, rad (m), rad/s (m/s), rad/s^2 (m/s^2) and Nm (N); torques are left out if the URDF has no masses. If a joint
    that moves is left out, a line that begins with ``#`` stands before the header; so do lines with the parts and
    events of a program.
    """
    columns = rows.columns()
    text = io.StringIO()
    text.writelines(f"# brachis: {sentence}\n" for sentence in rows.notes)
    writer = csv.writer(text, lineterminator="\n")
    writer.writerow(columns)
    # repr gives the shortest text that reads back as the same float.
    writer.writerows(np.column_stack([*columns.values()]).tolist())
    stream.write(text.getvalue().encode())


def write_parquet(rows: JointRows, stream: BinaryIO) -> None:
    """Write the same table as `write_csv`, as Parquet.

    The metadata key ``brachis`` contains the joints with their units, the end time in s, sentences about moving joints
    that are left out, and the parts and events of a program.
    """
    pyarrow = require_library("pyarrow", "a Parquet file")
    parquet = require_library("pyarrow.parquet", "a Parquet file")
    units = dict(zip(rows.joints, rows.units, strict=True))
    about = {"joints": units, "t_end_s": rows.t_end, "left_out": rows.left_out}
    about |= _describe_program(rows)
    table = pyarrow.table(rows.columns())
    metadata = {"brachis": json.dumps(about)}
    parquet.write_table(table.replace_schema_metadata(metadata), stream)


SCHEMA_ID: Final = "urn:brachis:joint-trajectory:1"


_SCHEMA: Final = """\
{
  "$schema": "https://json-schema.org/draft/2020-12/schema",
  "$id": "urn:brachis:joint-trajectory:1",
  "$defs": {
    "_Samples": {
      "additionalProperties": false,
      "description": "Motion at the times of an exported file.",
      "properties": {
        "t": {
          "description": "s",
          "items": {"type": "number"},
          "minItems": 2,
          "title": "T",
          "type": "array"
        },
        "s": {
          "description": "path coordinate, 0 to 1",
          "items": {"type": "number"},
          "minItems": 2,
          "title": "S",
          "type": "array"
        },
        "q": {
          "description": "positions, rad or m, a row for each t, a column for each joint",
          "items": {"items": {"type": "number"}, "minItems": 1, "type": "array"},
          "minItems": 2,
          "title": "Q",
          "type": "array"
        },
        "qdot": {
          "description": "velocities, rad/s or m/s",
          "items": {"items": {"type": "number"}, "minItems": 1, "type": "array"},
          "minItems": 2,
          "title": "Qdot",
          "type": "array"
        },
        "qddot": {
          "description": "accelerations, rad/s^2 or m/s^2",
          "items": {"items": {"type": "number"}, "minItems": 1, "type": "array"},
          "minItems": 2,
          "title": "Qddot",
          "type": "array"
        },
        "tau": {
          "default": [],
          "description": "torques, Nm, or forces, N; absent if the URDF has no masses",
          "items": {"items": {"type": "number"}, "minItems": 1, "type": "array"},
          "minItems": 2,
          "title": "Tau",
          "type": "array"
        }
      },
      "required": ["t", "s", "q", "qdot", "qddot"],
      "title": "samples",
      "type": "object"
    }
  },
  "additionalProperties": false,
  "description": "A joint trajectory written by brachis.",
  "properties": {
    "$schema": {"const": "urn:brachis:joint-trajectory:1", "title": "$Schema", "type": "string"},
    "joint_names": {
      "description": "Joints in the order of the columns.",
      "items": {"type": "string"},
      "minItems": 1,
      "title": "Joint Names",
      "type": "array"
    },
    "position_units": {
      "description": "Unit of every joint's position.",
      "items": {"enum": ["rad", "m", "deg", "mm"], "type": "string"},
      "minItems": 1,
      "title": "Position Units",
      "type": "array"
    },
    "t_end": {
      "description": "End time, s.",
      "exclusiveMinimum": 0,
      "title": "T End",
      "type": "number"
    },
    "dt": {
      "description": "Period of the samples, s.",
      "exclusiveMinimum": 0,
      "title": "Dt",
      "type": "number"
    },
    "warnings": {
      "description": "Joints that move and are left out.",
      "items": {"type": "string"},
      "title": "Warnings",
      "type": "array"
    },
    "parts": {
      "description": "Parts of a program, with their times, s.",
      "items": {
        "properties": {
          "name": {"type": "string"},
          "kind": {"enum": ["path", "move", "approach", "retract", "dwell"]},
          "begin": {"type": "number"},
          "end": {"type": "number"}
        },
        "type": "object"
      },
      "title": "Parts",
      "type": "array"
    },
    "events": {
      "description": "Events of a program, with their times, s.",
      "items": {
        "properties": {"name": {"type": "string"}, "time": {"type": "number"}},
        "type": "object"
      },
      "title": "Events",
      "type": "array"
    },
    "samples": {"$ref": "#/$defs/_Samples"}
  },
  "required": ["$schema", "joint_names", "position_units", "t_end", "dt", "warnings", "samples"],
  "title": "A joint trajectory",
  "type": "object"
}
"""
"""The JSON schema of exported trajectories, draft 2020-12."""


def samples_schema() -> dict[str, Any]:
    """Return the JSON schema of exported trajectories, draft 2020-12; also ``brachis schema --of trajectory``."""
    schema: dict[str, Any] = json.loads(_SCHEMA)
    return schema


def _describe_program(rows: JointRows) -> dict[str, Any]:
    """Return the parts and events of a program as plain data for JSON; empty for other motions."""
    return {
        name: [vars(item) for item in items]
        for name, items in (("parts", rows.parts), ("events", rows.events))
        if items
    }


def write_json(rows: JointRows, stream: BinaryIO) -> None:
    """Write samples as JSON that conforms to `samples_schema`."""
    names = ("t", "s", *rows.samples.columns.values())
    content = {
        "$schema": SCHEMA_ID,
        "joint_names": rows.joints,
        "position_units": rows.units,
        "t_end": rows.t_end,
        "dt": rows.dt,
        "warnings": rows.left_out,
        **_describe_program(rows),
        "samples": {name: getattr(rows.samples, name).tolist() for name in names},
    }
    lines = (
        f"  {json.dumps(key)}: {json.dumps(value, allow_nan=False)}"
        for key, value in content.items()
    )
    stream.write(("{\n" + ",\n".join(lines) + "\n}\n").encode())
