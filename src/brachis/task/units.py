"""The units of the keys of task files, for messages and plots."""

from __future__ import annotations

from itertools import pairwise

from brachis.task.limit_kinds import ROBOT_LIMITS

_UNITS = {
    name: unit
    for unit, names in {
        "m": """
            frames.xyz scene.position tool_offset.xyz mounting.xyz payload.com path_start.position
            path.blend line.to line.by line.length arc.center arc.via arc.to circle.center helix.center
            helix.pitch spline.through bspline.control_points program.approach program.retract
            scene.box scene.sphere cylinder.radius cylinder.length capsule.radius capsule.length
        """,
        "m/s": """
            path.speed boundary.start_speed boundary.end_speed tool_limits.speed process_speed.speed
        """,
        "m/s^2": "robot.gravity tool_limits.acceleration",
        "rad (m)": "robot.locked_joints limits.position start.joints end.joints",
        "kg": "payload.mass",
        "kg m^2": "payload.inertia friction.rotor_inertia",
        "N m (force, N)": "limits.torque limits.rms_torque",
        "rad/s (m/s)": "limits.velocity friction.coulomb_velocity",
        "rad/s^2 (m/s^2)": "limits.acceleration",
        "W": "limits.power",
        "rad/s^3 (m/s^3)": "limits.jerk",
        "N m/s (force, N/s)": "limits.torque_rate",
        "kg m^2 (kg)": "friction.armature",
        "N m s/rad (N s/m)": "friction.viscous",
        "N m (N)": "friction.coulomb",
        "s": "path.dwell program.dwell events.lead search.time_limit solver.time_limit",
        "rad": "path_start.rotation_vector to.rotation_vector",
        "": "speed.s",
        "rad/s": "tool_limits.angular_speed",
    }.items()
    for name in names.split()
} | {f"limits.{name}": row.unit for name, row in ROBOT_LIMITS.items()}
"""Units by the last two names of a key. The unit for prismatic joints is in brackets."""


def unit_of(key: str) -> str:
    """Return the unit of a dotted key of a task, or of one entry of its value; empty if there is no unit.

    Examples
    --------
    >>> from brachis.task.units import unit_of
    >>> unit_of("robot.payload.mass"), unit_of("path.0.line.angle_deg"), unit_of("spline.intervals")
    ('kg', 'deg', '')
    """
    names = [name for name in key.split(".") if not name.isdecimal()]
    if names[0] == "postures":
        return "rad (m)"
    if names[0] == "frames":
        del names[1:2]  # its name
    units = (_UNITS.get(".".join(pair)) for pair in reversed([*pairwise(names)]))
    unit_by_name = "deg" if key.endswith("_deg") else ""
    return next((unit for unit in units if unit is not None), unit_by_name)
