"""Motions that were made elsewhere: from files of joint positions over time to trajectories."""

from brachis.apps.recording.importing import import_motion
from brachis.apps.recording.recording import Recording, Units, read_recording

__all__ = ["Recording", "Units", "import_motion", "read_recording"]
