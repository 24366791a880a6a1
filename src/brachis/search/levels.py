"""Search levels: how much is tried for each value of the task's `search.effort`."""

from __future__ import annotations

import dataclasses
from dataclasses import dataclass


@dataclass(frozen=True)
class SearchLevel:
    """One level of the search.

    Attributes
    ----------
    decompositions : int
        Decompositions that are looked at; those farthest from singularity at the start come first.
    joint_paths : int
        Joint paths taken from the lattice of a decomposition, for each branch on which the motion may begin.
    numeric : int
        Joint paths by numeric inverse kinematics as well, if the start posture is given.
    in_charts : int
        Plans in charts; four times as many joint paths are looked at.
    in_closed_forms : int
        Coarse plans in closed forms; those with the least estimated time come first.
    refined : int
        Plans that are refined and verified at most, as long as they may beat the best one.
    cells_per_turn, nodes : int
        Of the lattice.
    only_minima : bool
        Whether of the lattice of all postures only joint paths of locally least length are taken.
    fallback : bool
        Whether it is gone through only while no motion is verified.
    """

    decompositions: int
    joint_paths: int
    numeric: int
    in_charts: int
    in_closed_forms: int
    refined: int
    cells_per_turn: int = 72
    nodes: int = 120
    only_minima: bool = True
    fallback: bool = False


_SINGLE = SearchLevel(1, 1, 0, in_charts=1, in_closed_forms=1, refined=1)
_FAST = SearchLevel(6, 4, 0, in_charts=4, in_closed_forms=24, refined=4)
_THOROUGH = SearchLevel(
    20, 8, 8, 8, 100, 12, cells_per_turn=96, nodes=300, only_minima=False
)
_EXHAUSTIVE = SearchLevel(
    10_000, 30, 8, 12, 10_000, 40, cells_per_turn=144, nodes=600, only_minima=False
)

SEARCH_LEVELS = {
    "single": (_SINGLE, dataclasses.replace(_FAST, fallback=True)),
    "fast": (_FAST,),
    "thorough": (_FAST, _THOROUGH),
    "exhaustive": (_FAST, _THOROUGH, _EXHAUSTIVE),
}
"""Levels that are gone through one after the other, by the task's ``search.effort``; so a good motion is known soon."""
