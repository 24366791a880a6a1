"""First guesses, and knots where a motion with a least speed changes its speed, and evenly where it does not."""

from __future__ import annotations

from types import SimpleNamespace

import numpy as np
import pytest

from brachis.search import phase_plane
from brachis.task import load_task

TASK = {
    "brachis": 1,
    "task_space": ["x", "y"],
    "start": {"joints": [0.0, 0.0]},
    "path": [{"line": {"by": [0.5, 0.0]}}],
    "spline": {"intervals": 20},
}


def breaks(times: np.ndarray, monkeypatch: pytest.MonkeyPatch) -> np.ndarray:
    start = SimpleNamespace(problem=SimpleNamespace(task=load_task(TASK)))
    monkeypatch.setattr(
        phase_plane,
        "_least_speed_guess",
        lambda _start: (np.linspace(0.0, 1.0, len(times))[:, None], times),
    )
    return phase_plane.initial_knots(start)


def test_a_constant_speed_has_even_knots(monkeypatch):
    found = breaks(np.linspace(0.0, 4.0, 401), monkeypatch)
    np.testing.assert_allclose(np.diff(found), 0.05, rtol=1e-12)


def test_knots_are_closer_where_the_speed_changes(monkeypatch):
    s = np.linspace(0.0, 1.0, 401)
    found = breaks(np.where(s < 0.5, s, 0.5 + 4.0 * (s - 0.5)), monkeypatch)
    lengths, place = np.diff(found), 0.2  # at s = 0.5 in normalised time
    near = np.abs(0.5 * (found[1:] + found[:-1]) - place) < 0.02
    assert np.abs(found - place).min() < 0.01
    assert lengths[near].max() < 0.1 * lengths.max()
    assert np.abs(np.diff(np.log(lengths[1:-1]))).max() < np.log(5.0), (
        "and not too different from their neighbours"
    )
    assert found[0] == 0.0
    assert found[-1] == 1.0


def test_intervals_grow_by_half_with_their_distance_from_a_switch():
    found = phase_plane.grade_knots(np.array([0.0, 0.3, 1.0]), 24)
    lengths, middle = np.diff(found), 0.5 * (found[1:] + found[:-1])
    away = np.abs(middle[:, None] - [0.0, 0.3, 1.0]).min(axis=1)
    assert len(lengths) == 24
    assert (lengths > 0.0).all()
    grown = np.polyfit(away, lengths, 1)[0]
    assert grown == pytest.approx(0.5, rel=0.1)


def test_more_intervals_than_switches_need_are_spread_over_the_whole_time():
    lengths = np.diff(phase_plane.grade_knots(np.array([0.0, 0.3, 1.0]), 400))
    assert lengths.min() > 1e-6
    assert lengths.max() < 0.04
