"""Handling of Ctrl-C that never loses a press.

Python raises KeyboardInterrupt wherever the program happens to be. The import of a compiled library may swallow this
exception or turn it into an ImportError; a finaliser may only print it. The command line therefore remembers every
press (`SigintHandler`), and checks between its stages whether a press was missed.
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
"""Exit code after an interrupt."""


class SigintHandler:
    """A handler of SIGINT that remembers a press of Ctrl-C until it takes effect; a second press ends the program.

    Attributes
    ----------
    pending : bool
        Whether a press of Ctrl-C has not taken effect yet.
    raising : bool
        Whether a press also raises KeyboardInterrupt.
    """

    heard: ClassVar[int] = 0
    """Number of presses that have interrupted something."""
    pending = False
    raising = False

    def __call__(self, _number: int, _frame: FrameType | None) -> None:
        """Remember a press, and interrupt the program if it may be interrupted here."""
        self.remember()
        if self.raising:
            raise KeyboardInterrupt

    def remember(self) -> None:
        """Remember a press; end the program if another press is pending."""
        if self.pending:
            show_cursor = b"\x1b[?25h\n" if os.isatty(2) else b""
            os.write(2, show_cursor + b"brachis: interrupted\n")
            os._exit(INTERRUPTED)
        self.pending = True


def install() -> None:
    """Remember presses of Ctrl-C from now on. If SIGINT is ignored, it stays ignored."""
    if signal.getsignal(signal.SIGINT) is not signal.SIG_IGN:
        signal.signal(signal.SIGINT, SigintHandler())
        hook = sys.unraisablehook

        def quiet(unraisable: UnraisableHookArgs) -> None:
            """Pass on every exception except a KeyboardInterrupt in a finaliser, whose press is remembered instead."""
            if not issubclass(unraisable.exc_type, KeyboardInterrupt):
                hook(unraisable)

        sys.unraisablehook = quiet


def sigint_handler() -> SigintHandler:
    """Return the installed handler that remembers presses; without one, as inside another program, return a new one."""
    handler = signal.getsignal(signal.SIGINT)
    return handler if isinstance(handler, SigintHandler) else SigintHandler()


def check() -> None:
    """Raise KeyboardInterrupt if a press is pending."""
    if sigint_handler().pending:
        raise KeyboardInterrupt


def clear() -> None:
    """Forget a press that took effect, and count it."""
    SigintHandler.heard += 1
    sigint_handler().pending = False


def ignore() -> None:
    """Ignore presses in this process; its parent handles them."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)


@contextlib.contextmanager
def interruptible() -> Iterator[None]:
    """Let a press of Ctrl-C interrupt the program within this block, including a press before the block.

    If a press is swallowed within the block, the block ends with KeyboardInterrupt, whatever else happened.
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
    """Let a press of Ctrl-C end this block but not the program; this is the intended way to end the block."""
    try:
        yield
    except KeyboardInterrupt:
        clear()


@contextlib.contextmanager
def defer() -> Iterator[None]:
    """Defer a press of Ctrl-C to the end of this block, where KeyboardInterrupt is raised.

    Use this function for code that must not be interrupted or might swallow a press: imports of compiled libraries,
    finalisers.
    """
    before = signal.getsignal(signal.SIGINT)
    in_main_thread = threading.current_thread() is threading.main_thread()
    if not in_main_thread or not callable(before):  # ignored, or not Python's
        yield
        return
    pressed = False

    def keep(_number: int, _frame: FrameType | None) -> None:
        """Remember a press for later."""
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
    """Make processes started within this block ignore Ctrl-C; this process handles a press at the end of the block."""
    with defer():
        # New processes inherit the mask of blocked signals.
        before = signal.pthread_sigmask(signal.SIG_BLOCK, {signal.SIGINT})
        try:
            yield
        finally:
            signal.pthread_sigmask(signal.SIG_SETMASK, before)
