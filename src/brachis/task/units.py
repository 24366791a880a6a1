"""The units of the keys of task files, for messages and plots."""

from __future__ import annotations

from itertools import pairwise

_UNITS = {
    "frames.xyz": "m",
    "scene.position": "m",
    "path.speed": "m/s",
    "tool_offset.xyz": "m",
    "mounting.xyz": "m",
    "robot.gravity": "m/s^2",
    "robot.locked_joints": "rad (m)",
    "payload.mass": "kg",
    "payload.com": "m",
    "payload.inertia": "kg m^2",
    "limits.torque": "N m (force, N)",
    "limits.velocity": "rad/s (m/s)",
    "limits.acceleration": "rad/s^2 (m/s^2)",
    "limits.position": "rad (m)",
    "limits.power": "W",
    "limits.total_power": "W",
    "limits.rms_torque": "N m (force, N)",
    "limits.jerk": "rad/s^3 (m/s^3)",
    "limits.torque_rate": "N m/s (force, N/s)",
    "friction.armature": "kg m^2 (kg)",
    "friction.rotor_inertia": "kg m^2",
    "friction.viscous": "N m s/rad (N s/m)",
    "friction.coulomb": "N m (N)",
    "friction.coulomb_velocity": "rad/s (m/s)",
    "start.joints": "rad (m)",
    "end.joints": "rad (m)",
    "path_start.position": "m",
    "path.dwell": "s",
    "path.blend": "m",
    "path_start.rotation_vector": "rad",
    "to.rotation_vector": "rad",
    "line.to": "m",
    "line.by": "m",
    "line.length": "m",
    "arc.center": "m",
    "arc.via": "m",
    "arc.to": "m",
    "circle.center": "m",
    "helix.center": "m",
    "helix.pitch": "m",
    "spline.through": "m",
    "bspline.control_points": "m",
    "boundary.start_speed": "m/s",
    "boundary.end_speed": "m/s",
    "tool_limits.speed": "m/s",
    "speed.s": "",
    "tool_limits.acceleration": "m/s^2",
    "tool_limits.angular_speed": "rad/s",
    "process_speed.speed": "m/s",
    "search.time_limit": "s",
    "solver.time_limit": "s",
}
"""Units by the last two names of a key; in brackets that of prismatic joints."""


def unit_of(key: str) -> str:
    """Return the unit of a dotted key of a task, or of a joint's or row's entry in it; empty where it has none.

    Examples
    --------
    >>> from brachis.task.units import unit_of
    >>> unit_of("robot.payload.mass"), unit_of("path.0.line.angle_deg"), unit_of("spline.intervals")
    ('kg', 'deg', '')
    """
    names = [part for part in key.split(".") if not part.isdecimal()]
    if names[0] == "postures":
        return "rad (m)"
    if names[0] == "frames":
        del names[1:2]  # its name
    units = (_UNITS.get(".".join(pair)) for pair in reversed([*pairwise(names)]))
    other = "deg" if key.endswith("_deg") else ""
    return next((unit for unit in units if unit is not None), other)
