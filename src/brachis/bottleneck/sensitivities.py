"""What a limit costs: the derivative of t_E with respect to every limit, from the multipliers.

Torque, velocity and acceleration enter as ratios to their limits, held in [-1, 1]: a limit that rises by the fraction
e lets the bounds of its rows out by e, so that with the multipliers w of the joint's active rows

    dt_E / d(ln limit) = -sum w.

Positions are measured in half ranges about the middle of the range, or in rad or m where it is wide or open; an end
that moves outwards lets out the rows at that end alone. See `multipliers` for w, and for what holds where it is not
unique.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from brachis.bottleneck.multipliers import Multipliers, multipliers_of_answer
from brachis.nlp import Transcription
from brachis.nlp.constraints.position import WIDE
from brachis.refine import Refined
from brachis.robot import Limits, Robot

STATIONARY = 1e-3
"""With a larger residual the answer is not an optimum, and its multipliers say little."""
RATE_UNITS = {"velocity": "/s", "acceleration": "/s^2"}
"""Added to the unit of the position; torques have their own."""
_SMALLEST = 1e-9


@dataclass(frozen=True)
class Sensitivity:
    """What one limit of one joint costs.

    Attributes
    ----------
    joint : str
    kind : {"torque", "velocity", "acceleration", "position"}
    end : {"lower", "upper"} or None
        End of the range; None where the limit holds in both directions.
    limit : float
        In `unit`.
    whole : float
        What a change by 100 % means, in `unit`: the limit; of a position the range, or 1 where it is open.
    unit : str
    derivative : float
        Derivative of t_E with respect to the limit, s per `unit`; <= 0 but at a lower end, which is raised by it.
    """

    joint: str
    kind: str
    end: str | None
    limit: float
    whole: float
    unit: str
    derivative: float

    @property
    def outwards(self) -> float:
        """Sign of a change of the limit that leaves more room."""
        return -1.0 if self.end == "lower" else 1.0

    def change(self, fraction: float) -> float:
        """Predict the change of t_E, s, for a limit that leaves more room by a fraction; 0.01 is +1 %."""
        return self.outwards * self.derivative * self.whole * fraction

    def raised(self, limits: Limits, joint: int, fraction: float) -> Limits:
        """Return limits with this one, of the joint with this index, leaving more room by a fraction."""
        name = self.kind if self.end is None else f"position_{self.end}"
        values = {field: getattr(limits, field).copy() for field in limits.__dataclass_fields__}
        values[name][joint] += self.outwards * self.whole * fraction
        return Limits(**values)

    def to_dict(self) -> dict[str, Any]:
        """Return the figures as plain data for JSON."""
        return {
            "joint": self.joint,
            "kind": self.kind,
            "end": self.end,
            "limit": self.limit,
            "unit": self.unit,
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


@dataclass(frozen=True)
class Sensitivities:
    """What all limits cost.

    Attributes
    ----------
    limits : tuple of Sensitivity
        All limits of the robot, the costliest first.
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

    def of(self, joint: str, kind: str, end: str | None = None) -> Sensitivity:
        """Sensitivity to one limit; KeyError where there is no such limit."""
        for entry in self.limits:
            if (entry.joint, entry.kind, entry.end) == (joint, kind, end):
                return entry
        raise KeyError((joint, kind, end))

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
    return sensitivities_at(refined.problem, multipliers_of_answer(refined))


def sensitivities_at(problem: Transcription, multipliers: Multipliers) -> Sensitivities:
    """As `sensitivities`, from a problem and the multipliers of its answer."""
    robot, count = problem.decomposition.robot, len(problem.tau)
    limits: list[Sensitivity] = []
    boundaries: list[BranchBoundary] = []
    first = 0
    for constraint in problem.constraints:
        size = len(constraint.lower)
        for column, label in enumerate(constraint.labels):
            rows = np.zeros(len(problem.lower))
            rows[first + column + size * np.arange(count)] = 1.0
            if constraint.physical:
                limits += _of_joint(robot, constraint.kind, label, rows, multipliers)
            elif (slope := -multipliers.change(rows)) > _SMALLEST:
                boundaries.append(BranchBoundary(label, float(constraint.lower[column]), slope))
        first += count * size
    limits.sort(key=lambda entry: entry.change(1.0))
    return Sensitivities(tuple(limits), tuple(boundaries), multipliers.source, multipliers.residual, multipliers.unique)


def _of_joint(robot: Robot, kind: str, joint: str, rows: np.ndarray, multipliers: Multipliers) -> list[Sensitivity]:
    """Sensitivities to one kind of limit of one joint, whose rows are marked by 1."""
    index = robot.joint_names.index(joint)
    length = robot.position_units[index]
    if kind != "position":
        limit = float(getattr(robot.limits, kind)[index])
        unit = {"rad": "Nm", "m": "N"}[length] if kind == "torque" else length + RATE_UNITS[kind]
        return [Sensitivity(joint, kind, None, limit, limit, unit, multipliers.change(rows) / limit)]
    ends = {"lower": float(robot.limits.position_lower[index]), "upper": float(robot.limits.position_upper[index])}
    closed = np.isfinite(list(ends.values())).all()
    whole = ends["upper"] - ends["lower"] if closed else 1.0
    per_unit = 2.0 / whole if closed and 0.5 * whole <= WIDE else 1.0  # rows count half ranges, or rad or m
    found = []
    for end, limit in ends.items():
        if np.isfinite(limit):
            sign = 1.0 if end == "lower" else -1.0
            derivative = -sign * multipliers.change(rows * per_unit, sign)
            found.append(Sensitivity(joint, kind, end, limit, whole, length, derivative))
    return found
