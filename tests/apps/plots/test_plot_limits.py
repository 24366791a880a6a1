"""Ratios to all limits, a panel for each kind."""

import numpy as np

from brachis.apps.bottleneck import limit_ratios
from brachis.apps.plots import plot_limits
from support.motions import with_tool_speed


def lines(ax):
    """Curves by their labels."""
    return {
        line.get_label(): line
        for line in ax.get_lines()
        if not line.get_label().startswith("_")
    }


def test_a_panel_for_every_kind_and_a_line_for_every_value(line_trajectory):
    trajectory = with_tool_speed(line_trajectory, 2.0)
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
