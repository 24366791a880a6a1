"""Every kind of limit by itself: partials against differences, relaxation, lines of the phase plane, ratios."""

from __future__ import annotations

import dataclasses
from types import SimpleNamespace

import numpy as np
import pytest

from brachis.limits import TABLE, Label, Limit, Moments, Partials, limits_of
from support.chains import planar_robot
from support.phases import FRICTION

ROBOT = planar_robot("RRP", "xz", friction={**FRICTION, "viscous": 1.0})
TASK = SimpleNamespace(tool_limits=SimpleNamespace(speed=0.7), custom_limits={})
ORDERS = ("q", "qdot", "qddot", "qdddot")
RNG = np.random.default_rng(3)
STATES = Moments(*(RNG.normal(size=(6, 3)) for _ in range(4)))


@pytest.fixture(params=sorted(TABLE))
def limit(request):
    some = np.array([5.0, np.inf, 7.0])
    limits = dataclasses.replace(ROBOT.limits, acceleration=some, jerk=10.0 * some, torque_rate=100.0 * some)
    built = TABLE[request.param](dataclasses.replace(ROBOT, limits=limits), TASK)
    assert built.kind == request.param
    return built


def test_partials_equal_differences(limit):
    h, found = 1e-4, limit.partials(STATES)
    assert any(getattr(found, part) is not None for part in ORDERS)
    for part in ORDERS:
        exact = getattr(found, part)
        for joint in range(3):
            moved = []
            for step in (2.0, 1.0, -1.0, -2.0):
                arrays = {name: getattr(STATES, name).copy() for name in ORDERS}
                arrays[part][:, joint] += step * h
                moved.append(limit.values(Moments(**arrays)))
            expected = (-moved[0] + 8.0 * moved[1] - 8.0 * moved[2] + moved[3]) / (12.0 * h)
            mine = np.zeros_like(expected) if exact is None else exact[:, :, joint]
            np.testing.assert_allclose(mine, expected, atol=1e-6 * max(1.0, np.abs(expected).max()))


def test_every_value_has_a_label_and_a_figure(limit):
    count = len(limit.lower)
    assert limit.values(STATES).shape == (6, count)
    assert len(limit.labels) == len(limit.upper) == count
    assert len({str(label) for label in limit.labels}) == count
    assert all(label.unit and label.key.split(".")[0] in ("robot", "tool_limits") for label in limit.labels)
    assert {bound.column for bound in limit.bounds} == set(range(count))


def test_relaxing_a_figure_lets_its_own_bounds_out_and_no_others(limit):
    for bound in limit.bounds:
        other = limit.relaxed(bound, 0.1 * bound.whole)
        np.testing.assert_array_equal(other.values(STATES), limit.values(STATES))
        with np.errstate(invalid="ignore"):  # inf - inf
            low, high = np.nan_to_num(limit.lower - other.lower), np.nan_to_num(other.upper - limit.upper)
        for moves, end in ((low, "upper"), (high, "lower")):
            assert not np.delete(moves, bound.column).any()
            assert moves[bound.column] == pytest.approx(0.0) if bound.end == end else moves[bound.column] >= 0.0
        assert max(low[bound.column], high[bound.column]) > 0.05


def test_ratios_are_one_at_the_bounds_and_violations_begin_there(limit):
    for at, sign in ((limit.upper, 1.0), (limit.lower, -1.0)):
        values = np.where(np.isfinite(at), at, 0.0)[None]
        on = np.isfinite(at)
        np.testing.assert_allclose(limit.ratio(values)[0, on], sign)
        np.testing.assert_allclose(limit.violation(values)[0, on], 0.0, atol=1e-12)


def test_lines_of_the_phase_plane_are_the_limit_along_a_path(limit):
    """Without velocity friction: values (or, for ceilings, their squares) are a u + b x + c."""
    free = dataclasses.replace(ROBOT, friction=planar_robot("RRP", "xz").friction, limits=limit_source(limit))
    limit = TABLE[limit.kind](free, TASK)
    q, q_ds, q_dds = (RNG.normal(size=(5, 3)) for _ in range(3))
    lines = limit.lines(q, q_ds, q_dds)
    if lines is None:
        assert limit.kind in ("position", "jerk", "torque_rate")
        return
    u, speed = 0.7, 1.3
    values = limit.values(Moments(q, q_ds * speed, q_ds * u + q_dds * speed**2, np.zeros_like(q)))
    of_u = 0.0 if lines.u is None else lines.u * u
    expected = values**2 if lines.u is None else values
    np.testing.assert_allclose(of_u + lines.x * speed**2 + lines.constant, expected, atol=1e-9)


def limit_source(limit):
    given = {
        kind: np.array([5.0, np.inf, 7.0]) for kind in ("acceleration", "jerk", "torque_rate") if kind == limit.kind
    }
    return dataclasses.replace(ROBOT.limits, **given)


def test_limits_come_in_the_order_of_the_table_and_only_where_there_is_one():
    kinds = [limit.kind for limit in limits_of(ROBOT, TASK)]
    assert kinds == ["torque", "velocity", "position", "tool_speed"]
    open_task = SimpleNamespace(tool_limits=SimpleNamespace(speed=None), custom_limits={})
    assert "tool_speed" not in [limit.kind for limit in limits_of(ROBOT, open_task)]


@pytest.mark.parametrize(("lower", "upper"), [(0.0, 0.3), (-0.1, -0.05), (-np.inf, 0.2), (0.5, np.inf), (-3.0, 4.0)])
def test_a_ratio_is_above_one_exactly_where_a_bound_is_violated(lower, upper):
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
