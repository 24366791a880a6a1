"""ROS 2's JointTrajectory as YAML, as ``ros2 topic pub`` takes it.

ROS 2's message ``trajectory_msgs/msg/JointTrajectory``, as plain data.

ROS 2's JointTrajectory in an MCAP bag.
"""

from __future__ import annotations

import json
import os
from collections.abc import Sequence
from typing import Any, Final

from brachis.apps.export.rows import JointRows, needed, rows_of
from brachis.common.files import atomic_write
from brachis.trajectory import Trajectory

MESSAGE: Final = "trajectory_msgs/msg/JointTrajectory"
_NANO = 1_000_000_000


def message_of(rows: JointRows) -> dict[str, Any]:
    """Return the message's fields.

    ``effort`` stays empty: `joint_trajectory_controller` refuses trajectories that have it where no joint is driven by
    effort. Times are whole nanoseconds.
    """
    points = [
        {
            "positions": q,
            "velocities": qdot,
            "accelerations": qddot,
            "effort": [],
            "time_from_start": dict(
                zip(("sec", "nanosec"), divmod(round(t * _NANO), _NANO), strict=True)
            ),
        }
        for t, q, qdot, qddot in zip(
            *(part.tolist() for part in (rows.t, rows.q, rows.qdot, rows.qddot)),
            strict=True,
        )
    ]
    header = {"stamp": {"sec": 0, "nanosec": 0}, "frame_id": ""}
    return {"header": header, "joint_names": list(rows.joints), "points": points}


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
    lines += [
        f"header: {_flow(message['header'])}",
        f"joint_names: {_flow(message['joint_names'])}",
        "points:",
    ]
    for point in message["points"]:
        first, *others = (f"{name}: {_flow(value)}" for name, value in point.items())
        lines += [f"- {first}", *(f"  {other}" for other in others)]
    with atomic_write(path) as stream:
        stream.write(("\n".join(lines) + "\n").encode())


def _flow(value: Any) -> str:
    """Write a value in YAML's flow style, which is JSON's but for floats: those of YAML 1.1 have a point."""
    if isinstance(value, float):
        text = repr(value)
        return text if "." in text else text.replace("e", ".0e")
    if isinstance(value, list):
        return f"[{', '.join(map(_flow, value))}]"
    if isinstance(value, dict):
        return (
            f"{{{', '.join(f'{key}: {_flow(each)}' for key, each in value.items())}}}"
        )
    return json.dumps(value)


TOPIC: Final = "/joint_trajectory_controller/joint_trajectory"
"""Where ros2_control's controller listens."""

_SEPARATOR = "\n" + "=" * 80 + "\n"
_POINT = """MSG: trajectory_msgs/JointTrajectoryPoint
float64[] positions
float64[] velocities
float64[] accelerations
float64[] effort
builtin_interfaces/Duration time_from_start"""
_DEFINITION = _SEPARATOR.join(
    (
        "std_msgs/Header header\nstring[] joint_names\ntrajectory_msgs/JointTrajectoryPoint[] points",
        "MSG: std_msgs/Header\nbuiltin_interfaces/Time stamp\nstring frame_id",
        _POINT,
        "MSG: builtin_interfaces/Time\nint32 sec\nuint32 nanosec",
        "MSG: builtin_interfaces/Duration\nint32 sec\nuint32 nanosec",
    )
)


def export_mcap(
    trajectory: Trajectory,
    path: str | os.PathLike[str],
    dt: float,
    *,
    last: str = "exact",
    joints: Sequence[str] | None = None,
) -> None:
    """Write a bag with one message on `TOPIC`, at time zero; see `brachis.export.write` for the parameters.

    Its metadata ``brachis`` name joints that move and are left out.
    """
    writers = needed("mcap_ros2.writer", "an MCAP bag")
    rows = rows_of(trajectory, dt, last, joints)
    message = message_of(rows)
    with atomic_write(path) as stream, writers.Writer(stream) as writer:
        schema = writer.register_msgdef(MESSAGE, _DEFINITION)
        writer.write_message(TOPIC, schema, message, log_time=0, publish_time=0)
        writer.add_metadata("brachis", {"left_out": "; ".join(rows.left_out)})
