"""Checks of a verification by their names, and motions of which one part is off."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np

from brachis.trajectory import Trajectory
from brachis.verify import Check, Verification, verify_trajectory


def failed_checks(verification: Verification) -> list[str]:
    """Return the names of the checks that did not pass."""
    return [check.name for check in verification.checks if not check.passed]


def failing_checks(trajectory: Trajectory, **options: Any) -> set[str]:
    """Return the names of the checks that a motion does not pass."""
    return set(failed_checks(verify_trajectory(trajectory, **options)))


def with_entry(
    trajectory: Trajectory, name: str, place: Any, by: float | np.ndarray
) -> Trajectory:
    """Return the motion with some entries of an array moved."""
    array = np.array(getattr(trajectory, name))
    array[place] += by
    return replace(trajectory, **{name: array})


def check_of(verification: Verification, name: str) -> Check:
    """Return the one check with a name."""
    (check,) = (check for check in verification.checks if check.name == name)
    return check
