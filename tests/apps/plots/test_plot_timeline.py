from dataclasses import replace

import numpy as np
import pytest
from matplotlib.collections import PolyCollection, QuadMesh

from brachis.apps.bottleneck import limit_ratios, saturations
from brachis.apps.plots import plot_timeline


def rows(ax):
    return [label.get_text() for label in ax.get_yticklabels()]


def meshes(ax):
    return [each for each in ax.collections if isinstance(each, QuadMesh)]


def spans(ax):
    """Times of the marked stretches, row by row."""
    bars = [
        each
        for each in ax.collections
        if isinstance(each, PolyCollection) and not isinstance(each, QuadMesh)
    ]
    return [
        [
            (path.vertices[:, 0].min(), path.vertices[:, 0].max())
            for path in bar.get_paths()
        ]
        for bar in bars
    ]


def test_a_row_for_every_limit_that_comes_near(line_trajectory):
    ax = plot_timeline(line_trajectory).axes[0]
    peaks = {entry.label: entry.peak for entry in saturations(line_trajectory)}
    expected = {str(label) for label, peak in peaks.items() if peak > 0.5}
    assert {"j1 torque", "j2 torque"} <= expected
    assert set(rows(ax)) == expected
    assert len(meshes(ax)) == len(expected)
    assert f"= {line_trajectory.t_end:.3f}" in ax.get_xlabel()


def test_ratios_that_stay_the_same_have_no_row_unless_they_are_active(line_trajectory):
    ratios = limit_ratios(line_trajectory)
    values = np.full_like(ratios.values, 0.7)
    values[:, 0] = 1.0
    entries = saturations(replace(ratios, values=values))
    assert [entry.label for entry in entries if entry.is_drawn] == [ratios.labels[0]]


def test_colours_are_the_ratios(line_trajectory):
    ax = plot_timeline(line_trajectory).axes[0]
    ratios = limit_ratios(line_trajectory)
    column = [str(label) for label in ratios.labels].index("j1 torque")
    drawn = meshes(ax)[rows(ax).index("j1 torque")].get_array().ravel()
    used = np.abs(ratios.values[:, column])
    np.testing.assert_allclose(drawn, 0.5 * (used[1:] + used[:-1]))


def test_active_stretches_are_marked_where_they_are(line_trajectory):
    ax = plot_timeline(line_trajectory).axes[0]
    (entry,) = [
        each for each in saturations(line_trajectory) if str(each.label) == "j1 torque"
    ]
    assert entry.active
    drawn = spans(ax)[rows(ax).index("j1 torque")]
    np.testing.assert_allclose(
        sorted(drawn), [(stretch.begin, stretch.end) for stretch in entry.active]
    )
    marked = sum(end - begin for begin, end in drawn) / line_trajectory.t_end
    assert marked == pytest.approx(entry.share), (
        "the report's text says what the plot shows"
    )
    assert 0.5 < entry.share < 0.7
    assert len(entry.active) < 7


def test_the_timeline_says_that_no_limit_is_near(line_trajectory, with_limits):
    open_range = {
        "position_lower": np.full(3, -np.inf),
        "position_upper": np.full(3, np.inf),
    }
    ax = plot_timeline(
        with_limits(line_trajectory, torque=np.full(3, 1e4), **open_range)
    ).axes[0]
    assert rows(ax) == []
    assert any("more than half of its limit" in text.get_text() for text in ax.texts)
