"""Plots, report and viewer show the parts and events of a program, with the limits of each part."""

from dataclasses import replace

import numpy as np
import pytest

from brachis.apps import plots
from brachis.apps.bottleneck import limit_ratios
from brachis.apps.plots.panels import panels_of, ratio_panel
from brachis.apps.report import make_report
from brachis.apps.view import tables
from brachis.explain.sensitivities import label_of_speed
from support.cycle import NAMES


@pytest.fixture(scope="module")
def motion(cycle):
    return cycle.explained_trajectory


def lines_at(ax):
    """Times of the vertical lines of axes."""
    return [
        float(line.get_xdata()[0])
        for line in ax.lines
        if len(line.get_xdata()) == 2 and np.ptp(line.get_xdata()) == 0.0
    ]


def test_panels_have_lines_and_names_of_parts_and_events(motion):
    figure = plots.plot_motion(motion)
    times = [part.end for part in motion.parts[:-1]]
    times += [event.time for event in motion.events]
    for ax in figure.axes:
        assert lines_at(ax) == pytest.approx(times)
    written = {text.get_text(): text for text in figure.axes[0].texts}
    assert set(written) == {"process_on", "process_off", *NAMES} - {"dwell 1"}
    assert written["process_on"].get_rotation() == 90.0
    assert lines_at(plots.plot_timeline(motion).axes[0]) == pytest.approx(times)


def test_narrow_parts_are_named_upwards_and_names_are_no_mathematics(motion):
    figure = plots.style.new_figure(60.0, 30.0)
    ax = figure.add_subplot()
    plots.style.mark_phases(ax, motion, labels=True)
    rotations = {text.get_text(): text.get_rotation() for text in ax.texts}
    assert rotations["bead"] == 0.0
    longest = max(motion.parts, key=lambda part: part.duration)
    assert rotations[longest.name] == 0.0


def test_limits_of_a_part_hold_only_in_it(motion):
    first, bead = motion.parts[:2]
    samples = motion.at(np.linspace(0.0, motion.t_end, 500))
    velocity, tool = panels_of(motion, samples, "velocity", "tool speed")
    inside = samples.t < first.end
    for curve in velocity.curves:
        assert set(curve.upper[inside]) == {0.5}
        assert set(curve.upper[~inside]) == {2.0}
    (curve,) = tool.curves
    inside = (samples.t >= bead.begin) & (samples.t < motion.parts[3].begin)
    assert set(curve.upper[inside]) == {0.3}
    assert np.isinf(curve.upper[~inside]).all()
    (position,) = panels_of(motion, samples, "position")
    assert all(np.ndim(curve.upper) == 0 for curve in position.curves)


def test_ratios_have_a_line_where_there_is_the_limit_and_names_that_differ(motion):
    ratios = limit_ratios(motion)
    (curve,) = ratio_panel(motion, ratios, "tool speed / limit").curves
    assert curve.name == "tool"
    assert np.isnan(curve.values[ratios.t < motion.parts[0].end]).all()
    label = label_of_speed("process speed", 0.2, "")
    held = replace(label, share="tool speed / limit")
    more = np.column_stack([ratios.values, np.ones(len(ratios.t))])
    both = replace(ratios, labels=(*ratios.labels, held), values=more)
    curves = ratio_panel(motion, both, "tool speed / limit").curves
    names = [curve.name for curve in curves]
    assert names == ["tool speed", "tool process speed of 0.2 m/s"]
    assert curves[0].style != curves[1].style
    plots.plot_limits(motion)


def test_a_report_has_a_table_of_parts_with_their_limits(motion):
    page = make_report(motion)
    assert page.verified
    rows = page.html.split('<table class="phases">')[1].split("</table>")[0]
    for name in NAMES:
        assert f"<td>{name}</td>" in rows
    assert "x_axis velocity (" in rows
    assert "tool speed (" in rows
    assert "<td>line (by [0.1, 0.2]); the tool moves 0." in page.html
    assert " m in all; prescribed" in page.html
    assert f"<td>process_on at {motion.events[0].time:.4f} s, process_off" in page.html
    assert "prescribed: x, y<" in page.html
    assert "none, then 3 kg at " in page.html
    assert "more speed at tool" in page.html


def test_a_report_of_a_new_plan_has_the_same(cycle):
    page = cycle.report()
    assert page.verified
    assert "<td>bead</td>" in page.html
    assert cycle.smoothing in page.html


def test_the_viewers_tables_name_the_part(motion):
    bead = motion.parts[1]
    now = motion.at(bead.begin + 0.01)
    assert "part: bead" in tables.state_table(motion, now)
    table = tables.phases_table(motion)
    assert all(f">{name}<" in table for name in NAMES)
