"""Ctrl-C that is never lost.

Python raises KeyboardInterrupt wherever the program happens to be. A compiled library that is being imported may
swallow it, or turn it into an ImportError; a finaliser may only print it. The command line therefore remembers every
press (`SigintHandler`), and looks between its stages whether one went unheard.
"""

from __future__ import annotations

import contextlib
import os
import signal
import sys
import threading
from collections.abc import Iterator
from types import FrameType
from typing import TYPE_CHECKING, ClassVar

if TYPE_CHECKING:
    from sys import UnraisableHookArgs

INTERRUPTED = 130
"""Exit code."""


class SigintHandler:
    """A handler of SIGINT that remembers a press until it is heard; a second one ends the program at once.

    Attributes
    ----------
    pending : bool
        Whether a press was not yet heard.
    raising : bool
        Whether a press also raises KeyboardInterrupt.
    """

    heard: ClassVar[int] = 0
    """How many presses ended something early."""
    pending = False
    raising = False

    def __call__(self, _number: int, _frame: FrameType | None) -> None:
        """Remember a press, and interrupt the program if it may be interrupted here."""
        self.remember()
        if self.raising:
            raise KeyboardInterrupt

    def remember(self) -> None:
        """Remember a press; end the program if one is pending already."""
        if self.pending:
            show_cursor = b"\x1b[?25h\n" if os.isatty(2) else b""
            os.write(2, show_cursor + b"brachis: interrupted\n")
            os._exit(INTERRUPTED)
        self.pending = True


def install() -> None:
    """Remember presses from now on; where SIGINT is ignored, it stays so."""
    if signal.getsignal(signal.SIGINT) is not signal.SIG_IGN:
        signal.signal(signal.SIGINT, SigintHandler())
        hook = sys.unraisablehook

        def quiet(unraisable: UnraisableHookArgs) -> None:
            """Hand on all but a KeyboardInterrupt in a finaliser: the press is remembered."""
            if not issubclass(unraisable.exc_type, KeyboardInterrupt):
                hook(unraisable)

        sys.unraisablehook = quiet


def sigint_handler() -> SigintHandler:
    """Return the handler that remembers presses; within another program, for example, one that knows of none."""
    handler = signal.getsignal(signal.SIGINT)
    return handler if isinstance(handler, SigintHandler) else SigintHandler()


def check() -> None:
    """Raise KeyboardInterrupt if a press went unheard."""
    if sigint_handler().pending:
        raise KeyboardInterrupt


def clear() -> None:
    """Forget a press that was heard, and count it."""
    SigintHandler.heard += 1
    sigint_handler().pending = False


def ignore() -> None:
    """Let presses end nothing in this process, whose parent hears them."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)


@contextlib.contextmanager
def interruptible() -> Iterator[None]:
    """Let presses interrupt the program within this block, one before it included.

    A press that was swallowed within ends the block with KeyboardInterrupt, whatever came of it otherwise.
    """
    handler = sigint_handler()
    handler.raising = True
    try:
        check()
        yield
    finally:
        handler.raising = False
        check()


@contextlib.contextmanager
def end_on_interrupt() -> Iterator[None]:
    """Let a press end this block, which is how it is meant to end, and nothing else."""
    try:
        yield
    except KeyboardInterrupt:
        clear()


@contextlib.contextmanager
def defer() -> Iterator[None]:
    """Let a press wait for the end of this block, which raises KeyboardInterrupt then.

    For what must not be broken off, or might swallow it: imports of compiled libraries, finalisers.
    """
    before = signal.getsignal(signal.SIGINT)
    in_main_thread = threading.current_thread() is threading.main_thread()
    if not in_main_thread or not callable(before):  # ignored, or not Python's
        yield
        return
    pressed = False

    def keep(_number: int, _frame: FrameType | None) -> None:
        """Note a press for later."""
        nonlocal pressed
        pressed = True
        if isinstance(before, SigintHandler):
            before.remember()

    signal.signal(signal.SIGINT, keep)
    try:
        yield
    finally:
        signal.signal(signal.SIGINT, before)
        if pressed:
            raise KeyboardInterrupt


@contextlib.contextmanager
def block_in_children() -> Iterator[None]:
    """Let processes that are started within this block never hear Ctrl-C; this one hears a press at its end."""
    with defer():
        # Processes inherit the mask.
        before = signal.pthread_sigmask(signal.SIG_BLOCK, {signal.SIGINT})
        try:
            yield
        finally:
            signal.pthread_sigmask(signal.SIG_SETMASK, before)
