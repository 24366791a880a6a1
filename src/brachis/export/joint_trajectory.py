"""ROS 2's message ``trajectory_msgs/msg/JointTrajectory``, as plain data."""

from __future__ import annotations

from typing import Any, Final

from brachis.export.rows import JointRows

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
            "time_from_start": dict(zip(("sec", "nanosec"), divmod(round(t * _NANO), _NANO), strict=True)),
        }
        for t, q, qdot, qddot in zip(*(part.tolist() for part in (rows.t, rows.q, rows.qdot, rows.qddot)), strict=True)
    ]
    header = {"stamp": {"sec": 0, "nanosec": 0}, "frame_id": ""}
    return {"header": header, "joint_names": list(rows.joints), "points": points}
