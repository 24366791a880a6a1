"""A line that may be moved to a faster place."""

TASK = {
    "brachis": 1,
    "robot": {"urdf": "scara3"},
    "start": "free",
    "path_start": [1.5, -0.3],
    "path": [{"line": {"by": [0.0, 0.6]}}],
    "task_space": ["x", "y"],
}
