"""The bottleneck report: what every limit costs, which is active when, and how far the motion is from a reference."""

from __future__ import annotations

import os
from dataclasses import dataclass
from html import escape
from typing import TYPE_CHECKING, Any

from brachis.bottleneck.check import SensitivityCheck, check_sensitivities
from brachis.bottleneck.knots import KnotCost, knot_cost
from brachis.bottleneck.reference import Reference, find_reference
from brachis.bottleneck.saturation import THRESHOLD, Saturation, saturations
from brachis.bottleneck.saved import solved_again
from brachis.bottleneck.sensitivities import Sensitivities, sensitivities
from brachis.bottleneck.words import in_words
from brachis.errors import InputError
from brachis.limits import Role
from brachis.summary import LINES
from brachis.trajectory import Trajectory

if TYPE_CHECKING:
    from brachis.result import Result


@dataclass(frozen=True, repr=False)
class BottleneckReport:
    """What holds a motion back.

    Attributes
    ----------
    t_end : float
        Of the motion, s.
    sensitivities : Sensitivities or None
        What every limit costs; None of a motion that was not planned, and is no optimum whose multipliers tell.
    saturations : tuple of Saturation
        When every limit is active, those active longest first.
    knots : KnotCost or None
        What the knots cost; None where that is not known.
    check : SensitivityCheck or None
        The predictions beside solving again, where asked for.
    reference : Reference or None
        The best value known, where asked for and found.
    reference_sought : bool
        True where it was asked for.

    Examples
    --------
    >>> import brachis
    >>> result = brachis.plan(brachis.examples.scara_line, redundant_joints=["j1"], effort="single", intervals=8)
    >>> print(str(result.bottleneck()).splitlines()[0])
    10 % more torque at j1 (1 Nm) saves 3.4 % (87 ms)
    """

    t_end: float
    sensitivities: Sensitivities | None
    saturations: tuple[Saturation, ...]
    knots: KnotCost | None = None
    check: SensitivityCheck | None = None
    reference: Reference | None = None
    reference_sought: bool = False

    def __str__(self) -> str:
        """Say all in plain words."""
        return self.text()

    def text(self, *, degrees: bool = False) -> str:
        """Say all in plain words, angles in degrees where asked for."""
        return "\n".join(in_words(**vars(self), degrees=degrees))

    def __repr__(self) -> str:
        """Say what there is room for on a screen."""
        lines = str(self).split("\n")
        return "\n".join([*lines[:LINES], "..."] if len(lines) > LINES else lines)

    def _repr_html_(self) -> str:
        """Say all in plain words in a notebook."""
        return f"<pre>{escape(str(self))}</pre>"

    def to_dict(self) -> dict[str, Any]:
        """Return the figures as plain data for JSON."""
        return {
            "t_end_s": self.t_end,
            "sensitivities": None if self.sensitivities is None else self.sensitivities.to_dict(),
            "active_from_ratio": THRESHOLD,
            "saturations": [entry.to_dict() for entry in self.saturations],
            "knots": None if self.knots is None else self.knots.to_dict(),
            "check": None if self.check is None else self.check.to_dict(),
            "reference": None if self.reference is None else self.reference.to_dict(),
        }


def report(
    motion: Result | Trajectory | str | os.PathLike[str], *, check: bool = False, reference: bool = False
) -> BottleneckReport:
    """Find out what holds a planned motion back.

    Parameters
    ----------
    motion : Result, Trajectory or path
        Of `brachis.plan`; or a trajectory, a loaded one for example, or its file, whose problem is solved again
        (`solved_again`).
    check : bool, optional
        Solve again with every limit raised by 1 % and compare with the multipliers' predictions.
    reference : bool, optional
        Plan again with discontinuous torque allowed on a fine mesh: the best value known, not a proven bound.

    Returns
    -------
    BottleneckReport

    Raises
    ------
    InputError
        The result was made without keeping its solved program, or a trajectory's closed form is not known here.
    PlanningError
        A trajectory is no optimum of its problem; or, with `check`, no solver could solve the problem again.

    Examples
    --------
    >>> import brachis
    >>> result = brachis.plan(brachis.examples.scara_line, redundant_joints=["j1"], effort="single", intervals=8)
    >>> found = brachis.bottleneck.report(result.trajectory)  # as of a loaded one
    >>> [sensitivity.label.subject for sensitivity in found.sensitivities.limits][0]
    'j1'
    """
    if isinstance(motion, str | os.PathLike):
        motion = Trajectory.load(motion)
    if isinstance(motion, Trajectory) and motion.recovered is not None:
        if check or reference:
            hint = "brachis compare plans the same path; ask for the bottlenecks of that plan"
            problem = "the motion was not planned: nothing of it can be solved again"
            raise InputError(problem, where=motion.recovered.source, hint=hint)
        return BottleneckReport(motion.t_end, None, saturations(motion))
    if isinstance(motion, Trajectory):
        trajectory, refined = motion, solved_again(motion)
    elif motion.attempt.refined is None:
        raise InputError("the result holds no solved problem", where="result", allowed="a result of brachis.plan")
    else:
        trajectory, refined = motion.trajectory, motion.attempt.refined
    found, tolerance = sensitivities(refined), trajectory.task.refinement.tolerance
    limits = [limit for limit in refined.program.limits if limit.role is not Role.SAFEGUARD]
    return BottleneckReport(
        t_end=trajectory.t_end,
        sensitivities=found,
        saturations=saturations(trajectory, limits),
        knots=knot_cost(trajectory, limits, refined.t_end),
        check=check_sensitivities(refined, found) if check else None,
        reference=find_reference(refined, tolerance=tolerance) if reference else None,
        reference_sought=reference,
    )
