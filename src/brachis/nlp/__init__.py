"""The nonlinear program: phases, links and initial guesses."""

from brachis.nlp.curves import Boundary
from brachis.nlp.grid import FixedGrid, Grid
from brachis.nlp.link import Link
from brachis.nlp.motion import Motion
from brachis.nlp.phase import Phase
from brachis.nlp.program import Program

__all__ = ["Boundary", "FixedGrid", "Grid", "Link", "Motion", "Phase", "Program"]
