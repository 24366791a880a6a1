"""Broken inputs for `fuzz.py`: valid task files, URDFs, CSV files and results, and what may happen to them.

A case is its number: the same number gives the same files.
"""

from __future__ import annotations

import contextlib
import copy
import io
import json
import math
import random
import re
import xml.etree.ElementTree as ET
import zipfile
from collections.abc import Callable
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
import yaml

ROBOTS = Path(__file__).parents[1] / "robots"
KINDS = (
    "task",
    "task bytes",
    "urdf",
    "urdf bytes",
    "csv",
    "csv bytes",
    "result",
    "result bytes",
    "result extreme",
)
_DEEP = "@deep@"
_SCARA = {
    "urdf": "robot.urdf",
    "tool_frame": "tool",
    "gravity": [0, 0, 0],
    "limits": {"torque": 10, "velocity": 8},
}
_START = {"joints": [0.5236, -2.0944, 2.0944]}
_CHEAP = {
    "search": {"effort": "single", "time_limit": 3.0},
    "spline": {"degree": 3, "intervals": 5, "rest": "full"},
    "solver": {"name": "auto", "max_iterations": 40, "time_limit": 1.0},
    "refinement": {"max_rounds": 1},
}
_TASKS: tuple[dict[str, Any], ...] = (
    {
        "start": _START,
        "task_space": ["x", "y"],
        "path": [{"line": {"length": 0.3, "angle_deg": 90}}],
        "end": "free",
    },
    {
        "start": _START,
        "task_space": ["x", "y"],
        "path": [
            {"line": {"length": 0.3, "angle_deg": 90}, "blend": 0.05},
            {"line": {"by": [-0.2, 0]}},
        ],
        "redundant_joints": ["j3"],
    },
    {
        "start": "free",
        "path_start": [0.9, 0.4],
        "task_space": ["x", "y"],
        "path": [{"line": {"to": [0.8, 0.6]}}],
    },
    {
        "start": _START,
        "task_space": ["x", "y"],
        "path": [{"csv": {"file": "path.csv", "relative": True}}],
    },
    {
        "start": _START,
        "task_space": ["x", "y", "yaw"],
        "path": [
            {
                "spline": {
                    "through": [[0.05, 0.1, 0.1], [0.1, 0.2, 0.3]],
                    "relative": True,
                }
            }
        ],
        "redundant_joints": [],
    },
)
_RAIL = {
    "robot": {"urdf": "robot.urdf", "tool_frame": "tool"},
    "start": {"joints": [0.0, 0.3, 0.2, 1.5, 0.2, 1.2, 0.1]},
    "task_space": "pose",
    "path": [{"line": {"by": [0.0, 0.2, 0.0]}}],
    "redundant_joints": ["rail"],
}
_OTHER_ROBOTS = {"tx90l_rail": _RAIL}
_WEIRD: tuple[Any, ...] = (
    *(
        math.nan,
        math.inf,
        -math.inf,
        1e308,
        -1e308,
        1e-308,
        1e12,
        1e-12,
        -1,
        0,
        -0.0,
        10**400,
        2**63,
    ),
    *(
        "1,5",
        "",
        "10 Nm",
        "nan",
        "x" * 5000,
        "\0",
        "\ud7ff\u202e",
        "!!python/object:os.system",
        "j1",
        "../robot.urdf",
    ),
    *(
        None,
        True,
        [],
        {},
        [[]],
        {"a": 1},
        [0.1] * 3000,
        [math.nan] * 3,
        ["j1"] * 50,
        _DEEP,
        "/dev/zero",
        ".",
    ),
)
_WEIRD_TEXT = (
    "nan",
    "inf",
    "-inf",
    "1e308",
    "1e-308",
    "-1",
    "0",
    "1,5",
    "",
    "10 Nm",
    "0 0",
    "1 2 3 4",
    "${x}",
    "a" * 5000,
)
_LONGEST = 3.0
"""Of a plan, s: a task may ask for more time than a case has."""


@dataclass(frozen=True)
class Case:
    """Files, by name, and which of them is read how."""

    number: int
    kind: str
    files: dict[str, bytes] = field(repr=False)
    done: tuple[str, ...]


def case(
    number: int, results: tuple[bytes, ...], kinds: tuple[str, ...] = KINDS
) -> Case:
    """Make the files of a case, of one of the kinds in turn; `results` are valid result files."""
    rng = random.Random(f"brachis {number}")  # noqa: S311  (not for secrets)
    kind = kinds[number % len(kinds)]
    what, _, how = kind.partition(" ")
    if what == "result":
        breaks_result = {
            "": broken_result,
            "bytes": broken_bytes,
            "extreme": extreme_result,
        }
        broken = breaks_result[how](rng.choice(results), rng)
        return Case(number, kind, {"result.npz": broken}, ("verify",))
    robot, task = _valid(rng, what)
    urdf = (ROBOTS / robot / "robot.urdf").read_text().encode()
    files = {"robot.urdf": urdf, "path.csv": _csv(rng), "task.yaml": b""}
    breaks: dict[str, Callable[[bytes], bytes]] = {
        "urdf": lambda text: broken_xml(text, rng),
        "csv": lambda text: broken_csv(text, rng),
    }
    if what == "task" and not how:
        for _ in range(rng.choice((1, 1, 2, 4))):
            task = broken_tree(task, rng)
        task = _bounded(task)
    files["task.yaml"] = _yaml(task)
    name = {"task": "task.yaml", "urdf": "robot.urdf", "csv": "path.csv"}[what]
    if how:
        files[name] = broken_bytes(files[name], rng)
    elif what in breaks:
        files[name] = breaks[what](files[name])
    return Case(
        number, kind, files, ("inspect", "plan") if what == "urdf" else ("plan",)
    )


def _valid(rng: random.Random, what: str) -> tuple[str, dict[str, Any]]:
    """Choose a robot and a task for it."""
    if what == "csv":
        return "scara3", {"brachis": 1, "robot": _SCARA, **_TASKS[3], **_CHEAP}
    if rng.random() < 0.05:
        robot = rng.choice(tuple(_OTHER_ROBOTS))
        return robot, {
            "brachis": 1,
            **copy.deepcopy(_OTHER_ROBOTS[robot]),
            **copy.deepcopy(_CHEAP),
        }
    return "scara3", copy.deepcopy(
        {"brachis": 1, "robot": _SCARA, **rng.choice(_TASKS), **_CHEAP}
    )


def _bounded(task: Any) -> Any:
    """Keep the time of the search so short that a case ends."""
    search = task.get("search") if isinstance(task, dict) else None
    if isinstance(search, dict) and isinstance(
        search.get("time_limit", 0.0), int | float
    ):
        search["time_limit"] = min(search.get("time_limit", _LONGEST), _LONGEST)
    elif isinstance(task, dict) and search is None:
        task["search"] = dict(_CHEAP["search"])
    return task


def _yaml(task: object) -> bytes:
    text = yaml.safe_dump(task, default_flow_style=None, allow_unicode=True)
    return re.sub(f"'?{_DEEP}'?", "[" * 3000 + "]" * 3000, text).encode(
        "utf-8", "surrogatepass"
    )


def _csv(rng: random.Random) -> bytes:
    points = [
        (0.02 * i, 0.03 * i + 0.01 * math.sin(0.4 * i))
        for i in range(rng.choice((3, 8, 12)))
    ]
    return (
        "# waypoints, m\nx,y\n" + "".join(f"{x:.6f},{y:.6f}\n" for x, y in points)
    ).encode()


def _places(tree: Any) -> list[tuple[Any, Any]]:
    """List all containers in a tree with each of their keys."""
    found = []
    keys = (
        list(tree)
        if isinstance(tree, dict)
        else range(len(tree))
        if isinstance(tree, list)
        else ()
    )
    for key in keys:
        found += [(tree, key), *_places(tree[key])]
    return found


def broken_tree(tree: Any, rng: random.Random) -> Any:
    """Drop, swap, repeat, rename or replace something in mappings and lists."""
    tree = copy.deepcopy(tree)
    places = _places(tree)
    if not places:
        return rng.choice(_WEIRD)
    holder, key = rng.choice(places)
    value = holder[key]
    action = rng.choice(
        ("weird", "weird", "drop", "swap", "repeat", "rename", "scale", "copy")
    )
    if action == "drop":
        del holder[key]
    elif action == "swap":
        other, place = rng.choice(places)
        if not _holds(value, other) and not _holds(other[place], holder):
            holder[key], other[place] = (
                copy.deepcopy(other[place]),
                copy.deepcopy(value),
            )
    elif action == "repeat" and isinstance(holder, list):
        holder[key:key] = [
            copy.deepcopy(value) for _ in range(rng.choice((1, 2, 30, 2000)))
        ]
    elif action == "rename" and isinstance(holder, dict):
        holder[rng.choice((str(key)[:-1], f"{key}s", "x", "1", ""))] = holder.pop(key)
    elif (
        action == "scale"
        and isinstance(value, int | float)
        and not isinstance(value, bool)
    ):
        holder[key] = value * 10.0 ** rng.uniform(-6.0, 6.0) * rng.choice((1.0, -1.0))
    elif action == "copy":
        holder[key] = copy.deepcopy(rng.choice(places)[0])
    else:
        holder[key] = rng.choice(_WEIRD)
    return tree


def _holds(tree: Any, part: object) -> bool:
    return tree is part or any(
        holder is part or holder[key] is part for holder, key in _places(tree)
    )


def broken_xml(text: bytes, rng: random.Random) -> bytes:
    """Drop, repeat, move, rename or change elements and attributes."""
    root = ET.fromstring(text)
    for _ in range(rng.choice((1, 1, 2, 4))):
        parents = {child: parent for parent in root.iter() for child in parent}
        element = rng.choice(list(parents) or [root])
        parent = parents.get(element, root)
        action = rng.choice(
            ("weird", "weird", "weird", "unset", "drop", "repeat", "rename", "move")
        )
        names = list(element.attrib)
        if action == "weird" and names:
            element.set(rng.choice(names), rng.choice(_WEIRD_TEXT))
        elif action == "unset" and names:
            del element.attrib[rng.choice(names)]
        elif action == "repeat":
            parent.append(copy.deepcopy(element))
        elif action == "rename":
            element.tag = rng.choice(
                ("x", "link", "joint", "mimic", "inertial", "origin")
            )
        elif element in parents:
            parent.remove(element)
            if action == "move":
                rng.choice(list(root.iter())).append(element)
    return ET.tostring(root)


def broken_csv(text: bytes, rng: random.Random) -> bytes:
    """Change cells, rows and the header."""
    rows = [line.split(",") for line in text.decode().splitlines()]
    for _ in range(rng.choice((1, 1, 2, 5))):
        row = rng.choice(rows)
        action = rng.choice(
            (
                "weird",
                "weird",
                "drop cell",
                "more",
                "drop",
                "repeat",
                "swap",
                "quote",
                "many",
            )
        )
        if action == "weird" and row:
            row[rng.randrange(len(row))] = rng.choice(
                (*_WEIRD_TEXT, "\0", '"', "\r", "\ufeff", "z", "yaw", "1_0")
            )
        elif action == "drop cell" and row:
            row.pop()
        elif action == "more":
            row += ["0.5"] * rng.choice((1, 5000))
        elif action == "drop" and len(rows) > 1:
            rows.remove(row)
        elif action == "repeat":
            rows.insert(rng.randrange(len(rows)), list(row))
        elif action == "many":
            rows += [
                [f"{0.001 * i:.4f}", "0.1"] for i in range(rng.choice((50, 20_000)))
            ]
        elif action == "quote" and row:
            row[0] = f'"{row[0]}'
        else:
            rng.shuffle(rows)
    return (
        rng.choice(("\n", "\n", "\r\n", "\r"))
        .join(",".join(row) for row in rows)
        .encode()
    )


def broken_bytes(data: bytes, rng: random.Random) -> bytes:
    """Flip bits, cut, repeat and insert bytes."""
    content = bytearray(data)
    for _ in range(rng.choice((1, 1, 3, 20))):
        at = rng.randrange(len(content) + 1)
        length = rng.choice((1, 1, 8, 200))
        action = rng.choice(
            (
                "flip",
                "flip",
                "cut",
                "end",
                "insert",
                "repeat",
                "digit",
                "digit",
                "digit",
            )
        )
        if action == "digit":
            digits = [
                place for place, byte in enumerate(content) if byte in b"0123456789.-"
            ] or [0]
            at = rng.choice(digits)
            content[at : at + 1] = rng.choice(tuple(b"0123456789.-+eE ")).to_bytes()
        elif action == "flip" and at < len(content):
            content[at] ^= 1 << rng.randrange(8)
        elif action == "cut":
            del content[at : at + length]
        elif action == "end" and rng.random() < 0.3:
            del content[at:]
        elif action == "insert":
            content[at:at] = rng.randbytes(length)
        else:
            content[at:at] = content[at : at + length] * rng.choice((1, 50))
    return bytes(content)


def broken_result(data: bytes, rng: random.Random) -> bytes:
    """Change arrays, metadata and members of a result file."""
    with np.load(io.BytesIO(data)) as archive:
        parts: dict[str, Any] = dict(archive)
    for _ in range(rng.choice((1, 1, 2))):
        name = rng.choice([name for name in parts if name != "meta"])
        action = rng.choice(
            (
                "meta",
                "meta",
                "meta",
                "urdf",
                "value",
                "value",
                "shape",
                "type",
                "drop",
                "swap",
            )
        )
        if action == "meta":
            meta = broken_tree(json.loads(str(parts["meta"])), rng)
            parts["meta"] = np.array(
                json.dumps(meta).replace(f'"{_DEEP}"', "[" * 5000 + "]" * 5000)
            )
        elif action == "urdf":
            meta = json.loads(str(parts["meta"]))
            if (
                isinstance(meta, dict)
                and isinstance(meta.get("urdf"), str)
                and meta["urdf"].startswith("<")
            ):
                meta["urdf"] = broken_xml(meta["urdf"].encode(), rng).decode()
                parts["meta"] = np.array(json.dumps(meta))
        elif action == "value" and parts[name].dtype == float and parts[name].size:
            parts[name] = parts[name].copy()
            flat = parts[name].reshape(-1)
            weird = (
                math.nan,
                math.inf,
                1e308,
                -1e308,
                1e-308,
                -1.0,
                0.0,
                1e6,
                flat[0],
                flat[-1],
            )
            flat[rng.randrange(flat.size) if rng.random() < 0.7 else slice(None)] = (
                rng.choice(weird)
            )
        elif action == "shape":
            array = parts[name]
            parts[name] = rng.choice(
                (
                    array.T,
                    array[:-1],
                    array.ravel(),
                    array[None],
                    array[:0],
                    np.float64(1.0),
                )
            )
        elif action == "type":
            parts[name] = parts[name].astype(
                rng.choice(("int8", "complex128", "float16", "U9", "bool"))
            )
        elif action == "drop":
            del parts[name]
        else:
            other = rng.choice([each for each in parts if each != "meta"])
            parts[name], parts[other] = parts[other], parts[name]
        if len(parts) < 3:
            break
    return _archive(parts, rng)


_COUNTS = (2, 300, 3000, 20_000, 49_000, 60_000, 400_000)
_LIMITS: tuple[dict[str, Any], ...] = (
    {"torque": 10, "torque_rate": 80, "jerk": 50, "acceleration": 9, "velocity": 3},
    {"torque": 10, "power": 5, "total_power": 9, "rms_torque": 4, "velocity": 2},
    {"torque": 1e12, "velocity": 1e-6, "jerk": 1e-6},
)
_TOOL_LIMITS: tuple[dict[str, Any], ...] = (
    {"speed": 0.4, "acceleration": 2.0, "angular_speed": 1.0},
    {"process_speed": [{"s": [0.3, 0.6], "speed": 0.1}]},
    {
        "process_speed": [
            {"s": [i / 1000, (i + 0.5) / 1000], "speed": 0.1} for i in range(1000)
        ]
    },
    {
        "speed": {
            "s": [i / 30_000 for i in range(30_001)],
            "speed": [0.1 + i % 2 for i in range(30_001)],
        }
    },
)
_PATHS: tuple[list[dict[str, Any]], ...] = (
    [{"line": {"by": [0.0, 0.3 / 3000]}}] * 3000,
    [{"line": {"by": [0.0, 0.3 / 30_000]}}] * 30_000,
    [{"line": {"by": [0.0, 0.1]}, "blend": 1e-9}, {"line": {"by": [0.1, 0.0]}}] * 200,
    [
        {
            "spline": {
                "through": [[0.0, 0.3 * i / 20_000] for i in range(1, 20_001)],
                "relative": True,
            }
        }
    ],
    [{"arc": {"radius": 1e9, "angle_deg": 1e9}}],
    [{"line": {"length": 1e12, "angle_deg": 90}}],
)


_Parts = dict[str, Any]


def _many_nodes(parts: _Parts, _meta: _Parts, rng: random.Random) -> None:
    old = parts["times"]
    parts["times"] = np.linspace(old[0], old[-1], rng.choice(_COUNTS))
    for name in _MOMENTS:
        parts[name] = np.column_stack(
            [np.interp(parts["times"], old, column) for column in parts[name].T]
        )


def _many_knots(parts: _Parts, meta: _Parts, rng: random.Random) -> None:
    count, degree = rng.choice(_COUNTS), meta["degree"]
    parts["knots"] = np.concatenate(
        [np.zeros(degree), np.linspace(0.0, 1.0, count), np.ones(degree)]
    )
    places, old = (
        np.linspace(0.0, 1.0, count + degree - 1),
        np.linspace(0.0, 1.0, parts["control_points"].shape[1]),
    )
    parts["control_points"] = np.array(
        [np.interp(places, old, row) for row in parts["control_points"]]
    )


def _far_and_fast(parts: _Parts, _meta: _Parts, rng: random.Random) -> None:
    for name in _MOMENTS:
        parts[name] = parts[name] * 10.0 ** rng.uniform(0.0, 12.0)


def _other_task(_parts: _Parts, meta: _Parts, rng: random.Random) -> None:
    changes = {"path": _PATHS, "tool_limits": _TOOL_LIMITS, "task_space": _SPACES}
    key = rng.choice(("limits", *changes))
    if key == "limits":
        meta["task"]["robot"]["limits"] = rng.choice(_LIMITS)
    else:
        meta["task"][key] = rng.choice(changes[key])


def _extreme_values(parts: _Parts, _meta: _Parts, rng: random.Random) -> None:
    name = rng.choice([name for name in parts if name != "meta" and parts[name].size])
    changed = parts[name].copy().reshape(-1)
    weird = (math.nan, math.inf, -math.inf, 1e300, -1e300, 1e-300, 1e12, -1e12, 1e6)
    changed[rng.randrange(changed.size) if rng.random() < 0.5 else slice(None)] = (
        rng.choice(weird)
    )
    parts[name] = changed.reshape(parts[name].shape)


def _close_nodes(parts: _Parts, _meta: _Parts, rng: random.Random) -> None:
    times, k = parts["times"].copy(), rng.randrange(1, len(parts["times"]))
    times[k:] += times[k - 1] + 10.0 ** rng.uniform(-15.0, 0.0) - times[k]
    parts["times"] = times


def _other_times(parts: _Parts, _meta: _Parts, rng: random.Random) -> None:
    parts["times"] = parts["times"] * rng.choice(
        (-1.0, 1e-300, 1e-9, 1e-3, 1e3, 1e9, 1e300)
    )


_EXTREMES = (
    _many_nodes,
    _many_knots,
    _far_and_fast,
    _other_task,
    _other_task,
    _extreme_values,
    _close_nodes,
    _other_times,
)
_MOMENTS = ("q", "qdot", "qddot", "qddot_before")
_TYPES = (np.longdouble, np.float16, np.uint8, "M8[s]", object, "S8", ">f8", "V8", bool)
_SPACES = (["x", "y", "yaw"], ["x"], "pose", "joints")


def extreme_result(data: bytes, rng: random.Random) -> bytes:
    """Ask a result file for as much work and memory as it can, with figures of any size and arrays of any kind."""
    with np.load(io.BytesIO(data)) as archive:
        parts: _Parts = dict(archive)
    meta = json.loads(str(parts["meta"]))
    for _ in range(rng.choice((1, 1, 2, 3))):
        rng.choice(_EXTREMES)(parts, meta, rng)
    retyped = rng.choice(list(parts)) if rng.random() < 0.1 else "meta"
    if retyped != "meta":
        with contextlib.suppress(ValueError, TypeError), np.errstate(all="ignore"):
            parts[retyped] = parts[retyped].astype(rng.choice(_TYPES))
    parts["meta"] = np.array(json.dumps(meta))
    stream = io.BytesIO()
    with np.errstate(all="ignore"):
        np.savez_compressed(stream, **parts)
    last = rng.choice(("", "", "", "", "", "", "header", "bomb", "many"))
    return stream.getvalue() if not last else _rezipped(stream.getvalue(), last, rng)


def _rezipped(data: bytes, how: str, rng: random.Random) -> bytes:
    """Change the header of an array, or add members that are large or many."""
    with zipfile.ZipFile(io.BytesIO(data)) as archive:
        members = {name: archive.read(name) for name in archive.namelist()}
    name = rng.choice(list(members))
    if how == "header":
        content = members[name]
        header = content[10 : 10 + int.from_bytes(content[8:10], "little")]
        shape = rng.choice(
            (
                b"(10000000000,)",
                b"(-1,)",
                b"(1" + b"0" * 40 + b",)",
                b"()",
                b"(2.5,)",
                b"(" * 2000,
            )
        )
        broken = rng.choice(
            (
                header[: rng.randrange(len(header))],
                re.sub(rb"\(.*?\)", shape, header),
                header[::-1],
            )
        )
        members[name] = (
            content[:8]
            + len(broken).to_bytes(2, "little")
            + broken
            + content[10 + len(header) :]
        )
    elif how == "bomb":
        members[rng.choice((name, "extra.npy"))] = bytes(200_000_000)
    else:
        members |= {f"{i}.npy": b"" for i in range(50_000)}
    stream = io.BytesIO()
    with zipfile.ZipFile(stream, "w", zipfile.ZIP_DEFLATED) as archive:
        for name, member in members.items():
            archive.writestr(name, member)
    return stream.getvalue()


def _archive(parts: dict[str, Any], rng: random.Random) -> bytes:
    """Write an npz archive; now and then compressed, or with a member twice."""
    stream = io.BytesIO()
    with np.errstate(all="ignore"):
        (np.savez_compressed if rng.random() < 0.2 else np.savez)(stream, **parts)
    if rng.random() < 0.1:
        with zipfile.ZipFile(stream, "a") as archive:
            archive.writestr(
                rng.choice(("q", "extra", "../meta.npy")), rng.randbytes(100)
            )
    return stream.getvalue()
