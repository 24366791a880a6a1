"""Paths of several segments: derivatives in s, joins, blends, lengths."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from brachis.path import Path, build_path
from brachis.task import load_task

MIXED: list[dict[str, Any]] = [
    {"line": {"length": 1.0, "angle_deg": 0}, "blend": 0.2},
    {"line": {"length": 0.6, "angle_deg": 120}, "blend": 0.3},
    {"arc": {"center": [0.2, 0.5], "angle_deg": 100, "yaw": "tangent"}, "blend": 0.1},
    {"spline": {"through": [[0.4, 0.3, 0.5], [0.9, 0.8, 0.1]], "relative": True}},
]


def path_of(segments: list[dict[str, Any]], start: Any, rows: list[str]) -> Path:
    task = load_task(
        {"brachis": 1, "start": {"joints": [0]}, "task_space": rows, "path": segments}
    )
    path = build_path(task.path, start, rows)
    assert isinstance(path, Path)
    return path


@pytest.fixture
def mixed() -> Path:
    return path_of(MIXED, [0, 0, 0.3], ["x", "y", "yaw"])


def test_derivatives_by_s(mixed: Path) -> None:
    s = np.random.default_rng(3).uniform(0.001, 0.999, 300)
    h = 1e-6
    s = s[np.abs(s[:, None] - mixed.breaks).min(axis=1) > 2 * h]
    sample, after, before = mixed.sample(s), mixed.sample(s + h), mixed.sample(s - h)
    for lower, upper in (("target", "xi"), ("xi", "xi_ds"), ("xi_ds", "xi_dds")):
        exact = getattr(sample, upper)
        difference = (getattr(after, lower) - getattr(before, lower)) / (2 * h)
        assert exact.shape == (s.size, 3)
        assert np.abs(exact).max() > 1
        np.testing.assert_allclose(difference, exact, atol=1e-6 * np.abs(exact).max())


def test_three_derivatives_continue_across_all_joins(mixed: Path) -> None:
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


def test_without_a_blend_the_third_derivative_would_jump() -> None:
    """The continuity test above can fail: the same corner, between the curves themselves, is far from continuous."""
    path = path_of(
        [MIXED[0], {"line": {"length": 1, "angle_deg": 120}}],
        [0, 0, 0],
        ["x", "y", "yaw"],
    )
    first, _, last = (piece.curve for piece in path.spans)
    jump = (
        last.derivatives(np.zeros(1), 1)[1]
        - first.derivatives(np.array([first.length]), 1)[1]
    )
    assert np.linalg.norm(jump) > 1


def test_ends_and_length(mixed: Path) -> None:
    ends = mixed.sample([0.0, 1.0]).target
    np.testing.assert_allclose(ends[0], [0, 0, 0.3])
    corner = np.array([1 - 0.3, 0.6 * np.sin(np.deg2rad(120))])
    center = np.array([0.2, 0.5])
    angle = np.deg2rad(100)
    turn = np.array([[np.cos(angle), -np.sin(angle)], [np.sin(angle), np.cos(angle)]])
    np.testing.assert_allclose(
        ends[1, :2], center + turn @ (corner - center) + [0.9, 0.8], atol=1e-12
    )
    assert ends[1, 2] == pytest.approx(0.3 + angle + 0.1)
    fine = mixed.sample(np.linspace(0, 1, 20001)).target[:, :2]
    assert mixed.length == pytest.approx(
        np.linalg.norm(np.diff(fine, axis=0), axis=1).sum(), rel=1e-6
    )


def test_a_blend_leaves_the_rest_of_the_segments_alone() -> None:
    corner = [{"line": {"to": [1, 0]}, "blend": 0.25}, {"line": {"to": [1, 1]}}]
    path = path_of(corner, [0, 0], ["x", "y"])
    sample = path.sample(path.breaks)
    np.testing.assert_allclose(
        sample.target, [[0, 0], [0.75, 0], [1, 0.25], [1, 1]], atol=1e-12
    )
    inside = path.sample(np.linspace(path.breaks[1], path.breaks[2], 50)).target
    assert np.all(inside[:, 0] <= 1)
    assert np.all(inside[:, 1] >= 0)
    assert np.abs(inside - [1, 0]).sum(axis=1).min() > 0.05


@given(st.floats(0, 160), st.floats(0.05, 0.5), st.floats(1.0, 3.0))
def test_a_blend_keeps_its_speed(turn: float, size: float, length: float) -> None:
    segments = [
        {"line": {"length": 1.0, "angle_deg": 20}, "blend": size},
        {"line": {"length": length, "angle_deg": 20 + turn}},
    ]
    path = path_of(segments, [0, 0], ["x", "y"])
    speed = np.linalg.norm(path.sample(np.linspace(0, 1, 400)).xi, axis=1) / path.total
    assert speed.max() < 1.3
    assert speed.min() > 0.2
    if turn <= 90:
        assert speed.min() > 0.65


def test_blends_may_meet_in_the_middle() -> None:
    segments: list[dict[str, Any]] = [
        {"line": {"by": [1, 0]}, "blend": 0.5},
        {"line": {"by": [0, 1]}, "blend": 0.5},
        {"line": {"by": [-1, 0]}},
    ]
    path = path_of(segments, [0, 0], ["x", "y"])
    assert len(path.spans) == 4
    middle = path.sample(path.breaks[2:3])
    np.testing.assert_allclose(middle.target, [[1, 0.5]], atol=1e-12)
    np.testing.assert_allclose(middle.xi / path.total, [[0, 1]], atol=1e-12)


@pytest.mark.parametrize(
    "segments",
    [
        [{"line": {"to": [1, 0.5]}}, {"line": {"to": [3, 1.5]}}],
        [
            {"arc": {"center": [1, 0], "angle_deg": 70}},
            {"arc": {"center": [1, 0], "angle_deg": 50}},
        ],
        [
            {"line": {"to": [1, 1]}},
            {"spline": {"through": [[2, 2], [2.5, 2.5], [4, 4]]}},
        ],
        [{"line": {"to": [0.333333, 0.666667]}}, {"line": {"to": [1, 2]}}],
    ],
)
def test_smooth_continuations_need_no_blend(segments: list[dict[str, Any]]) -> None:
    path = path_of(segments, [0, 0], ["x", "y"])
    assert len(path.spans) == 2
    assert (
        np.abs(
            np.diff(path.sample(path.breaks[1] + np.array([-1e-9, 1e-9])).xi_ds, axis=0)
        ).max()
        < 1e-5
    )


def test_the_path_continues_smoothly_beyond_its_ends(mixed: Path) -> None:
    h = 1e-7
    outside = mixed.sample([-h, 0.0, 1.0, 1 + h])
    np.testing.assert_allclose(
        outside.target[1] - outside.target[0], outside.xi[0] * h, atol=1e-12
    )
    np.testing.assert_allclose(
        outside.target[3] - outside.target[2], outside.xi[2] * h, atol=1e-12
    )


def test_nan_stays_nan(mixed: Path) -> None:
    sample = mixed.sample([0.5, np.nan])
    assert np.all(np.isnan(sample.target[1]))
    assert not np.any(np.isnan(sample.xi_dds[0]))


def test_one_row_and_yaw_alone() -> None:
    path = path_of([{"line": {"by": [-2]}}], [0.5], ["z"])
    np.testing.assert_allclose(path.sample([0, 0.5, 1]).target[:, 0], [0.5, -0.5, -1.5])
    assert path.length == pytest.approx(2)
    turning = path_of([{"line": {"by": [0, 0, 2]}}], [0, 0, 0], ["x", "y", "yaw"])
    np.testing.assert_allclose(turning.sample([0.5]).xi, [[0, 0, 2]])
    assert turning.length == 0


def test_a_sample_is_frozen_and_paths_do_not_share_the_start() -> None:
    start = np.zeros(2)
    path = path_of([{"line": {"by": [1, 0]}}], start, ["x", "y"])
    start[:] = 9
    np.testing.assert_array_equal(path.sample([0.0]).target, [[0, 0]])
