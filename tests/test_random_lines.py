"""Random reachable lines from random start postures: all end in a verified plan.

The full count, 200, is `benchmarks/random_lines.py`.
"""

import pytest

import brachis
from support.scara import scara


@pytest.mark.parametrize("number", range(4))
def test_random_reachable_lines(bench, number):
    robot = scara()
    tasks = list(bench("random_lines").random_tasks(robot, seed=0, count=4))
    assert brachis.plan(robot, tasks[number]).verified
