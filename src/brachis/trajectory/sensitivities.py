"""What holds a motion back, as plain data that is saved with it: what limits, speeds and stops cost."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import asdict, dataclass
from typing import Any, Literal

from brachis.common.labels import Label
from brachis.common.summary import Summary

TIMINGS = "timings"
"""Source of sensitivities that come from timings of the joint path, without multipliers."""
Accuracy = Literal["exact", "estimate", "least", "bound"]
"""How near a saving is to what the motion would gain; see `TaskSaving`."""
STATIONARY = 1e-3
"""Part of the gradient that may be unbalanced at an optimum."""


@dataclass(frozen=True)
class Sensitivity:
    """What one figure of a limit, or of the task, costs.

    Attributes
    ----------
    label : Label
        What is limited, and the figure's unit.
    side : {"lower", "upper"} or None
        End of a range; None for a figure that bounds both sides.
    figure : float
        In the label's unit.
    full_scale : float
        What a change by 100 % means: of most limits the figure itself, of a position the width of its range.
    derivative : float
        Derivative of t_E with respect to the figure, s per unit; <= 0 except at a lower end, which is raised by it.
    s : tuple of (float, float)
        Path coordinates between which the figure counts; empty for all of the path.
    """

    label: Label
    side: str | None
    figure: float
    full_scale: float
    derivative: float
    s: tuple[tuple[float, float], ...] = ()

    @property
    def outwards(self) -> float:
        """Sign of a change of the figure that leaves more room."""
        return -1.0 if self.side == "lower" else 1.0

    def change(self, fraction: float) -> float:
        """Predict the change of t_E, s, for a limit that leaves more room by a fraction; 0.01 is +1 %."""
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
    """What the motion would gain if the task asked for something else, such as no dwell or no stop.

    Attributes
    ----------
    change : str
        In words, for example ``without the dwell at s = 0.3``.
    saved : float
        By how much the motion gets shorter, s.
    accuracy : {"exact", "estimate", "least", "bound"}
        Whether it saves that; about that; at least about that; or along the same joint path no more than that.
    """

    change: str
    saved: float
    accuracy: Accuracy = "exact"


@dataclass(frozen=True)
class BranchBoundary:
    """What the branch's boundary costs; it limits the choice of redundant joints, not the robot.

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
        return {
            "label": self.label,
            "margin": self.margin,
            "derivative_s": self.derivative,
        }


@dataclass(frozen=True, repr=False)
class Sensitivities(Summary):
    """What limits, speeds and stops cost.

    Attributes
    ----------
    limits : tuple of Sensitivity
        All figures of all limits but safeguards, process speeds and blends, the costliest first.
    boundaries : tuple of BranchBoundary
        Branch margins that hold the motion back.
    source : str
        Origin of the multipliers: ``"solver"`` or ``"least squares"``; or ``"timings"`` in place of multipliers.
    residual : float
        Part of the gradient of t_E that they do not balance; an optimum has 0.
    unique : bool
        False if the multipliers are not unique: the derivatives then hold for more room only, not for less.
    task : tuple of TaskSaving
        What changes of the task save, those that save most first.
    """

    limits: tuple[Sensitivity, ...]
    boundaries: tuple[BranchBoundary, ...]
    source: str
    residual: float
    unique: bool
    task: tuple[TaskSaving, ...] = ()

    @property
    def reliable(self) -> bool:
        """Whether the answer is an optimum, judged by the multipliers; otherwise they are rough."""
        return self.residual <= STATIONARY

    def of(self, subject: str, kind: str, end: str | None = None) -> Sensitivity:
        """Sensitivity to one figure, such as ``of("j1", "torque")``; KeyError if it does not exist."""
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
            "multipliers": self.source,
            "residual": self.residual,
            "reliable": self.reliable,
            "unique": self.unique,
        }

    def to_file(self) -> dict[str, Any]:
        """Return all as plain data for JSON, from which `of_file` makes it again."""
        return asdict(self)

    @classmethod
    def of_file(cls, stored: Mapping[str, Any]) -> Sensitivities:
        """Take what `to_file` wrote.

        Raises
        ------
        ValidationError
            Of pydantic: it is something else.
        """
        from pydantic import TypeAdapter

        return TypeAdapter(cls).validate_python(stored)
