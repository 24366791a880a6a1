"""Search for the fastest motion: lattice seeds, and a portfolio over decompositions, branches and seeds."""

from brachis.search.portfolio import Found, find_fastest
from brachis.search.seeds import first_start
from brachis.search.solving import Listener

__all__ = ["Found", "Listener", "find_fastest", "first_start"]
