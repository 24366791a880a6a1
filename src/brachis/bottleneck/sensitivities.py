"""What a limit costs: the derivative of t_E with respect to every limit, from the multipliers.

Every limit tells which figures a user could change, and at which rate d the bounds of its rows move outwards when one
of them gives way (`brachis.limits.Bound`): with the multipliers w of these rows

    dt_E / d(figure) = -sum w d.

See `multipliers` for w, and for what holds where it is not unique.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from brachis.bottleneck.multipliers import Multipliers, multipliers_of_answer
from brachis.limits import Bound, Label, Limit, Role
from brachis.nlp import Program
from brachis.refine import Refined
from brachis.summary import Summary

STATIONARY = 1e-3
"""With a larger residual the answer is not an optimum, and its multipliers say little."""
_SMALLEST = 1e-9


@dataclass(frozen=True)
class Sensitivity:
    """What one figure of a limit costs.

    Attributes
    ----------
    limit : Limit
    bound : Bound
        The figure.
    derivative : float
        Derivative of t_E with respect to the figure, s per unit; <= 0 but at a lower end, which is raised by it.
    """

    limit: Limit
    bound: Bound
    derivative: float

    @property
    def label(self) -> Label:
        """What is limited, and the figure's unit."""
        return self.limit.labels[self.bound.column]

    @property
    def outwards(self) -> float:
        """Sign of a change of the figure that leaves more room."""
        return -1.0 if self.bound.end == "lower" else 1.0

    def change(self, fraction: float) -> float:
        """Predict the change of t_E, s, for a limit that leaves more room by a fraction; 0.01 is +1 %."""
        return self.outwards * self.derivative * self.bound.whole * fraction

    def to_dict(self) -> dict[str, Any]:
        """Return the figures as plain data for JSON."""
        return {
            "subject": self.label.subject,
            "kind": self.label.kind,
            "end": self.bound.end,
            "limit": self.bound.figure,
            "unit": self.label.unit,
            "derivative_s_per_unit": self.derivative,
            "change_for_1_percent_s": self.change(0.01),
            "change_for_10_percent_s": self.change(0.1),
        }


@dataclass(frozen=True)
class BranchBoundary:
    """What the branch's boundary costs; no limit of the robot, but of the choice of redundant joints.

    Attributes
    ----------
    label : str
        Of the margin.
    margin : float
        Least branch margin in force, dimensionless.
    derivative : float
        Derivative of t_E with respect to it, s.
    """

    label: str
    margin: float
    derivative: float

    def to_dict(self) -> dict[str, Any]:
        """Return the figures as plain data for JSON."""
        return {"label": self.label, "margin": self.margin, "derivative_s": self.derivative}


@dataclass(frozen=True, repr=False)
class Sensitivities(Summary):
    """What all limits cost.

    Attributes
    ----------
    limits : tuple of Sensitivity
        All figures of all limits but safeguards, the costliest first.
    boundaries : tuple of BranchBoundary
        Branch margins that hold the motion back.
    source : str
        Where the multipliers are from: ``"solver"`` or ``"least squares"``.
    residual : float
        Part of the gradient of t_E that they do not balance; an optimum has 0.
    unique : bool
        False where the multipliers are not unique: the derivatives then hold for more room only, not for less.
    """

    limits: tuple[Sensitivity, ...]
    boundaries: tuple[BranchBoundary, ...]
    source: str
    residual: float
    unique: bool

    @property
    def reliable(self) -> bool:
        """True where the answer is an optimum as far as the multipliers tell."""
        return self.residual <= STATIONARY

    def of(self, subject: str, kind: str, end: str | None = None) -> Sensitivity:
        """Sensitivity to one figure, such as ``of("j1", "torque")``; KeyError where there is none."""
        for entry in self.limits:
            if (entry.label.subject, entry.label.kind, entry.bound.end) == (subject, kind, end):
                return entry
        raise KeyError((subject, kind, end))

    def to_dict(self) -> dict[str, Any]:
        """Return the figures as plain data for JSON."""
        return {
            "limits": [entry.to_dict() for entry in self.limits],
            "branch_boundaries": [entry.to_dict() for entry in self.boundaries],
            "multipliers": self.source,
            "residual": self.residual,
            "reliable": self.reliable,
            "unique": self.unique,
        }


def sensitivities(refined: Refined) -> Sensitivities:
    """Derive from a refined answer what every limit costs.

    Parameters
    ----------
    refined : Refined
        ``result.attempt.refined``.

    Returns
    -------
    Sensitivities
        Of the answer before its end time was lengthened to meet the limits between collocation points.
    """
    return sensitivities_at(refined.program, multipliers_of_answer(refined))


def sensitivities_at(program: Program, multipliers: Multipliers) -> Sensitivities:
    """As `sensitivities`, from a problem and the multipliers of its answer."""
    found: list[Sensitivity] = []
    boundaries: list[BranchBoundary] = []
    for limit in program.limits:
        rows = program.rows_of(limit)
        for bound in limit.bounds:
            rates = np.zeros(len(program.lower))
            rates[rows[:, bound.column]] = bound.per_unit
            if limit.role is not Role.SAFEGUARD:
                found.append(_sensitivity(limit, bound, rates, multipliers))
            elif (slope := -multipliers.change(rates)) > _SMALLEST:
                boundaries.append(BranchBoundary(limit.labels[bound.column].subject, bound.figure, slope))
    found.sort(key=lambda entry: entry.change(1.0))
    return Sensitivities(tuple(found), tuple(boundaries), multipliers.source, multipliers.residual, multipliers.unique)


def _sensitivity(limit: Limit, bound: Bound, rates: np.ndarray, multipliers: Multipliers) -> Sensitivity:
    """Sensitivity to a figure that moves the bounds of the rows outwards at `rates`, (c,)."""
    if bound.end is None:
        return Sensitivity(limit, bound, multipliers.change(rates))
    sign = 1.0 if bound.end == "lower" else -1.0
    return Sensitivity(limit, bound, -sign * multipliers.change(rates, sign))
