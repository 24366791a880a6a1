"""Search for the fastest motion: joint paths from lattices, a portfolio over decompositions, branches and starts."""

from brachis.search.chart_starts import first_map
from brachis.search.given_motion import GIVEN, given_start
from brachis.search.phase_plane import initial_guess, initial_knots
from brachis.search.portfolio import find_fastest, is_planned
from brachis.search.record import Record
from brachis.search.remedies import try_remedies
from brachis.search.solving import (
    MARGINS,
    best_of_joints,
    solve_by_margin_continuation,
    solve_in_chart,
    solve_without_third_order_limits,
)

__all__ = [
    "GIVEN",
    "MARGINS",
    "Record",
    "best_of_joints",
    "find_fastest",
    "first_map",
    "given_start",
    "initial_guess",
    "initial_knots",
    "is_planned",
    "solve_by_margin_continuation",
    "solve_in_chart",
    "solve_without_third_order_limits",
    "try_remedies",
]
