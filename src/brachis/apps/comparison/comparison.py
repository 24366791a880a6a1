"""Two motions along one path, side by side.

What the rows of a recorded motion prove of its limits, whatever it does between them.

A joint that moves by dq within a period h has a velocity of dq / h at some time of it, and an acceleration equal to the
second difference over h^2 within two periods, a jerk equal to the third over h^3 within three (mean value theorem of
divided differences). So a limit on one of these is exceeded for certain where the differences exceed it. A limit on
another quantity (a torque, the tool's speed) is compared with the quantity's value for these means, at the posture in
the middle of the periods: what is left out is how posture and velocity change within them. What the errors of the rows
may add to a ratio is subtracted. It is less over more periods, so that some are taken together, too.
"""

from __future__ import annotations

from dataclasses import dataclass
from math import factorial
from typing import Any

import numpy as np

from brachis.common.summary import Summary
from brachis.limits import Limit, Moments, Role, limits_of
from brachis.result import Result
from brachis.robot import bind
from brachis.trajectory import Trajectory
from brachis.verify import Verification

_STRIDES = (1, 2, 4)
"""Periods that are taken as one, for limits of joints; those of the tool may change along the path."""


@dataclass(frozen=True, eq=False)
class RatioBounds:
    """What rows prove of one limit.

    Attributes
    ----------
    limit : str
        Its kind in words.
    subjects : tuple of str
        Of its c values: joints, or the tool.
    t : (K,) ndarray
        Times of the rows, s.
    ratios : (K, c) ndarray
        Sizes of the ratios that are reached for certain; 0 where nothing is proven.
    """

    limit: str
    subjects: tuple[str, ...]
    t: np.ndarray
    ratios: np.ndarray

    @property
    def worst(self) -> tuple[float, str, float]:
        """Largest ratio, of what, and when, s."""
        row, column = np.unravel_index(np.argmax(self.ratios), self.ratios.shape)
        return (
            float(self.ratios[row, column]),
            self.subjects[column],
            float(self.t[row]),
        )


def bound_ratios(trajectory: Trajectory) -> tuple[RatioBounds, ...]:
    """Compare the rows of an imported motion with every limit of its task; nothing where the rows are not known."""
    assert trajectory.recovered is not None
    t = trajectory.recovered.rows[:, 0]
    if not len(t):
        return ()
    robot, _ = bind(trajectory.robot, trajectory.task.task_space)
    return tuple(
        RatioBounds(
            limit.name,
            tuple(label.subject for label in limit.labels),
            t,
            _bound_limit(trajectory, limit),
        )
        for limit in limits_of(robot, trajectory.task)
    )


def _bound_limit(trajectory: Trajectory, limit: Limit) -> np.ndarray:
    """Return the sizes of the ratios to one limit, (K, c)."""
    assert trajectory.recovered is not None
    t = trajectory.recovered.rows[:, 0]
    count = len(t)
    found = np.zeros((count, len(limit.labels)))
    order = _order(limit, _means(trajectory, np.arange(1)[:, None])[0])
    towards = np.where(
        np.isfinite(limit.centre),
        limit.centre,
        np.where(np.isfinite(limit.upper), -np.inf, np.inf),
    )
    alone = limit.role is not Role.ROBOT or limit.guarantee.is_mean
    for stride in _STRIDES[:1] if alone else _STRIDES:
        windows = np.arange(max(count - order * stride, 0))[
            :, None
        ] + stride * np.arange(order + 1)
        windows = windows[~_across(trajectory, windows, limit.breaks)]
        if not len(windows):
            continue
        moments, errors = _means(trajectory, windows)
        partials = limit.partials(moments)
        slopes = (partials.q, partials.qdot, partials.qddot, partials.qdddot)
        products = [
            np.abs(slope) @ error
            for slope, error in zip(slopes, errors, strict=True)
            if slope is not None
        ]
        off = np.sum(products, axis=0)[:, :, 0]
        values = limit.values(moments)
        values = values - np.clip(values - towards, -off, off)
        if limit.guarantee.is_mean:
            return (
                np.abs(
                    limit.ratio(
                        np.trapezoid(values, t[windows[:, order // 2]], axis=0) / t[-1]
                    )
                )[None]
                + found
            )
        np.maximum.at(found, windows[:, order // 2], np.abs(limit.ratio(values)))
    return found


def _order(limit: Limit, moments: Moments) -> int:
    """Return the highest time derivative of the joints' positions that a limit asks for."""
    partials = limit.partials(moments)
    asked = (partials.q, partials.qdot, partials.qddot, partials.qdddot)
    return max(order for order, part in enumerate(asked) if part is not None)


def _across(
    trajectory: Trajectory, windows: np.ndarray, breaks: np.ndarray
) -> np.ndarray:
    """Tell for windows of rows, (W, m + 1), whether the limit changes abruptly within them, (W,)."""
    t = trajectory.recovered.rows[:, 0]  # type: ignore[union-attr]
    first, last = (
        trajectory.path_spline(t[windows[:, end]])[:, None] for end in (0, -1)
    )
    return np.asarray(((first < breaks) & (breaks < last)).any(axis=1))


def _means(
    trajectory: Trajectory, windows: np.ndarray
) -> tuple[Moments, list[np.ndarray]]:
    """Differentiate the polynomials through m + 1 rows each, in the middle of windows of rows, (W, m + 1).

    Returns
    -------
    Moments
        The m-th derivative is m! times the divided difference; higher ones are 0.
    list of (W, n, 1) ndarray
        What the errors of the rows add to q and each derivative at most.
    """
    recovered = trajectory.recovered
    assert recovered is not None
    t, q = recovered.rows[windows, 0], recovered.rows[windows, 1:]
    order = windows.shape[1] - 1
    middle = 0.5 * (t[:, order // 2] + t[:, (order + 1) // 2])
    unit = np.max(t[:, -1] - t[:, 0], initial=0.0) or 1.0
    powers = ((t - middle[:, None]) / unit)[:, :, None] ** np.arange(order + 1)
    weights = np.linalg.inv(powers) * [
        [factorial(power) / unit**power] for power in range(order + 1)
    ]
    weights = np.concatenate(
        [weights, np.zeros((len(windows), 3 - order, order + 1))], axis=1
    )
    errors = np.abs(weights).sum(axis=2)[:, :, None] * recovered.error
    found, qdot, qddot, qdddot = np.moveaxis(weights @ q, 1, 0)
    moments = Moments(found, qdot, qddot, qdddot, trajectory.path_spline(middle))
    return moments, [error[:, :, None] for error in np.moveaxis(errors, 1, 0)]


@dataclass(frozen=True)
class Use:
    """How much of a limit both motions use.

    Attributes
    ----------
    limit : str
        Its kind.
    today : float
        Largest ratio that the rows of today's motion prove; 1 is all of it. See `brachis.apps.comparison.RatioBounds`.
    today_at : str
        What comes nearest to it: a joint, or the tool.
    today_time : float
        When, s.
    today_up_to : float
        Largest ratio of the motion that was made of the rows. What lies between the rows is not known.
    planned : float
        Largest ratio of the plan.
    planned_at : str
    """

    limit: str
    today: float
    today_at: str
    today_time: float
    today_up_to: float
    planned: float
    planned_at: str

    @property
    def today_in_words(self) -> str:
        """Say how much today's motion uses for certain, and how much it may."""
        proven = f"{100.0 * self.today:.1f} %"
        possible = f"{100.0 * self.today_up_to:.1f} %"
        return (
            proven
            if proven == possible
            else f"{proven}, between the rows up to {possible}"
        )


@dataclass(frozen=True, repr=False)
class Comparison(Summary):
    """A motion of today and the one planned in its place.

    Attributes
    ----------
    today : Trajectory
        With the path recovered from it.
    verification : Verification
        Of today's motion, as it was made of its rows.
    proven : tuple of RatioBounds
        What its rows alone prove, limit by limit; empty where they are not known.
    result : Result
        Of the plan along the same path, within the same limits.

    Examples
    --------
    >>> import tempfile
    >>> import brachis
    >>> result = brachis.plan(brachis.examples.scara_line, redundant_joints=["j1"], effort="single", intervals=8)
    >>> with tempfile.TemporaryDirectory() as folder:
    ...     brachis.export.write(result.trajectory, f"{folder}/today.csv", dt=0.004)
    ...     found = brachis.compare(f"{folder}/today.csv", task=result.task)
    >>> [use.limit for use in found.uses], isinstance(found, brachis.Comparison)
    (['torque'], True)
    """

    today: Trajectory
    verification: Verification
    proven: tuple[RatioBounds, ...]
    result: Result

    @property
    def saved(self) -> float:
        """Part of today's time that the plan saves; negative where it takes longer."""
        return 1.0 - self.result.t_end / self.today.t_end

    @property
    def uses(self) -> tuple[Use, ...]:
        """How much of every limit both motions use."""
        today = {proven.limit: proven.worst for proven in self.proven}
        found = {check.name: check for check in self.verification.checks}
        uses = []
        for check in self.result.verification.checks:
            limit = check.name.removesuffix(" ratio")
            if check.of_limit and limit in today and check.name in found:
                up_to = max(today[limit][0], found[check.name].value)
                uses.append(
                    Use(limit, *today[limit], up_to, check.value, check.subject or "")
                )
        return tuple(uses)

    @property
    def exceeded(self) -> tuple[Use, ...]:
        """Limits that today's motion exceeds for certain, beyond the task's tolerance."""
        tolerance = self.today.task.refinement.tolerance
        return tuple(use for use in self.uses if use.today > 1.0 + tolerance)

    @property
    def verdict(self) -> str:
        """Say in one line what is gained."""
        times = f"{self.result.t_end:.4f} s instead of {self.today.t_end:.4f} s"
        if not self.result.verified:
            return f"no verified motion was found along the path of today's ({times})"
        return f"{100.0 * abs(self.saved):.1f} % {'faster' if self.saved >= 0.0 else 'slower'}: {times}"

    @property
    def remarks(self) -> tuple[str, ...]:
        """Say what of today's motion has to be known beside the times."""
        jumps = "today's rows begin or end with an acceleration, so the plan may do so as well (rest: velocity)"
        exceeded = (
            f"today's motion exceeds the {use.limit} limit of {use.today_at} by {100.0 * (use.today - 1.0):.2g} % at "
            f"{use.today_time:.4f} s, as its rows prove; between them it may be by up to "
            f"{100.0 * (use.today_up_to - 1.0):.2g} %"
            for use in self.exceeded
        )
        unknown = "the rows of today's motion are not known: import its CSV file again to compare it with the limits"
        remarks = {
            jumps: self.today.task.spline.rest != "full",
            unknown: not self.proven,
        }
        return (*exceeded, *(remark for remark, holds in remarks.items() if holds))

    def summary(self) -> dict[str, object]:
        """Return what is shown."""
        uses = (
            f"{use.limit} {use.today_in_words} today, {100.0 * use.planned:.1f} % planned"
            for use in self.uses
        )
        return {
            "verdict": self.verdict,
            "limits used": "; ".join(uses),
            "remarks": "; ".join(self.remarks) or "none",
        }

    def __str__(self) -> str:
        """Say all in plain words."""
        lines = [self.verdict, *self.remarks]
        lines += [
            f"{use.limit}: {use.today_in_words} used today ({use.today_at}), "
            f"{100.0 * use.planned:.1f} % in the plan ({use.planned_at})"
            for use in self.uses
        ]
        assert self.today.recovered is not None
        return "\n".join([*lines, *self.today.recovered.told])

    def to_dict(self) -> dict[str, Any]:
        """Return the figures as plain data for JSON."""
        assert self.today.recovered is not None
        return {
            "t_end": self.result.t_end,
            "t_end_today": self.today.t_end,
            "saved": self.saved,
            "verdict": self.verdict,
            "verified": self.result.verified,
            "today_within_limits": not self.exceeded if self.proven else None,
            "remarks": list(self.remarks),
            "limits": [vars(use) for use in self.uses],
            "recovered": self.today.recovered.to_dict(),
            "verification_today": self.verification.to_dict(),
            "plan": self.result.to_dict(),
        }
