"""The nonlinear program: phases, links and initial guesses."""

from brachis.nlp.boundary import Boundary
from brachis.nlp.grid import FixedGrid, Grid
from brachis.nlp.link import Link
from brachis.nlp.motion import Motion
from brachis.nlp.objective import EndTime, LeastAcceleration, Objective
from brachis.nlp.phase import Phase
from brachis.nlp.program import Program

__all__ = [
    "Boundary",
    "EndTime",
    "FixedGrid",
    "Grid",
    "LeastAcceleration",
    "Link",
    "Motion",
    "Objective",
    "Phase",
    "Program",
]
