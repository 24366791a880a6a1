"""The panels of a motion in plots, report and viewer: quantities over time, with their units and limits.

A new panel needs one row in `PANELS`, and a function if its values are not among the samples.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import numpy as np

from brachis.apps.bottleneck.saturation import LimitRatios
from brachis.limits.tool import build_tool_speed
from brachis.robot.joints import UNITS, shown_unit
from brachis.scene import scene_of
from brachis.scene.chain import Chain
from brachis.trajectory import Samples, Trajectory

MOST_CURVES = 10
"""Maximum number of curves in a panel of ratios."""
BLACK = 48
"""Style number of curves that belong to the whole arm: a solid black line in all figures."""

CurveBound = np.ndarray | float
"""A limit over time, (K,), or a constant limit."""


@dataclass(frozen=True, eq=False)
class PanelCurve:
    """One curve of a panel.

    Attributes
    ----------
    name : str
        Name of the curve's subject: a joint, ``tool``, ...
    style : int
        Number of the colour and dashes: the index of the joint, or `BLACK`.
    values : (K,) ndarray
    lower, upper : float or (K,) ndarray
        Limits of the values; infinite if there is none.
    is_range : bool
        Whether the limits are the ends of a range. The ratio is then 0 in the middle of the range; otherwise it is 0
        at zero.
    """

    name: str
    style: int
    values: np.ndarray
    lower: CurveBound = -np.inf
    upper: CurveBound = np.inf
    is_range: bool = False

    @property
    def is_limited(self) -> bool:
        """Whether the curve has limits in both directions at all times."""
        return bool(np.all(np.isfinite(self.upper - self.lower)))

    @property
    def ratios(self) -> np.ndarray:
        """Ratios of the values to the limit in their direction, measured from the centre, (K,).

        The curve must have both limits.
        """
        centre = 0.5 * self.lower + 0.5 * self.upper if self.is_range else 0.0
        away = self.values - centre
        return away / np.where(away > 0.0, self.upper - centre, centre - self.lower)


@dataclass(frozen=True, eq=False)
class Panel:
    """Curves over one time axis, with their limits.

    Attributes
    ----------
    title : str
        Title in words: ``position``, ``torque``, ``torque / limit``, ...
    symbol : str
        The title in Matplotlib's mathematical notation.
    unit : str
        Unit of the values; empty if they are dimensionless.
    t : (K,) ndarray
        Times, s.
    curves : tuple of PanelCurve
        The curves, with joints in chain order.
    ratio_title : str
        Title for the ratios of the values to their limits.
    is_ratio : bool
        Whether the values are already such ratios.
    ends : (float or None, float or None)
        Ends of the vertical axis; None for an end that follows from the values.
    """

    title: str
    symbol: str
    unit: str
    t: np.ndarray
    curves: tuple[PanelCurve, ...]
    ratio_title: str = ""
    is_ratio: bool = False
    ends: tuple[float | None, float | None] = (None, None)

    @property
    def heading(self) -> str:
        """The title of the panel with its unit."""
        return f"{self.title} ({self.unit})" if self.unit else self.title

    @property
    def label(self) -> str:
        """The symbol of the panel with its unit."""
        return f"{self.symbol} ({self.unit})" if self.unit else self.symbol

    @property
    def values(self) -> np.ndarray:
        """The values of all curves, (K, c)."""
        return np.column_stack([curve.values for curve in self.curves])

    def near_limits(self) -> list[tuple[np.ndarray, list[PanelCurve]]]:
        """List the limits to draw: all for ratios, otherwise those no further from the motion than 30 % of its range.

        Returns
        -------
        list of ((K,) ndarray, list of PanelCurve)
            The limit over time, which is NaN where it is far from the motion, and the curves that share this limit.
        """
        reach = 0.3 * max(np.ptp(self.values), 1e-9)
        drawn: dict[bytes, tuple[np.ndarray, list[PanelCurve]]] = {}
        for curve in self.curves:
            lowest = curve.values.min() - reach
            highest = curve.values.max() + reach
            for limit in (curve.lower, curve.upper):
                is_near = (limit >= lowest) & (limit <= highest)
                is_drawn = np.isfinite(limit) & (is_near | self.is_ratio)
                if np.any(is_drawn):
                    line = np.where(is_drawn, limit, np.nan) + np.zeros_like(self.t)
                    drawn.setdefault(line.tobytes(), (line, []))[1].append(curve)
        return list(drawn.values())

    def view(self) -> tuple[float, float]:
        """Return the ends of the axis: `ends`, or else the ends of the values and of the limits close to them."""
        limits = [line for line, _ in self.near_limits()]
        shown = np.column_stack([self.values, *limits])
        low = float(np.nanmin(shown))
        high = float(np.nanmax(shown))
        margin = 0.05 * (high - low) if high - low > 1e-9 else 1.0
        first, last = self.ends
        return (
            low - margin if first is None else first,
            high + margin if last is None else last,
        )


@dataclass(frozen=True)
class PanelRow:
    """A row of the table of panels.

    Attributes
    ----------
    values : callable
        Function of trajectory and samples that returns the values: (K, n) for joints, otherwise (K,).
    symbol : str
        Symbol in Matplotlib's mathematical notation.
    prismatic : tuple of str
        Title and symbol for prismatic joints, if these differ.
    is_range : bool
        Whether the limits are the ends of a range; see `PanelCurve`.
    needs_masses : bool
        Whether the values need the masses of the URDF.
    only_if_limited : bool
        Whether the row is shown only if the robot limits this quantity.
    unit : str or None
        Unit of the values; None for joints, whose units differ.
    bounds : callable or None
        Function of trajectory and samples that returns the smallest and the largest value that the task allows, each a
        number or (K,).
    name : str
        Name of the curve, if the row has only one curve.
    ends : (float or None, float or None)
        Ends of the vertical axis; see `Panel`.
    """

    values: Callable[[Trajectory, Samples], np.ndarray]
    symbol: str
    prismatic: tuple[str, str] | None = None
    is_range: bool = False
    needs_masses: bool = False
    only_if_limited: bool = False
    unit: str | None = None
    bounds: Callable[[Trajectory, Samples], tuple[CurveBound, CurveBound]] | None = None
    name: str = "tool"
    ends: tuple[float | None, float | None] = (None, None)


def _bound_tool_speed(
    trajectory: Trajectory, samples: Samples
) -> tuple[CurveBound, CurveBound]:
    """Return minus infinity, and the maximum tool speed that the task allows, (K,), m/s."""
    largest = np.full(len(samples.t), np.inf)
    for component, rows, t in trajectory.split_times(samples.t):
        limit = build_tool_speed(component.robot, component.task)
        if limit is not None:
            s = component.path_coordinate(t)
            largest[rows] = limit.largest_at(s)[0].min(axis=1)
    return -np.inf, largest


def _smallest_distances(trajectory: Trajectory, samples: Samples) -> np.ndarray:
    """Return the distances of the closest pairs of bodies, (K,), m."""
    distances = np.full(len(samples.t), np.nan)
    chain = Chain.of(trajectory.robot.model)
    for component, rows, _ in trajectory.split_times(samples.t):
        scene = scene_of(component.robot, component.task)
        if scene is not None and len(scene.pairs) and len(rows):
            placed = chain.place(samples.q[rows])
            distances[rows] = scene.find_closest(placed).distance
    # Without pairs, nothing is close.
    return np.where(np.isnan(distances), np.nanmax(distances), distances)


PANELS = {
    "position": PanelRow(lambda _, samples: samples.q, "$q$", is_range=True),
    "velocity": PanelRow(lambda _, samples: samples.qdot, r"$\dot{q}$"),
    "acceleration": PanelRow(lambda _, samples: samples.qddot, r"$\ddot{q}$"),
    "jerk": PanelRow(
        lambda trajectory, samples: trajectory.jerk(samples.t),
        r"$\dddot{q}$",
        only_if_limited=True,
    ),
    "torque": PanelRow(
        lambda trajectory, samples: trajectory.torque(samples.t),
        r"$\tau$",
        prismatic=("force", "$F$"),
        needs_masses=True,
    ),
    "path coordinate": PanelRow(
        lambda _, samples: samples.s, "$s$", unit="", ends=(-0.04, 1.04)
    ),
    "tool speed": PanelRow(
        lambda _, samples: samples.tool_speed,
        "tool speed",
        unit="m/s",
        bounds=_bound_tool_speed,
        ends=(0.0, None),
    ),
    "clearance": PanelRow(
        _smallest_distances,
        "clearance",
        unit="m",
        bounds=lambda trajectory, _: (trajectory.task.collisions.clearance, np.inf),
        name="closest pair",
    ),
}
"""All panels by title. Rows without a unit belong to joints; their keys are the names of the robot's limits."""


def joint_rows_of(trajectory: Trajectory) -> tuple[str, ...]:
    """Return the titles of the joint rows that are shown for a motion."""
    return tuple(
        name
        for name, row in PANELS.items()
        if row.unit is None
        and (trajectory.robot.has_masses or not row.needs_masses)
        and (
            not row.only_if_limited
            or np.isfinite(trajectory.robot.limits.both_ways(name)).any()
        )
    )


def tool_rows_of(trajectory: Trajectory) -> tuple[str, ...]:
    """Return the titles of the tool rows, including the clearance if the task checks collisions."""
    tasks = [
        (part.robot, part.task) for part, _, _ in trajectory.split_times(np.zeros(1))
    ]
    scenes = [scene_of(*pair) for pair in tasks]
    has_pairs = any(scene is not None and len(scene.pairs) for scene in scenes)
    return ("tool speed", "clearance") if has_pairs else ("tool speed",)


def panels_of(
    trajectory: Trajectory, samples: Samples, *names: str, degrees: bool = False
) -> list[Panel]:
    """Make panels of a motion. Joints in rad and joints in m have separate panels.

    Parameters
    ----------
    trajectory : Trajectory
    samples : Samples
        Samples of the trajectory.
    *names : str
        Titles of the panels, from `PANELS`.
    degrees : bool, optional
        Whether to show angles in degrees.

    Returns
    -------
    list of Panel
        One or two panels for each row, with revolute joints first. Torques have no panel if there are no masses.
    """
    panels = []
    for name in names:
        row = PANELS[name]
        if row.needs_masses and not trajectory.robot.has_masses:
            continue
        if row.unit is None:
            panels += _joint_panels(trajectory, samples, name, degrees=degrees)
            continue
        values = row.values(trajectory, samples)
        bounds = row.bounds(trajectory, samples) if row.bounds else ()
        curve = PanelCurve(row.name, BLACK, values, *bounds)
        panels.append(
            Panel(name, row.symbol, row.unit, samples.t, (curve,), ends=row.ends)
        )
    return panels


def _joint_panels(
    trajectory: Trajectory, samples: Samples, name: str, *, degrees: bool
) -> list[Panel]:
    """Make the panels of a joint row, one for each unit."""
    row = PANELS[name]
    robot = trajectory.robot
    lower, upper = _joint_bounds(trajectory, samples.t, name)
    columns = row.values(trajectory, samples).T
    names = trajectory.joint_names
    panels = []
    for base, is_shown in (("rad", robot.revolute), ("m", ~robot.revolute)):
        unit, factor = shown_unit(UNITS[name][base], degrees=degrees)
        curves = []
        for joint in np.flatnonzero(is_shown).tolist():
            values, low, high = (
                factor * figures[joint] for figures in (columns, lower, upper)
            )
            curve = PanelCurve(names[joint], joint, values, low, high, row.is_range)
            curves.append(curve)
        if curves:
            for_prismatic = row.prismatic if base == "m" else None
            title, symbol = for_prismatic or (name, row.symbol)
            unit = unit.replace("^2", "²").replace("^3", "³")
            ratio = f"{title} in its range" if row.is_range else f"{title} / limit"
            panels.append(Panel(title, symbol, unit, samples.t, tuple(curves), ratio))
    return panels


def _joint_bounds(trajectory: Trajectory, t: np.ndarray, name: str) -> np.ndarray:
    """Return the limits of the joints, (2, n), or (2, n, K) at times t, (K,), if parts of a program have others."""
    pieces = list(trajectory.split_times(t))
    n = trajectory.robot.n
    limits = [piece[0].robot.limits.both_ways(name)[:, :n] for piece in pieces]
    if all(np.array_equal(limits[0], other) for other in limits):
        return limits[0]
    bounds = np.empty((2, n, len(t)))
    for ends, (_, rows, _) in zip(limits, pieces, strict=True):
        bounds[:, :, rows] = ends[:, :, None]
    return bounds


def curves_of(panels: Sequence[Panel], name: str) -> list[tuple[Panel, PanelCurve]]:
    """List the curves of one joint, each with its panel."""
    return [
        (panel, curve)
        for panel in panels
        for curve in panel.curves
        if curve.name == name
    ]


def ratio_panel(
    trajectory: Trajectory, ratios: LimitRatios, *titles: str, symbol: str = ""
) -> Panel:
    """Make a panel of the ratios to some kinds of limits. A subject has the same style in all such panels.

    If there are many subjects, such as pairs of bodies, only the subjects that come closest to their limits are shown.

    Parameters
    ----------
    trajectory : Trajectory
    ratios : LimitRatios
    *titles : str
        Kinds of limits, by the axis titles of their labels.
    symbol : str, optional
        Title in Matplotlib's mathematical notation, to be used in place of words.
    """
    places = [(label.axis, label.subject) for label in ratios.labels]
    subjects = [
        label.subject.rstrip(",") if places.count(place) == 1 else str(label)
        for label, place in zip(ratios.labels, places, strict=True)
    ]
    order = list(dict.fromkeys((*trajectory.joint_names, *subjects)))
    peaks = np.nanmax(np.abs(ratios.values), axis=0)
    chosen = [k for k, label in enumerate(ratios.labels) if label.axis in titles]
    nearest = sorted(chosen, key=lambda k: -peaks[k])[:MOST_CURVES]
    shown = sorted((order.index(subjects[k]), k) for k in nearest)
    is_signed = np.nanmin(ratios.values[:, nearest]) < 0.0
    lower = -1.0 if is_signed else -np.inf
    curves = [
        PanelCurve(subjects[k], number, ratios.values[:, k], lower, 1.0)
        for number, k in shown
    ]
    title = ", ".join(titles)
    top = 1.15 * max(1.0, *peaks[nearest].tolist())
    return Panel(
        title,
        symbol or title,
        "",
        ratios.t,
        tuple(curves),
        is_ratio=True,
        ends=(-top if is_signed else -0.05 * top, top),
    )


def at_distinct_times(ratios: LimitRatios) -> LimitRatios:
    """Return the ratios without the values just before jumps, so that no time occurs twice."""
    is_last = np.append(np.diff(ratios.t) > 0.0, True)
    return replace(ratios, t=ratios.t[is_last], values=ratios.values[is_last])


def torque_panels(
    trajectory: Trajectory, samples: Samples, ratios: LimitRatios
) -> list[Panel]:
    """Make one panel of the ratios of torques and forces to their limits.

    If no joint has a limit, the panels show the torques and forces themselves. Without masses the list is empty.
    """
    panels = panels_of(trajectory, samples, "torque")
    titles = titles_of(ratios)
    limited = [panel for panel in panels if panel.ratio_title in titles]
    if not limited:
        return panels
    symbols = [panel.symbol.strip("$") for panel in limited]
    symbol = ", ".join(rf"${tau} / {tau}_\mathrm{{max}}$" for tau in symbols)
    shown = [panel.ratio_title for panel in limited]
    return [ratio_panel(trajectory, ratios, *shown, symbol=symbol)]


def titles_of(ratios: LimitRatios) -> list[str]:
    """List the axis titles of all kinds of limits."""
    return list(dict.fromkeys(label.axis for label in ratios.labels))
