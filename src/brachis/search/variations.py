"""Joint paths around others, for arms with several redundant joints.

The lattice's sample of such an arm's postures may hold a single class of joint paths, above all where both ends are
given, and a solve from it ends at the optimum next to it. Solves from joint paths around it, displaced by waves over s,
end at others.
"""

from __future__ import annotations

import dataclasses
from collections.abc import Sequence

import numpy as np

from brachis.search.cells import cell_sizes
from brachis.search.joint_path import JointPath

_LARGEST, _SIZES = 1.0 / 16.0, 4
"""Standard deviation of the largest waves, in turns, and how many sizes there are, each half the one before."""


def varied(joint_paths: Sequence[JointPath], most: int, seed: int) -> list[JointPath]:
    """Displace joint paths, one after the other and over again, by waves at random.

    Parameters
    ----------
    joint_paths : sequence of JointPath
        At least one.
    most : int
        How many to make.
    seed : int

    Returns
    -------
    list of JointPath
        Within the joints' ranges and from the given ends, but beside the prescribed path: the nearest postures on it
        are meant.
    """
    rng = np.random.default_rng(seed)
    robot, limits = joint_paths[0].problem.robot, joint_paths[0].problem.robot.limits
    size = _LARGEST * cell_sizes(robot.revolute, 1)
    found = []
    for number in range(most):
        given = joint_paths[number % len(joint_paths)]
        waves = _waves(given)
        heights = rng.normal(0.0, size / 2.0 ** (number // len(joint_paths) % _SIZES), (len(waves), robot.n))
        q = np.clip(given.q + waves.T @ heights, limits.position_lower, limits.position_upper)
        found.append(dataclasses.replace(given, q=q))
    return found


def _waves(joint_path: JointPath) -> np.ndarray:
    """Displacements over s, (W, S + 1): zero at the ends that are given."""
    s, problem = joint_path.s, joint_path.problem
    waves = [np.sin(np.pi * s), 0.5 * np.sin(2.0 * np.pi * s)]
    if problem.start is None:
        waves.append(1.0 - s)
    if problem.end is None:
        waves.append(s)
    return np.array(waves)
