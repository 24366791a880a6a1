"""Plots, report and viewer show where phases meet; a motion of one phase has nothing of it."""

import numpy as np
import pytest

from brachis.apps import plots
from brachis.apps.report import make_report
from brachis.apps.view import tables
from support.gantry import gantry_motion


@pytest.fixture(scope="module")
def motion():
    return gantry_motion()


def lines_at(ax):
    """Times of the vertical lines of axes."""
    return [
        float(line.get_xdata()[0])
        for line in ax.lines
        if len(line.get_xdata()) == 2 and np.ptp(line.get_xdata()) == 0.0
    ]


def test_every_panel_has_a_line_where_phases_meet(motion):
    figure = plots.plot_motion(motion)
    for ax in figure.axes:
        assert lines_at(ax) == pytest.approx([1.0, 1.5, 2.5, 3.5])
    texts = [text.get_text() for text in figure.axes[0].texts]
    assert texts == ["1", "dwell", "3", "0.3 m/s", "5"]


def test_the_timeline_has_them_too(motion):
    assert lines_at(plots.plot_timeline(motion).axes[0]) == [1.0, 1.5, 2.5, 3.5]


def test_a_report_has_a_table_of_phases(motion):
    page = make_report(motion)
    assert page.verified
    assert '<table class="phases">' in page.html
    assert "<td>4 given speed</td><td>0.55 to 0.85</td>" in page.html


def test_the_viewer_says_which_phase_it_shows(motion):
    assert "phase 1 of 5: move" in tables.state_table(motion, motion.at(0.0))
    assert "phase 3 of 5: move" in tables.state_table(motion, motion.at(1.5))
    assert "phase 5 of 5: move" in tables.state_table(motion, motion.at(4.5))
    assert "2 dwell" in tables.phases_table(motion)


def test_a_motion_of_one_phase_has_no_table(line_trajectory):
    assert tables.phases_table(line_trajectory) == ""
    now = line_trajectory.at(0.0)
    assert "phase" not in tables.state_table(line_trajectory, now)
    assert '<table class="phases">' not in make_report(line_trajectory).html
    for ax in plots.plot_motion(line_trajectory).axes:
        assert lines_at(ax) == []
