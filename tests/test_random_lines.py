"""200 random reachable lines from random start postures: at least 99 % end in a verified plan, the rest say why."""

from __future__ import annotations

import importlib.util
from pathlib import Path

import brachis

ROOT = Path(__file__).parents[1]
COUNT = 200


def test_random_reachable_lines():
    spec = importlib.util.spec_from_file_location("random_lines", ROOT / "benchmarks/random_lines.py")
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    limits = brachis.LimitSpec(torque=10.0, velocity=None)
    robot = brachis.Robot.from_urdf(ROOT / "robots/scara3/robot.urdf", gravity=[0, 0, 0], limits=limits)
    verified, reasons = 0, []
    for task in module.random_tasks(robot, seed=0, count=COUNT):
        try:
            result = brachis.plan(robot, task)
        except brachis.BrachisError as error:
            reasons.append(str(error))
        else:
            verified += result.verified
            if not result.verified:
                reasons.append("; ".join(check.name for check in result.verification.checks if not check.passed))
    assert verified >= 0.99 * COUNT, reasons
    assert verified + len(reasons) == COUNT
    assert all(len(reason) > 10 for reason in reasons)
