"""ROS 2's JointTrajectory as YAML, as ``ros2 topic pub`` takes it."""

from __future__ import annotations

import json
import os
from collections.abc import Sequence
from typing import Any

from brachis.export.joint_trajectory import MESSAGE, message_of
from brachis.export.rows import rows_of
from brachis.files import atomic_write
from brachis.trajectory import Trajectory


def export_ros2_yaml(
    trajectory: Trajectory,
    path: str | os.PathLike[str],
    dt: float,
    *,
    last: str = "exact",
    joints: Sequence[str] | None = None,
) -> None:
    """Write one message ``trajectory_msgs/msg/JointTrajectory``; see `brachis.export.write` for the parameters."""
    rows = rows_of(trajectory, dt, last, joints)
    message = message_of(rows)
    lines = [f"# {MESSAGE}", *(f"# {sentence}" for sentence in rows.left_out)]
    lines += [f"header: {_flow(message['header'])}", f"joint_names: {_flow(message['joint_names'])}", "points:"]
    for point in message["points"]:
        first, *others = (f"{name}: {_flow(value)}" for name, value in point.items())
        lines += [f"- {first}", *(f"  {other}" for other in others)]
    with atomic_write(path) as stream:
        stream.write(("\n".join(lines) + "\n").encode())


def _flow(value: Any) -> str:  # noqa: ANN401
    """Write a value in YAML's flow style, which is JSON's but for floats: those of YAML 1.1 have a point."""
    if isinstance(value, float):
        text = repr(value)
        return text if "." in text else text.replace("e", ".0e")
    if isinstance(value, list):
        return f"[{', '.join(map(_flow, value))}]"
    if isinstance(value, dict):
        return f"{{{', '.join(f'{key}: {_flow(each)}' for key, each in value.items())}}}"
    return json.dumps(value)
