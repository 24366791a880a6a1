"""Jerk and torque rate through all of it: refusals, plan, dense grid, verification, sensitivity, timeline."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

import brachis
from brachis.apps.bottleneck import check_sensitivities
from brachis.errors import InputError
from brachis.verify import verify_trajectory
from brachis.verify.mechanics import torque_rates, torques
from support.arrays import assert_scaled
from support.effort import QUICK

ROOT = Path(__file__).parents[2]
FIGURES = {"jerk": 12.0, "torque_rate": 25.0}  # rad/s^3 and Nm/s


def task(*, spline=None, **limits):
    found = brachis.load_task(ROOT / "examples/01_scara_line.yaml").to_dict()
    found["path"] = [{"line": {"length": 1.0, "angle_deg": 45.0}}]
    found["robot"]["limits"] |= limits
    settings = found["spline"] | (spline or {})
    return {**found, "spline": settings, "search": QUICK}


@pytest.fixture(scope="module")
def free():
    return brachis.plan(task())


@pytest.fixture(scope="module", params=FIGURES)
def kind(request):
    return request.param


@pytest.fixture(scope="module")
def result(kind):
    return brachis.plan(task(**{kind: FIGURES[kind]}))


def rates(trajectory, kind, count=5_000):
    """Differences of accelerations or torques over the saved motion, per second."""
    t = np.linspace(0.0, trajectory.t_end, count)
    values = trajectory.acceleration(t) if kind == "jerk" else trajectory.torque(t)
    return np.abs(np.diff(values, axis=0)) / np.diff(t)[:, None]


def test_the_limit_holds_everywhere_and_is_active(kind, free, result):
    assert rates(free.trajectory, kind).max() > 2.0 * FIGURES[kind], (
        "without the limit it is exceeded"
    )
    assert result.verified
    assert rates(result.trajectory, kind).max() == pytest.approx(
        FIGURES[kind], rel=5e-4
    )
    assert rates(result.trajectory, kind).max() < FIGURES[kind] * 1.0002
    assert result.t_end > 1.01 * free.t_end


@pytest.mark.parametrize(("follows", "factor"), [(True, 1.0), (False, 9.0)])
def test_verification_finds_a_rate_within_a_microsecond(kind, result, follows, factor):
    """A jerk that is constant over so short a piece, and that of a quintic whose acceleration alone has changed.

    The latter's jerk ends at nine times the mean, as `brachis.trajectory.trajectory` states it: m + a + b is 1 + 3 + 5.
    """
    trajectory, change, h = result.trajectory, np.array([0.1, 0.0, 0.0]), 1e-6
    t = 0.4321 * trajectory.t_end + np.array([0.0, h])
    place = int(np.searchsorted(trajectory.times, t[0]))
    assert trajectory.times[place] > t[1]
    at = trajectory.at(t)
    later = np.array([[0.0], [1.0]]) * change
    q, qdot, qddot = (
        at.q + follows * h**2 / 6.0 * later,
        at.qdot + follows * h / 2.0 * later,
        at.qddot + later,
    )
    new = {"times": at.t, "q": q, "qdot": qdot, "qddot": qddot, "qddot_before": qddot}
    arrays = {
        name: np.insert(getattr(trajectory, name), place, values, axis=0)
        for name, values in new.items()
    }
    checks = {
        each.name: each
        for each in verify_trajectory(replace(trajectory, **arrays)).checks
    }
    found = checks[f"{kind.replace('_', ' ')} ratio"]
    inertia = (
        1.0
        if kind == "jerk"
        else np.abs(trajectory.torque(t[0]) - _torque(trajectory, t[0], change)).max()
        / 0.1
    )
    # Positions are known to 2e-16 |q|: a jerk of 60 * 2e-16 |q| / h^3, near 1e4 rad/s^3 beside 9e5.
    assert found.value == pytest.approx(
        factor * 0.1 / h * inertia / FIGURES[kind], rel=2e-2
    )
    assert found.time == pytest.approx(t[0], abs=2e-6)


def _torque(trajectory, t, change):
    states = (
        np.atleast_2d(part(t))
        for part in (trajectory.position, trajectory.velocity, trajectory.acceleration)
    )
    q, qdot, qddot = states
    return torques(trajectory.robot, q, qdot, qddot + change)[0]


@pytest.mark.parametrize(("step", "above"), [(0.01, 1e-4), (0.0005, 5e-6)])
def test_prediction_is_what_solving_again_gives(kind, result, step, above):
    """Within 1 % other limits take over, here and there; within small steps none do."""
    found = check_sensitivities(
        result.candidate.refined, result.sensitivities, step=step
    )
    large = found.larger(above)
    assert {entry.sensitivity.label.kind for entry in large} >= {kind.replace("_", " ")}
    assert all(entry.optimal for entry in large)
    if step < 0.01:
        assert found.worst_deviation(above) < 0.005


def test_the_limits_of_rates_are_for_splines_that_can_hold_them(kind):
    figure = {kind: FIGURES[kind]}
    words = f"the {kind.replace('_', ' ')} limit needs a continuous acceleration"
    with pytest.raises(
        InputError, match=rf"spline\.degree: {words}; found 2, .*; allowed: >= 3"
    ):
        brachis.plan(task(spline={"degree": 2, "rest": "velocity"}, **figure))
    with pytest.raises(
        InputError,
        match=rf"spline\.rest: {words}; found velocity, .*; allowed: full or jerk",
    ):
        brachis.plan(task(spline={"rest": "velocity"}, **figure))


def test_rates_of_the_verification_are_differences_of_its_torques(free):
    trajectory, t, h = free.trajectory, np.linspace(0.1, 2.0, 9) + 0.0123, 1e-4
    parts = [
        getattr(trajectory, name)(t)
        for name in ("position", "velocity", "acceleration", "jerk")
    ]
    friction = replace(
        trajectory.robot.friction,
        viscous=np.full(3, 2.0),
        coulomb=np.full(3, 1.5),
        v_eps=np.ones(3),
    )
    robot = replace(trajectory.robot, friction=friction)

    def after(step):
        q, qdot, qddot, qdddot = parts
        moved = q + step * qdot + step**2 / 2 * qddot + step**3 / 6 * qdddot
        return torques(
            robot,
            moved,
            qdot + step * qddot + step**2 / 2 * qdddot,
            qddot + step * qdddot,
        )

    expected = (after(h) - after(-h)) / (2.0 * h)
    assert_scaled(torque_rates(robot, *parts), expected, 1e-6)
