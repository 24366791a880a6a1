"""An elbow arm of the literature with limits on torques and their rates, beside the published end time.

Path and limits: D. Constantinescu, Smooth time optimal trajectory planning for industrial manipulators, MASc thesis,
University of British Columbia, 1999. Links of 0.75 m, 6.6 kg and 4.2 kg; the path x = 0.5 m,
y = 20 p^3 - 30 p^2 + 10 p, z = p - 0.5 (m) for p from 0 to 1; torques up to 140, 140 and 50 Nm, their rates up to 500,
500 and 100 Nm/s.

Assumed, where this script knows no figure: the first joint turns about a vertical axis, the other two about horizontal
ones at the height z = 0; links are slender uniform rods, and the column below them has no inertia; no payload, no
friction, no drive inertia; gravity 9.81 m/s^2; the torques begin and end where they hold the arm at rest, and their
rates may jump there. The arm is not redundant: it has two sides and two elbows, and the fastest of the four is printed.
"""

from __future__ import annotations

import tempfile
from pathlib import Path

import numpy as np

import brachis

PUBLISHED_S = 2.74
LENGTH_M, MASSES_KG = 0.75, (6.6, 4.2)
TORQUES_NM, RATES_NM_S = [140.0, 140.0, 50.0], [500.0, 500.0, 100.0]
_LINK = """
  <link name="{name}"><inertial><origin xyz="{half} 0 0"/><mass value="{mass}"/>
    <inertia ixx="0" ixy="0" ixz="0" iyy="{inertia}" iyz="0" izz="{inertia}"/></inertial></link>"""
_JOINT = """
  <joint name="{name}" type="continuous"><parent link="{parent}"/><child link="{child}"/>
    <origin xyz="{x} 0 0"/><axis xyz="{axis}"/></joint>"""


def urdf() -> str:
    """Write the arm as URDF text."""
    rods = [
        _LINK.format(
            name=name, half=0.5 * LENGTH_M, mass=mass, inertia=mass * LENGTH_M**2 / 12.0
        )
        for name, mass in zip(("upper_arm", "forearm"), MASSES_KG, strict=True)
    ]
    rods.append(_LINK.format(name="column", half=0, mass=1, inertia=1e-6))
    joints = [
        _JOINT.format(name="waist", parent="base", child="column", x=0, axis="0 0 1"),
        _JOINT.format(
            name="shoulder", parent="column", child="upper_arm", x=0, axis="0 1 0"
        ),
        _JOINT.format(
            name="elbow", parent="upper_arm", child="forearm", x=LENGTH_M, axis="0 1 0"
        ),
    ]
    tool = '\n  <joint name="flange" type="fixed"><parent link="forearm"/><child link="tool"/>'
    tool += f'<origin xyz="{LENGTH_M} 0 0"/></joint>'
    bodies = '\n  <link name="base"/><link name="tool"/>'
    return f'<robot name="elbow_arm">{bodies}{"".join(rods)}{"".join(joints)}{tool}\n</robot>\n'


def path_points(count: int) -> list[list[float]]:
    """Sample the path, m."""
    p = np.linspace(0.0, 1.0, count)
    return np.column_stack(
        [np.full(count, 0.5), 20.0 * p**3 - 30.0 * p**2 + 10.0 * p, p - 0.5]
    ).tolist()


def planned(**settings: object) -> brachis.Result:
    """Plan the motion; `settings` are those of the splines and of the joint limits."""
    limits = {
        "torque": TORQUES_NM,
        "velocity": None,
        "torque_rate": settings.pop("torque_rate", RATES_NM_S),
    }
    first, *through = path_points(61)
    task = {
        "brachis": 1,
        "robot": {"limits": limits},
        "start": "free",
        "path_start": first,
        "task_space": "position",
        "path": [{"spline": {"through": through}}],
        "spline": settings,
    }
    with tempfile.TemporaryDirectory() as folder:
        file = Path(folder) / "elbow_arm.urdf"
        file.write_text(urdf(), encoding="utf-8")
        return brachis.plan(file, task)


def main() -> None:
    """Print one line for every number of intervals."""
    free = planned(intervals=40, torque_rate=None)
    print(f"N =  40, torques alone: {free.t_end:.3f} s")
    for intervals in (20, 40, 80):
        result = planned(intervals=intervals)
        state = "verified" if result.verified else "not verified"
        print(
            f"N = {intervals:3d}: {result.t_end:.3f} s, {state}, on branch {result.candidate.branch} ",
            end="",
        )
        print(f"in {result.timing['total']:.1f} s (published: {PUBLISHED_S} s)")


if __name__ == "__main__":
    main()
