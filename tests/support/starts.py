"""Starting points from numeric inverse kinematics."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from brachis.optimise.guess import starting_point
from brachis.optimise.program import Program
from brachis.search.differential_ik import differential_ik_paths


def starting_points(program: Program) -> Iterator[np.ndarray]:
    """Points x of a program of one phase along a path, the most natural first."""
    (phase,) = program.phases
    found = (
        starting_point(program, [joint_path], [None])
        for joint_path in differential_ik_paths(phase.joint_map)
    )
    return (x for x in found if x is not None)
