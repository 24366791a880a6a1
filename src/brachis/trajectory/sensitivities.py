"""Sensitivities of a motion, saved with it as plain data: the time that limits, speeds and stops cost."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import asdict, dataclass
from typing import Any, Literal

from brachis.common.labels import Label
from brachis.common.summary import Summary

TIMINGS = "timings"
"""Value of `source` for sensitivities that come from timings of the joint path instead of multipliers."""
Accuracy = Literal["exact", "estimate", "least", "bound"]
"""Accuracy of a predicted saving; see `TaskSaving`."""
STATIONARY = 1e-3
"""Maximum fraction of the gradient that may remain unbalanced at an optimum."""


@dataclass(frozen=True)
class Sensitivity:
    """The time that one figure of a limit or of the task costs.

    Attributes
    ----------
    label : Label
        Label of the limited quantity, with the unit of the figure.
    side : {"lower", "upper"} or None
        End of a range that the figure sets; None for a figure that bounds both sides.
    figure : float
        Value of the limit in the label's unit.
    full_scale : float
        Change of the figure that counts as 100 %: for most limits the figure itself, for a position the width of its
        range.
    derivative : float
        Derivative of the end time t_E with respect to the figure, s per unit. The derivative is <= 0, except at a lower
        end, where a larger figure leaves less room.
    s : tuple of (float, float)
        Intervals of the path coordinate in which the figure applies; empty for the whole path.
    """

    label: Label
    side: str | None
    figure: float
    full_scale: float
    derivative: float
    s: tuple[tuple[float, float], ...] = ()

    @property
    def outwards(self) -> float:
        """Sign of a change of the figure that gives the motion more room."""
        return -1.0 if self.side == "lower" else 1.0

    def change(self, fraction: float) -> float:
        """Predict the change of the end time, s, if the limit is relaxed by a fraction of its full scale."""
        return self.outwards * self.derivative * self.full_scale * fraction

    def to_dict(self) -> dict[str, Any]:
        """Return the figures as plain data for JSON."""
        return {
            "subject": self.label.subject,
            "kind": self.label.kind,
            "key": self.label.key,
            "s": [list(interval) for interval in self.s],
            "end": self.side,
            "limit": self.figure,
            "unit": self.label.unit,
            "derivative_s_per_unit": self.derivative,
            "change_for_1_percent_s": self.change(0.01),
            "change_for_10_percent_s": self.change(0.1),
        }


@dataclass(frozen=True)
class TaskSaving:
    """Time that the motion would gain from a change of the task, such as no dwell or no stop.

    Attributes
    ----------
    change : str
        The change in words, for example ``without the dwell at s = 0.3``.
    saved : float
        Time that the change saves, s.
    accuracy : {"exact", "estimate", "least", "bound"}
        Whether `saved` is exact, an estimate, an estimated minimum, or an upper bound along the same joint path.
    """

    change: str
    saved: float
    accuracy: Accuracy = "exact"


@dataclass(frozen=True)
class Gradient:
    """Derivative of the end time with respect to a placement or a mass.

    Attributes
    ----------
    subject : str
        What is changed: the name of a frame, ``path`` for paths in the world, ``base``, ``payload``, or ``tool``.
    figure : str
        ``x``, ``y`` and ``z`` along the axes of the world; ``roll``, ``pitch`` and ``yaw`` about them, through the
        beginning of the path that moves (of several: their mean), or else the origin; ``mass``; or a process speed.
    unit : str
        ``m``, ``rad``, ``kg`` or ``m/s``.
    derivative : float or None
        Derivative of the end time t_E, s per unit; None if there is none.
    note : str
        Why there is no derivative.
    """

    subject: str
    figure: str
    unit: str
    derivative: float | None
    note: str = ""

    @property
    def row(self) -> tuple[str, str, str]:
        """The row of a table: what changes, in which way, and the derivative with its unit, or why there is none."""
        if self.derivative is None:
            return self.subject, self.figure, self.note
        per = "s/(m/s)" if self.unit == "m/s" else f"s/{self.unit}"
        return self.subject, self.figure, f"{self.derivative:+.4g} {per}"


@dataclass(frozen=True)
class BranchBoundary:
    """The time that the boundary of the branch costs; the boundary depends on the redundant joints, not on the robot.

    Attributes
    ----------
    label : str
        Name of the branch margin.
    margin : float
        Minimum branch margin that the program allows, dimensionless.
    derivative : float
        Derivative of the end time t_E with respect to `margin`, s.
    """

    label: str
    margin: float
    derivative: float

    def to_dict(self) -> dict[str, Any]:
        """Return the figures as plain data for JSON."""
        return {
            "label": self.label,
            "margin": self.margin,
            "derivative_s": self.derivative,
        }


@dataclass(frozen=True, repr=False)
class Sensitivities(Summary):
    """The time that limits, speeds and stops cost.

    Attributes
    ----------
    limits : tuple of Sensitivity
        All figures of limits (without safeguards), process speeds and blends. The costliest come first.
    boundaries : tuple of BranchBoundary
        Costs of the branch margins that slow the motion down.
    source : str
        Origin of the multipliers, ``"solver"`` or ``"least squares"``; or ``"timings"`` if there are no multipliers.
    residual : float
        Fraction of the gradient of the end time t_E that the multipliers do not balance. This fraction is 0 at an
        optimum.
    unique : bool
        False if the multipliers are not unique. The derivatives are then valid only if a limit is relaxed, not if it is
        tightened.
    task : tuple of TaskSaving
        Savings from changes of the task. The largest come first.
    gradients : tuple of Gradient
        Derivatives with respect to the placements of workpieces and base, and to the payload.
    """

    limits: tuple[Sensitivity, ...]
    boundaries: tuple[BranchBoundary, ...]
    source: str
    residual: float
    unique: bool
    task: tuple[TaskSaving, ...] = ()
    gradients: tuple[Gradient, ...] = ()

    @property
    def reliable(self) -> bool:
        """Whether the multipliers show that the solution is an optimum; if not, they are only approximate."""
        return self.residual <= STATIONARY

    def of(self, subject: str, kind: str, end: str | None = None) -> Sensitivity:
        """Return the sensitivity to one figure, such as ``of("j1", "torque")``; KeyError if it does not exist."""
        key = (subject, kind, end)
        for entry in self.limits:
            if (entry.label.subject, entry.label.kind, entry.side) == key:
                return entry
        raise KeyError(key)

    def to_dict(self) -> dict[str, Any]:
        """Return the figures as plain data for JSON."""
        return {
            "limits": [entry.to_dict() for entry in self.limits],
            "branch_boundaries": [entry.to_dict() for entry in self.boundaries],
            "task": [asdict(entry) for entry in self.task],
            "gradients": [asdict(entry) for entry in self.gradients],
            "multipliers": self.source,
            "residual": self.residual,
            "reliable": self.reliable,
            "unique": self.unique,
        }

    def to_file(self) -> dict[str, Any]:
        """Return all data in plain form for JSON. `of_file` is the inverse."""
        return asdict(self)

    @classmethod
    def of_file(cls, stored: Mapping[str, Any]) -> Sensitivities:
        """Read the data that `to_file` wrote.

        Raises
        ------
        ValidationError
            The data are invalid. The error is raised by pydantic.
        """
        from pydantic import TypeAdapter

        return TypeAdapter(cls).validate_python(stored)
