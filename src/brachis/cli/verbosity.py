"""How much a command says: the options ``--quiet`` and ``--verbose`` of every command."""

from __future__ import annotations

from contextvars import ContextVar
from enum import IntEnum


class Verbosity(IntEnum):
    """How much is said besides errors, and besides the JSON or file that was asked for."""

    QUIET = 0
    NORMAL = 1
    VERBOSE = 2


_CHOSEN = ContextVar("verbosity", default=Verbosity.NORMAL)


def chosen() -> Verbosity:
    """Return what the command line asks for."""
    return _CHOSEN.get()


def choose(verbosity: Verbosity) -> None:
    """Say this much from now on, within the context of the running command."""
    _CHOSEN.set(verbosity)
