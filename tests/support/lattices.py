"""Lattices of closed forms, made of a decomposition alone."""

from __future__ import annotations

from typing import Any

from brachis.problem.problem import Decomposition
from brachis.search.lattice import Lattice


def branch_lattice(decomposition: Decomposition, **options: Any) -> Lattice:
    """Make the lattice of a decomposition, whose joint paths stay on its branches."""
    problem = decomposition.problem
    return Lattice(problem, [decomposition], keeps_branch=True, **options)
