"""Formats of controllers: ROS 2's ``JointTrajectory`` and URScript.

The message of ROS 2 is written as YAML for ``ros2 topic pub``, or in an MCAP bag. A
URScript program gives Universal Robots' arms one ``servoj`` command a period.
"""

from __future__ import annotations

from typing import Any, BinaryIO, Final

import numpy as np
import yaml

from brachis.apps.export.rows import JointRows, require_library
from brachis.errors import InputError

MESSAGE: Final = "trajectory_msgs/msg/JointTrajectory"


def message_of(rows: JointRows) -> dict[str, Any]:
    """Return the message's fields.

    ``effort`` stays empty: `joint_trajectory_controller` refuses trajectories that have it where no joint is driven by
    effort. Times are whole nanoseconds.
    """
    if not {"rad", "m"}.issuperset(rows.units):
        raise InputError(
            "JointTrajectory takes rad and m",
            where="units",
            found=", ".join(dict.fromkeys(rows.units)),
        )
    shown = rows.quantities
    points = []
    samples = rows.samples
    for k, t in enumerate(samples.t.tolist()):
        seconds, nanoseconds = divmod(round(t * 1e9), 10**9)
        point = {
            "positions": samples.q[k].tolist(),
            "velocities": samples.qdot[k].tolist() if "qd" in shown else [],
            "accelerations": samples.qddot[k].tolist() if "qdd" in shown else [],
            "effort": [],
            "time_from_start": {"sec": seconds, "nanosec": nanoseconds},
        }
        points.append(point)
    header = {"stamp": {"sec": 0, "nanosec": 0}, "frame_id": ""}
    return {"header": header, "joint_names": list(rows.joints), "points": points}


def write_ros2_yaml(rows: JointRows, stream: BinaryIO) -> None:
    """Write one message ``trajectory_msgs/msg/JointTrajectory``."""
    comments = "".join(f"# {line}\n" for line in (MESSAGE, *rows.left_out))
    message = yaml.safe_dump(
        message_of(rows), sort_keys=False, default_flow_style=None, width=np.inf
    )
    stream.write((comments + message).encode())


TOPIC: Final = "/joint_trajectory_controller/joint_trajectory"
"""Topic on which ros2_control's controller listens."""

_DEFINITION = """\
std_msgs/Header header
string[] joint_names
trajectory_msgs/JointTrajectoryPoint[] points
================================================================================
MSG: std_msgs/Header
builtin_interfaces/Time stamp
string frame_id
================================================================================
MSG: trajectory_msgs/JointTrajectoryPoint
float64[] positions
float64[] velocities
float64[] accelerations
float64[] effort
builtin_interfaces/Duration time_from_start
================================================================================
MSG: builtin_interfaces/Time
int32 sec
uint32 nanosec
================================================================================
MSG: builtin_interfaces/Duration
int32 sec
uint32 nanosec"""
"""The message and its parts, as bags describe them."""


def write_mcap(rows: JointRows, stream: BinaryIO) -> None:
    """Write a bag with one message on `TOPIC`, at time zero.

    Its metadata ``brachis`` name joints that move and are left out.
    """
    writers = require_library("mcap_ros2.writer", "an MCAP bag")
    with writers.Writer(stream) as writer:
        schema = writer.register_msgdef(MESSAGE, _DEFINITION)
        message = message_of(rows)
        writer.write_message(TOPIC, schema, message, log_time=0, publish_time=0)
        writer.add_metadata("brachis", {"left_out": "; ".join(rows.left_out)})


_SERVOJ = "0.03, 300"
"""The shortest lookahead time of servoj, s, and its proportional gain, the default of its manual."""


def write_urscript(rows: JointRows, stream: BinaryIO) -> None:
    """Write a program with one ``servoj`` a period, which leads to its row's posture.

    The program halts with a message if the arm is not at the start posture, and moves nothing then.

    Raises
    ------
    InputError
        There are other joints than six revolute ones; an arm on a rail is written with its six as `joints`, and the
        rail, which its own controller moves at the same time, in another format.
    """
    if rows.units != ("rad",) * 6:
        named = zip(rows.joints, rows.units, strict=True)
        raise InputError(
            "servoj takes the angles of six joints",
            where="joints",
            found=", ".join(f"{name} ({unit})" for name, unit in named),
            allowed="six revolute joints, from the base on",
            hint="List only the arm's six joints in joints, and write a rail in another format. With a profile, hold "
            "the rail (robot.locked_joints)",
        )
    first, *postures = (
        f"[{', '.join(map(repr, row))}]" for row in rows.samples.q.tolist()
    )
    periods = np.diff(rows.samples.t).round(12).tolist()
    moves = "".join(
        f"  servoj({posture}, 0, 0, {period!r}, {_SERVOJ})\n"
        for posture, period in zip(postures, periods, strict=True)
    )
    comments = "".join(f"  # {sentence}\n" for sentence in rows.left_out)
    program = f"""\
def brachis_motion():
  # {len(postures)} periods, {rows.t_end:.6g} s; joints {", ".join(rows.joints)}, rad
{comments}  start = {first}
  now = get_actual_joint_positions()
  i = 0
  while i < 6:
    if norm(now[i] - start[i]) > 0.005:
      popup("The arm is not at the start posture of the motion", error=True, blocking=True)
      halt
    end
    i = i + 1
  end
{moves}  stopj(10)
end
brachis_motion()
"""
    stream.write(program.encode())
