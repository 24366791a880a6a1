"""Paths of several segments: derivatives in s, joins, blends, lengths."""

import numpy as np
import pytest
import yaml
from hypothesis import given
from hypothesis import strategies as st
from numpy.testing import assert_allclose

from support.arrays import assert_near
from support.poses import row_path

MIXED = yaml.safe_load("""
- line: {length: 1.0, angle_deg: 0}
  blend: 0.2
- line: {length: 0.6, angle_deg: 120}
  blend: 0.3
- arc:
    center: [0.2, 0.5]
    angle_deg: 100
    yaw: tangent
  blend: 0.1
- spline:
    through:
    - [0.4, 0.3, 0.5]
    - [0.9, 0.8, 0.1]
    relative: true
""")


@pytest.fixture
def mixed():
    return row_path(MIXED, [0, 0, 0.3], ["x", "y", "yaw"])


def test_derivatives_by_s(mixed):
    s = np.random.default_rng(3).uniform(0.001, 0.999, 300)
    h = 1e-6
    s = s[np.abs(s[:, None] - mixed.breaks).min(axis=1) > 2 * h]
    sample, after, before = mixed.sample(s), mixed.sample(s + h), mixed.sample(s - h)
    for lower, upper in (("target", "xi"), ("xi", "xi_ds"), ("xi_ds", "xi_dds")):
        exact = getattr(sample, upper)
        difference = (getattr(after, lower) - getattr(before, lower)) / (2 * h)
        assert exact.shape == (s.size, 3)
        assert np.abs(exact).max() > 1
        assert_near(difference, exact, 1e-6)


def test_three_derivatives_continue_across_all_joins(mixed):
    assert (
        mixed.breaks.size == 8
    )  # three lines and arcs, a spline, and a blend at each of three corners
    inner = mixed.breaks[1:-1]
    h = 1e-10
    before, after = mixed.sample(inner - h), mixed.sample(inner + h)
    everywhere = mixed.sample(np.linspace(0, 1, 1000))
    for name in ("target", "xi", "xi_ds", "xi_dds"):
        jump = np.abs(getattr(after, name) - getattr(before, name)).max()
        assert jump < 1e-6 * np.abs(getattr(everywhere, name)).max(), name


def test_ends_and_length(mixed):
    ends = mixed.sample([0.0, 1.0]).target
    assert_allclose(ends[0], [0, 0, 0.3])
    corner = np.array([1 - 0.3, 0.6 * np.sin(np.deg2rad(120))])
    center = np.array([0.2, 0.5])
    angle = np.deg2rad(100)
    turn = np.array([[np.cos(angle), -np.sin(angle)], [np.sin(angle), np.cos(angle)]])
    assert_allclose(
        ends[1, :2], center + turn @ (corner - center) + [0.9, 0.8], atol=1e-12
    )
    assert ends[1, 2] == pytest.approx(0.3 + angle + 0.1)
    fine = mixed.sample(np.linspace(0, 1, 20001)).target[:, :2]
    assert mixed.length == pytest.approx(
        np.linalg.norm(np.diff(fine, axis=0), axis=1).sum(), rel=1e-6
    )


def test_a_blend_leaves_the_rest_of_the_segments_alone():
    corner = [{"line": {"to": [1, 0]}, "blend": 0.25}, {"line": {"to": [1, 1]}}]
    path = row_path(corner, [0, 0], ["x", "y"])
    sample = path.sample(path.breaks)
    assert_allclose(sample.target, [[0, 0], [0.75, 0], [1, 0.25], [1, 1]], atol=1e-12)
    inside = path.sample(np.linspace(path.breaks[1], path.breaks[2], 50)).target
    assert np.all(inside[:, 0] <= 1)
    assert np.all(inside[:, 1] >= 0)
    assert np.abs(inside - [1, 0]).sum(axis=1).min() > 0.05


@given(st.floats(0, 160), st.floats(0.05, 0.5), st.floats(1.0, 3.0))
def test_a_blend_keeps_its_speed(turn, size, length):
    segments = [
        {"line": {"length": 1.0, "angle_deg": 20}, "blend": size},
        {"line": {"length": length, "angle_deg": 20 + turn}},
    ]
    path = row_path(segments, [0, 0], ["x", "y"])
    speed = np.linalg.norm(path.sample(np.linspace(0, 1, 400)).xi, axis=1) / path.total
    assert speed.max() < 1.3
    assert speed.min() > 0.2
    if turn <= 90:
        assert speed.min() > 0.65


@pytest.mark.parametrize(
    "segments",
    [
        "[{line: {to: [1, 0.5]}}, {line: {to: [3, 1.5]}}]",
        "[{arc: {center: [1, 0], angle_deg: 70}}, {arc: {center: [1, 0], angle_deg: 50}}]",
        "[{line: {to: [1, 1]}}, {spline: {through: [[2, 2], [2.5, 2.5], [4, 4]]}}]",
        "[{line: {to: [0.333333, 0.666667]}}, {line: {to: [1, 2]}}]",
    ],
)
def test_smooth_continuations_need_no_blend(segments):
    path = row_path(yaml.safe_load(segments), [0, 0], ["x", "y"])
    assert len(path.spans) == 2
    sides = path.sample(path.breaks[1] + np.array([-1e-9, 1e-9])).xi_ds
    assert np.abs(np.diff(sides, axis=0)).max() < 1e-5
