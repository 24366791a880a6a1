"""The fastest timing of a given joint path, found in the phase plane."""

from brachis.timing.course import Course, TimedCourse
from brachis.timing.gap import SlowTimingWarning, TimingGap, find_timing_gap
from brachis.timing.joint_path import JointPath, Timing, divide_turns
from brachis.timing.phase_plane import PhasePlane, is_left_out

__all__ = [
    "Course",
    "JointPath",
    "PhasePlane",
    "SlowTimingWarning",
    "TimedCourse",
    "Timing",
    "TimingGap",
    "divide_turns",
    "find_timing_gap",
    "is_left_out",
]
