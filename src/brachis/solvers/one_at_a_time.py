"""A lock for backends that threads of one process must not run at the same time."""

from __future__ import annotations

import functools
import threading

import numpy as np

from brachis.solvers.protocol import Problem, Progress, Solve, SolverOptions, SolverReport

_LOCK = threading.RLock()
"""Uno's BQPD and IPOPT's MUMPS keep their state in memory that all threads share: two solves at once crash."""


def one_at_a_time(solve: Solve) -> Solve:
    """Let a solve wait until no other thread is in one (decorator)."""

    @functools.wraps(solve)
    def waiting(problem: Problem, x: np.ndarray, options: SolverOptions, progress: Progress | None) -> SolverReport:
        with _LOCK:
            return solve(problem, x, options, progress)

    return waiting
