"""The trajectory: immutable, evaluated at any time, saved and loaded with all that is needed to verify it again."""

from brachis.trajectory.phases import (
    PHASE_COLUMNS,
    MotionPhase,
    PhaseSpline,
    join_splines,
    phase_rows,
    split_splines,
)
from brachis.trajectory.pieces import Pieces
from brachis.trajectory.recovered import Recovered, check_tolerance
from brachis.trajectory.result_file import SCHEMA
from brachis.trajectory.samples import Samples
from brachis.trajectory.trajectory import (
    CONTINUOUS_TORQUE,
    Motion,
    Trajectory,
    motion_of,
    of_motion,
)

__all__ = [
    "CONTINUOUS_TORQUE",
    "PHASE_COLUMNS",
    "SCHEMA",
    "Motion",
    "MotionPhase",
    "PhaseSpline",
    "Pieces",
    "Recovered",
    "Samples",
    "Trajectory",
    "check_tolerance",
    "join_splines",
    "motion_of",
    "of_motion",
    "phase_rows",
    "split_splines",
]
