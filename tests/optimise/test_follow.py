"""Splines along the fastest timing of a joint path."""

import numpy as np
import pytest

import brachis


@pytest.mark.parametrize("torque", [None, "auto"], ids=["accelerations", "torques"])
def test_random_walks_are_as_fast_as_their_timing(torque):
    rng = np.random.default_rng(3)
    points = np.cumsum(rng.normal(0.0, 0.3, (30, 7)), axis=0).clip(-1.5, 1.5)
    limits = {} if torque else {"torque": None, "acceleration": 8.0, "velocity": 2.0}
    result = brachis.plan(
        "iiwa14",
        start=points[0].tolist(),
        task_space="joints",
        path=[{"spline": {"through": points[1:].tolist()}}],
        limits=limits,
        least_motion=False,
    )
    assert result.verified
    assert result.candidate.reports[-1].solver == "phase plane"
    assert -1e-3 < result.timing_gap.gap < 3e-3
