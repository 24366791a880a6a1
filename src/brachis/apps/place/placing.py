"""The result of a search for a faster place, and its ranges and tasks as text."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
import yaml

from brachis.common.summary import Summary
from brachis.errors import InputError, check_names
from brachis.explain.placement import COORDINATES
from brachis.result import Result
from brachis.robot.plausibility import issue_above, report_issues
from brachis.task import Task

RANGES = {
    name if unit == "m" else f"{name}_deg": (
        name,
        1.0 if unit == "m" else np.pi / 180.0,
    )
    for name, unit in COORDINATES.items()
}
"""Coordinates for which the user gives ranges: the coordinate of a placement, and its factor to m or rad."""


@dataclass(frozen=True)
class Trial:
    """A place that was tried.

    Attributes
    ----------
    change : dict of str to float
        Change of the placement, m and degrees, by the names in `RANGES`.
    t_end : float
        End time, s; infinite without a verified motion.
    """

    change: dict[str, float]
    t_end: float


@dataclass(frozen=True, repr=False)
class Placing(Summary):
    """A faster place for a workpiece or the base.

    Attributes
    ----------
    moved : str
        Name of the frame, or ``base``.
    change : dict of str to float
        How the placement changed, m and degrees, along and about the axes of the world.
    task : Task
        The changed task.
    before, after : Result
        Plans of the task as it was, and of the changed task.
    trials : tuple of Trial
        All places that were tried, in their order.

    Examples
    --------
    >>> import brachis
    >>> line = {"path": brachis.Line(by=[0.0, 0.6]), "path_start": [1.5, -0.3]}
    >>> options = {"start": "free", "task_space": ["x", "y"], "starts": 1, "steps": 1}
    >>> placing = brachis.place("scara3", ranges={"x": (-0.2, 0.2)}, **options, **line)
    >>> placing.moved, list(placing.change), placing.gain >= 0.0
    ('workpiece', ['x'], True)
    """

    moved: str
    change: dict[str, float]
    task: Task
    before: Result
    after: Result
    trials: tuple[Trial, ...]

    @property
    def gain(self) -> float:
        """Fraction of the end time that the change saves."""
        return 1.0 - self.after.t_end / self.before.t_end

    def summary(self) -> Mapping[str, object]:
        """Return the entries that are shown to the user."""
        times = [trial.t_end for trial in self.trials]
        return {
            "moved": self.moved,
            "by": write_change(self.change) or "nothing: no other place is faster",
            "end time before": write_end_time(self.before),
            "end time after": write_end_time(self.after),
            "gain": f"{100.0 * self.gain:.1f} %",
            "places tried": f"{len(times)}, {times.count(np.inf)} without a verified motion",
        }

    def to_dict(self) -> dict[str, Any]:
        """Return the figures as plain data for JSON."""
        return {
            "moved": self.moved,
            "change": self.change,
            "t_end_before": self.before.t_end,
            "verified_before": self.before.verified,
            "t_end": self.after.t_end,
            "gain": self.gain,
            "verified": self.after.verified,
            "trials": [
                {"change": trial.change, "t_end": trial.t_end}
                for trial in self.trials
                if np.isfinite(trial.t_end)
            ],
        }


def write_end_time(result: Result) -> str:
    """Write the end time of a plan, and whether its motion may not be run."""
    return f"{result.t_end:.4f} s{'' if result.verified else ', not verified'}"


def write_task(task: Task) -> str:
    """Write a task as YAML, without the keys that have their defaults."""
    content = task.model_dump(mode="json", exclude_defaults=True)
    paths = [part for part in content.get("program", ()) if "path" in part]
    spaces = [part["task_space"] for part in paths]
    if spaces and spaces == spaces[:1] * len(spaces):
        content["task_space"] = spaces[0]
        for part in paths:
            del part["task_space"]
    return yaml.safe_dump({"brachis": task.brachis, **content}, sort_keys=False)


def write_change(change: Mapping[str, float]) -> str:
    """Write a change of a placement with units; coordinates that stay are left out."""
    return ", ".join(
        f"{name.removesuffix('_deg')} {value:+.4g} {'deg' if name.endswith('_deg') else 'm'}"
        for name, value in change.items()
        if value
    )


def read_range(text: str) -> tuple[str, tuple[float, float]]:
    """Read a range such as ``x=-0.2,0.2``.

    Raises
    ------
    InputError
    """
    name, _, ends = text.partition("=")
    try:
        low, high = map(float, ends.split(","))
    except ValueError:
        raise InputError(
            "this is not a range",
            where="--range",
            found=text,
            allowed="NAME=FROM,TO, such as x=-0.2,0.2",
        ) from None
    return name, (low, high)


def check_ranges(ranges: Mapping[str, tuple[float, float]]) -> None:
    """Refuse unknown coordinates, and ranges without a width or without the present place."""
    check_names("coordinate", ranges, RANGES, "ranges")
    if not ranges:
        raise InputError(
            "no range is given, so nothing can be moved",
            where="ranges",
            allowed="a range for at least one coordinate, such as x: (-0.2, 0.2)",
        )
    for name, pair in ranges.items():
        values = np.array(pair, dtype=float)
        is_pair = values.shape == (2,) and np.isfinite(values).all()
        if not (is_pair and values[0] <= 0.0 <= values[1] and np.ptp(values)):
            raise InputError(
                "this is not a range",
                where=f"ranges.{name}",
                found=pair,
                allowed="two numbers with 0, the present place, between them or at an end, such as (-0.2, 0.2)",
            )
        if not name.endswith("_deg"):
            wide = "the range looks like mm"
            size = float(np.abs(values).max())
            issues = issue_above(f"ranges.{name}", wide, size, 10.0, "m")
            report_issues(tuple(issues), strict=None)
