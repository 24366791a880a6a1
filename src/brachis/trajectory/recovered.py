"""What is known of a motion that was not planned here."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from brachis.common.arguments import number, numbers
from brachis.common.arrays import freeze
from brachis.errors import InputError

SMALLEST, LARGEST = 2e-7, 1e-3
"""Tolerances, m and rad."""


def check_tolerance(tolerance: float) -> float:
    """Return a tolerance, m and rad; refuse one that says nothing of a path, or is narrower than paths are fitted.

    Raises
    ------
    InputError
    """
    tolerance = number(tolerance, "tolerance", "m and rad")
    if not SMALLEST <= tolerance <= LARGEST:
        allowed = f"{SMALLEST:g} to {LARGEST:g} m and rad"
        raise InputError(
            "is no tolerance of a path",
            where="tolerance",
            found=tolerance,
            allowed=allowed,
        )
    return tolerance


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
        Times, s, and joint positions, rad or m, as the file has them; none where they are not known, as in result
        files of schema 2. Read-only.
    error : (n,) ndarray
        How far these positions may be off, rad or m. Read-only.
    """

    source: str
    tolerance: float
    told: tuple[str, ...]
    rows: np.ndarray = field(repr=False)
    error: np.ndarray = field(repr=False)

    def __post_init__(self) -> None:
        """Refuse tolerances that say nothing; take copies of the arrays that nobody can write to.

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
        return {
            **self.to_dict(),
            "rows": self.rows.tolist(),
            "error": self.error.tolist(),
        }

    @classmethod
    def of_file(cls, data: object, n: int) -> Recovered | None:
        """Read what `to_file` wrote of a motion of `n` joints; None for None.

        Raises
        ------
        InputError
            It is something else.
        """
        if data is None:
            return None
        parts = dict(data) if isinstance(data, Mapping) else {}
        source, tolerance, told = (
            parts.get(name) for name in ("source", "tolerance", "told")
        )
        listed = isinstance(told, list) and all(isinstance(line, str) for line in told)
        if not isinstance(source, str) or type(tolerance) is not float or not listed:
            allowed = "source, tolerance, told, rows, error; or null"
            raise InputError(
                "wrong type",
                where="recovered",
                found=", ".join(parts) or type(data).__name__,
                allowed=allowed,
            )
        rows = numbers(
            parts.get("rows", np.empty((0, 1 + n))),
            "recovered.rows",
            "s, then rad or m",
        )
        error = numbers(parts.get("error", np.zeros(n)), "recovered.error", "rad or m")
        if not rows.size:
            return cls(
                source, tolerance, tuple(told or ()), rows.reshape(0, 1 + n), error
            )
        fits = (
            rows.shape == (len(np.atleast_1d(rows)), 1 + n)
            and len(rows) > 1
            and error.shape == (n,)
        )
        finite = np.isfinite(rows).all() and np.isfinite(error).all()
        if not fits or not finite or not (np.diff(rows[:, 0]) > 0.0).all():
            found = f"rows {rows.shape}, error {error.shape}"
            allowed = (
                f"rows (K, {1 + n}) with ascending times, error ({n},); finite numbers"
            )
            raise InputError(
                "not the rows of a file",
                where="recovered",
                found=found,
                allowed=allowed,
            )
        return cls(source, tolerance, tuple(told or ()), rows, error)
