"""End times over one key, or two."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

from brachis.apps.plots import style
from brachis.apps.sweeps.pools import VERIFIED
from brachis.errors import InputError
from brachis.task.schema import unit_of

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

_HEIGHT = 62.0
_CELL_MM = 8.0
_HIGHEST = 180.0
_MOST_TICKS = 12
_MOST_WRITTEN = 12
_FILLED = 0.5
"""Part of all combinations of two keys that have to be there for a heat map; draws at random are points."""
_ALIKE, _MOST_DECIMALS = 1e-5, 5
"""Of the longest time: plans that differ by less are as good as the same."""
_COLOURS = "viridis"
_LABEL = r"$t_\mathrm{E}$ (s)"
_Cells = Mapping[tuple[Any, ...], float]


def plot_sweep(rows: Sequence[Mapping[str, Any]], keys: Sequence[str]) -> Figure:
    """Draw the end times of verified plans over one key, a line, or two, a heat map.

    Parameters
    ----------
    rows : sequence of mapping
        With the keys, ``status`` and ``t_end_s`` (s). Of plans that agree in the keys the fastest is shown.
    keys : sequence of str
        One or two. Where few of the combinations of two are there, as with random draws, points take the place of the
        heat map.

    Returns
    -------
    Figure
        Crosses mark where no plan is verified.

    Raises
    ------
    InputError
        There is no key or more than two, or no plan is verified.
    """
    if len(keys) not in (1, 2):
        raise InputError(
            "a figure has one axis or two",
            where="keys",
            found=len(keys),
            allowed="1 or 2 keys that vary",
        )
    cells: dict[tuple[Any, ...], float] = {}
    for row in rows:
        place = tuple(row[key] for key in keys)
        t_end = row["t_end_s"] if row["status"] == VERIFIED else math.inf
        cells[place] = min(t_end, cells.get(place, math.inf))
    if not any(map(math.isfinite, cells.values())):
        raise InputError(
            "there is nothing to draw", where="plans", found="none that is verified"
        )
    axes = [_values([place[axis] for place in cells]) for axis in range(len(keys))]
    if len(keys) == 1:
        return _line(cells, axes[0], keys[0])
    if len(cells) >= _FILLED * len(axes[0]) * len(axes[1]):
        return _heat_map(cells, axes, keys)
    return _points(cells, axes, keys)


def _values(found: Sequence[Any]) -> list[Any]:
    """List the values of a key: numbers sorted, others as they come."""
    values = list(dict.fromkeys(found))
    return sorted(values) if _are_numbers(values) else values


def _are_numbers(values: Sequence[Any]) -> bool:
    return all(
        isinstance(value, int | float) and not isinstance(value, bool)
        for value in values
    )


def _line(cells: _Cells, values: list[Any], key: str) -> Figure:
    figure = style.new_figure(style.COLUMN_WIDTH, _HEIGHT)
    ax = figure.add_subplot()
    times = np.array([cells[(value,)] for value in values])
    found = np.isfinite(times)
    places = _places(values)
    line = "-" if _are_numbers(values) else "none"
    ax.plot(
        places,
        np.where(found, times, np.nan),
        marker="o",
        markersize=3.0,
        **{**style.joint_style(0), "linestyle": line},
    )
    _cross(ax, places[~found], np.full((~found).sum(), times[found].max()))
    style.dress(ax, _title(key), _LABEL)
    _name(ax, "x", values)
    return figure


def _heat_map(cells: _Cells, axes: Sequence[list[Any]], keys: Sequence[str]) -> Figure:
    columns, rows = axes
    times = np.array(
        [[cells.get((column, row), math.nan) for column in columns] for row in rows]
    )
    figure = style.new_figure(
        style.PAGE_WIDTH, min(_HIGHEST, max(_HEIGHT, 24.0 + _CELL_MM * len(rows)))
    )
    ax = figure.add_subplot()
    shown = np.where(np.isfinite(times), times, np.nan)
    image = ax.imshow(shown, cmap=_COLOURS, aspect="auto", origin="lower")
    failed = np.argwhere(np.isinf(times))
    _cross(ax, failed[:, 1], failed[:, 0])
    if max(times.shape) <= _MOST_WRITTEN:
        middle, decimals = 0.5 * (np.nanmin(shown) + np.nanmax(shown)), _decimals(shown)
        for (row, column), time in np.ndenumerate(shown):
            if math.isfinite(time):
                colour = "white" if time < middle else "black"
                ax.text(
                    column,
                    row,
                    f"{time:.{decimals}f}",
                    color=colour,
                    ha="center",
                    va="center",
                    fontsize=style.TICK_SIZE,
                )
    _finish(figure, ax, image, keys)
    _name(ax, "x", columns, always=True)
    _name(ax, "y", rows, always=True)
    return figure


def _points(cells: _Cells, axes: Sequence[list[Any]], keys: Sequence[str]) -> Figure:
    figure = style.new_figure(style.PAGE_WIDTH, 1.4 * _HEIGHT)
    ax = figure.add_subplot()
    where = [dict(zip(values, _places(values), strict=True)) for values in axes]
    at = np.array([[where[0][first], where[1][second]] for first, second in cells])
    times = np.array(list(cells.values()))
    found = np.isfinite(times)
    image = ax.scatter(
        at[found, 0], at[found, 1], c=times[found], cmap=_COLOURS, s=14.0
    )
    _cross(ax, at[~found, 0], at[~found, 1])
    _finish(figure, ax, image, keys)
    _name(ax, "x", axes[0])
    _name(ax, "y", axes[1])
    return figure


def _finish(figure: Figure, ax: Axes, image: Any, keys: Sequence[str]) -> None:
    style.dress(ax, _title(keys[0]), _title(keys[1]))
    bar = figure.colorbar(image, ax=ax)
    style.dress(bar.ax, "", _LABEL)


def _title(key: str) -> str:
    """Name a key with its unit."""
    unit = unit_of(key)
    return style.plain(f"{key} ({unit})" if unit else key)


def _decimals(times: np.ndarray) -> int:
    """Return how many decimals tell the times, s, apart that differ by more than `_ALIKE`, two at least."""
    apart = np.diff(np.unique(times[np.isfinite(times)]))
    apart = apart[apart > _ALIKE * np.nanmax(times)]
    return (
        int(np.clip(np.ceil(-np.log10(apart.min()) - 1e-6), 2, _MOST_DECIMALS))
        if len(apart)
        else 2
    )


def _places(values: Sequence[Any]) -> np.ndarray:
    """Where values lie on an axis: at themselves where they are numbers, otherwise one beside the other."""
    return np.array(values if _are_numbers(values) else range(len(values)), float)


def _name(ax: Axes, axis: str, values: Sequence[Any], *, always: bool = False) -> None:
    """Write names beside the places of values that are not numbers, or of all."""
    if always or not _are_numbers(values):
        step = math.ceil(len(values) / _MOST_TICKS)
        shown = range(0, len(values), step)
        ax.set(
            **{
                f"{axis}ticks": list(shown),
                f"{axis}ticklabels": [_write_value(values[place]) for place in shown],
            }
        )


def _write_value(value: Any) -> str:
    if value is None:
        return "not set"
    return f"{value:.4g}" if _are_numbers([value]) else style.plain(str(value))


def _cross(ax: Axes, x: np.ndarray, y: np.ndarray) -> None:
    """Mark plans that are not verified."""
    if len(x):
        ax.scatter(
            x,
            y,
            marker="x",
            color=style.COLOURS[1],
            s=18.0,
            linewidths=0.8,
            label="no verified plan",
            zorder=3.0,
        )
        style.legend_above(ax, style.COLUMN_WIDTH)
