"""Libraries that only some formats need."""

from __future__ import annotations

import importlib
from types import ModuleType

from brachis.errors import InputError


def needed(name: str, what: str) -> ModuleType:
    """Import a library of the extra ``export``.

    Parameters
    ----------
    name : str
        Of the module.
    what : str
        What needs it.

    Raises
    ------
    InputError
        It is not installed.
    """
    try:
        return importlib.import_module(name)
    except ImportError as error:
        raise InputError(
            f"{what} needs a library that is not installed",
            found=str(error),
            hint='Install it with: pip install "brachis[export]"',
        ) from error
