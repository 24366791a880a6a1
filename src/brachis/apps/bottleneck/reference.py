"""Comparison of a motion with the best end time known, which shows how much time the motion loses.

To compute the reference, the same problem is solved with discontinuous torque, starting from the motion. Rest means
only zero velocity, so that torques may leave their static values at once. Knots lie where torques switch. Limits on
higher derivatives are left out. The result is a local optimum, not a proven bound.
"""

from __future__ import annotations

import time
from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any

from brachis.apps.bottleneck.optimum import search_from
from brachis.common.deadline import Deadline
from brachis.common.progress import Listener, ignore
from brachis.errors import PlanningError
from brachis.ik import Family
from brachis.search.stages import FinishedCandidate

MEANING = "the same problem with discontinuous torque allowed; the best value known, not a proven bound"
_JUMPING = 2
"""Order of the highest derivative that is bounded if accelerations jump. Limits on higher derivatives are left out."""
_TIME_LIMIT = 8.0
"""Maximum wall time for computing the reference, s."""
_TOLERANCE = 1e-4
"""Fraction of the motion time that the knots of the reference may cost."""


@dataclass(frozen=True)
class Reference:
    """The best end time known for the problem of a motion.

    Attributes
    ----------
    t_end : float
        End time of the reference, s.
    distance : float
        How much longer the examined motion takes, as a fraction of `t_end`.
    intervals : int
        Number of intervals of the reference's splines.
    wall_time : float
        Wall time for computing the reference, s.
    candidate : FinishedCandidate
        The reference motion, as a finished candidate.
    """

    t_end: float
    distance: float
    intervals: int
    wall_time: float
    candidate: FinishedCandidate

    def to_dict(self) -> dict[str, Any]:
        """Return the figures as plain data for JSON."""
        return {
            "meaning": MEANING,
            "t_end_s": self.t_end,
            "distance": self.distance,
            "intervals": self.intervals,
            "wall_time_s": self.wall_time,
        }


def find_reference(
    candidate: FinishedCandidate,
    *,
    families: Sequence[Family] = (),
    listener: Listener = ignore,
) -> Reference | None:
    """Plan again, starting from the motion, with ``rest: velocity`` and as many intervals as needed.

    Parameters
    ----------
    candidate : FinishedCandidate
        The motion to compare, ``result.candidate``.
    families : sequence, optional
        Families with which the motion was planned.
    listener : callable, optional
        Function that is called with a text about every iteration.

    Returns
    -------
    Reference or None
        None if no faster motion was found.
    """
    began = time.perf_counter()
    task = candidate.problem.task
    knots = {"rest": "velocity", "intervals": "auto", "knots": "uniform"}
    spline = task.spline.model_copy(update={**knots, "tolerance": _TOLERANCE})
    changes: dict[str, object] = {"spline": spline}
    known = candidate.problem.limits
    limits = [limit for limit in known if limit.order <= _JUMPING]
    if len(limits) < len(known):
        # The verification still checks the limits that were left out, so the motion may fail the verification.
        refinement = task.refinement.model_copy(update={"max_rounds": 0})
        changes["refinement"] = refinement
    problem = replace(
        candidate.problem,
        task=task.model_copy(update=changes),
        limits=tuple(limits),
    )
    deadline = Deadline.after(_TIME_LIMIT)
    try:
        best = search_from(candidate.trajectory, problem, families, deadline, listener)
    except PlanningError:
        return None
    distance = candidate.t_end / best.t_end - 1.0
    if distance <= 0.0:
        return None
    elapsed = time.perf_counter() - began
    intervals = best.refined.program.intervals
    return Reference(best.t_end, distance, intervals, elapsed, best)
