"""Threads of the libraries for linear algebra."""

from __future__ import annotations

from contextlib import AbstractContextManager

from threadpoolctl import ThreadpoolController


def use_one_thread() -> AbstractContextManager[object]:
    """Let linear algebra use one thread: batches are small, and on busy cores a second costs twenty times its gain."""
    return ThreadpoolController().limit(limits=1, user_api="blas")
