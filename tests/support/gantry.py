"""A motion of a gantry by hand: a line, a wait at a corner, and a line with a given speed on a part of it.

The tool moves 0.4 m in x and 0.6 m in z, so that s is a length in m. The gantry has two slides in x: the first one,
j1, is redundant and moves by 0.2 m in all.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from brachis.robot import bind
from brachis.robot.from_task import robot_from_settings
from brachis.task import load_task
from brachis.trajectory import PhaseSpline, Trajectory, join_splines
from support.chains import Joint, chain_urdf

DEGREE = 5
DWELL = 0.5
SPEED = 0.3
TASK: dict[str, Any] = {
    "brachis": 1,
    "start": {"joints": [0.0, 0.0, 0.0]},
    "task_space": ["x", "z"],
    "path": [
        {"line": {"by": [0.4, 0.0]}, "dwell": DWELL},
        {"line": {"by": [0.0, 0.6]}},
    ],
    "tool_limits": {"process_speed": {"speed": SPEED, "s": [0.55, 0.85]}},
    "spline": {"degree": DEGREE},
}
"""Its robot is missing; see `gantry_motion`."""


def gantry_urdf() -> str:
    """Slides j1 and j2 along x, and j3 along z, against gravity."""
    limit = {"lower": -2.0, "upper": 2.0, "velocity": 2.0, "effort": 100.0}
    axes = ((1.0, 0.0, 0.0), (1.0, 0.0, 0.0), (0.0, 0.0, 1.0))
    return chain_urdf([Joint("prismatic", axis=axis, limit=limit) for axis in axes])


def quintic(
    t_end: float, begin: tuple[float, float], end: tuple[float, float]
) -> PhaseSpline:
    """The curves s(t) and q1(t) of a phase, from s and ds/dt at its ends, without an acceleration there."""
    (s0, v0), (s1, v1) = begin, end
    before = s0 + v0 * t_end / DEGREE * np.arange(3)
    behind = s1 - v1 * t_end / DEGREE * np.arange(3)[::-1]
    s = np.append(before, behind)
    knots = np.repeat([0.0, 1.0], DEGREE + 1)
    return PhaseSpline(t_end, knots, DEGREE, np.array([s, 0.2 * s]))


SPLINES = (
    quintic(1.0, (0.0, 0.0), (0.4, 0.0)),
    quintic(DWELL, (0.4, 0.0), (0.4, 0.0)),
    quintic(1.0, (0.4, 0.0), (0.55, SPEED)),
    quintic(1.0, (0.55, SPEED), (0.85, SPEED)),
    quintic(1.0, (0.85, SPEED), (1.0, 0.0)),
)


def gantry_motion(
    splines: tuple[PhaseSpline, ...] = SPLINES, **parts: Any
) -> Trajectory:
    """The motion with these curves; `parts` of its task are changed."""
    urdf = gantry_urdf()
    task = load_task({**TASK, **parts})
    robot, _ = bind(robot_from_settings(task.robot, urdf_text=urdf), task.task_space)
    ends = [_at(spline, 0.0) for spline in splines]
    last = [_at(spline, spline.t_end) for spline in splines]
    knots, control_points = join_splines(splines)
    phase_ends = np.cumsum([spline.t_end for spline in splines])
    q, qdot, after = np.stack([*ends, last[-1]], axis=1)
    before = np.stack([ends[0], *last], axis=1)[2]
    return Trajectory(
        task=task,
        urdf=urdf,
        robot=robot,
        redundant_joints=("j1",),
        branch="",
        times=np.append(0.0, phase_ends),
        q=q,
        qdot=qdot,
        qddot=after,
        qddot_before=before,
        knots=knots,
        degree=DEGREE,
        control_points=control_points,
        phase_ends=phase_ends,
        chart_rows=np.empty((0, 0, 0)),
        chart_knots=np.empty(0),
    )


def _at(spline: PhaseSpline, t: float) -> np.ndarray:
    """Joint positions, velocities and accelerations, (3, 3), at a time in a phase, s."""
    motion = np.array(spline.at(np.array([t])))[:3, 0]
    s, redundant = motion.T
    middle = spline.control_points[0].mean()
    corner = np.array([0.4, 0.0, 0.0])
    x, z = (s, 0.0 * s) if middle < 0.4 else (corner, s - corner)
    return np.stack([redundant, x - redundant, z], axis=1)
