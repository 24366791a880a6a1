"""The result file, an npz archive with the arrays, the task and the URDF of a trajectory."""

from __future__ import annotations

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

from brachis.common import tolerances
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
from brachis.task.fields import LARGEST, Model
from brachis.task.messages import task_error
from brachis.trajectory.phases import find_phase_knots
from brachis.trajectory.program import Event, MotionPart
from brachis.trajectory.recovered import Recovered, StoredRecovery
from brachis.trajectory.sensitivities import Sensitivities

SCHEMA = 4
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
"""Names of the arrays in the file, as in `Trajectory`."""
_MOST_BYTES = 128_000_000
"""Maximum size of a result file and of its unpacked content, bytes."""
_MOST_NODES = 500_000
"""Maximum number of nodes of a motion. This bounds the time that the verification takes."""
_HIGHEST_DEGREE = 7
"""Maximum degree of the splines, the same as in tasks."""
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
"""Errors raised when an archive, an array header or JSON is broken."""


class _StoredPart(Model, strict=True):
    """Name, kind, times, s, and travel of a part of a program."""

    name: str
    kind: str
    begin: float
    end: float
    travel: str = ""


class _StoredEvent(Model, strict=True):
    """Name and time, s, of an event."""

    name: str
    time: float


class _Meta(Model, extra="ignore", strict=True):
    """Content of a result file, except its arrays."""

    task: dict[str, Any]
    urdf: str
    redundant_joints: list[str]
    branch: str
    degree: int
    joint_names: list[str]
    recovered: StoredRecovery | None = None
    own_limits: list[str] = Field(default_factory=list)
    sensitivities: dict[str, Any] | None = None
    begin: float = 0.0
    parts: list[_StoredPart] = Field(default_factory=list)
    events: list[_StoredEvent] = Field(default_factory=list)
    components: list[_Meta] = Field(default_factory=list)


def write_result(
    path: str | os.PathLike[str],
    meta: Mapping[str, object],
    arrays: Mapping[str, np.ndarray],
) -> None:
    """Write a result file completely or not at all.

    Raises
    ------
    InputError
        The suffix is not npz, the folder does not exist or cannot be written, the file exists and is not a result, or
        there are too many nodes.
    """
    check_suffix(
        path, ".npz", "brachis.export.write writes tables and controller formats"
    )
    _check_nodes(arrays["times"])
    contents: dict[str, Any] = {
        "meta": np.array(json.dumps({"schema": SCHEMA, **meta})),
        **arrays,
    }
    with atomic_write(path, BEGINNINGS[".npz"]) as stream:
        np.savez(stream, **contents)


def read_result(path: Path) -> dict[str, Any]:
    """Read and check a result file; return the arguments of a `Trajectory`.

    Raises
    ------
    ResultFileError
        The file is missing, is broken or has an unknown schema version, or its parts do not fit each other.
    """
    check_kind(path, Kind.RESULT, ResultFileError)
    where = str(path)
    try:
        meta, arrays = _read_parts(io.BytesIO(read_file(path, _MOST_BYTES)))
    except FileNotFoundError as error:
        raise ResultFileError("the file does not exist", where=where) from error
    except _BROKEN as error:
        raise ResultFileError(
            "the file is not a brachis result",
            where=where,
            found=getattr(error, "strerror", None)
            or str(error)
            or type(error).__name__,
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
        return _check_parts(_Meta.model_validate(meta), arrays)
    except (ValidationError, InputError) as error:
        cause: Exception = error
        if isinstance(error, ValidationError):
            cause = task_error(error, "meta", _Meta)
        raise ResultFileError(
            "the result file is broken", where=where, found=str(cause)
        ) from error


def _read_parts(stream: BinaryIO) -> tuple[dict[str, Any], dict[str, np.ndarray]]:
    """Read the metadata and the arrays. Only the types of these parts are checked."""
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
        meta = json.loads(str(archive["meta"]))
        if not isinstance(meta, dict):
            raise TypeError("the metadata are not a mapping")
        ours = meta.get("schema") == SCHEMA
        names = [*ARRAYS]
        for number in range(len(meta.get("components", ()))):
            names += [f"{number}.{name}" for name in ARRAYS]
        arrays = {name: archive[name] for name in names if ours}
    for name, array in arrays.items():
        if not isinstance(array, np.ndarray):  # a member without the suffix .npy
            raise TypeError(f"{name} is not an array")
    return meta, arrays


def _check_parts(meta: _Meta, arrays: dict[str, np.ndarray]) -> dict[str, Any]:
    """Check that the parts fit each other, and return the arguments of a `Trajectory`."""
    task = load_task(meta.task)
    robot = robot_from_settings(task.robot, urdf_text=meta.urdf)
    robot, _ = bind(robot, task.task_space, task.tolerances)
    _refuse_unless(
        meta.joint_names == list(robot.joint_names),
        "joint_names",
        "the joints are not those of the URDF",
        meta.joint_names,
        robot.joint_names,
    )
    for stated in (task.joints_at("start"), task.joints_at("end")):
        if stated:
            robot.posture(stated[0], f"task.{stated[1]}")
    redundant = [name for name in robot.joint_names if name in meta.redundant_joints]
    _refuse_unless(
        meta.redundant_joints == redundant,
        "redundant_joints",
        "unknown joints",
        meta.redundant_joints,
        f"some of {', '.join(robot.joint_names)}, in this order",
    )
    for name, array in arrays.items():
        _refuse_unless(
            array.dtype.kind in "fiu" and (np.abs(array) <= LARGEST).all(),
            name,
            "some numbers are not finite or are too large",
            array,
            f"numbers between -{LARGEST:g} and {LARGEST:g}",
        )
    arrays = {name: array.astype(float) for name, array in arrays.items()}
    components = []
    for number, part in enumerate(meta.components):
        inner = {name: arrays.pop(f"{number}.{name}") for name in ARRAYS}
        components.append((part.begin, _check_parts(part, inner)))
    r = _redundancy(
        arrays["chart_rows"], arrays["chart_knots"], robot.n, len(redundant)
    )
    _check_arrays(arrays, robot.n, r, meta.degree)
    recovered = meta.recovered
    return {
        "task": task,
        "urdf": meta.urdf,
        "robot": robot,
        "redundant_joints": tuple(redundant),
        "branch": meta.branch,
        "degree": meta.degree,
        "recovered": recovered and Recovered.of_file(recovered, robot.n),
        "own_limits": tuple(meta.own_limits),
        "sensitivities": meta.sensitivities
        and Sensitivities.of_file(meta.sensitivities),
        "parts": tuple(MotionPart(**vars(part)) for part in meta.parts),
        "events": tuple(Event(**vars(event)) for event in meta.events),
        "components": components,
        **arrays,
    }


def _refuse_unless(
    fits: bool | np.bool_, where: str, problem: str, value: object, allowed: object
) -> None:
    if fits:
        return
    if isinstance(value, np.ndarray):
        value = f"an array of {value.dtype}, {value.shape}, that begins with {value.ravel()[:4].tolist()}"
    raise InputError(problem, where=where, found=value, allowed=allowed)


def _redundancy(rows: np.ndarray, knots: np.ndarray, n: int, named: int) -> int:
    """Return the degree of redundancy, from the chart after checking it, or else from the number of named joints."""
    if rows.shape[:1] == (0,) and not knots.size:
        return named
    degree = 5
    fits = rows.ndim == 3 and rows.shape[2] == n + 1
    if (
        fits
    ):  # the chart's reference begins at s = 0 and ends at s = 1, except for rounding
        count = len(rows) + degree + 1 if len(rows) != 1 else 0
        rounded = np.round(knots, 9)
        fits = knots.shape == (count,) and (not count or _are_knots(rounded, degree))
    _refuse_unless(
        fits,
        "chart_rows",
        "the rows and knots of the chart do not fit each other or the robot",
        f"{rows.shape}, knots {knots.shape}",
        f"rows (B, r, {n + 1}), and B + {degree + 1} knots from 0 to 1 if B is not 1",
    )
    _refuse_unless(
        named in (0, rows.shape[1]),
        "redundant_joints",
        "the joints are not those of the chart",
        named,
        rows.shape[1],
    )
    return int(rows.shape[1])


def _are_knots(knots: np.ndarray, degree: int) -> bool:
    """Return whether these are the knots of splines of this degree over [0, 1]."""
    outer = degree + 1
    if not 1 <= degree <= _HIGHEST_DEGREE or knots.ndim != 1 or len(knots) < 2 * outer:
        return False
    ends = not knots[:outer].any() and (knots[-outer:] == 1.0).all()
    return bool(ends and (np.diff(knots) >= 0.0).all())


def _check_arrays(arrays: dict[str, np.ndarray], n: int, r: int, degree: int) -> None:
    """Check the shapes and the order of the arrays.

    Pieces and intervals that are too short would be lost in rounding.
    """
    times = arrays["times"]
    knots = arrays["knots"]
    shortest = tolerances.TIME
    _check_nodes(times)
    begins = times.ndim == 1 and len(times) > 1 and times[0] == 0.0
    _refuse_unless(
        begins and (np.diff(times) >= shortest).all(),
        "times",
        "not times",
        times,
        f"ascending numbers from 0, at least {shortest:g} s apart",
    )
    _refuse_unless(
        _are_knots(knots, degree),
        "knots",
        f"not the knots of a spline of degree {degree}",
        knots,
        f"ascending numbers from 0 to 1, each end degree + 1 times; degrees up to {_HIGHEST_DEGREE}",
    )
    inner = knots[degree : len(knots) - degree]
    ends = knots[find_phase_knots(knots, degree)]
    gaps = np.diff(inner)
    _refuse_unless(
        ((gaps >= shortest) | np.isin(inner[1:], ends) & (gaps == 0.0)).all(),
        "knots",
        "internal knots are repeated",
        knots,
        f"every internal knot once, at least {shortest:g} apart, or degree + 1 times where phases meet",
    )
    phase_ends = arrays["phase_ends"]
    fits = phase_ends.shape == (len(ends) - 1,) and phase_ends[-1] == times[-1]
    _refuse_unless(
        fits
        and np.isin(phase_ends, times).all()
        and (np.abs(phase_ends / times[-1] - ends[1:]) <= shortest).all(),
        "phase_ends",
        "not the ends of the phases",
        phase_ends,
        "times of nodes, where knots are repeated; the last one is the end time",
    )
    shapes = dict.fromkeys(("q", "qdot", "qddot", "qddot_before"), (len(times), n))
    shapes["control_points"] = (1 + r, len(knots) - degree - 1)
    for name, shape in shapes.items():
        actual = arrays[name].shape
        _refuse_unless(actual == shape, name, "wrong shape", actual, shape)


def _check_nodes(times: np.ndarray) -> None:
    """Raise an error for a motion with more nodes than can be verified."""
    _refuse_unless(
        times.size <= _MOST_NODES,
        "times",
        "the motion has too many nodes",
        times.size,
        f"at most {_MOST_NODES}; import fewer rows, or only a part of the motion",
    )
