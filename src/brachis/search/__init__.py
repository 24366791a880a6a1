"""Search for the fastest motion: joint paths from lattices, a portfolio over decompositions, branches and starts."""

from brachis.search.portfolio import Stages, find_fastest
from brachis.search.record import Record
from brachis.search.solving import MARGINS, Listener, continued, solve_with
from brachis.search.starts import first_start

__all__ = ["MARGINS", "Listener", "Record", "Stages", "continued", "find_fastest", "first_start", "solve_with"]
