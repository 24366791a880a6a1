"""Ratios to limits that the rows of a recorded motion prove, whatever happens between the rows.

A joint that moves by dq within a period h has the velocity dq / h at some time within this period. Within two periods
it has an acceleration equal to the second difference over h^2, and within three periods a jerk equal to the third
difference over h^3 (mean value theorem of divided differences). If such a difference exceeds a limit, the motion
certainly exceeds this limit. A limit on another quantity, such as a torque or the tool speed, is compared with the
value that results from these means at the posture in the middle of the periods. Changes of posture and velocity within
the periods are neglected. The amount that errors of the rows may add to a ratio is subtracted. Because these errors
matter less over longer periods, several periods are also combined into one.
"""

from __future__ import annotations

from dataclasses import dataclass
from math import factorial

import numpy as np

from brachis.common.arrays import apply_each
from brachis.limits import Limit, Moments, Role, limits_of
from brachis.trajectory import Trajectory


@dataclass(frozen=True, eq=False)
class RatioBounds:
    """Ratios to one limit that the rows prove.

    Attributes
    ----------
    limit : str
        Name of the limit.
    subjects : tuple of str
        Subjects of the c values of the limit: joints, or the tool.
    t : (K,) ndarray
        Times of the rows, s.
    ratios : (K, c) ndarray
        Magnitudes of the ratios that are certainly reached; 0 where nothing is proven.
    """

    limit: str
    subjects: tuple[str, ...]
    t: np.ndarray
    ratios: np.ndarray

    @property
    def worst(self) -> tuple[float, str, float]:
        """The largest ratio, its subject, and its time, s."""
        row, column = np.unravel_index(np.argmax(self.ratios), self.ratios.shape)
        ratio = float(self.ratios[row, column])
        return ratio, self.subjects[column], float(self.t[row])


def bound_ratios(trajectory: Trajectory) -> tuple[RatioBounds, ...]:
    """Compute, for every limit of the task, the ratios that the rows of an imported motion prove."""
    assert trajectory.recovered is not None
    t = trajectory.recovered.rows[:, 0]
    bounds = []
    for limit in limits_of(trajectory.robot, trajectory.task):
        subjects = tuple(label.subject for label in limit.labels)
        ratios = _bound_limit(trajectory, t, limit)
        bounds.append(RatioBounds(limit.name, subjects, t, ratios))
    return tuple(bounds)


def _bound_limit(trajectory: Trajectory, t: np.ndarray, limit: Limit) -> np.ndarray:
    """Return the magnitudes of the ratios to one limit, (K, c), that the rows at times t prove."""
    ratios = np.zeros((len(t), len(limit.labels)))
    first_row, _ = _differentiate(trajectory, np.zeros((1, 1), dtype=int))
    slopes = limit.partials(first_row).by_joints
    order = max(power for power, slope in enumerate(slopes) if slope is not None)
    one_sided = np.where(np.isfinite(limit.upper), -np.inf, np.inf)
    harmless = np.where(np.isfinite(limit.centre), limit.centre, one_sided)
    is_mean = limit.guarantee.is_mean
    # Numbers of periods combined into one. Tool limits may change along the path, so their periods are not combined.
    strides = (1, 2, 4) if limit.role is Role.ROBOT and not is_mean else (1,)
    for stride in strides:
        first = np.arange(max(len(t) - order * stride, 0))[:, None]
        windows = first + stride * np.arange(order + 1)
        s = trajectory.path_spline(t[windows[:, [0, -1]]].ravel()).reshape(-1, 2)
        across = (s[:, :1] < limit.breaks) & (limit.breaks < s[:, 1:])
        windows = windows[~across.any(axis=1)]
        if not len(windows):
            continue
        means, errors = _differentiate(trajectory, windows)
        off = np.zeros((len(windows), len(limit.labels)))
        for slope, error in zip(limit.partials(means).by_joints, errors, strict=True):
            if slope is not None:
                off += apply_each(np.abs(slope), error)
        values = limit.values(means)
        values = values - np.clip(values - harmless, -off, off)
        middle = windows[:, order // 2]
        if is_mean:
            mean = np.trapezoid(values, t[middle], axis=0) / t[-1]
            return np.abs(limit.ratio(mean)) + ratios
        np.maximum.at(ratios, middle, np.abs(limit.ratio(values)))
    return ratios


def _differentiate(
    trajectory: Trajectory, windows: np.ndarray
) -> tuple[Moments, np.ndarray]:
    """Differentiate the polynomial through each window of m + 1 rows, (W, m + 1), in the middle of the window.

    Returns
    -------
    Moments
        The m-th derivative is m! times the divided difference; higher derivatives are 0.
    (4, W, n) ndarray
        Largest amounts that errors of the rows can add to q and to each derivative.
    """
    recovered = trajectory.recovered
    assert recovered is not None
    t = recovered.rows[windows, 0]
    order = windows.shape[1] - 1
    middle = 0.5 * (t[:, order // 2] + t[:, (order + 1) // 2])
    unit = np.max(t[:, -1] - t[:, 0], initial=0.0) or 1.0
    powers = ((t - middle[:, None]) / unit)[:, :, None] ** np.arange(order + 1)
    factors = [[factorial(power) / unit**power] for power in range(order + 1)]
    weights = np.zeros((len(windows), 4, order + 1))
    weights[:, : order + 1] = np.linalg.inv(powers) * factors
    errors = np.abs(weights).sum(axis=2)[:, :, None] * recovered.error
    q, qdot, qddot, qdddot = np.moveaxis(weights @ recovered.rows[windows, 1:], 1, 0)
    moments = Moments(q, qdot, qddot, qdddot, trajectory.path_spline(middle))
    return moments, np.moveaxis(errors, 1, 0)
