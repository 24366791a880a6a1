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
        Joint paths by numeric inverse kinematics beside them, where the start posture is given.
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
    cells_per_turn: int
    nodes: int
    only_minima: bool = True
    fallback: bool = False


_LEVELS = {
    "single": SearchLevel(
        1,
        joint_paths=1,
        numeric=0,
        in_charts=1,
        in_closed_forms=1,
        refined=1,
        cells_per_turn=72,
        nodes=120,
    ),
    "fast": SearchLevel(
        6,
        joint_paths=4,
        numeric=0,
        in_charts=4,
        in_closed_forms=24,
        refined=4,
        cells_per_turn=72,
        nodes=120,
    ),
    "thorough": SearchLevel(
        20,
        joint_paths=8,
        numeric=8,
        in_charts=8,
        in_closed_forms=100,
        refined=12,
        cells_per_turn=96,
        nodes=300,
        only_minima=False,
    ),
    "exhaustive": SearchLevel(
        10_000,
        joint_paths=30,
        numeric=8,
        in_charts=12,
        in_closed_forms=10_000,
        refined=40,
        cells_per_turn=144,
        nodes=600,
        only_minima=False,
    ),
}

SEARCH_LEVELS = {
    "single": (
        _LEVELS["single"],
        dataclasses.replace(_LEVELS["fast"], fallback=True),
    ),
    "fast": (_LEVELS["fast"],),
    "thorough": (_LEVELS["fast"], _LEVELS["thorough"]),
    "exhaustive": (_LEVELS["fast"], _LEVELS["thorough"], _LEVELS["exhaustive"]),
}
"""Levels that are gone through one after the other, by the task's ``search.effort``; so a good motion is known soon."""
