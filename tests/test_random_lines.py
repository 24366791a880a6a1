"""Random reachable lines from random start postures: all end in a verified plan.

The full count, 200, is `benchmarks/random_lines.py`.
"""

from __future__ import annotations

import importlib.util
from pathlib import Path

import pytest

import brachis

ROOT = Path(__file__).parents[1]
COUNT, PARTS = 4, 2


@pytest.mark.parametrize("part", range(PARTS))
def test_random_reachable_lines(part):
    spec = importlib.util.spec_from_file_location(
        "random_lines", ROOT / "benchmarks/random_lines.py"
    )
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    limits = brachis.LimitSpec(torque=10.0, velocity=None)
    robot = brachis.Robot.from_urdf(
        ROOT / "robots/scara3/robot.urdf", gravity=[0, 0, 0], limits=limits
    )
    verified, reasons = 0, []
    own = list(module.random_tasks(robot, seed=0, count=COUNT))[part::PARTS]
    for task in own:
        try:
            result = brachis.plan(robot, task)
        except brachis.BrachisError as error:
            reasons.append(str(error))
        else:
            verified += result.verified
            if not result.verified:
                reasons.append(
                    "; ".join(
                        check.name
                        for check in result.verification.checks
                        if not check.passed
                    )
                )
    assert verified == len(own), reasons
