"""Motions that were made elsewhere: from files of joint positions over time to trajectories."""

from brachis.recording.columns import Units
from brachis.recording.importing import import_motion
from brachis.recording.recording import Recording, read_recording

__all__ = ["Recording", "Units", "import_motion", "read_recording"]
