"""Ratios to all limits, a panel for each kind."""

import numpy as np

from brachis.apps.bottleneck import limit_ratios
from brachis.apps.plots import plot_limits
from support.figures import lines_by_label
from support.motions import with_tool_speed


def test_a_panel_for_every_kind_and_a_line_for_every_value(line_trajectory):
    trajectory = with_tool_speed(line_trajectory, 2.0)
    ratios = limit_ratios(trajectory)
    panels = plot_limits(trajectory).axes
    drawn = {
        (label, ax.get_ylabel()): line
        for ax in panels
        for label, line in lines_by_label(ax).items()
    }
    assert set(drawn) == {(label.subject, label.axis) for label in ratios.labels}
    assert {("tool", "tool speed / limit"), ("j1", "torque / limit")} < set(drawn)
    for label, column in zip(ratios.labels, ratios.values.T, strict=True):
        np.testing.assert_allclose(
            drawn[label.subject, label.axis].get_ydata(), column, atol=1e-9
        )
