"""Lines of joints are told apart, with colours and without."""

from __future__ import annotations

import itertools

from brachis.apps.plots import plot_motion
from brachis.apps.plots.style import joint_style


def test_line_styles_differ_from_the_first_joint_on():
    styles = [joint_style(joint)["linestyle"] for joint in range(6)]
    assert len(set(map(str, styles))) == 6


def test_no_two_joints_of_a_long_chain_look_the_same():
    looks = [
        (joint_style(joint)["color"], str(joint_style(joint)["linestyle"]))
        for joint in range(30)
    ]
    assert len(set(looks)) == 30


def test_figures_use_them(line_trajectory):
    lines = [
        line
        for line in plot_motion(line_trajectory).axes[0].get_lines()
        if line.get_gid() != "limit"
    ]
    patterns = [line._unscaled_dash_pattern for line in lines]
    assert all(one != other for one, other in itertools.combinations(patterns, 2))
