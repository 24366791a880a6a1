"""The trajectory: immutable, evaluated at any time, and saved with all the data needed to verify it again."""

from brachis.trajectory.phases import (
    PHASE_COLUMNS,
    MotionPhase,
    PhaseSpline,
    join_splines,
    phase_rows,
)
from brachis.trajectory.pieces import Pieces
from brachis.trajectory.program import (
    PART_COLUMNS,
    Event,
    MotionPart,
    part_rows,
    torques_of,
)
from brachis.trajectory.recovered import Recovered
from brachis.trajectory.samples import Samples
from brachis.trajectory.source import (
    MotionSource,
    change_robots,
    motion_of,
    of_motion,
    phase_table,
    settings_in_use,
)
from brachis.trajectory.trajectory import CONTINUOUS_TORQUE, Trajectory

__all__ = [
    "CONTINUOUS_TORQUE",
    "PART_COLUMNS",
    "PHASE_COLUMNS",
    "Event",
    "MotionPart",
    "MotionPhase",
    "MotionSource",
    "PhaseSpline",
    "Pieces",
    "Recovered",
    "Samples",
    "Trajectory",
    "change_robots",
    "join_splines",
    "motion_of",
    "of_motion",
    "part_rows",
    "phase_rows",
    "phase_table",
    "settings_in_use",
    "torques_of",
]
