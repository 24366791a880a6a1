"""Intervals are halved where they lose most, against plain Python of the same rule."""

import heapq
import itertools

import numpy as np
import pytest

from brachis import kernel

FEW = 8


def loss(t, values, rate, jumps, ramps, low, high):
    """What an interval loses."""
    first, last = np.searchsorted(t, [low, high])
    first = max(first - 1, 0)
    at = t[first : last + 1]
    if len(at) < 3:
        return 0.0
    inside = values[first : last + 1]
    part = (at - at[0]) / (at[-1] - at[0])
    off = np.abs(inside - inside[0] - part[:, None] * (inside[-1] - inside[0])).max()
    slowest = rate[first : last + 1].min()
    late = ramps[first : first + len(at) - 1].max() * (high - low)
    part_lost = late / slowest if late < slowest else 1.0
    smooth = off - jumps[first : first + len(at) - 1].max() if len(at) >= FEW else 0.0
    return (high - low) * max(smooth, off * part_lost)


def halve(timing, pieces, tolerance, shortest, most):
    evenly = [i / pieces for i in range(pieces + 1)]
    queue = [(-loss(*timing, *pair), *pair) for pair in itertools.pairwise(evenly)]
    heapq.heapify(queue)
    done = []
    lost = -sum(item[0] for item in queue)
    while lost > tolerance and queue and len(done) + len(queue) < most:
        worst, low, high = heapq.heappop(queue)
        lost += worst
        if high - low < shortest:
            done.append(low)
            continue
        middle = 0.5 * (low + high)
        for part in ((low, middle), (middle, high)):
            own = loss(*timing, *part)
            lost += own
            heapq.heappush(queue, (-own, *part))
    return np.sort([*done, *(low for _, low, _ in queue)])


@pytest.mark.parametrize(
    "tolerance, shortest, most",
    [(1e-3, 1e-4, 10_000), (0, 0.01, 300), (0, 0, 50)],
)
@pytest.mark.parametrize("seed", range(5))
def test_intervals(seed, tolerance, shortest, most):
    rng = np.random.default_rng(seed)
    t = np.sort(rng.uniform(0.0, 1.0, 400))
    values = np.column_stack([np.sign(np.sin(17.0 * t)), np.sin(9.0 * t), t**2])
    jumps = np.abs(np.diff(values, axis=0)).max(axis=1)
    timing = (t, values, 0.1 + t, np.where(jumps > 1.0, jumps, 0.0), jumps / 24.0)
    found = kernel.halve_intervals(
        *timing,
        least_times=FEW,
        begin_count=8,
        tolerance=tolerance,
        shortest=shortest,
        max_count=most,
    )
    np.testing.assert_allclose(
        found, halve(timing, 8, tolerance, shortest, most), atol=1e-12
    )
