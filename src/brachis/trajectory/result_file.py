"""The result file: one npz archive with a trajectory's arrays, its task and its URDF."""

from __future__ import annotations

import hashlib
import io
import json
import os
import tokenize
import zipfile
import zlib
from collections.abc import Mapping
from pathlib import Path
from typing import Any, BinaryIO

import numpy as np
from pydantic import Field, ValidationError

from brachis.common.files import (
    BEGINNINGS,
    Kind,
    atomic_write,
    check_kind,
    check_suffix,
    read_file,
)
from brachis.errors import InputError, ResultFileError
from brachis.robot import bind
from brachis.robot.from_task import robot_from_settings
from brachis.task import load_task
from brachis.task.fields import Model
from brachis.task.messages import task_error
from brachis.trajectory.recovered import Recovered, StoredRecovery
from brachis.trajectory.sensitivities import Sensitivities

SCHEMA = 5
ARRAYS = (
    "times",
    "q",
    "qdot",
    "qddot",
    "qddot_before",
    "knots",
    "control_points",
    "phase_ends",
    "chart_rows",
    "chart_knots",
)
"""Names of the arrays in the file; as in `Trajectory`."""
_MOST_BYTES = 128_000_000
"""Largest size of a result file, and of what it holds unpacked."""
_MOST_NODES = 500_000
"""Largest number of nodes of a motion: they bound the time that its verification takes."""
_BROKEN = (
    OSError,
    ValueError,
    TypeError,
    LookupError,
    EOFError,
    ArithmeticError,
    RuntimeError,
    MemoryError,
    SyntaxError,
    tokenize.TokenError,
    zipfile.BadZipFile,
    zlib.error,
)
"""What archives, headers of arrays and JSON raise when they are broken."""


class _Meta(Model, extra="ignore", strict=True):
    """What a result file says besides its arrays."""

    task: dict[str, Any]
    urdf: str
    redundant_joints: list[str]
    branch: str
    degree: int
    joint_names: list[str]
    recovered: StoredRecovery | None = None
    own_limits: list[str] = Field(default_factory=list)
    sensitivities: dict[str, Any] | None = None


def write_result(
    path: str | os.PathLike[str],
    meta: Mapping[str, object],
    arrays: Mapping[str, np.ndarray],
) -> None:
    """Write a result file whole or not at all.

    Raises
    ------
    InputError
        The suffix is another than npz, the folder does not exist or cannot be written, the file exists and is not a
        result, or there are too many nodes.
    """
    check_suffix(
        path, ".npz", "brachis.export.write writes tables and formats of controllers"
    )
    count = arrays["times"].size
    if count > _MOST_NODES:
        raise InputError(
            "the motion has too many nodes",
            where="times",
            found=count,
            allowed=f"at most {_MOST_NODES}; import fewer rows, or a part of them",
        )
    text = np.array(json.dumps({"schema": SCHEMA, **meta}))
    digest = np.array(digest_of(text, arrays))
    contents: dict[str, Any] = {"meta": text, **arrays, "digest": digest}
    with atomic_write(path, BEGINNINGS[".npz"]) as stream:
        np.savez(stream, **contents)


def digest_of(text: np.ndarray, arrays: Mapping[str, np.ndarray]) -> str:
    """Return the SHA-256 of the metadata as text and of the arrays, by which a file is known that was changed."""
    digest = hashlib.sha256()
    for name, part in {"meta": text, **arrays}.items():
        digest.update(f"{name} {part.dtype} {part.shape} ".encode())
        digest.update(part.tobytes())
    return digest.hexdigest()


def read_result(path: Path) -> dict[str, Any]:
    """Read a result file; return the arguments of a `Trajectory`.

    Raises
    ------
    ResultFileError
        The file is missing, broken or of another schema version, or its parts do not fit each other.
    """
    check_kind(path, Kind.RESULT, ResultFileError)
    where = str(path)
    try:
        meta, arrays = _read_parts(io.BytesIO(read_file(path, _MOST_BYTES)))
    except FileNotFoundError as error:
        raise ResultFileError("the file does not exist", where=where) from error
    except _BROKEN as error:
        reason = getattr(error, "strerror", None) or str(error) or type(error).__name__
        raise ResultFileError(
            "the file is not a brachis result",
            where=where,
            found=reason,
            allowed="a file written by brachis plan",
        ) from error
    schema = meta.get("schema")
    if schema != SCHEMA:
        raise ResultFileError(
            "unknown schema version",
            where=where,
            found=schema,
            allowed=SCHEMA,
            hint="Plan again, or load the file with the release that wrote it",
        )
    try:
        return _build_parts(_Meta.model_validate(meta), arrays)
    except (ValidationError, InputError) as error:
        found: Exception = error
        if isinstance(error, ValidationError):
            found = task_error(error, "meta", _Meta)
        raise ResultFileError(
            "the result file is broken", where=where, found=str(found)
        ) from error


def _read_parts(stream: BinaryIO) -> tuple[dict[str, Any], dict[str, np.ndarray]]:
    """Read the metadata and the arrays, unchecked but for their types."""
    if not zipfile.is_zipfile(stream):
        raise ValueError("the file is not an npz archive")
    with zipfile.ZipFile(stream) as archive:
        members = archive.infolist()
    numpys = {zipfile.ZIP_STORED, zipfile.ZIP_DEFLATED}
    if not {member.compress_type for member in members} <= numpys:
        raise ValueError("an archive that NumPy does not write")
    unpacked = sum(member.file_size for member in members)
    if unpacked > _MOST_BYTES:
        raise ValueError(
            f"an archive of {unpacked / 1e6:.3g} MB unpacked, at most {_MOST_BYTES / 1e6:g} MB are read"
        )
    stream.seek(0)
    with np.load(stream, allow_pickle=False) as archive:
        text = archive["meta"]
        meta = json.loads(str(text))
        if not isinstance(meta, dict):
            raise TypeError("the metadata are not a mapping")
        if meta.get("schema") != SCHEMA:
            return meta, {}
        arrays = {name: np.asarray(archive[name]) for name in ARRAYS}
        if str(archive["digest"]) != digest_of(text, arrays):
            raise ValueError("the content is not what was saved")
    return meta, arrays


def _build_parts(meta: _Meta, arrays: dict[str, np.ndarray]) -> dict[str, Any]:
    """Make the robot and the task; return the arguments of a `Trajectory`."""
    task = load_task(meta.task)
    robot = robot_from_settings(task.robot, urdf_text=meta.urdf)
    robot, _ = bind(robot, task.task_space, task.tolerances)
    if meta.joint_names != list(robot.joint_names):
        raise InputError(
            "the joints are not those of the URDF",
            where="joint_names",
            found=meta.joint_names,
            allowed=robot.joint_names,
        )
    recovered = meta.recovered
    return {
        "task": task,
        "urdf": meta.urdf,
        "robot": robot,
        "redundant_joints": tuple(meta.redundant_joints),
        "branch": meta.branch,
        "degree": meta.degree,
        "recovered": recovered and Recovered.of_file(recovered, robot.n),
        "own_limits": tuple(meta.own_limits),
        "sensitivities": meta.sensitivities
        and Sensitivities.of_file(meta.sensitivities),
        **arrays,
    }
