"""Formats of controllers: ROS 2's ``JointTrajectory`` and URScript.

The ROS 2 message is written as YAML for ``ros2 topic pub``, or in an MCAP bag. A URScript program gives an arm by
Universal Robots one ``servoj`` command per period.
"""

from __future__ import annotations

from typing import Any, BinaryIO, Final

import numpy as np
import yaml

from brachis.apps.export.rows import JointRows, require_library
from brachis.errors import InputError

MESSAGE: Final = "trajectory_msgs/msg/JointTrajectory"


def message_of(rows: JointRows) -> dict[str, Any]:
    """Return the fields of the message.

    ``effort`` stays empty, because `joint_trajectory_controller` refuses trajectories with it unless joints are driven
    by effort. Times are in whole nanoseconds.
    """
    if not {"rad", "m"}.issuperset(rows.units):
        raise InputError(
            "JointTrajectory needs rad and m",
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
    comments = "".join(f"# {line}\n" for line in (MESSAGE, *rows.notes))
    message = yaml.safe_dump(
        message_of(rows), sort_keys=False, default_flow_style=None, width=np.inf
    )
    stream.write((comments + message).encode())


TOPIC: Final = "/joint_trajectory_controller/joint_trajectory"
"""Topic to which the controller of ros2_control listens."""

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
"""Definition of the message and its parts, as stored in bags."""


def write_mcap(rows: JointRows, stream: BinaryIO) -> None:
    """Write a bag with one message on `TOPIC`, at time zero.

    The metadata ``brachis`` of the bag name the moving joints that are left out.
    """
    writers = require_library("mcap_ros2.writer", "an MCAP bag")
    with writers.Writer(stream) as writer:
        schema = writer.register_msgdef(MESSAGE, _DEFINITION)
        message = message_of(rows)
        writer.write_message(TOPIC, schema, message, log_time=0, publish_time=0)
        writer.add_metadata("brachis", {"left_out": "; ".join(rows.left_out)})
        if rows.parts:
            writer.add_metadata("program", {"notes": "; ".join(rows.notes)})


_SERVOJ = "0.03, 300"
"""Lookahead time of servoj, s (the shortest), and its proportional gain (the default of the manual)."""


def write_urscript(rows: JointRows, stream: BinaryIO) -> None:
    """Write a program with one ``servoj`` per period, which leads to the posture of one row.

    If the arm is not at the start posture, the program shows a message and halts without moving it.

    Raises
    ------
    InputError
        The joints are not exactly six revolute ones. For an arm on a rail, pass the arm's six joints as `joints`, and
        write the rail, which its own controller moves at the same time, in another format.
    """
    if rows.units != ("rad",) * 6:
        named = zip(rows.joints, rows.units, strict=True)
        raise InputError(
            "servoj needs the angles of six joints",
            where="joints",
            found=", ".join(f"{name} ({unit})" for name, unit in named),
            allowed="six revolute joints, starting at the base",
            hint="List only the six joints of the arm in joints, and write a rail in another format. With a profile, "
            "hold the rail (robot.locked_joints)",
        )
    first, *postures = (
        f"[{', '.join(map(repr, row))}]" for row in rows.samples.q.tolist()
    )
    periods = np.diff(rows.samples.t).round(12).tolist()
    moves = "".join(
        f"  servoj({posture}, 0, 0, {period!r}, {_SERVOJ})\n"
        for posture, period in zip(postures, periods, strict=True)
    )
    comments = "".join(f"  # {sentence}\n" for sentence in rows.notes)
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
