"""Figures of sweeps."""

import math

import numpy as np
import pytest

from brachis.apps.sweeps.figure import plot_sweep
from brachis.errors import InputError, UnknownNameError


def row(t_end, **keys):
    return {**keys, "status": "verified" if t_end else "failed", "t_end_s": t_end}


def test_a_line_over_one_key():
    figure = plot_sweep(
        [row(2.0, a=3), row(1.0, a=1), row(None, a=2), row(1.5, a=1)], ["a"]
    )
    (ax,) = figure.axes
    (line,) = ax.lines
    assert line.get_xdata().tolist() == [1.0, 2.0, 3.0]
    assert line.get_ydata()[[0, 2]].tolist() == [1.0, 2.0]
    assert math.isnan(line.get_ydata()[1])
    assert ax.collections[0].get_offsets().tolist() == [[2.0, 2.0]]


def test_a_heat_map_over_two_keys():
    rows = [
        row(1.0 + a + b if a + b < 3 and b < 2 else None, a=a, b=word)
        for a in (0, 1, 2)
        for b, word in enumerate("xyz")
    ]
    figure = plot_sweep(rows, ["a", "b"])
    ax, _ = figure.axes
    shown = np.ma.filled(ax.images[0].get_array(), np.nan)
    assert shown[:2, :2].tolist() == [[1.0, 2.0], [2.0, 3.0]]
    assert shown.shape == (3, 3), "a row without any verified plan is there, too"
    assert [tick.get_text() for tick in ax.get_yticklabels()] == ["x", "y", "z"]
    crosses = {tuple(place) for place in ax.collections[0].get_offsets().tolist()}
    assert crosses == {(2.0, 1.0), (0.0, 2.0), (1.0, 2.0), (2.0, 2.0)}


def test_draws_of_two_keys_are_points_and_crosses_without_a_verified_plan():
    rows = [row(1.0 if i else None, a=i * 0.1, b=float(i**2)) for i in range(9)]
    ax = plot_sweep(rows, ["a", "b"]).axes[0]
    points, crosses = (marks.get_offsets() for marks in ax.collections)
    assert not ax.images
    verified = [[plan["a"], plan["b"]] for plan in rows[1:]]
    assert points.compressed().reshape(-1, 2).tolist() == verified
    assert crosses.tolist() == [[0.0, 0.0]]


@pytest.mark.parametrize("rows", [[], [row(None, a=1)]])
def test_nothing_to_draw(rows):
    with pytest.raises(InputError, match="no plan is verified"):
        plot_sweep(rows, ["a"])


def test_a_figure_has_the_first_keys_or_those_of_the_caller(undisturbed):
    angle, length, degree = undisturbed.varied
    ax = undisturbed.plot().axes[0]
    assert (ax.get_xlabel(), ax.get_ylabel()) == (f"{angle} (deg)", f"{length} (m)")
    assert undisturbed.plot([degree]).axes[0].get_xlabel() == "spline.degree"
    with pytest.raises(UnknownNameError, match=r"path\.0\.line\.length"):
        undisturbed.plot(["line.length"])
    with pytest.raises(InputError, match="1 or 2 keys"):
        undisturbed.plot(undisturbed.varied)
