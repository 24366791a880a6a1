"""ROS 2's ``JointTrajectory``: YAML for ``ros2 topic pub``, and an MCAP bag."""

from __future__ import annotations

import os
from collections.abc import Sequence
from typing import Any, Final

import numpy as np
import yaml

from brachis.apps.export.rows import JointRows, require_library, rows_of
from brachis.common.files import atomic_write
from brachis.trajectory import Trajectory

MESSAGE: Final = "trajectory_msgs/msg/JointTrajectory"


def message_of(rows: JointRows) -> dict[str, Any]:
    """Return the message's fields.

    ``effort`` stays empty: `joint_trajectory_controller` refuses trajectories that have it where no joint is driven by
    effort. Times are whole nanoseconds.
    """
    points = []
    for k, t in enumerate(rows.t.tolist()):
        seconds, nanoseconds = divmod(round(t * 1e9), 10**9)
        point = {
            "positions": rows.q[k].tolist(),
            "velocities": rows.qdot[k].tolist(),
            "accelerations": rows.qddot[k].tolist(),
            "effort": [],
            "time_from_start": {"sec": seconds, "nanosec": nanoseconds},
        }
        points.append(point)
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
    comments = "".join(f"# {line}\n" for line in (MESSAGE, *rows.left_out))
    message = yaml.safe_dump(
        message_of(rows), sort_keys=False, default_flow_style=None, width=np.inf
    )
    with atomic_write(path) as stream:
        stream.write((comments + message).encode())


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
    writers = require_library("mcap_ros2.writer", "an MCAP bag")
    rows = rows_of(trajectory, dt, last, joints)
    message = message_of(rows)
    with atomic_write(path) as stream, writers.Writer(stream) as writer:
        schema = writer.register_msgdef(MESSAGE, _DEFINITION)
        writer.write_message(TOPIC, schema, message, log_time=0, publish_time=0)
        writer.add_metadata("brachis", {"left_out": "; ".join(rows.left_out)})
