"""A lock for backends that threads of one process must not run at the same time."""

from __future__ import annotations

import functools
import threading
from collections.abc import Callable

from brachis.solvers.protocol import SolverReport

_LOCK = threading.RLock()
"""Uno's BQPD and IPOPT's MUMPS keep their state in memory that all threads share: two solves at once crash."""


def one_at_a_time(solve: Callable[..., SolverReport]) -> Callable[..., SolverReport]:
    """Let a solve wait until no other thread is in one (decorator)."""

    @functools.wraps(solve)
    def waiting(*arguments: object, **options: object) -> SolverReport:
        with _LOCK:
            return solve(*arguments, **options)

    return waiting
