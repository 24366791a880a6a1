"""Search for the fastest motion: joint paths from lattices, a portfolio over decompositions, branches and guesses."""

from brachis.search.portfolio import Search
from brachis.search.remedies import try_remedies
from brachis.search.starts import first_map

__all__ = ["Search", "first_map", "try_remedies"]
