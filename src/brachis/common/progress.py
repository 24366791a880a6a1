"""Progress of a plan: reported to a listener, to the log named ``brachis``, and on a line that is updated."""

from __future__ import annotations

import importlib
import logging
import sys
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from typing import Any

Listener = Callable[[str], None]
"""Function that receives the planner's current step, in plain words; it may raise KeyboardInterrupt."""


def ignore(_text: str) -> None:
    """Ignore a report of progress."""


class Iteration(str):
    """A report of an iteration within a stage. Iterations are logged at level DEBUG, stages at INFO."""

    __slots__ = ()


@contextmanager
def report_progress(
    listener: Listener | None, progress: bool | None
) -> Iterator[Listener]:
    """Provide a listener that logs every step, passes it on to another listener, and shows it to the user.

    Parameters
    ----------
    listener : callable or None
    progress : bool or None
        Whether steps are shown. With None, they are shown in notebooks unless there is a listener.
    """
    if progress is None:
        progress = listener is None and _in_notebook()
    line = _Line()
    log = logging.getLogger("brachis")

    def report(text: str) -> None:
        """Log a step, pass it on to the listener, and show it."""
        level = logging.DEBUG if isinstance(text, Iteration) else logging.INFO
        log.log(level, "%s", text)
        if listener is not None:
            listener(text)
        if progress:
            line.show(text)

    try:
        yield report
    finally:
        line.clear()


class _Line:
    """A line that shows the current step, below the cell of a notebook or on standard error.

    If standard error is not a terminal, every stage is written on a separate line.
    """

    def __init__(self) -> None:
        self._display: Any = None
        self._width = 0
        self._last = 0.0

    def show(self, text: str) -> None:
        """Show a step in place of the previous one; at most ten iterations per second."""
        now = time.monotonic()
        if isinstance(text, Iteration) and now - self._last < 0.1:
            return
        self._last = now
        if _in_notebook():
            self._show_in_notebook(text)
        elif sys.stderr.isatty():
            sys.stderr.write(f"\r{text:<{self._width}}")
            self._width = len(text)
        elif not isinstance(text, Iteration):
            sys.stderr.write(f"{text}\n")
        sys.stderr.flush()

    def clear(self) -> None:
        """Erase the line."""
        if self._display is not None:
            self._show_in_notebook("")
        elif self._width:
            sys.stderr.write(f"\r{'':<{self._width}}\r")
            sys.stderr.flush()

    def _show_in_notebook(self, text: str) -> None:
        content = {"text/plain": str(text)}
        if self._display is None:
            ipython = importlib.import_module("IPython.display")
            self._display = ipython.display(content, raw=True, display_id=True)
        else:
            self._display.update(content, raw=True)


def _in_notebook() -> bool:
    """Return whether this runs in a notebook's kernel."""
    ipython = sys.modules.get("IPython")
    return ipython is not None and hasattr(ipython.get_ipython(), "kernel")
