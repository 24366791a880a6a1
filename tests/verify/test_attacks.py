"""Saved motions that were tampered with, each so that a coarse look would let it pass: none may end verified."""

from dataclasses import replace

import numpy as np
import pytest

import brachis
from brachis.errors import InputError
from brachis.optimise.bspline import insert_knots
from brachis.robot import dynamics
from brachis.robot.limits import MAGNITUDES
from brachis.task.limit_models import ToolLimits
from brachis.trajectory import Pieces
from brachis.verify import verify_trajectory
from support.checks import check_of, failing_checks, with_entry
from support.effort import QUICK
from support.motions import with_limits

MIDDLE = 60


@pytest.fixture(scope="module")
def rubbing():
    """A motion of the planar arm under Coulomb friction, whose joints reverse, with a torque limit out of the way."""
    friction = {"coulomb": 0.5, "coulomb_velocity": 0.01}
    line = brachis.examples.scara_line
    return brachis.plan(line, friction=friction, **QUICK).trajectory


def ratio(trajectory, kind):
    return check_of(verify_trajectory(trajectory), f"{kind} ratio")


def with_node(trajectory, t, **offsets):
    """The motion with one more node, at time t, there as before but for the offsets."""
    place = int(np.searchsorted(trajectory.times, t))
    values = {
        "times": t,
        "q": trajectory.position(t),
        "qdot": trajectory.velocity(t),
        "qddot": trajectory.acceleration(t),
        "qddot_before": trajectory.acceleration(t),
    }
    arrays = {
        name: np.insert(getattr(trajectory, name), place, value, axis=0)
        for name, value in values.items()
    }
    for name, offset in offsets.items():
        arrays[name][place] += offset
    return replace(trajectory, **arrays)


ORDERS = {
    "position": 0,
    "velocity": 1,
    "acceleration": 2,
    "jerk": 3,
    "torque": 2,
    "torque rate": 3,
    "tool speed": 1,
    "tool acceleration": 2,
    "tool angular speed": 1,
    "power": 1,
    "total power": 1,
}
"""The derivative of the motion that a limit holds down, at the least."""
GROWTH = (0.5, 1.8, 5.0, 50.0)
"""What a position that is off by 1 after 1 s makes of each derivative in between, at the least."""


def limited_to(trajectory, kind):
    """The motion, limited by nothing but one kind, of which it uses two thirds."""
    free = with_limits(
        with_tool_limits(trajectory),
        **dict.fromkeys(MAGNITUDES, np.full(3, np.inf)),
        position_lower=np.full(3, -np.inf),
        position_upper=np.full(3, np.inf),
    )
    t = np.linspace(0.0, trajectory.t_end, 3000)
    states = trajectory.at(t)
    if kind == "position":
        return with_limits(free, position_upper=states.q.max(axis=0) + 1e-3), 1.0
    if kind.startswith("tool"):
        spin = np.abs(states.qdot.sum(axis=1)).max()
        bend = np.linalg.norm(
            np.gradient(np.gradient(states.tool_position, t, axis=0), t, axis=0), axis=1
        )[5:-5].max()
        limit = {
            "speed": states.tool_speed.max(),
            "angular_speed": spin,
            "acceleration": bend,
        }
        name = kind.removeprefix("tool ").replace(" ", "_")
        return with_tool_limits(free, **{name: 1.5 * limit[name]}), 6.0 * limit[name]
    rate = np.abs(np.gradient(states.tau, t, axis=0)).max()
    limit = {
        "velocity": np.abs(states.qdot).max(),
        "acceleration": np.abs(states.qddot).max(),
        "jerk": np.abs(trajectory.jerk_pieces.c).max(),
        "torque": np.abs(states.tau).max(),
        "torque rate": rate,
        "power": np.abs(states.tau * states.qdot).max(),
        "total power": np.abs(states.tau * states.qdot).sum(axis=1).max(),
    }[kind]
    whole = float(1.5 * limit) if kind == "total power" else np.full(3, 1.5 * limit)
    return with_limits(free, **{kind.replace(" ", "_"): whole}), 30.0 * limit


def with_tool_limits(trajectory, **limits):
    return replace(
        trajectory,
        task=trajectory.task.model_copy(update={"tool_limits": ToolLimits(**limits)}),
    )


@pytest.mark.parametrize("kind", ORDERS)
def test_a_limit_that_is_exceeded_between_nodes_close_together(planned, kind):
    limited, excess = limited_to(planned, kind)
    middle = 0.503 * planned.t_end
    order = ORDERS[kind]
    for gap in (1e-6, 2e-5, 1e-4, 1e-3):
        by = max(excess * gap**order / GROWTH[order], 1e-14) * np.eye(3)[1]
        divided = with_node(with_node(limited, middle), middle + gap)
        assert f"{kind} ratio" not in failing_checks(divided), gap
        spiked = with_entry(
            divided, "q", int(np.searchsorted(divided.times, middle + gap)), 2.0 * by
        )
        assert f"{kind} ratio" in failing_checks(spiked), gap


@pytest.mark.parametrize("gap", [1e-6, 2e-5, 1e-4, 1e-3])
def test_a_path_that_is_left_between_nodes_close_together(planned, gap):
    """Both nodes are on the path; their velocities bend the motion off it in between."""
    middle = 0.503 * planned.t_end
    divided = with_node(with_node(planned, middle), middle + gap)
    assert "path error" not in failing_checks(divided)
    place = int(np.searchsorted(divided.times, middle))
    assert "path error" in failing_checks(
        with_entry(divided, "qdot", place, 1e-7 / gap * np.eye(3)[1])
    )


def true_worst_torque(trajectory, pieces=slice(None), places=100):
    """Largest ratio that the trajectory's own evaluation finds at so many places in every piece."""
    begins = trajectory.times[:-1][pieces, None]
    lengths = np.diff(trajectory.times)[pieces, None]
    t = (begins + lengths * np.linspace(0.0, 1.0, places)).ravel()
    states = trajectory.at(np.clip(t, 0.0, trajectory.t_end))
    robot = trajectory.robot
    tau = dynamics.torque(robot, states.q, states.qdot, states.qddot)
    return float(np.abs(tau / robot.limits.torque).max())


@pytest.mark.parametrize("joint", range(3))
@pytest.mark.parametrize(
    "gap, by", [(1e-6, 5e-10), (1e-7, 5e-12), (1e-5, 1e-9), (1e-4, 2e-8)]
)
def test_nodes_close_together_that_disagree(planned, gap, by, joint):
    """Two nodes `gap` seconds apart disagree by `by` rad.

    The torque in between is hidden from any grid of times; its limit and the acceleration's are exceeded.
    """
    spiked = with_node(planned, planned.times[MIDDLE] + gap, q=by * np.eye(3)[joint])
    assert "torque ratio" in failing_checks(spiked)
    check = ratio(spiked, "torque")
    assert check.value == pytest.approx(
        true_worst_torque(spiked, slice(MIDDLE - 2, MIDDLE + 3), 4000), rel=1e-5
    )
    assert abs(check.time - planned.times[MIDDLE]) <= 2.0 * np.diff(planned.times).max()


@pytest.mark.parametrize("joint", range(3))
@pytest.mark.parametrize("name, by", [("qdot", 1e-5), ("qddot", 1e-2)])
def test_nodes_that_are_a_little_off(planned, name, by, joint):
    assert failing_checks(with_entry(planned, name, (MIDDLE, joint), by))


@pytest.mark.parametrize("row", [2, 3])
@pytest.mark.parametrize("piece", [None, 0, -1], ids=["shortest", "first", "last"])
def test_a_coefficient_of_one_piece(planned, piece, row):
    """Inner coefficients leave both nodes as they are, or one of them: a spike of acceleration in between."""
    lengths = np.diff(planned.times)
    chosen = int(np.argmin(lengths)) if piece is None else piece
    torn = replace(planned)
    coefficients = torn.pieces.c.copy()
    coefficients[row, chosen, 1] += 20.0 * lengths[chosen] ** 2
    vars(torn)["pieces"] = Pieces(coefficients, torn.times)
    assert {"torque ratio", "acceleration jump"} & failing_checks(torn)


def test_a_motion_of_one_piece(planned):
    ends = {
        name: getattr(planned, name)[[0, -1]]
        for name in ("times", "q", "qdot", "qddot", "qddot_before")
    }
    assert "path error" in failing_checks(replace(planned, **ends))


def test_a_motion_that_takes_too_long_to_look_at_is_an_error(planned):
    fast = replace(planned, q=1e6 * planned.q, qdot=1e6 * planned.qdot)
    with pytest.raises(
        InputError, match=r"found \d+ instants to check; allowed: 2000000"
    ):
        verify_trajectory(fast)


@pytest.fixture(scope="module")
def finely(planned):
    """Positions at 5000 times."""
    return planned.sample(planned.t_end / 5000).q


@pytest.mark.parametrize("far", [1e4, 1e300, np.inf])
@pytest.mark.parametrize("upper", [False, True])
@pytest.mark.parametrize("joint", range(3))
def test_a_position_beyond_the_near_end_of_a_far_range(
    planned, finely, joint, upper, far
):
    """Half a range of 1e4 rad is no measure of what is beyond its near end."""
    q, beyond = finely[:, joint], 2e-4
    low, high = np.full(3, -np.inf), np.full(3, np.inf)
    low[joint], high[joint] = (
        (-far, q.max() - beyond) if upper else (q.min() + beyond, far)
    )
    limited = with_limits(planned, position_lower=low, position_upper=high)
    assert failing_checks(limited) == {"position ratio"}
    check = ratio(limited, "position")
    assert check.subject == planned.joint_names[joint]
    assert check.value == pytest.approx(1.0 + beyond, abs=1e-6)
    assert not failing_checks(
        with_limits(planned, position_lower=low - beyond, position_upper=high + beyond)
    )


@pytest.mark.parametrize("half", [1e-3, 1e-6])
def test_a_narrow_range_is_measured_in_its_halves(planned, half):
    zero = 0.0 * planned.q
    still = replace(planned, q=zero, qdot=zero, qddot=zero, qddot_before=zero)
    ends = np.array([half, np.inf, np.inf])
    inside = with_limits(still, position_lower=-ends, position_upper=ends)
    assert "position ratio" not in failing_checks(inside)
    beyond = 2e-4 * max(half, 1e-5)
    outside = with_limits(
        still,
        position_lower=np.array([beyond, -np.inf, -np.inf]),
        position_upper=2.0 * ends + beyond,
    )
    assert "position ratio" in failing_checks(outside)


def test_position_velocity_and_acceleration_are_exact_between_the_nodes(planned):
    """The largest values of the polynomials lie between the nodes, and between the points of any grid."""
    t = np.linspace(0.0, planned.t_end, 200_001)
    for kind in ("velocity", "acceleration"):
        limit = np.abs(getattr(planned, kind)(t)).max(axis=0)
        found = ratio(with_limits(planned, **{kind: limit}), kind)
        assert 1.0 - 1e-12 <= found.value < 1.0 + 1e-7
    q = planned.position(t)
    limits = {"position_lower": q.min(axis=0), "position_upper": q.max(axis=0)}
    check = ratio(with_limits(planned, **limits), "position")
    assert 1.0 - 1e-12 <= check.value < 1.0 + 1e-8


@pytest.mark.parametrize("width", [1e-2, 1e-3, 1e-4, 1e-5, 1e-7])
def test_a_peak_within_the_friction_of_a_reversal(rubbing, width):
    """The torque limit is put where the torque just beside a reversal is a little above it, and nowhere else."""
    friction = replace(rubbing.robot.friction, v_eps=np.full(3, width))
    narrow = replace(rubbing, robot=replace(rubbing.robot, friction=friction))
    t, rates = rubbing.times, rubbing.qdot.T
    places = np.argwhere(rates[:, 1:] * rates[:, :-1] < 0.0)
    assert places.size, "no joint reverses: the test would show nothing"
    joint, k = places[len(places) // 2]
    low, high = t[k], t[k + 1]
    for _ in range(80):
        middle = 0.5 * (low + high)
        same = rubbing.velocity(middle)[joint] * rubbing.velocity(low)[joint] > 0.0
        low, high = (middle, high) if same else (low, middle)
    beside = np.logspace(-9, -4, 3000)
    offsets = np.concatenate([-beside[::-1], beside])
    tau = narrow.torque(np.clip(0.5 * (low + high) + offsets, t[k], t[k + 1]))[:, joint]
    limit = np.full(3, 1e6)
    limit[joint] = np.abs(tau).max() / (1.0 + 2e-4)
    check = ratio(with_limits(narrow, torque=limit), "torque")
    assert check.value >= 1.0 + 2e-4 - 1e-5
    assert not check.passed


def with_knots(trajectory, added):
    """The same motion with more knots."""
    fine = np.sort(np.concatenate([trajectory.knots, added]))
    points = insert_knots(
        trajectory.control_points, trajectory.knots, fine, trajectory.degree
    )
    return replace(trajectory, knots=fine, control_points=points)


@pytest.mark.parametrize("interval", range(2, 18, 3))
def test_s_runs_backwards_within_one_interval(planned, interval):
    """So short and so little that ds/dt is negative between two points of a grid alone."""
    knots = np.unique(planned.knots)
    middle = 0.5 * (knots[interval] + knots[interval + 1])
    finer = with_knots(planned, np.linspace(middle - 1e-6, middle + 1e-6, 8))
    place = int(np.searchsorted(finer.knots, middle)) - 2
    both = 0, [place, place + 1]
    back = with_entry(finer, "control_points", both, [1e-6, -1e-6])
    assert "ds/dt below zero" in failing_checks(back)


@pytest.mark.parametrize("point", [2, 8, 13, 20])
@pytest.mark.parametrize("row", [0, 1])
def test_wrong_control_points(planned, row, point):
    assert failing_checks(with_entry(planned, "control_points", (row, point), 1e-6))


def test_a_bump_of_a_spline_between_two_nodes(planned):
    """Knots of its own make room for it where no node is."""
    begin, end = planned.times[MIDDLE : MIDDLE + 2] / planned.t_end
    finer = with_knots(planned, np.linspace(begin, end, 10)[1:-1])
    place = int(np.searchsorted(finer.knots, 0.5 * (begin + end))) - 2
    bump = with_entry(finer, "control_points", (1, place), 1e-5)
    assert failing_checks(bump) == {"redundant joints' splines"}


def test_the_torque_is_found_to_a_hundred_thousandth(planned):
    verification = verify_trajectory(planned)
    assert verification.worst_ratio == pytest.approx(
        true_worst_torque(planned), abs=1e-5
    )
