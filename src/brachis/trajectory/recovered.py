"""What is known of a motion that was not planned here."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import asdict, dataclass
from typing import Any

from brachis.arguments import number
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
        raise InputError("is no tolerance of a path", where="tolerance", found=tolerance, allowed=allowed)
    return tolerance


@dataclass(frozen=True)
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
    """

    source: str
    tolerance: float
    told: tuple[str, ...]

    def __post_init__(self) -> None:
        """Refuse tolerances that say nothing.

        Raises
        ------
        InputError
        """
        check_tolerance(self.tolerance)

    def to_dict(self) -> dict[str, Any]:
        """Return plain data for JSON."""
        return {**asdict(self), "told": list(self.told)}

    @classmethod
    def of_dict(cls, data: object) -> Recovered | None:
        """Read what `to_dict` wrote; None for None.

        Raises
        ------
        InputError
            It is something else.
        """
        if data is None:
            return None
        parts = dict(data) if isinstance(data, Mapping) else {}
        source, tolerance, told = (parts.get(name) for name in ("source", "tolerance", "told"))
        listed = isinstance(told, list) and all(isinstance(line, str) for line in told)
        if not isinstance(source, str) or type(tolerance) is not float or not listed:
            raise InputError("wrong type", where="recovered", found=data, allowed="source, tolerance, told; or null")
        return cls(source, tolerance, tuple(told or ()))
