"""Starting points from numeric inverse kinematics."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from brachis.nlp import Program
from brachis.nlp.guess import starting_point
from brachis.nlp.numeric_course import numeric_courses


def starting_points(program: Program) -> Iterator[np.ndarray]:
    """Points x of a program of one phase along a path, the most natural first."""
    (phase,) = program.phases
    found = (starting_point(program, [course]) for course in numeric_courses(phase.joint_map))
    return (x for x in found if x is not None)
