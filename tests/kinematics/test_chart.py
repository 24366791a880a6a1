"""The chart's motion against differences in time and against the closed form's, its derivatives against differences."""

import pickle

import numpy as np
import pytest
from numpy.testing import assert_allclose, assert_array_equal

from brachis.errors import UnreachableError
from brachis.kinematics import ChartMap, ChartRows
from support.chains import planar_robot
from support.charts import chart_of, jacobian, least_motion, path_from
from support.motions import (
    PLANAR,
    THREE_CIRCLES,
    TOO_FAR,
    Sway,
    arc_path,
    check_derivatives,
    check_time_derivatives,
)
from support.scara import scara
from support.screw_arms import seven_joints
from support.spatial import START, rail_arm

SEVEN = [0.3, -0.7, 0.4, 1.3, 0.5, -0.9, 0.2]
SPATIAL = {
    "r = 1, 7R, pose": (seven_joints, "pose", SEVEN, ["j1"]),
    "r = 1, rail, pose": (rail_arm, "pose", list(START), ["j1"]),
    "r = 4, 7R, position": (seven_joints, "position", SEVEN, None),
    "r = 2, rail, free roll": (rail_arm, "pose_free_roll", [*START, 0.0], None),
}


def bent_path(robot, start):
    """A circular arc in space near the tool, along which the orientation is kept."""
    tool = robot.tool_placement(np.array(start[: robot.n], dtype=float)).translation
    via, to = tool + np.array([0.06, 0.05, -0.04]), tool + np.array([0.02, 0.12, -0.1])
    return [{"arc": {"via": via.tolist(), "to": to.tolist()}}]


def case_of(name):
    """Robot, rows, segments, start posture and redundant joints of a case."""
    if name in PLANAR:
        pattern, plane, rows, start, redundant = PLANAR[name]
        robot = planar_robot(pattern, plane)
        arc = arc_path(robot, rows, start, angle_deg=35.0)
        return robot, rows, arc, start, redundant
    make, rows, start, redundant = SPATIAL[name]
    robot = make()
    return robot, rows, bent_path(robot, start), start, redundant


CASES = [
    (name, kind) for name in (*PLANAR, *SPATIAL) for kind in ("constant", "following")
]
CASES += [
    (name, "swinging")
    for name in ("r = 1, 3R", "r = 2, PPRR", "r = 1, 7R, pose", "r = 4, 7R, position")
]
T = np.linspace(0.02, 0.97, 25)  # not at the knots of rows that follow


@pytest.fixture(params=CASES, ids=str, scope="module")
def motion(request):
    name, kind = request.param
    robot, rows, segments, start, _ = case_of(name)
    return Sway(chart_of(robot, rows, segments, start, kind), amplitude=0.1)


def test_path_is_met_exactly(motion):
    chart = motion.joint_map
    y, *_ = motion(T)
    q = chart.postures(y)
    targets = chart.path.sample(y[:, 0]).target
    missed = chart.task_map.difference(targets, chart.task_map.values(q))
    assert np.abs(missed).max() < 1e-12
    assert_allclose(chart.curves(y[:, 0], q), y, atol=1e-12)


def test_motion_is_the_time_derivative_of_the_postures(motion):
    check_time_derivatives(motion, T, exact=1e-12)


def test_derivatives(motion):
    exact = check_derivatives(motion, T)
    for part in (exact.qdot_y, exact.qddot_y, exact.qddot_ydot):
        assert np.abs(part).max() > 0.05


def least_singular(chart, q, s):
    """Least singular value of J over C, (K,), from Pinocchio's Jacobian."""
    parts = jacobian(chart.task_map, q), chart.rows.at(s)[0]
    augmented = np.concatenate(parts, axis=1)
    return np.linalg.svd(augmented, compute_uv=False)[:, -1]


def test_margins(motion):
    """They are the least singular value as a part of the reference's median one."""
    chart, h = motion.joint_map, 1e-6
    state = chart.state(*motion(T))
    along = least_singular(chart, chart.reference, chart.s)

    def expected(q, s):
        return least_singular(chart, q, s) / np.median(along)

    s, q = state.y[:, 0], state.q
    assert_allclose(chart.margins(state)[:, 0], expected(q, s), rtol=1e-9)
    assert_allclose(chart.start_margins(), along[:1] / np.median(along), rtol=1e-9)
    by_q, by_s = chart.margin_gradient(state)
    for joint, step in enumerate(h * np.eye(chart.robot.n)):
        difference = (expected(q + step, s) - expected(q - step, s)) / (2.0 * h)
        assert_allclose(
            by_q[:, 0, joint], difference, atol=2e-7 * max(1.0, np.abs(by_q).max())
        )
    difference = (expected(q, s + h) - expected(q, s - h)) / (2.0 * h)
    assert_allclose(by_s[:, 0], difference, atol=2e-7 * max(1.0, np.abs(by_s).max()))


def test_history_does_not_matter(motion):
    """Near the reference or as far as the margin allows: a map that was asked much before answers like a new one."""
    used = motion.joint_map
    rng = np.random.default_rng(7)
    for amplitude in (0.05, 0.15, 0.3):
        y = np.column_stack(
            [rng.uniform(0.0, 1.0, 60), rng.normal(0.0, amplitude, (60, used.r))]
        )
        y[:, 1:] += used.coordinates(0.0, used.start)[1:]
        fresh = ChartMap(
            used.task_map, used.path, used.rows, used.s, used.reference
        ).postures(y)
        good = np.isfinite(fresh).all(axis=1)
        good[good] = least_singular(used, fresh[good], y[good, 0]) > 0.05
        y, fresh = y[good], fresh[good]
        assert len(y) > 20
        zero = np.zeros_like(y)
        every = np.arange(len(y))
        for order in (rng.permutation(every), rng.permutation(every), every):
            assert_allclose(
                used.state(y[order], zero, zero, zero).q, fresh[order], atol=1e-11
            )


def test_a_copy_by_pickle_answers_alike(motion):
    chart = motion.joint_map
    parts = motion(T)
    copy = pickle.loads(pickle.dumps(chart))  # noqa: S301  (our own)
    first, second = chart.state(*parts), copy.state(*parts)
    for name in ("q", "qdot", "qddot", "gradient"):
        assert_allclose(getattr(second, name), getattr(first, name), atol=1e-10)
    assert_array_equal(copy.start, chart.start)


@pytest.mark.parametrize("turns", [-3, 0, 2])
def test_angles_stay_in_the_turns_of_the_reference(turns):
    """Joint 1 follows a circle about the base three times, from any turn on."""
    start = np.array([0.2 + 2.0 * np.pi * turns, 1.0, 0.6])
    task_map, path = path_from(scara(), ["x", "y"], THREE_CIRCLES, start)

    def around(s):
        return start + np.outer(6.0 * np.pi * s, [1.0, 0.0, 0.0])

    s = np.linspace(0.0, 1.0, 200)
    rows = ChartRows.constant(np.array([[0.3, 0.6, 0.7]]))
    chart = ChartMap(task_map, path, rows, s, around(s))
    fine = np.linspace(0.0, 1.0, 777)
    expected = around(fine)
    y = chart.curves(fine, expected)
    assert_allclose(chart.postures(y), expected, atol=1e-9)
    assert_allclose(chart.postures(y[::-1]), expected[::-1], atol=1e-9)
    begin, end = (chart.coordinates(1.0, q) for q in expected[[0, -1]])
    assert_allclose(end, y[-1], atol=1e-12)
    assert end[1] != pytest.approx(begin[1], abs=1.0)


def test_no_posture_beyond_reach_nor_beyond_the_self_motion():
    start = np.array([0.2, 1.0, 0.6])
    task_map, path = path_from(scara(), ["x", "y"], TOO_FAR, start)
    s = np.linspace(0.0, 0.1, 9)
    reference = least_motion(task_map, path, start, s)
    rows = ChartRows.constant(np.array([[0.0, 0.0, 1.0]]))
    chart = ChartMap(task_map, path, rows, s, reference)
    y = np.array([[0.0, 0.6], [1.0, 0.6], [0.05, 9.0]])
    assert_array_equal(np.isfinite(chart.postures(y)).all(axis=1), [True, False, False])
    zero = np.zeros((1, 2))
    chart.state(y[:1], zero, zero, zero)
    for beyond in (y[1:2], y[2:]):
        with pytest.raises(UnreachableError, match="no posture"):
            chart.state(beyond, zero, zero, zero)
