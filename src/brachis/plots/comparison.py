"""End times of many plans side by side."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING

from brachis.errors import InputError
from brachis.plots import style

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

_BARS_PER_PANEL = 48
_GROUP_WIDTH = 0.84
_HEADROOM = 1.27


Case = float | str
"""What is planned: a number that is varied, or a name."""

_ROW = 3
"""Case, choice, end time."""


def plot_comparison(rows: Sequence[tuple[Case, str, float]], xlabel: str = "", unit: str = "") -> Figure:
    """Plot the end times of cases, one bar for each choice.

    Parameters
    ----------
    rows : sequence of (case, choice, t_end)
        What is planned (a direction, a payload, the name of a path, ...), what is chosen for it (redundant joints, a
        branch, a robot, ...) and the end time in s; NaN marks a plan that was not found. Choices keep the order in
        which they first appear; cases too, unless all of them are numbers, which are sorted.
    xlabel : str, optional
        What the cases are.
    unit : str, optional
        Written behind every case, with a space before it if there is to be one.

    Returns
    -------
    Figure
        Two columns wide, with more panels below where there are many cases. The shortest time of every case is printed
        in bold type.

    Raises
    ------
    InputError
        There are no rows, a case is not finite, a time is not positive, or a pair of case and choice comes twice.

    Examples
    --------
    >>> from brachis.plots import plot_comparison
    >>> rows = [("seam", "rail", 2.1), ("seam", "joint_1", 2.4), ("hem", "rail", 2.3), ("hem", "joint_1", 2.5)]
    >>> figure = plot_comparison(rows, "path")
    """
    cells = _cells(rows)
    cases: list[Case] = list(dict.fromkeys(case for case, _ in cells))
    if not any(isinstance(case, str) for case in cases):
        cases.sort(key=float)
    choices = list(dict.fromkeys(choice for _, choice in cells))
    panels = math.ceil(len(cases) / max(1, _BARS_PER_PANEL // len(choices)))
    per_panel = math.ceil(len(cases) / panels)
    figure = style.new_figure(style.PAGE_WIDTH, 12.0 + 58.0 * panels)
    height = _HEADROOM * max((t_end for t_end in cells.values() if t_end > 0.0), default=1.0)
    for panel in range(panels):
        ax = figure.add_subplot(panels, 1, panel + 1)
        _draw(ax, cases[panel * per_panel : (panel + 1) * per_panel], choices, cells, unit)
        ax.set_xlim(-0.5, per_panel - 0.5)
        ax.set_ylim(0.0, height)
        ax.set_xlabel(xlabel if panel == panels - 1 else "")
        if panel == 0:
            style.legend_above(ax, style.PAGE_WIDTH - 20.0)
    return figure


def _cells(rows: Sequence[tuple[Case, str, float]]) -> dict[tuple[Case, str], float]:
    """Check the rows and key them by case and choice."""
    if not isinstance(rows, Sequence):
        raise InputError(
            "wrong type", where="rows", found=repr(rows), allowed="a list of (case, choice, end time in s)"
        )
    if not rows:
        raise InputError("there is nothing to compare", where="rows", found="no rows", allowed="at least one")
    cells: dict[tuple[Case, str], float] = {}
    for number, row in enumerate(rows):
        where = f"rows[{number}]"
        if not isinstance(row, Sequence) or len(row) != _ROW or isinstance(row, str):
            raise InputError("wrong type", where=where, found=repr(row), allowed="(case, choice, end time in s)")
        case, choice, t_end = row
        if not isinstance(case, str) and not math.isfinite(case):
            raise InputError("is not a case", where=where, found=f"{case}", allowed="a finite number, or a name")
        if not (math.isnan(t_end) or 0.0 < t_end < math.inf):
            raise InputError("is not an end time", where=where, found=f"{t_end} s", allowed="> 0 s, or NaN for no plan")
        if (case, choice) in cells:
            raise InputError("comes twice", where=where, found=f"{_name(case)} with {choice!r}")
        cells[case, choice] = t_end
    return cells


def _name(case: Case) -> str:
    return case if isinstance(case, str) else f"{case:g}"


def _draw(
    ax: Axes, cases: Sequence[Case], choices: Sequence[str], cells: Mapping[tuple[Case, str], float], unit: str
) -> None:
    """Draw one panel of grouped bars with their values; pairs without a row leave a gap."""
    width = _GROUP_WIDTH / len(choices)
    found = {pair: t_end for pair, t_end in cells.items() if not math.isnan(t_end)}
    for column, choice in enumerate(choices):
        shift = (column - 0.5 * (len(choices) - 1)) * width
        places = [place + shift for place, case in enumerate(cases) if (case, choice) in found]
        times = [found[case, choice] for case in cases if (case, choice) in found]
        ax.bar(places, times, 0.9 * width, label=style.plain(choice), **style.bar_style(column))
        for place, case in enumerate(cases):
            if (case, choice) in cells:
                best = min((found[case, other] for other in choices if (case, other) in found), default=math.nan)
                _write(ax, place + shift, cells[case, choice], bold=cells[case, choice] == best)
    style.dress(ax, "", r"$t_\mathrm{E}$ (s)")
    ax.set_xticks(range(len(cases)), [style.plain(f"{_name(case)}{unit}") for case in cases])
    ax.tick_params(axis="x", length=0.0)


def _write(ax: Axes, place: float, value: float, *, bold: bool) -> None:
    """Write a value above its bar."""
    ax.annotate(
        "no plan" if math.isnan(value) else f"{value:.3f}",
        (place, 0.0 if math.isnan(value) else value),
        xytext=(0.0, 2.0),
        textcoords="offset points",
        rotation=90.0,
        fontsize=style.TICK_SIZE - 0.5,
        fontweight="bold" if bold else "normal",
        horizontalalignment="center",
        verticalalignment="bottom",
    )
