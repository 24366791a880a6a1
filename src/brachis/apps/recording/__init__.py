"""Recorded motions: reading files of joint positions over time, and turning them into trajectories."""

from brachis.apps.recording.importing import import_motion, joint_path_of
from brachis.apps.recording.recording import Recording, read_recording

__all__ = ["Recording", "import_motion", "joint_path_of", "read_recording"]
