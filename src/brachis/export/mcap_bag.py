"""ROS 2's JointTrajectory in an MCAP bag."""

from __future__ import annotations

import os
from collections.abc import Sequence
from typing import Final

from brachis.export.joint_trajectory import MESSAGE, message_of
from brachis.export.optional import needed
from brachis.export.rows import rows_of
from brachis.files import atomic_write
from brachis.trajectory import Trajectory

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
