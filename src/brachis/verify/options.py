"""What passes a verification."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True)
class VerifyOptions:
    """What passes.

    Attributes
    ----------
    ratio_tolerance : float
        Largest excess over a limit, as a fraction of it.
    path_tolerance : float
        Largest distance from the path, m or rad.
    points_per_interval : int
        Grid points per knot interval of the splines.
    progress_tolerance : float
        Largest backward path velocity (1/s), and largest error of s at the ends (dimensionless).
    posture_tolerance : float
        Largest error of the start and end postures, rad or m.
    rest_velocity_tolerance : float
        Largest joint velocity at the ends, rad/s or m/s.
    rest_acceleration_tolerance : float
        Largest joint acceleration at the ends where the task asks for full rest, rad/s^2 or m/s^2.
    rest_jerk_tolerance : float
        Largest joint jerk at the ends where the task asks for rest in jerk, as a fraction of one plus the largest one.
    jump_tolerance : float
        Largest jump where polynomial pieces join, as a fraction of one plus the quantity's largest value.
    spline_tolerance : float
        Largest difference at the nodes between the redundant joints' splines and the joint motion, rad or m.
    """

    ratio_tolerance: float = 1e-4
    path_tolerance: float = 1e-9
    points_per_interval: int = 32
    progress_tolerance: float = 1e-9
    posture_tolerance: float = 1e-9
    rest_velocity_tolerance: float = 1e-8
    rest_acceleration_tolerance: float = 1e-6
    rest_jerk_tolerance: float = 1e-4
    jump_tolerance: float = 1e-6
    spline_tolerance: float = 1e-8
