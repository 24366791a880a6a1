"""Random plans under narrow friction and with far ranges: an independent look finds none beyond its limits.

The full count, 300 over all robots, is `benchmarks/random_plans.py`.
"""

from dataclasses import replace

import numpy as np
import pytest

from brachis.trajectory import Trajectory

PATIENCE = 600.0
"""s; a busy machine must not decide what is verified."""


@pytest.fixture(scope="module")
def random_plans(bench):
    return bench("random_plans")


@pytest.fixture(scope="module")
def made(random_plans, tmp_path_factory):
    """Result file of a plan that is verified, and what the second look found."""
    folder = tmp_path_factory.mktemp("plans")
    _, outcome, excess, _ = random_plans.planned("gantry2", 0, 0, folder, PATIENCE)
    assert outcome == "verified"
    return folder / "gantry2_0.npz", excess


@pytest.mark.parametrize(
    "name, number",
    [("scara3", 1), ("gantry2", 1), ("gantry2", 2), ("gantry2", 3), ("gantry2", 4)],
)
def test_a_verified_plan_is_within_its_limits(random_plans, name, number, tmp_path):
    _, outcome, excess, _ = random_plans.planned(name, 0, number, tmp_path, PATIENCE)
    assert outcome == "verified"
    assert max(excess.values()) <= random_plans.ALLOWED


def test_the_second_look_agrees_with_the_verification(random_plans, made):
    path, excess = made
    trajectory = Trajectory.load(path)
    assert max(excess.values()) <= random_plans.ALLOWED
    t = np.linspace(0.0, trajectory.t_end, 5_001)
    limits = trajectory.robot.limits
    torque = (np.abs(trajectory.torque(t)) / limits.torque).max() - 1.0
    assert torque - 1e-9 <= excess["torque"] < torque + 1e-3
    beyond = np.maximum(
        limits.position_lower - trajectory.position(t),
        trajectory.position(t) - limits.position_upper,
    )
    assert excess["position"] == pytest.approx(beyond.max(), abs=1e-6)


@pytest.mark.parametrize(
    "name, by, kind",
    [("q", 1e-4, "torque"), ("qddot", 5.0, "torque"), ("q", 3.0, "position")],
)
def test_the_second_look_finds_what_is_wrong(
    random_plans, made, tmp_path, name, by, kind
):
    trajectory = Trajectory.load(made[0])
    array = np.array(getattr(trajectory, name))
    array[len(array) // 2] -= by
    replace(trajectory, **{name: array}).save(tmp_path / "wrong.npz")
    assert random_plans.recheck(tmp_path / "wrong.npz")[kind] > random_plans.ALLOWED
