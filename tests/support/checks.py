"""Checks of a verification by their names."""

from __future__ import annotations

from brachis.verify import Check, Verification


def failed_checks(verification: Verification) -> list[str]:
    """Return the names of the checks that did not pass."""
    return [check.name for check in verification.checks if not check.passed]


def check_of(verification: Verification, name: str) -> Check:
    """Return the one check with a name."""
    (check,) = (check for check in verification.checks if check.name == name)
    return check
