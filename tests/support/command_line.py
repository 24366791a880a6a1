"""The command line in this process."""

from __future__ import annotations

import contextlib
import signal
import sys
from collections.abc import Iterator
from functools import cache

import pytest
import typer.main

from brachis.apps.cli.main import main

make_group = cache(typer.main.get_command)
"""Typer's table of commands, which takes 0.05 s; a process of a user makes it once."""


def code_of(*arguments: object, columns: int = 200) -> int:
    """Exit code of a command."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(sys, "argv", ["brachis", *map(str, arguments)])
        patch.setenv("COLUMNS", str(columns))
        patch.setattr(typer.main, "get_command", make_group)
        with pytest.raises(SystemExit) as stop:
            main()
    return int(stop.value.code or 0)


@contextlib.contextmanager
def interrupts_kept() -> Iterator[None]:
    """The command line takes over SIGINT for good; what comes next gets it back."""
    before = signal.getsignal(signal.SIGINT)
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(sys, "unraisablehook", sys.unraisablehook)
        yield
    signal.signal(signal.SIGINT, before)
