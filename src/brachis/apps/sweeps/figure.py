"""The figure of a sweep: end times over one or two keys."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

from brachis.apps.plots import style
from brachis.apps.sweeps.plans import VERIFIED
from brachis.errors import InputError
from brachis.task.units import unit_of

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

_HEIGHT = 62.0
"""Height of the figure per key, mm."""
_MOST_TICKS = 12
"""Maximum number of names along an axis, and of cells along an axis of a heat map that shows times as text."""
_COLOURS = "viridis"
_END_TIME = r"$t_\mathrm{E}$ (s)"


def plot_sweep(rows: Sequence[Mapping[str, Any]], keys: Sequence[str]) -> Figure:
    """Draw the end times of verified plans over one key, as a line, or over two keys, as a heat map.

    Parameters
    ----------
    rows : sequence of mapping
        Rows with the keys, ``status`` and ``t_end_s`` (s). Among plans with the same values of the keys, the fastest is
        shown.
    keys : sequence of str
        One or two keys. If the rows contain less than half of the combinations of two keys, as for random draws, points
        are shown instead of a heat map.

    Returns
    -------
    Figure
        Figure in which crosses mark values for which no plan is verified.

    Raises
    ------
    InputError
        The number of keys is not 1 or 2, or no plan is verified.
    """
    if len(keys) not in (1, 2):
        raise InputError(
            "a figure can show only one or two keys",
            where="keys",
            found=len(keys),
            allowed="1 or 2 keys that vary",
        )
    cells = _find_fastest(rows, keys)
    times = np.array([*cells.values()])
    is_missing = np.isnan(times)
    if is_missing.all():
        raise InputError(
            "no plan is verified, so the figure would be empty",
            where="plans",
            allowed="at least one verified plan",
        )
    columns = list(zip(*cells, strict=True))
    is_line = len(keys) == 1
    is_heat_map = not is_line and 2 * len(cells) >= math.prod(
        len(set(column)) for column in columns
    )
    places, names = zip(
        *(_locate(column, side_by_side=is_heat_map) for column in columns), strict=True
    )
    width = style.COLUMN_WIDTH if is_line else style.PAGE_WIDTH
    figure = style.new_figure(width, _HEIGHT * len(keys))
    ax = figure.add_subplot()
    x = places[0]
    if is_line:
        y = np.full(len(x), np.nanmax(times))
        order = np.argsort(x)
        look = style.joint_style(0)
        if names[0]:
            look["linestyle"] = "none"
        ax.plot(x[order], times[order], marker="o", markersize=3.0, **look)
        style.dress(ax, _title(keys[0]), _END_TIME)
    else:
        y = places[1]
        if is_heat_map:
            image = _draw_heat_map(ax, x, y, times)
        else:
            image = ax.scatter(
                x, y, c=times, cmap=_COLOURS, s=14.0, plotnonfinite=False
            )
        style.dress(figure.colorbar(image, ax=ax).ax, "", _END_TIME)
        style.dress(ax, _title(keys[0]), _title(keys[1]))
    if is_missing.any():
        ax.scatter(
            x[is_missing],
            y[is_missing],
            marker="x",
            color=style.COLOURS[1],
            s=18.0,
            linewidths=0.8,
            label="no verified plan",
            zorder=3.0,
        )
        style.legend_above(ax, style.COLUMN_WIDTH)
    for axis, named in zip((ax.xaxis, ax.yaxis), names, strict=False):
        if named:
            ticks = range(0, len(named), math.ceil(len(named) / _MOST_TICKS))
            axis.set_ticks(ticks, [_write_value(named[tick]) for tick in ticks])
    return figure


def _find_fastest(
    rows: Sequence[Mapping[str, Any]], keys: Sequence[str]
) -> dict[tuple[Any, ...], float]:
    """Find the shortest end time, s, for each combination of the keys' values; NaN if no plan is verified."""
    cells: dict[tuple[Any, ...], float] = {}
    for row in rows:
        cell = tuple(row[key] for key in keys)
        t_end = row["t_end_s"] if row["status"] == VERIFIED else math.nan
        cells[cell] = np.fmin(t_end, cells.get(cell, math.nan))
    return cells


def _locate(
    column: Sequence[Any], *, side_by_side: bool
) -> tuple[np.ndarray, list[Any]]:
    """Return the positions of values on an axis, and the labels to write there instead of numbers.

    Numbers are placed at their own value. Other values, and all values of a heat map, are placed side by side.
    """
    distinct = list(dict.fromkeys(column))
    if all(type(value) in {int, float} for value in distinct):
        if not side_by_side:
            return np.array(column, float), []
        distinct.sort()
    place = {value: i for i, value in enumerate(distinct)}
    return np.array([place[value] for value in column], float), distinct


def _draw_heat_map(ax: Axes, x: np.ndarray, y: np.ndarray, times: np.ndarray) -> Any:
    """Draw cells at whole numbers x and y; cells with NaN are empty. Small maps show the times as text."""
    grid = np.full((int(y.max()) + 1, int(x.max()) + 1), np.nan)
    grid[y.astype(int), x.astype(int)] = times
    image = ax.imshow(grid, cmap=_COLOURS, aspect="auto", origin="lower")
    if max(grid.shape) > _MOST_TICKS:
        return image
    middle = 0.5 * (np.nanmin(times) + np.nanmax(times))
    for column, row, time in zip(x, y, times, strict=True):
        if math.isfinite(time):
            ax.text(
                column,
                row,
                f"{time:.4f}",
                color="white" if time < middle else "black",
                ha="center",
                va="center",
                fontsize=style.TICK_SIZE,
            )
    return image


def _title(key: str) -> str:
    """Return the name of a key with its unit."""
    unit = unit_of(key)
    return style.plain(f"{key} ({unit})" if unit else key)


def _write_value(value: Any) -> str:
    if value is None:
        return "not set"
    is_number = type(value) in {int, float}
    return f"{value:.4g}" if is_number else style.plain(str(value))
