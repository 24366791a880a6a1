"""What a worker does: one plan, whatever comes of it."""

from __future__ import annotations

import tempfile
import time
import warnings
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import brachis
from brachis import planner
from brachis.errors import ClusterError
from brachis.plausibility import PlausibilityWarning
from brachis.result import Result
from brachis.sweeps.plans import Plan, robot_of

VERIFIED, UNVERIFIED, FAILED = "verified", "unverified", "failed"


@dataclass(frozen=True)
class Outcome:
    """What came of a plan.

    Attributes
    ----------
    facts : dict
        Values of `brachis.sweeps.store.COLUMNS`; those that are left out are null.
    motion : bytes or None
        The saved trajectory, an npz archive.
    """

    facts: dict[str, Any]
    motion: bytes | None = None

    @classmethod
    def of_error(cls, error: BaseException, wall_time: float | None = None, *, message: str = "") -> Outcome:
        """Return the outcome of a plan that failed; the message is the error's own unless another is given."""
        message = message or str(error) or type(error).__name__
        return cls({"status": FAILED, "error": type(error).__name__, "message": message, "wall_time_s": wall_time})


def planned(plan: Plan) -> Outcome:
    """Make a plan.

    Raises
    ------
    ClusterError
        This process has another version of brachis than the one that asks.
    """
    if plan.version != brachis.__version__:
        problem = "a worker has another version of brachis"
        raise ClusterError(problem, found=brachis.__version__, allowed=plan.version, hint="Install the same everywhere")
    began = time.perf_counter()
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore", PlausibilityWarning)  # they are among the outcome's remarks
            result = planner.plan(robot_of(plan), plan.task, progress=False, check_advice=False)
        return Outcome(_facts(result, time.perf_counter() - began), _saved(result))
    except Exception as error:  # noqa: BLE001  (of thousands of plans one must not end the others, whatever it is)
        return Outcome.of_error(error, time.perf_counter() - began)


def _facts(result: Result, wall_time: float) -> dict[str, Any]:
    remarks = [*map(str, result.warnings), *(f"left undone: {each}" for each in result.undone)]
    return {
        "status": VERIFIED if result.verified else UNVERIFIED,
        "t_end_s": result.t_end,
        "worst_ratio": result.verification.worst_ratio,
        "path_error": result.verification.path_error,
        "chosen_joints": ", ".join(result.trajectory.redundant_joints),
        "chosen_branch": result.trajectory.branch,
        "chosen_solver": result.solver_report.solver,
        "iterations": sum(report.iterations for report in result.attempt.reports),
        "wall_time_s": wall_time,
        "remarks": "; ".join(remarks) or None,
    }


def _saved(result: Result) -> bytes:
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "motion.npz"
        result.trajectory.save(path)
        return path.read_bytes()
