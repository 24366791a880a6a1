"""Phases with every kind of limit at once but `OTHER_TASKS`, for tests of the nonlinear program."""

from __future__ import annotations

from typing import Any

import numpy as np

from brachis.limits import LIMIT_BUILDERS
from brachis.optimise.phase import Phase
from brachis.optimise.program import Program
from brachis.task import FROM_URDF, LimitSpec
from support.chains import planar_robot, program_of
from support.starts import starting_points

FRICTION = {"armature": 0.2, "viscous": [1.0], "coulomb": 2.0, "coulomb_velocity": 0.5}
TOOL_LIMITS = {
    "speed": {"s": [0.0, 0.5, 1.0], "speed": [2.0, 1.5, 1.8]},
    "acceleration": 5.0,
    "angular_speed": 2.0,
}
OTHER_TASKS = (
    "singularity",
    "joint_ends",
    "tool_tilt",
    "tool_distance",
    "tool_range",
    "clearance",
)
"""They need margins, tolerances or a scene."""
PHASE_KINDS = tuple(kind for kind in LIMIT_BUILDERS if kind not in OTHER_TASKS)
CASES: dict[str, tuple[str, list[str], list[float], list[str]]] = {
    "r0": ("RR", ["x", "z"], [0.4, 1.2], []),
    "r0_yaw": ("RRR", ["x", "z", "pitch"], [0.4, 1.8, 0.5], []),
    "r1": ("RRP", ["x", "z"], [0.4, 1.2, 0.1], ["j3"]),
    "r1_yaw": ("RRRR", ["x", "z", "pitch"], [0.4, -0.6, 1.4, 0.8], ["j1"]),
    "r2": ("RRRR", ["x", "z"], [0.4, 0.8, 0.7, 0.5], ["j1", "j4"]),
}


def phase_of(
    case: str,
    *,
    end: list[float] | None = None,
    position: Any = FROM_URDF,
    **spline: Any,
) -> Phase:
    """A bent path in the vertical plane under gravity, friction, and the limits that the splines can hold."""
    pattern, rows, start, redundant = CASES[case]
    friction = {**FRICTION, "viscous": [1.0 + 0.1 * i for i in range(len(pattern))]}
    settings = {"degree": 3, "intervals": 5, "points_per_interval": 2, **spline}
    bounded = settings["degree"] > 2 and settings.get("rest") != "velocity"
    limits = LimitSpec(
        acceleration=20.0,
        position=position,
        power=50.0,
        total_power=90.0,
        rms_torque=70.0,
        torque_speed={"j1": [[0.0, 100.0], [1.0, 90.0], [3.0, 40.0]]},
        jerk=300.0 if bounded else None,
        torque_rate=5e3 if bounded else None,
    )
    robot = planar_robot(pattern, "xz", friction=friction, limits=limits)
    through = [[-0.05, 0.05, 0.1], [-0.1, 0.06, 0.15], [-0.13, 0.03, 0.2]]
    points = [point[: len(rows)] for point in through]
    path = [{"spline": {"through": points, "relative": True}}]
    settings |= {"end": end, "tool_limits": TOOL_LIMITS}
    (phase,) = program_of(robot, rows, path, start, redundant, **settings).phases
    kinds = {limit.kind for limit in phase.limits}
    missing = set(PHASE_KINDS) - kinds - (set() if bounded else {"jerk", "torque_rate"})
    if position is None:
        missing.discard("position")
    assert not missing, f"the limits above have no {missing}"
    return phase


def reachable_points(
    phase: Phase, count: int, spread: float = 0.01
) -> list[np.ndarray]:
    """Points x near the first guess, moved at random in every variable."""
    rng, first = np.random.default_rng(7), next(starting_points(Program([phase])))
    return [first + spread * rng.uniform(-1.0, 1.0, len(first)) for _ in range(count)]
