"""Drives that are stronger or faster in one direction: known optima, and that the limits hold on both sides."""

import numpy as np
import pytest

from brachis.apps.bottleneck import report
from brachis.verify import verify_trajectory
from support.checks import check_of, failed_checks
from support.slides import X, plan_slides, slides

MASS, LENGTH, PUSH, BRAKE = 4.0, 1.2, 50.0, 20.0


def plan(limits, way=LENGTH, intervals=70):
    return plan_slides(
        slides([X], [PUSH], MASS),
        ["x"],
        [way],
        settings={"limits": limits},
        spline={"intervals": intervals},
    )


@pytest.mark.parametrize("way", [LENGTH, -LENGTH])
def test_a_slide_that_brakes_less_than_it_pushes(way):
    # Switched at a part F- / (F+ + F-) of the time, whichever way it goes: t^2 = 2 m L (1 / F+ + 1 / F-).
    result = plan({"torque": {"j1": [-BRAKE, PUSH]}}, way)
    best = np.sqrt(2.0 * MASS * LENGTH * (1.0 / PUSH + 1.0 / BRAKE))
    assert result.verified
    assert best * (1.0 - 1e-4) < result.t_end < 1.001 * best
    tau = result.trajectory.torque(np.linspace(0.0, result.t_end, 5001))
    assert -BRAKE * (1.0 + 1e-4) <= tau.min() < -0.999 * BRAKE
    assert 0.999 * PUSH < tau.max() <= PUSH * (1.0 + 1e-4)


def test_the_plan_with_equal_limits_breaks_the_unequal_ones_and_sensitivities_name_the_end():
    free = plan({"torque": PUSH}, intervals=20)
    bound = plan({"torque": {"j1": [-BRAKE, PUSH]}})
    assert free.t_end < 0.9 * bound.t_end
    verification = verify_trajectory(free.trajectory, robot=bound.trajectory.robot)
    assert failed_checks(verification) == ["torque ratio"]
    ratio = check_of(verification, "torque ratio").value
    assert ratio == pytest.approx(PUSH / BRAKE, rel=1e-3)
    sensitivities = report(bound).sensitivities
    for side, figure in (("lower", -BRAKE), ("upper", PUSH)):
        # t^2 = 2 m L (1 / |F1| + 1 / F2), so that dt / d|F| = -m L / (t F^2)
        slope = MASS * LENGTH / (bound.t_end * figure**2)
        derivative = sensitivities.of("j1", "force", side).derivative
        assert derivative == pytest.approx(-np.sign(figure) * slope, rel=0.05)


def test_a_slide_that_is_faster_one_way():
    limits = {"velocity": {"j1": [-1.0, 2.0]}}
    out, back = plan(limits), plan(limits, -LENGTH)
    for result, speed in ((out, 2.0), (back, 1.0)):
        trapezoid = LENGTH / speed + speed * MASS / PUSH
        assert result.verified
        assert trapezoid * (1.0 - 1e-4) < result.t_end < 1.001 * trapezoid
    free = plan({}, -LENGTH, 20)
    verification = verify_trajectory(free.trajectory, robot=back.trajectory.robot)
    assert failed_checks(verification) == ["velocity ratio"]
