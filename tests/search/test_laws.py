"""Pairs of plans keep laws: what allows more motions is never slower, what allows fewer is never faster.

The full count, 300, is `benchmarks/laws.py`.
"""

from functools import cache

import numpy as np
import pytest

PAIRS = [
    ("torque limits, lower", 0),
    ("tool speed limited", 0),
    ("jerks limited", 0),
    ("joint ranges, narrower", 1),
    ("torque limits, higher", 5),  # with intervals: auto
    ("velocity limits, higher", 2),
    ("intervals doubled", 0),
    ("end posture freed", 0),
    ("start posture freed", 0),
    ("tolerances allowed", 1),
    ("effort fast, not single", 0),
    ("effort thorough, not fast", 0),
]
"""Changes, and numbers of pairs that are planned in a second or two."""


@pytest.fixture(scope="module")
def plan_pair(bench, tmp_path_factory):
    """Plan the pair of a change with a number."""
    laws = bench("laws")
    changes = {change.words: change for change in laws.CHANGES}
    folder = tmp_path_factory.mktemp("laws")
    return cache(
        lambda words, number: laws.plan_pair(changes[words], 0, number, folder)
    )


@pytest.mark.parametrize("words, number", PAIRS)
def test_the_plan_of_the_easier_task_is_not_slower(bench, plan_pair, words, number):
    pair = plan_pair(words, number)
    assert np.isfinite(pair.end_times).all(), pair.messages
    assert pair.violation < bench("laws").LARGE
