"""Charts around joint paths: constant rows where they do, rows that follow the null space where it turns, and none."""

import numpy as np
import pytest
from numpy.testing import assert_allclose, assert_array_equal
from scipy.linalg import null_space

from brachis.errors import UnreachableError
from brachis.ik.newton import null_spaces
from brachis.kinematics import ChartRows, chart_around, transversality
from support.charts import jacobian, least_motion, path_from, turned_null_spaces
from support.motions import Sway
from support.scara import START, scara
from support.screw_arms import seven_joints

SEVEN = [0.3, -0.7, 0.4, 1.3, 0.5, -0.9, 0.2]


def line_from(robot, rows, by, start):
    return path_from(robot, rows, [{"line": {"by": by}}], start)


def best_constant(null):
    """Greatest least transversality, over many constant rows (r = 1) for bases (S, n, 1)."""
    rows = np.random.default_rng(0).normal(size=(5000, null.shape[1]))
    rows /= np.linalg.norm(rows, axis=1)[:, None]
    return np.abs(rows @ null[:, :, 0].T).min(axis=1).max()


def move_to(task_map, q, target):
    """The posture in which the tool is at a target nearby, by Newton's method."""
    for _ in range(5):
        missed = target - task_map.value(q)
        q = q + np.linalg.pinv(jacobian(task_map, q[None])[0]) @ missed
    return q


@pytest.fixture(scope="module")
def once_around():
    """Joint path that goes round the whole self-motion while the tool moves a little.

    Tool and base of three links of 1 m are sqrt(3) m apart: no joint turns all around, so each of them turns back
    somewhere, and so does every linear function of them: no constant row stays transversal.
    """
    task_map, path = line_from(scara(), ["x", "y"], [0.0, 0.05], START)
    q, direction = [np.array(START)], None
    while len(q) < 600 and (len(q) < 20 or np.linalg.norm(q[-1] - q[0]) > 0.05):
        null = null_space(jacobian(task_map, q[-1][None])[0])[:, 0]
        direction = null if direction is None or null @ direction > 0.0 else -null
        here = task_map.value(np.array(START))
        q.append(move_to(task_map, q[-1] + 0.04 * direction, here))
    assert len(q) < 600
    s = np.linspace(0.0, 1.0, len(q))
    targets = zip(q, path.sample(s).target, strict=True)
    q = [move_to(task_map, posture, target) for posture, target in targets]
    return task_map, path, s, np.array(q)


@pytest.mark.parametrize(
    "rows, start, make",
    [
        (["x", "y"], START, scara),
        ("pose", SEVEN, seven_joints),
        ("position", SEVEN, seven_joints),
    ],
    ids=["3R", "7R, pose", "7R, position, r = 4"],
)
def test_constant_rows_where_they_do(rows, start, make):
    by = [0.0, 0.3] if make is scara else [0.1, 0.1, -0.1]
    task_map, path = line_from(make(), rows, by, start)
    s = np.linspace(0.0, 1.0, 50)
    chart = chart_around(task_map, path, s, least_motion(task_map, path, start, s))
    assert len(chart.rows.coefficients) == 1
    assert chart.rows.is_constant
    own = chart.rows.at(s[:1])[0][0]
    assert_allclose(own @ own.T, np.eye(len(own)), atol=1e-12)
    assert chart.redundant_joints == ()
    null = np.swapaxes(turned_null_spaces(task_map, chart.reference), 1, 2)
    assert transversality(own[None], null).min() > 0.35
    again = chart.postures(chart.curves(s, chart.reference))
    assert_allclose(again, chart.reference, atol=1e-9)


def test_rows_follow_the_null_space_where_it_turns(once_around):
    task_map, path, s, q = once_around
    null = np.swapaxes(turned_null_spaces(task_map, q), 1, 2)
    assert best_constant(null) < 0.3
    chart = chart_around(task_map, path, s, q)
    assert len(chart.rows.knots)
    assert len(chart.rows.coefficients) < len(s)
    rows, _ = chart.rows.at(s)
    assert transversality(rows, null).min() > 0.35
    augmented = np.concatenate([jacobian(task_map, q), rows], axis=1)
    assert np.linalg.svd(augmented, compute_uv=False)[:, -1].min() > 0.1
    assert_allclose(chart.postures(chart.curves(s, q)), q, atol=1e-9)
    # Between the places, and aside of them.
    t = np.linspace(0.02, 0.98, 200)
    state = chart.state(*Sway(chart, amplitude=0.05)(t))
    targets = path.sample(state.y[:, 0]).target
    assert_allclose(task_map.values(state.q), targets, atol=1e-12)
    assert chart.margins(state).min() > 0.1


def test_given_rows_are_kept_and_name_the_joints_that_they_select():
    task_map, path = line_from(scara(), ["x", "y"], [0.0, 0.2], START)
    s = np.linspace(0.0, 1.0, 20)
    q = least_motion(task_map, path, START, s)
    for rows, names in (
        ([[0.0, 1.0, 0.0]], ("j2",)),
        ([[0.0, 1.0, 1.0]], ()),
        ([[0.0, 2.0, 0.0]], ()),
    ):
        given = ChartRows.constant(np.array(rows))
        chart = chart_around(task_map, path, s, q, given)
        assert chart.rows is given
        assert chart.redundant_joints == names


def test_transversality_of_several_rows_is_that_of_the_worst_direction():
    task_map, _ = line_from(seven_joints(), "position", [0.0, 0.0, 0.1], SEVEN)
    slopes = jacobian(task_map, np.array([SEVEN]))
    null = null_spaces(slopes)
    assert_allclose(slopes @ null, 0.0, atol=1e-12)
    rows = null[0].T.copy()
    assert_allclose(transversality(rows[None], null), [1.0], atol=1e-12)
    aside = null_space(null[0].T)[:, 0]
    rows[2] = 0.6 * rows[2] + 0.8 * aside
    assert_allclose(transversality(rows[None], null), [0.6], atol=1e-12)


def test_a_joint_path_may_stand_still_in_s(once_around):
    """Self-motion while the tool waits: the first posture at a place counts, and the last one of all."""
    task_map, path, s, q = once_around
    waiting = s.copy()
    waiting[100:120] = waiting[100]
    waiting[5] = waiting[4] - 1e-9
    waiting[-6:] = 1.0
    chart = chart_around(task_map, path, waiting, q)
    assert np.diff(chart.s).min() > 0.0
    assert chart.s[0] == 0.0
    assert chart.s[-1] == 1.0
    assert len(chart.s) == len(s) - 19 - 1 - 5
    assert_array_equal(chart.reference[0], q[0])
    assert_array_equal(chart.start, q[0])
    assert_array_equal(chart.reference[-1], q[-1])
    assert_array_equal(chart.reference[99:102], q[[100, 120, 121]])


def test_no_chart_where_the_null_space_turns_too_fast():
    """Round and round the outstretched posture, where the Jacobian loses rank: the null space turns with it."""
    turns, places = 60, 900
    s = np.linspace(0.0, 1.0, places)
    angle = 2.0 * np.pi * turns * s
    q = np.column_stack(
        [np.full(places, 0.3), 0.02 * np.cos(angle), 0.02 * np.sin(angle)]
    )
    task_map, path = line_from(scara(), ["x", "y"], [0.001, 0.0], q[0])
    assert np.linalg.svd(jacobian(task_map, q), compute_uv=False)[:, -1].max() < 0.02
    with pytest.raises(UnreachableError, match="nearly singular along the reference"):
        chart_around(task_map, path, s, q)
