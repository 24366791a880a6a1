"""Plans whose shortest time is known by hand: slides pushed by limited forces.

A mass m, pushed over a distance L by a force of at most F, needs t* = 2 sqrt(m L / F): full force up to the middle,
full force back from there (bang-bang). A cubic spline's acceleration is linear between knots. With N even intervals and
free acceleration at the ends its best is a ramp over the two middle intervals, with rest: full two more ramps at the
ends:

    rest: velocity    t = t* / sqrt(1 - 4 / (3 N^2))
    rest: full        t = t* / sqrt(1 - 2 / N)

With free knots the ramp in the middle takes one interval of the least length, l, and so does each ramp at an end:

    rest: velocity    t = t* / sqrt(1 - l^2 / 3)
    rest: full        t = t* / sqrt(1 - 2 l + l^2)
"""

import numpy as np
import pytest
from numpy.testing import assert_allclose

from support.slides import X, Y, Z, plan_slides, slides

MASS, FORCE, LENGTH = 2.0, 50.0, 1.2
SLACK = 2e-4  # refinement may lengthen the time by its tolerance


ALONE = (slides([X], [FORCE]), ["x"], [LENGTH])
"""A slide, its row and its way."""
GANTRY = (slides([X, Y], [FORCE, FORCE]), ["x", "y"], [LENGTH, 0.0])
"""The lower one of two slides moves, and carries the upper one."""


def plan(
    robot,
    rows,
    by,
    *,
    intervals=20,
    rest="velocity",
    settings=None,
    task=None,
    **spline,
):
    spline |= {"intervals": intervals, "rest": rest}
    return plan_slides(
        robot, rows, by, settings=settings, spline=spline, **(task or {})
    )


def bang_bang(mass):
    return 2.0 * np.sqrt(mass * LENGTH / FORCE)


@pytest.mark.parametrize("rest", ["velocity", "full"])
@pytest.mark.parametrize(
    "first, last", [(2.0, 0.0), (0.0, 3.0), (1.5, 4.0), (6.0, 6.0)]
)
def test_slide_between_speeds(first, last, rest):
    """Full force forwards up to the speed v with 2 v^2 = 2 a L + v0^2 + v1^2, full force back from there."""
    task = {"boundary": {"start_speed": first, "end_speed": last}}
    result = plan(*ALONE, intervals=100, rest=rest, task=task)
    assert result.verified
    top = np.sqrt(FORCE / MASS * LENGTH + 0.5 * (first**2 + last**2))
    exact = (2.0 * top - first - last) * MASS / FORCE
    # With full rest the force is zero at both ends, and rises and falls within an interval.
    near = 1e-3 if rest == "velocity" else 1e-2
    assert result.t_end == pytest.approx(exact, rel=near)
    assert result.t_end > exact * (1.0 - 1e-4)
    ends = result.trajectory.at([0.0, result.t_end])
    assert_allclose(ends.qdot[:, 0], [first, last], atol=1e-9)
    force = np.abs(ends.tau).max()
    assert force < 1e-6 if rest == "full" else force > 0.9 * FORCE


@pytest.mark.parametrize(
    "by, mass",
    [([LENGTH, 0.0], 2.0 * MASS), ([0.0, LENGTH], MASS)],
    ids=["lower slide", "upper slide"],
)
def test_gantry_approaches_bang_bang_from_above(by, mass):
    # The lower slide carries the upper one.
    times = []
    for intervals in (10, 20, 40):
        result = plan(*GANTRY[:2], by, intervals=intervals)
        assert result.verified
        times.append(result.t_end)
        expected = bang_bang(mass) / np.sqrt(1.0 - 4.0 / (3.0 * intervals**2))
        assert result.t_end == pytest.approx(expected, rel=SLACK)
    assert times[0] > times[1] > times[2] > bang_bang(mass)
    assert times[2] < 1.01 * bang_bang(mass)


@pytest.mark.parametrize("intervals", [10, 20, 40])
def test_rest_in_acceleration_costs_two_more_ramps(intervals):
    result = plan(*GANTRY, intervals=intervals, rest="full")
    assert result.verified
    expected = bang_bang(2.0 * MASS) / np.sqrt(1.0 - 2.0 / intervals)
    assert result.t_end == pytest.approx(expected, rel=SLACK)
    ends = result.trajectory.acceleration(np.array([0.0, result.t_end]))
    assert_allclose(ends, 0.0, atol=1e-9)


@pytest.mark.parametrize("rest", ["velocity", "full"])
def test_free_knots_leave_the_shortest_ramps(rest):
    result = plan(*GANTRY, intervals=5, rest=rest, knots="free", shortest_interval=0.2)
    assert result.verified
    ramp = 0.2 / 5
    lost = ramp**2 / 3.0 if rest == "velocity" else 2.0 * ramp - ramp**2
    expected = bang_bang(2.0 * MASS) / np.sqrt(1.0 - lost)
    assert result.t_end == pytest.approx(expected, rel=SLACK)


@pytest.mark.parametrize("rest", ["velocity", "full"])
def test_mesh_refinement_comes_near_bang_bang(rest):
    result = plan(*GANTRY, intervals="auto", rest=rest)
    assert result.verified
    assert bang_bang(2.0 * MASS) <= result.t_end < 1.003 * bang_bang(2.0 * MASS)
    lengths = np.diff(np.unique(result.trajectory.knots))
    assert lengths.max() > 8.0 * lengths.min(), "knots belong where the force switches"


# The acceleration jumps at knots: nodes packed closely around one would let rounding spoil the pieces.
@pytest.mark.parametrize("intervals", [10, 40])
def test_parabolas_are_bang_bang_itself(intervals):
    result = plan(*GANTRY, intervals=intervals, degree=2)
    assert result.t_end == pytest.approx(bang_bang(2.0 * MASS), rel=SLACK)
    assert result.verified, result.verification


JERK = 50.0


@pytest.mark.parametrize(
    "limit", [{"jerk": JERK}, {"torque_rate": JERK * MASS}], ids=str
)
def test_jerk_limit(limit):
    # The jerk is J, -J, -J, J over a quarter of the time each: L = J t^3 / 32.
    free, result = (
        plan(*ALONE, rest="full", settings={"limits": limits}) for limits in ({}, limit)
    )
    largest_free, largest = (
        np.abs(planned.trajectory.jerk(np.linspace(0.0, planned.t_end, 2001))).max()
        for planned in (free, result)
    )
    assert largest_free > 5.0 * JERK
    assert result.verified
    expected = (32.0 * LENGTH / JERK) ** (1.0 / 3.0)
    assert result.t_end == pytest.approx(expected, rel=1e-3)
    assert largest <= JERK * (1.0 + SLACK)
    assert result.t_end > 1.3 * free.t_end


@pytest.mark.parametrize("acceleration", [None, 8.0])
def test_jerk_limit_beside_limits_of_velocity_and_acceleration(acceleration):
    velocity = 1.5
    limits = {"jerk": JERK, "velocity": velocity, "acceleration": acceleration}
    result = plan(*ALONE, intervals=48, rest="full", settings={"limits": limits})
    # The velocity is reached in 2 sqrt(v / J), or in v / a + a / J where the acceleration stays at its limit.
    ramp = (
        2.0 * np.sqrt(velocity / JERK)
        if acceleration is None
        else velocity / acceleration + acceleration / JERK
    )
    assert result.verified
    assert LENGTH / velocity + ramp <= result.t_end < (LENGTH / velocity + ramp) * 1.001


def test_rest_in_jerk_too():
    settings = {"limits": {"jerk": JERK}}
    result = plan(*ALONE, intervals=40, degree=4, rest="jerk", settings=settings)
    assert result.verified
    names = [check.name for check in result.verification.checks]
    assert {"start jerk", "end jerk"} <= set(names)
    jerk = result.trajectory.jerk(np.linspace(0.0, result.t_end, 4001))
    assert_allclose(jerk[[0, -1]], 0.0, atol=1e-4)
    assert np.abs(np.diff(jerk, axis=0)).max() < 0.05 * JERK, "it is continuous"
    best = (32.0 * LENGTH / JERK) ** (1.0 / 3.0)
    assert best < result.t_end < 1.03 * best


@pytest.mark.parametrize("way", [1.0, -1.0], ids=["up", "down"])
def test_lifting_against_gravity(way):
    # Full force up gives F/m - g, full force down F/m + g; from rest to rest t^2 = 2 L (a + b) / (a b).
    force = 30.0
    up, down = force / MASS - 9.81, force / MASS + 9.81
    best = np.sqrt(2.0 * LENGTH * (up + down) / (up * down))
    # The slide along x carries the lift.
    result = plan(
        slides([X, Z], [200.0, force]),
        ["x", "z"],
        [0.0, way * LENGTH],
        settings={"gravity": [0, 0, -9.81]},
    )
    assert result.verified
    assert best <= result.t_end < 1.01 * best


def test_two_slides_along_one_line_recoil_against_each_other():
    # The upper slide's force alone moves the tool: a = F / m. The lower slide is too weak to hold still (30 N against
    # 50 N) and has to give way, which costs no time: the best is that of the upper slide alone.
    weak = 30.0
    pair = (slides([X, X], [weak, FORCE]), ["x"], [LENGTH])
    task = {"redundant_joints": ["j1"]}
    held = {"limits": {"position": {"j1": [-1e-4, 1e-4]}}}
    # The interior-point method: an active-set method has to choose among rows that are all but equal.
    stiff = plan(*pair, settings=held, task={**task, "solver": "uno_interior"})
    result = plan(*pair, task=task)
    assert result.verified
    assert bang_bang(MASS) <= result.t_end < 1.01 * bang_bang(MASS)
    assert np.abs(result.sample(result.t_end / 99).q[:, 0]).max() > 0.05
    # Held in place, the lower slide passes on no more than its own force.
    assert stiff.t_end == pytest.approx(2.0 * np.sqrt(MASS * LENGTH / weak), rel=0.02)
