"""Search for the fastest motion: lattices give joint paths, and the most promising ones are optimised."""

from brachis.search.guesses import first_guess
from brachis.search.portfolio import Search
from brachis.search.remedies import try_remedies
from brachis.search.task_program import TaskProgram

__all__ = ["Search", "TaskProgram", "first_guess", "try_remedies"]
