"""Which limit is active when, and for how much of the time, from the trajectory alone."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from brachis.bottleneck.ratios import LimitRatios, limit_ratios
from brachis.limits import Label, Limit
from brachis.summary import Summary
from brachis.trajectory import Trajectory

THRESHOLD = 0.999
"""A limit is active where the motion is at this part of it or beyond."""


@dataclass(frozen=True)
class Stretch:
    """A stretch of time.

    Attributes
    ----------
    begin, end : float
        s.
    side : {"lower", "upper"}
        Which of the two bounds is active; of a torque, velocity or acceleration ``lower`` is the negative one.
    """

    begin: float
    end: float
    side: str


@dataclass(frozen=True, repr=False)
class Saturation(Summary):
    """How long one value of a limit is at it.

    Attributes
    ----------
    label : Label
        What is limited.
    share : float
        Part of the time, 0 to 1.
    peak : float
        Largest ratio to the limit.
    active : tuple of Stretch
        When, in the order of time.
    """

    label: Label
    share: float
    peak: float
    active: tuple[Stretch, ...]

    def to_dict(self) -> dict[str, Any]:
        """Return the figures as plain data for JSON."""
        return {
            "subject": self.label.subject,
            "kind": self.label.kind,
            "share": self.share,
            "peak_ratio": self.peak,
            "active_s": [[stretch.begin, stretch.end, stretch.side] for stretch in self.active],
        }


def saturations(
    trajectory: Trajectory, limits: Sequence[Limit] | None = None, *, threshold: float = THRESHOLD
) -> tuple[Saturation, ...]:
    """Find when every limit is active.

    Parameters
    ----------
    trajectory : Trajectory
        Any one, a saved one for example.
    limits : sequence of Limit, optional
        Those of the trajectory's task if left out.
    threshold : float, optional
        Part of the limit from which on it counts as active.

    Returns
    -------
    tuple of Saturation
        Of all limits, those active longest first.
    """
    return saturations_of(limit_ratios(trajectory, limits), threshold=threshold)


def saturations_of(ratios: LimitRatios, *, threshold: float = THRESHOLD) -> tuple[Saturation, ...]:
    """As `saturations`, from ratios already computed."""
    found = []
    for label, column in zip(ratios.labels, ratios.values.T, strict=True):
        active = [
            Stretch(begin, end, side)
            for side, sign in (("lower", -1.0), ("upper", 1.0))
            for begin, end in _stretches(ratios.t, sign * column, threshold)
        ]
        active.sort(key=lambda stretch: stretch.begin)
        duration = sum(stretch.end - stretch.begin for stretch in active)
        peak = float(np.abs(column).max())
        found.append(Saturation(label, float(duration / ratios.t[-1]), peak, tuple(active)))
    return tuple(sorted(found, key=lambda entry: (-entry.share, -entry.peak)))


def _stretches(t: np.ndarray, values: np.ndarray, threshold: float) -> list[tuple[float, float]]:
    """Stretches of time on which values, linear between the times (K,), are at the threshold or above."""
    above = values >= threshold
    edges = np.flatnonzero(np.diff(np.concatenate([[False], above, [False]]).astype(int)))
    found: list[tuple[float, float]] = []
    for first, after in edges.reshape(-1, 2).tolist():
        begin = _crossing(t, values, first - 1, threshold) if first else float(t[0])
        end = _crossing(t, values, after - 1, threshold) if after < len(t) else float(t[-1])
        found.append((begin, end))
    return found


def _crossing(t: np.ndarray, values: np.ndarray, before: int, threshold: float) -> float:
    """Time between two neighbours at which the line between them meets the threshold, s."""
    low, high = values[before], values[before + 1]
    return float(t[before] + (t[before + 1] - t[before]) * (threshold - low) / (high - low))
