"""The result file: one npz archive with a trajectory's arrays, its task and its URDF."""

from __future__ import annotations

import io
import json
import os
import tokenize
import zipfile
import zlib
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any, BinaryIO

import numpy as np

from brachis.common.files import Kind, atomic_write, check_kind, check_suffix, read_file
from brachis.errors import InputError, ResultFileError
from brachis.robot import Robot, bind
from brachis.robot.from_task import robot_from_settings
from brachis.task import Task, load_task
from brachis.trajectory.recovered import Recovered

SCHEMA = 3
ARRAYS = (
    "times",
    "q",
    "qdot",
    "qddot",
    "qddot_before",
    "knots",
    "control_points",
    "chart_rows",
    "chart_knots",
)
"""Names of the arrays in the file; as in `Trajectory`."""
CHART_DEGREE = 5
"""Of the splines of a chart's rows."""
LARGEST = 32_000_000
"""Of a result file and of what it holds unpacked, bytes."""
MOST_NODES = 50_000
"""Nodes of a motion, which bound what its verification takes."""
_LARGEST_NUMBER = 1e12
"""Of what an array holds: as in tasks."""
_SHORTEST_PIECE, _SHORTEST_INTERVAL = 1e-12, 1e-12
"""Of a motion, s, and of its splines, in normalised time: shorter ones are lost in rounding."""
_RENAMED = {"quaternion": "quaternion_wxyz"}
"""Keys of tasks in files of schema 2, and what they are called now."""
_HIGHEST_DEGREE = 7
"""Of splines, as in tasks."""
_PACKED = {zipfile.ZIP_STORED, zipfile.ZIP_DEFLATED}
"""How NumPy packs members of an archive."""
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


@dataclass(frozen=True, eq=False)
class Content:
    """What a result file says; the parts fit each other.

    Attributes
    ----------
    task : Task
    urdf : str
    robot : Robot
    redundant_joints : tuple of str
    branch : str
    degree : int
    recovered : Recovered or None
    arrays : dict of str to ndarray
        See `Trajectory` for their shapes.
    """

    task: Task
    urdf: str
    robot: Robot
    redundant_joints: tuple[str, ...]
    branch: str
    degree: int
    recovered: Recovered | None
    arrays: dict[str, np.ndarray]


def write_result(
    path: str | os.PathLike[str],
    meta: Mapping[str, object],
    arrays: Mapping[str, np.ndarray],
) -> None:
    """Write a result file whole or not at all.

    Raises
    ------
    InputError
        The suffix is another than npz, the folder does not exist or cannot be written, or there are too many nodes.
    """
    check_suffix(
        path, ".npz", "brachis.export.write writes tables and formats of controllers"
    )
    _check_nodes(arrays["times"])
    contents: dict[str, Any] = {
        "meta": np.array(json.dumps({"schema": SCHEMA, **meta})),
        **arrays,
    }
    with atomic_write(path) as stream:
        np.savez(stream, **contents)


def read_result(path: Path) -> Content:
    """Read and check a result file.

    Raises
    ------
    ResultFileError
        The file is missing, broken or of another schema version, or its parts do not fit each other.
    """
    check_kind(path, Kind.RESULT, ResultFileError)
    try:
        meta, arrays = _parts(io.BytesIO(read_file(path, LARGEST)))
    except FileNotFoundError as error:
        raise ResultFileError(
            "the result file does not exist", where=str(path)
        ) from error
    except _BROKEN as error:
        raise ResultFileError(
            "the file is not a brachis result",
            where=str(path),
            found=getattr(error, "strerror", None)
            or str(error)
            or type(error).__name__,
            allowed="a file written by brachis plan",
        ) from error
    if meta.get("schema") not in {2, SCHEMA}:
        raise ResultFileError(
            "unknown schema version",
            where=str(path),
            found=meta.get("schema"),
            allowed=SCHEMA,
        )
    try:
        if meta["schema"] != SCHEMA:
            meta = {**meta, "task": _renew_task(meta.get("task"))}
        return _content(meta, arrays)
    except InputError as error:
        raise ResultFileError(
            "the result file is broken", where=str(path), found=str(error)
        ) from error


def _parts(stream: BinaryIO) -> tuple[dict[str, Any], dict[str, np.ndarray]]:
    """Read the metadata and the arrays, unchecked but for their types."""
    if not zipfile.is_zipfile(stream):
        raise ValueError("no npz archive")
    stream.seek(0)
    with zipfile.ZipFile(stream) as archive:
        members = archive.infolist()
    if not {member.compress_type for member in members} <= _PACKED:
        raise ValueError("an archive that NumPy does not write")
    unpacked = sum(member.file_size for member in members)
    if unpacked > LARGEST:
        raise ValueError(
            f"an archive of {unpacked / 1e6:.3g} MB unpacked, at most {LARGEST / 1e6:g} MB are read"
        )
    stream.seek(0)
    archive = np.load(stream, allow_pickle=False)
    if not isinstance(archive, np.lib.npyio.NpzFile):
        raise ValueError("a single array")  # noqa: TRY004  (a wrong file, not a wrong call)
    with archive:
        meta = json.loads(str(archive["meta"]))
        arrays = {name: archive[name] for name in ARRAYS}
    foreign = [
        name for name, array in arrays.items() if not isinstance(array, np.ndarray)
    ]
    if foreign:  # a member without the suffix .npy is read as bytes
        raise ValueError(f"{foreign[0]} is no array")
    if not isinstance(meta, dict):
        raise ValueError("metadata that are no mapping")  # noqa: TRY004
    return meta, arrays


def _renew_task(part: object) -> object:
    """Write a task, or a part of one, of a file of schema 2 as tasks are written now: the order of quaternions."""
    if isinstance(part, list):
        return [_renew_task(each) for each in part]
    if not isinstance(part, dict):
        return part
    renewed = {
        _RENAMED.get(key, key): _renew_task(value) for key, value in part.items()
    }
    place = renewed.get("path_start")
    if isinstance(place, list) and renewed.get("task_space") in {
        "pose",
        "pose_free_roll",
    }:
        renewed["path_start"] = {"position": place[:3], "quaternion_wxyz": place[3:]}
    turn = renewed.get("rotate")
    if isinstance(turn, dict) and turn.get("frame") == "world":
        renewed["rotate"] = {**turn, "frame": "path"}
    return renewed


def _content(meta: dict[str, Any], arrays: dict[str, np.ndarray]) -> Content:
    """Check every part, and that they fit each other."""
    kinds = {
        "task": dict,
        "urdf": str,
        "redundant_joints": list,
        "branch": str,
        "degree": int,
        "joint_names": list,
    }
    for key, kind in kinds.items():
        if not isinstance(meta.get(key), kind) or isinstance(meta[key], bool):
            found = type(meta[key]).__name__ if key in meta else "nothing"
            raise InputError(
                "wrong type", where=key, found=found, allowed=kind.__name__
            )
    task = load_task(meta["task"])
    robot, _ = bind(
        robot_from_settings(task.robot, urdf_text=meta["urdf"]), task.task_space
    )
    if meta["joint_names"] != list(robot.joint_names):
        raise InputError(
            "other joints than the URDF's",
            where="joint_names",
            found=meta["joint_names"],
            allowed=robot.joint_names,
        )
    if task.start != "free":
        robot.posture(task.start.joints, "task.start.joints")
    if task.end != "free":
        robot.posture(task.end.joints, "task.end.joints")
    redundant = [name for name in robot.joint_names if name in meta["redundant_joints"]]
    if meta["redundant_joints"] != redundant:
        allowed = f"some of {', '.join(robot.joint_names)}, in this order"
        raise InputError(
            "unknown joints",
            where="redundant_joints",
            found=meta["redundant_joints"],
            allowed=allowed,
        )
    for name, array in arrays.items():
        if (
            array.dtype.kind not in "fiu"
            or not (np.abs(array) <= _LARGEST_NUMBER).all()
        ):
            allowed = f"numbers between -{_LARGEST_NUMBER:g} and {_LARGEST_NUMBER:g}"
            raise InputError(
                "not all are finite numbers of a usable size",
                where=name,
                allowed=allowed,
            )
    arrays = {name: array.astype(float) for name, array in arrays.items()}
    r = _redundancy(arrays, robot.n, len(redundant))
    _check_arrays(arrays, robot.n, r, meta["degree"])
    recovered = Recovered.of_file(meta.get("recovered"), robot.n)
    return Content(
        task,
        meta["urdf"],
        robot,
        tuple(redundant),
        meta["branch"],
        meta["degree"],
        recovered,
        arrays,
    )


def _redundancy(arrays: dict[str, np.ndarray], n: int, named: int) -> int:
    """Degree of redundancy, after a check of the chart that says it where joints do not."""
    rows, knots = arrays["chart_rows"], arrays["chart_knots"]
    if rows.shape[:1] == (0,) and not knots.size:
        return named
    fits = rows.ndim == 3 and rows.shape[2] == n + 1
    if fits and len(rows) == 1:
        fits = knots.shape == (0,)
    elif fits:  # the reference begins at s = 0 and ends at 1 to rounding
        fits = knots.shape == (len(rows) + CHART_DEGREE + 1,) and _are_knots(
            np.round(knots, 9), CHART_DEGREE
        )
    if not fits:
        allowed = f"rows (B, r, {n + 1}), and B + {CHART_DEGREE + 1} knots from 0 to 1 where B is not 1"
        raise InputError(
            "no chart",
            where="chart_rows",
            found=f"{rows.shape}, knots {knots.shape}",
            allowed=allowed,
        )
    if named not in (0, rows.shape[1]):
        raise InputError(
            "other joints than the chart's",
            where="redundant_joints",
            found=named,
            allowed=rows.shape[1],
        )
    return int(rows.shape[1])


def _are_knots(knots: np.ndarray, degree: int) -> bool:
    """Tell whether these are the knots of splines of a degree over [0, 1]."""
    outer = degree + 1
    long = (
        1 <= degree <= _HIGHEST_DEGREE and knots.ndim == 1 and len(knots) >= 2 * outer
    )
    ends = long and not knots[:outer].any() and bool((knots[-outer:] == 1.0).all())
    return ends and bool((np.diff(knots) >= 0.0).all())


def _check_arrays(arrays: dict[str, np.ndarray], n: int, r: int, degree: int) -> None:
    """Check shapes and order."""
    times, knots = arrays["times"], arrays["knots"]
    _check_nodes(times)
    if (
        times.ndim != 1
        or len(times) < 2
        or times[0] != 0.0
        or not (np.diff(times) >= _SHORTEST_PIECE).all()
    ):
        allowed = f"ascending numbers from 0, at least {_SHORTEST_PIECE:g} s apart"
        raise InputError(
            "not times", where="times", found=_extent(times), allowed=allowed
        )
    if not _are_knots(knots, degree):
        allowed = f"ascending numbers from 0 to 1, either degree + 1 times; degrees up to {_HIGHEST_DEGREE}"
        raise InputError(
            f"not the knots of a spline of degree {degree}",
            where="knots",
            found=_extent(knots),
            allowed=allowed,
        )
    if not (np.diff(knots[degree : len(knots) - degree]) >= _SHORTEST_INTERVAL).all():
        allowed = f"every internal knot once, at least {_SHORTEST_INTERVAL:g} apart"
        raise InputError("internal knots are repeated", where="knots", allowed=allowed)
    shapes = dict.fromkeys(("q", "qdot", "qddot", "qddot_before"), (len(times), n))
    shapes["control_points"] = (1 + r, len(knots) - degree - 1)
    for name, shape in shapes.items():
        if arrays[name].shape != shape:
            raise InputError(
                "wrong shape", where=name, found=arrays[name].shape, allowed=shape
            )


def _check_nodes(times: np.ndarray) -> None:
    """Refuse motions of so many nodes that they are not verified."""
    if times.size > MOST_NODES:
        hint = "Import fewer rows, or a part of them"
        raise InputError(
            "the motion has too many nodes",
            where="times",
            found=times.size,
            allowed=MOST_NODES,
            hint=hint,
        )


def _extent(array: np.ndarray) -> str:
    """Say briefly what an array is."""
    if array.ndim != 1 or not len(array):
        return f"an array of shape {array.shape}"
    return f"{len(array)} numbers from {array[0]:g} to {array[-1]:g}"
