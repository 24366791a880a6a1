"""Where a motion comes from that was not planned here, and how well its path is known."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Any

import numpy as np

from brachis.common.arguments import number, numbers
from brachis.common.arrays import freeze
from brachis.errors import InputError
from brachis.task.fields import Model

SMALLEST = 2e-7
"""m and rad: paths are not fitted to a smaller tolerance."""
LARGEST = 1e-3
"""m and rad: a path known to a larger tolerance says nothing."""


def check_tolerance(tolerance: float) -> float:
    """Return a tolerance, m and rad; refuse one outside [`SMALLEST`, `LARGEST`].

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
    """What a result file says of a motion that was not planned."""

    source: str
    tolerance: float
    told: list[str]
    rows: list[list[float]]
    error: list[float]


@dataclass(frozen=True, eq=False)
class Recovered:
    """Where a motion comes from that was not planned, and how its path was found.

    Attributes
    ----------
    source : str
        The file.
    tolerance : float
        How far the tool may be from the recovered path, m and rad.
    told : tuple of str
        What is known, and what is not, in plain words.
    rows : (K, 1 + n) ndarray
        Times, s, and joint positions, rad or m, as the file has them. Read-only.
    error : (n,) ndarray
        How far these positions may be off, rad or m. Read-only.
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
        """Return what is known as plain data for JSON, without the rows."""
        return {
            "source": self.source,
            "tolerance": self.tolerance,
            "told": list(self.told),
        }

    def to_file(self) -> dict[str, Any]:
        """Return all as plain data for JSON."""
        arrays = {"rows": self.rows.tolist(), "error": self.error.tolist()}
        return {**self.to_dict(), **arrays}

    @classmethod
    def of_file(cls, stored: StoredRecovery, n: int) -> Recovered:
        """Take what `to_file` wrote of a motion of `n` joints.

        Raises
        ------
        InputError
            The rows are not those of such a motion.
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
