"""The results of a verification as data, and its tolerances."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import asdict, dataclass, field
from typing import Any

from brachis.common.summary import Summary
from brachis.common.words import write_apart
from brachis.robot.joints import shown_unit

POSITION_SCALE = "0: the middle of the range, 1: an end"
"""Remark on the position check that explains its ratio."""


@dataclass(frozen=True)
class Margin:
    """The smallest value of a margin found at the checked instants.

    Attributes
    ----------
    name : str
        Name of the margin.
    value : float
    unit : str
        Unit of the value: ``-`` or ``%``.
    subject : str
        The joint that has this margin, or the arm.
    time : float
        Time at which the margin occurs, s.
    """

    name: str
    value: float
    unit: str
    subject: str
    time: float

    def in_words(self) -> str:
        """Write the margin with its subject and time."""
        unit = "" if self.unit == "-" else f" {self.unit}"
        return f"{self.value:.3g}{unit}, {self.subject} at {self.time:.4g} s"


@dataclass(frozen=True)
class Check:
    """The result of one check.

    Attributes
    ----------
    name : str
        Name of the check, for example ``torque ratio`` or ``path error``.
    value : float
        Worst value found: a ratio to the limit, or an error in `unit`.
    allowed : float
        Maximum value that passes.
    unit : str
        Unit of `value` and `allowed`; ``-`` for ratios.
    passed : bool
        Whether the value is at most the allowed one.
    subject : str or None
        Joint with the worst value, or the tool.
    time : float or None
        Time of the worst value, s.
    remark : str
        Note on the check; often empty.
    limit : str
        Name of the limit that the check compares the motion with, so that `value` is a ratio; empty for other checks.
    is_kept : bool
        Whether the planner takes this limit into account; otherwise motions are only checked against it.
    """

    name: str
    value: float
    allowed: float
    unit: str
    passed: bool = field(init=False)
    subject: str | None = None
    time: float | None = None
    remark: str = ""
    limit: str = ""
    is_kept: bool = True

    def __post_init__(self) -> None:
        """Convert NumPy numbers to plain ones, and compare the value with the allowed one."""
        object.__setattr__(self, "value", float(self.value))
        if self.time is not None:
            object.__setattr__(self, "time", float(self.time))
        object.__setattr__(self, "passed", bool(self.value <= self.allowed))

    @property
    def share(self) -> float:
        """The worst value as a fraction of the allowed one."""
        return self.value / self.allowed if self.allowed else self.value

    def figures(self, *, degrees: bool) -> tuple[str, str, str]:
        """Write the value found, the allowed value, and their unit. Ratios to a limit are written with six decimals.

        With `degrees`, angles are in degrees, except values that may be either in rad or in m.
        """
        ratio = self.limit or (self.unit == "-" and self.allowed > 1.0)
        unit, factor = shown_unit(self.unit, degrees=degrees)
        value = factor * self.value
        return (
            f"{value:.6f}" if ratio else f"{value:.1e}",
            f"{factor * self.allowed:.6g}",
            unit,
        )

    def in_words(self) -> str:
        """Write the value found and the allowed value, with subject, time and remark."""
        unit = "" if self.unit == "-" else f" {self.unit}"
        value, _ = write_apart(self.value, self.allowed)
        _, allowed, _ = self.figures(degrees=False)
        verdict = "<=" if self.passed else "FAILED, allowed"
        subject = f", {self.subject}" if self.subject else ""
        time = f" at {self.time:.4g} s" if self.time is not None else ""
        remark = f", {self.remark}" if self.remark else ""
        return f"{value}{unit} {verdict} {allowed}{unit}{subject}{time}{remark}"


@dataclass(frozen=True, repr=False)
class Verification(Summary):
    """All checks of one trajectory.

    Attributes
    ----------
    checks : tuple of Check
    points : int
        Number of instants at which the trajectory was evaluated.
    worst_ratio : float
        Largest ratio of any quantity to its limit.
    path_error : float
        Largest deviation from the path: the larger of the distance in m and the angle in rad.
    margins : tuple of Margin
        How close the motion comes to singular postures and to the ends of joint ranges.

    Examples
    --------
    >>> import brachis
    >>> result = brachis.plan(brachis.examples.scara_line, redundant_joints=["j1"], effort="single", intervals=8)
    >>> [check.name for check in result.verification.checks][:2]
    ['path error', 'torque ratio']
    """

    checks: tuple[Check, ...]
    points: int
    worst_ratio: float
    path_error: float
    margins: tuple[Margin, ...] = ()

    @property
    def passed(self) -> bool:
        """Whether every check passed."""
        return all(check.passed for check in self.checks)

    @property
    def failures(self) -> tuple[str, ...]:
        """What failed, in words."""
        failed = (check for check in self.checks if not check.passed)
        return tuple(f"{check.name}: {check.in_words()}" for check in failed)

    def to_dict(self) -> dict[str, Any]:
        """Return plain data for JSON."""
        return {"passed": self.passed, **asdict(self)}

    def summary(self) -> Mapping[str, object]:
        """Return the entries shown to the user: every check with its worst value."""
        return {
            "passed": "yes" if self.passed else "NO",
            "worst ratio": self.worst_ratio,
            **{check.name: check.in_words() for check in self.checks},
            **{margin.name: margin.in_words() for margin in self.margins},
        }


@dataclass(frozen=True)
class VerifyOptions:
    """Tolerances of the verification.

    Attributes
    ----------
    ratio_tolerance : float
        Maximum excess over a limit, as a fraction of the limit.
    path_tolerance : float
        Maximum distance from the path, m or rad.
    points_per_interval : int
        Number of grid points per knot interval of the splines.
    progress_tolerance : float
        Maximum backward path velocity (1/s), and maximum error of s at the ends (dimensionless).
    posture_tolerance : float
        Maximum error of the start and end postures, rad or m.
    rest_velocity_tolerance : float
        Maximum joint velocity at the ends, rad/s or m/s.
    rest_acceleration_tolerance : float
        Maximum joint acceleration at ends where the task asks for full rest, rad/s^2 or m/s^2.
    rest_jerk_tolerance : float
        Maximum joint jerk at ends where the task asks for rest in jerk, as a fraction of 1 plus the largest jerk.
    jump_tolerance : float
        Maximum jump where polynomial pieces join, as a fraction of 1 plus the largest value of the quantity.
    spline_tolerance : float
        Maximum difference between the splines of the redundant joints and the motion of these joints, rad or m.
    """

    ratio_tolerance: float = 1e-4
    path_tolerance: float = 1e-9
    points_per_interval: int = 32
    progress_tolerance: float = 1e-9
    posture_tolerance: float = 1e-9
    rest_velocity_tolerance: float = 1e-8
    rest_acceleration_tolerance: float = 1e-6
    rest_jerk_tolerance: float = 1e-4
    jump_tolerance: float = 1e-6
    spline_tolerance: float = 1e-8
