"""The nonlinear program: transcription, constraints, initial guesses."""

from brachis.nlp.motion import Motion
from brachis.nlp.transcription import Transcription

__all__ = ["Motion", "Transcription"]
