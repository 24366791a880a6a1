"""The nonlinear program: transcription, constraints, initial guesses."""

from brachis.nlp.transcription import Motion, Transcription

__all__ = ["Motion", "Transcription"]
