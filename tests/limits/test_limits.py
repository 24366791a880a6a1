"""Every kind of limit by itself: partials against differences, relaxation, lines of the phase plane, ratios."""

import dataclasses
from types import SimpleNamespace

import numpy as np
import pytest
import yaml

from brachis.limits import (
    LIMIT_BUILDERS,
    Label,
    Limit,
    Moments,
    Partials,
)
from brachis.task import LimitSpec, SpeedTable, Tolerances, ToolLimits
from brachis.task.scene import CollisionSettings, SceneBody
from brachis.task.tolerances import Margins
from support.arrays import assert_near
from support.chains import planar_robot
from support.phases import FRICTION

FALLING = yaml.safe_load("""
j1: [[0, 90], [1, 80], [2, 40]]
j2: [[0, 90], [0.5, 30], [1, 20]]
j3: [[0, 100], [1, 100], [2, 20]]
""")
ROBOT = planar_robot(
    "RRP",
    "xz",
    friction={**FRICTION, "viscous": 1.0},
    limits=LimitSpec(
        power=[40, None, 60],
        total_power=70,
        rms_torque=[30, 20, None],
        torque_speed=FALLING,
    ),
)
TOOL = ToolLimits(
    speed=SpeedTable(s=[0.0, 0.5, 0.5, 1.0], speed=[0.7, 1.0, 0.9, 1.1]),
    acceleration=2.0,
    angular_speed=1.5,
)
SCENE = (
    SceneBody(name="post", box=(0.3, 0.2, 0.4), position=(0.9, 0.3, 0.5)),
    SceneBody(name="ball", sphere=0.1, position=(-0.4, 0.2, 0.4)),
)
TASK = SimpleNamespace(
    tool_limits=TOOL,
    custom_limits={},
    scene=SCENE,
    frames={},
    collisions=CollisionSettings(capsules="auto"),
    collision_mode="avoid",
    tolerances=Tolerances(),
    margins=Margins(singularity=0.2, joint_ends=0.1),
    task_space=("x", "z"),
)
OF_TOLERANCES = ("tool_tilt", "tool_distance", "tool_range")
"""They need the virtual joints of the tool; see `test_tolerances.py`."""
RNG = np.random.default_rng(3)
# The path coordinates lie off all kinks.
STATES = Moments(
    *(RNG.normal(size=(6, 3)) for _ in range(4)),
    s=np.array([0.085, 0.15, 0.315, 0.59, 0.7, 0.93]),
)
ORDERS = ("q", "qdot", "qddot", "qdddot")
BY = (*ORDERS, "s")


@pytest.fixture(params=sorted(set(LIMIT_BUILDERS) - set(OF_TOLERANCES)))
def limit(request):
    some = np.array([5.0, np.inf, 7.0])
    limits = dataclasses.replace(
        ROBOT.limits, acceleration=some, jerk=10.0 * some, torque_rate=100.0 * some
    )
    robot = dataclasses.replace(ROBOT, limits=limits)
    built = LIMIT_BUILDERS[request.param](robot, TASK)
    assert built is not None, f"ROBOT and TASK of this file have no {request.param}"
    assert built.kind == request.param
    return built


def stated_slopes(partials, part, column):
    """Slopes by s, or by one joint's position or one of its derivatives, (K, c); None stands for zeros."""
    exact = getattr(partials, part)
    if exact is None:
        return np.zeros((len(STATES.q), partials.size))
    return exact if part == "s" else exact[:, :, column]


def test_partials_equal_differences(limit):
    h, found = 1e-4, limit.partials(STATES)
    assert any(getattr(found, part) is not None for part in ORDERS)
    for part in BY:
        for column in range(1 if part == "s" else 3):
            which = ... if part == "s" else (slice(None), column)
            moved = []
            for step in (2.0, 1.0, -1.0, -2.0):
                arrays = {name: getattr(STATES, name).copy() for name in BY}
                arrays[part][which] += step * h
                moved.append(limit.values(Moments(**arrays)))
            expected = (-moved[0] + 8.0 * moved[1] - 8.0 * moved[2] + moved[3]) / (
                12.0 * h
            )
            stated = stated_slopes(found, part, column)
            assert_near(stated, expected, 1e-6, least=1.0)


def test_every_value_has_a_label_and_a_figure(limit):
    count = len(limit.lower)
    assert limit.values(STATES).shape == (6, count)
    assert len(limit.labels) == len(limit.upper) == count
    assert len({str(label) for label in limit.labels}) == count
    assert all(
        label.unit
        and label.key.split(".")[0] in ("robot", "tool_limits", "collisions", "margins")
        for label in limit.labels
    )
    assert {bound.column for bound in limit.bounds} == set(range(count))


def test_relaxing_a_figure_lets_its_own_bounds_out_and_no_others(limit):
    for bound in limit.bounds:
        other = limit.relax(bound, 0.1 * bound.full_scale)
        np.testing.assert_allclose(
            other.values(STATES), limit.values(STATES), rtol=1e-12, atol=1e-12
        )
        with np.errstate(invalid="ignore"):  # inf - inf
            low, high = (
                np.nan_to_num(limit.lower - other.lower),
                np.nan_to_num(other.upper - limit.upper),
            )
        for moves, end in ((low, "upper"), (high, "lower")):
            assert not np.delete(moves, bound.column).any()
            assert (
                moves[bound.column] == pytest.approx(0.0)
                if bound.side == end
                else moves[bound.column] >= 0.0
            )
        assert max(low[bound.column], high[bound.column]) > 5e-4


@pytest.mark.parametrize(
    "lower, upper",
    [(0.0, 0.3), (-0.1, -0.05), (-np.inf, 0.2), (0.5, np.inf), (-3.0, 4.0)],
)
def test_a_ratio_is_above_one_exactly_beyond_the_bounds(lower, upper):
    """However narrow the bounds are, or far from zero."""

    class Sum(Limit):
        kind = "sum"
        labels = (Label("j1", "sum", "rad"),)

        def values(self, motion):
            return motion.q[:, :1]

        def partials(self, motion):
            return Partials(q=np.ones((len(motion.q), 1, 3)))

    limit = Sum()
    limit.lower, limit.upper = np.array([lower]), np.array([upper])
    values = np.linspace(-4.0, 5.0, 901)[:, None] + 1e-6
    ratio, violation = limit.ratio(values), limit.violation(values)
    assert np.array_equal(np.abs(ratio) > 1.0, violation > 0.0)
    beyond = violation > 0.0
    np.testing.assert_allclose(np.abs(ratio)[beyond], 1.0 + violation[beyond])
    for bound, sign in ((lower, -1.0), (upper, 1.0)):
        if np.isfinite(bound):
            assert limit.ratio(np.array([[bound]]))[0, 0] == sign


PAIRS = yaml.safe_load("""
torque: {j1: [-20.0, 60.0], j2: [-70.0, 5.0]}
velocity: {j2: [-1.0, 4.0], j3: 3.0}
""")


def pairs(kind):
    robot = planar_robot(
        "RRP", "xz", friction={**FRICTION, "viscous": 1.0}, limits=LimitSpec(**PAIRS)
    )
    return LIMIT_BUILDERS[kind](robot, TASK)


@pytest.mark.parametrize("kind", ["torque", "velocity"])
def test_pairs_of_limits_are_the_bounds_of_their_quantity(kind):
    limit = pairs(kind)
    test_partials_equal_differences(limit)
    test_relaxing_a_figure_lets_its_own_bounds_out_and_no_others(limit)
    figures = {
        (str(limit.labels[bound.column]), bound.side): bound.figure
        for bound in limit.bounds
    }
    first = {
        "torque": ("j1 torque", -20.0, 60.0),
        "velocity": ("j2 velocity", -1.0, 4.0),
    }[kind]
    assert (figures[first[0], "lower"], figures[first[0], "upper"]) == first[1:]
    assert figures["j3 force" if kind == "torque" else "j3 velocity", None] > 0.0
