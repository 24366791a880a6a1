"""Origin of a motion that was not planned here, and the accuracy of its path."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Any

import numpy as np

from brachis.common.arguments import number, numbers
from brachis.common.arrays import freeze
from brachis.errors import InputError
from brachis.task.fields import Model

SMALLEST = 2e-7
"""Minimum tolerance of a recovered path, m and rad. Paths are not fitted more closely than this."""
LARGEST = 1e-3
"""Maximum tolerance of a recovered path, m and rad. A path with a larger tolerance is of no use."""


def check_tolerance(tolerance: float) -> float:
    """Return a tolerance, m and rad, if it is within [`SMALLEST`, `LARGEST`].

    Raises
    ------
    InputError
    """
    tolerance = number(tolerance, "tolerance", "m and rad")
    if not SMALLEST <= tolerance <= LARGEST:
        raise InputError(
            "the tolerance of a path is out of range",
            where="tolerance",
            found=tolerance,
            allowed=f"{SMALLEST:g} to {LARGEST:g} m and rad",
        )
    return tolerance


class StoredRecovery(Model, extra="ignore", strict=True):
    """Entries of a result file for a motion that was not planned here."""

    source: str
    tolerance: float
    told: list[str]
    rows: list[list[float]]
    error: list[float]


@dataclass(frozen=True, eq=False)
class Recovered:
    """Origin of a motion that was not planned here, and how its path was recovered.

    Attributes
    ----------
    source : str
        Name of the file that the motion was read from.
    tolerance : float
        Maximum distance of the tool from the recovered path, m and rad.
    told : tuple of str
        Sentences for the user that say what is known about the motion and what is not.
    rows : (K, 1 + n) ndarray
        Times, s, and joint positions, rad or m, as in the file. Read-only.
    error : (n,) ndarray
        Largest possible error of these joint positions, rad or m. Read-only.
    """

    source: str
    tolerance: float
    told: tuple[str, ...]
    rows: np.ndarray = field(repr=False)
    error: np.ndarray = field(repr=False)

    def __post_init__(self) -> None:
        """Check the tolerance, and make the arrays read-only copies.

        Raises
        ------
        InputError
        """
        check_tolerance(self.tolerance)
        freeze(self, "rows", "error")

    def to_dict(self) -> dict[str, Any]:
        """Return plain data for JSON, without the rows."""
        return {
            "source": self.source,
            "tolerance": self.tolerance,
            "told": list(self.told),
        }

    def to_file(self) -> dict[str, Any]:
        """Return plain data for JSON, including the rows."""
        arrays = {"rows": self.rows.tolist(), "error": self.error.tolist()}
        return {**self.to_dict(), **arrays}

    @classmethod
    def of_file(cls, stored: StoredRecovery, n: int) -> Recovered:
        """Read the data that `to_file` wrote for a motion of `n` joints.

        Raises
        ------
        InputError
            The data do not describe such a motion.
        """
        rows = numbers(stored.rows, "recovered.rows", "s, then rad or m")
        error = np.array(stored.error)
        fits = rows.shape == (len(rows), 1 + n) and len(rows) > 1
        if not (fits and error.shape == (n,) and (np.diff(rows[:, 0]) > 0.0).all()):
            raise InputError(
                "not the rows of a file",
                where="recovered",
                found=f"rows {rows.shape}, error {error.shape}",
                allowed=f"rows (K, {1 + n}) with ascending times, error ({n},)",
            )
        return cls(stored.source, stored.tolerance, tuple(stored.told), rows, error)
