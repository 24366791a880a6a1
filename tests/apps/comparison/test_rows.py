"""What the rows of a recorded motion prove of its limits."""

import numpy as np
import pytest

import brachis
from brachis.apps.comparison import bound_ratios
from brachis.robot import dynamics
from brachis.verify import verify_trajectory
from support.scara import scara

SHARES = np.array([1.0, -0.5, 0.02])
"""Of the largest velocity, acceleration and jerk, joint by joint."""


def import_rows(folder, digits, dt, kind, share):
    """A motion that uses this share of a limit of the first joint, at every `dt` s: full speed up, full speed down."""
    t = np.arange(0.0, 2.0 + 0.5 * dt, dt)
    if kind == "jerk":
        edges = np.array([0.0, 0.5, 1.5, 2.0])  # jerk 1, -1, 1
        progress = sum(
            jump * np.clip(t - edge, 0.0, None) ** 3 / 6.0
            for jump, edge in zip((1, -2, 2, -1), edges, strict=True)
        )
    else:
        progress = np.where(t < 1.0, 0.5 * t**2, 1.0 - 0.5 * (2.0 - t) ** 2)
    file = folder / "today.csv"
    rows = np.column_stack([t, np.outer(progress, SHARES)])
    header = {"header": "t,j1,j2,j3", "comments": ""}
    np.savetxt(file, rows, delimiter=",", fmt=f"%.{digits}f", **header)
    robot = scara({"torque": 1e3, kind: 1.0 / share})
    return brachis.import_motion(file, robot, task_space=["x", "y"])


def worst(trajectory, kind):
    ratios = {proven.limit: proven.worst for proven in bound_ratios(trajectory)}
    return ratios[kind]


@pytest.mark.parametrize("digits, dt", [(4, 0.008), (5, 0.004), (4, 0.02), (12, 0.004)])
def test_rows_of_a_motion_at_its_limit_prove_no_more(digits, dt, tmp_path):
    """The spline through rounded rows overshoots, and fails its verification; that proves nothing."""
    trajectory = import_rows(tmp_path, digits, dt, "acceleration", 1.0)
    ratio, subject, _ = worst(trajectory, "acceleration")
    assert 0.8 < ratio <= 1.0 + 1e-9
    assert subject == "j1"
    if digits < 6:
        checks = {c.name: c.value for c in verify_trajectory(trajectory).checks}
        assert checks["acceleration ratio"] > 1.05


@pytest.mark.parametrize("digits, dt", [(4, 0.02), (6, 0.008), (12, 0.004)])
def test_rows_of_a_motion_beyond_its_limit_prove_it(digits, dt, tmp_path):
    trajectory = import_rows(tmp_path, digits, dt, "acceleration", 1.4)
    assert 1.2 < worst(trajectory, "acceleration")[0] <= 1.4 + 1e-9


@pytest.mark.parametrize("kind", ["velocity", "jerk"])
def test_velocity_is_a_mean_over_a_period_and_jerk_one_over_three(kind, tmp_path):
    trajectory = import_rows(tmp_path, 15, 1.0 / 30.0, kind, 1.0)
    largest = {"velocity": 1.0 - 0.5 / 30.0, "jerk": 1.0}[
        kind
    ]  # the velocity has its peak at a row
    assert worst(trajectory, kind)[0] == pytest.approx(largest, abs=1e-9)


def test_torques_are_those_of_the_mean_motion(tmp_path):
    trajectory = import_rows(tmp_path, 15, 0.008, "acceleration", 1.0)
    t = np.linspace(0.0, 1.0, 1001)
    derivatives = (0.5 * t**2, t, np.ones_like(t))
    q, qdot, qddot = (np.outer(derivative, SHARES) for derivative in derivatives)
    speeding = np.abs(dynamics.torque(trajectory.robot, q, qdot, qddot)).max()
    braking = np.abs(dynamics.torque(trajectory.robot, SHARES - q, qdot, -qddot)).max()
    assert worst(trajectory, "torque")[0] == pytest.approx(
        max(speeding, braking) / 1e3, rel=0.01
    )
