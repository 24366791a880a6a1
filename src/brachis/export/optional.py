"""Libraries that only some formats need."""

from __future__ import annotations

import importlib
from types import ModuleType

from brachis.errors import NotInstalledError


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
    NotInstalledError
    """
    try:
        return importlib.import_module(name)
    except ImportError as error:
        raise NotInstalledError(what, name.split(".", maxsplit=1)[0], "export") from error
