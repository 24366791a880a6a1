"""Search for the fastest motion: joint paths from lattices, a portfolio over decompositions, branches and starts."""

from brachis.search.chart_starts import first_map
from brachis.search.given_motion import GIVEN, given_start
from brachis.search.phase_plane import first_breaks, first_point
from brachis.search.portfolio import find_fastest, is_planned
from brachis.search.record import Record
from brachis.search.remedies import try_remedies
from brachis.search.solving import (
    MARGINS,
    best_of_joints,
    solve_by_margin_continuation,
    solve_without_third_order_limits,
    solved_in_chart,
)

__all__ = [
    "GIVEN",
    "MARGINS",
    "Record",
    "best_of_joints",
    "find_fastest",
    "first_breaks",
    "first_map",
    "first_point",
    "given_start",
    "is_planned",
    "solve_by_margin_continuation",
    "solve_without_third_order_limits",
    "solved_in_chart",
    "try_remedies",
]
