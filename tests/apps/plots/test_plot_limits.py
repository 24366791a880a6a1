"""Ratios to all limits, a panel for each kind."""

import dataclasses

import numpy as np
import pytest

from brachis.apps.bottleneck import limit_ratios
from brachis.apps.plots import plot_limits
from brachis.task import ToolLimits


def lines(ax):
    """Curves by their labels."""
    return {
        line.get_label(): line
        for line in ax.get_lines()
        if not line.get_label().startswith("_")
    }


def test_a_panel_for_every_kind_and_a_line_for_every_value(line_trajectory):
    capped = line_trajectory.task.model_copy(
        update={"tool_limits": ToolLimits(speed=2.0)}
    )
    trajectory = dataclasses.replace(line_trajectory, task=capped)
    ratios = limit_ratios(trajectory)
    panels = plot_limits(trajectory).axes
    drawn = {
        (line, ax.get_ylabel()): lines(ax)[line] for ax in panels for line in lines(ax)
    }
    assert set(drawn) == {(label.subject, label.axis) for label in ratios.labels}
    assert {("tool", "tool speed / limit"), ("j1", "torque / limit")} < set(drawn)
    for label, column in zip(ratios.labels, ratios.values.T, strict=True):
        np.testing.assert_allclose(
            drawn[label.subject, label.axis].get_ydata(), column, atol=1e-9
        )


def test_positions_are_drawn_by_their_place_in_the_range(line_trajectory, with_limits):
    q = line_trajectory.q
    middle, half = q[0], 1.25 * np.abs(q - q[0]).max(axis=0)
    ranged = with_limits(
        line_trajectory, position_lower=middle - half, position_upper=middle + half
    )
    (ax,) = (
        ax
        for ax in plot_limits(ranged).axes
        if ax.get_ylabel() == "position in its range"
    )
    for joint, line in enumerate(lines(ax).values()):
        t, place = line.get_data()
        np.testing.assert_allclose(
            place, ((line_trajectory.position(t) - middle) / half)[:, joint], atol=1e-9
        )
        assert np.abs(place).max() == pytest.approx(0.8, abs=1e-3)
