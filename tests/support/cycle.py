"""A cycle of a gantry: a program with a path, moves, a dwell, limits and a payload of its own, and events."""

from typing import Any

HOME = {"joints": [0.1, 0.1]}
CYCLE: dict[str, Any] = {
    "brachis": 1,
    "robot": {"urdf": "gantry2"},
    "postures": {"home": HOME["joints"]},
    "start": "home",
    "end": "start",
    "task_space": ["x", "y"],
    "search": {"effort": "single"},
    "program": [
        {"move": "next", "limits": {"velocity": 0.5}},
        {
            "path": [{"line": {"by": [0.1, 0.2]}}],
            "name": "bead",
            "path_start": [0.3, 0.2],
            "tool_limits": {"speed": 0.3},
            "events": [
                {"name": "process_on", "lead": 0.05},
                {"name": "process_off", "at": "end"},
            ],
        },
        {"dwell": 0.1},
        {"payload": {"mass": 3.0}},
        {"move": "home"},
    ],
}
"""A plan takes about a second."""
NAMES = ["move 1", "bead", "dwell 1", "move 2"]
KINDS = ["move", "path", "dwell", "move"]
