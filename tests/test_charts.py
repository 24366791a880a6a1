"""Plans in charts, from the task to the saved motion and its bottlenecks."""

import dataclasses

import numpy as np
import pytest
from numpy.testing import assert_allclose, assert_array_equal
from scipy.linalg import null_space

import brachis
from brachis.errors import (
    DecompositionError,
    ResultFileError,
    StartError,
)
from brachis.kinematics import ChartRows
from brachis.robot import task_map_of
from brachis.task import task_with
from brachis.trajectory import Trajectory
from brachis.verify import verify_trajectory
from support.charts import jacobian
from support.checks import failed_checks
from support.result_files import with_parts
from support.scara import START, scara


def scara_line(angle, **changes):
    line = brachis.Line(length=1.0, angle_deg=angle)
    task = {"start": START, "task_space": ["x", "y"], "path": line, "intervals": 20}
    return brachis.plan(scara(), **(task | changes))


@pytest.fixture(scope="module")
def result():
    return scara_line(270)


@pytest.fixture
def saved_file(result, tmp_path):
    path = tmp_path / "result.npz"
    result.trajectory.save(path)
    return path


def test_the_line_at_270_degrees(result):
    """The best closed form of a single joint comes to 1.5754 s at these knots: joint 3, before its limits are held."""
    assert result.verified
    assert result.t_end <= 1.572
    assert result.trajectory.branch == "chart"


def test_the_best_choice_of_joints_is_no_faster(result):
    other = scara_line(270, redundant_joints=["j3"])
    assert other.trajectory.redundant_joints == ("j3",)
    assert not len(other.trajectory.chart_rows)
    assert result.t_end <= other.t_end * 1.0005


@pytest.mark.parametrize("redundant", ["auto", ["j1"]])
def test_an_end_posture_may_have_few_digits(result, redundant):
    """The motion ends at the posture on the path that is nearest to the given one, and is held to that."""
    exact = result.trajectory.position(result.t_end)
    end = np.round(exact, 7)
    assert np.abs(end - exact).max() > 1e-9
    reached = scara_line(270, end=end, redundant_joints=redundant)
    trajectory = reached.trajectory
    assert reached.verified
    assert 1e-9 < np.abs(trajectory.position(reached.t_end) - end).max() < 1e-6
    task_map = task_map_of(trajectory.robot, ["x", "y"])
    self_motion = null_space(jacobian(task_map, end[None])[0])[:, 0]
    aside = task_with(reached.task, end=end + 1e-5 * self_motion)
    verification = verify_trajectory(dataclasses.replace(trajectory, task=aside))
    assert failed_checks(verification) == ["end posture"]


def test_a_saved_motion_passes_its_checks_again(result, saved_file):
    loaded = Trajectory.load(saved_file)
    assert loaded.branch == "chart"
    assert loaded.redundant_joints == result.trajectory.redundant_joints
    assert_array_equal(loaded.chart_rows, result.trajectory.chart_rows)
    assert_array_equal(loaded.chart_knots, result.trajectory.chart_knots)
    t = np.linspace(0.0, loaded.t_end, 50)
    assert_allclose(loaded.position(t), result.trajectory.position(t), atol=1e-14)
    assert verify_trajectory(loaded).passed
    # The curves of the chart describe the motion: sigma = C q - p.
    rows = ChartRows(loaded.chart_rows, loaded.chart_knots)
    sigma = rows.values(loaded.path_coordinate(loaded.times), loaded.q)
    assert_allclose(loaded.redundant_spline(loaded.times), sigma, atol=1e-8)


BROKEN = {
    "rows NaN": {"chart_rows": lambda a: a * np.nan},
    "rows of fewer joints": {"chart_rows": lambda a: a[:, :, 1:]},
    "rows a number": {"chart_rows": np.array(3.0)},
    "more rows": {"chart_rows": lambda a: np.repeat(a, 2, axis=1)},
    "several rows without knots": {"chart_rows": lambda a: np.repeat(a, 8, axis=0)},
    "knots of constant rows": {"chart_knots": np.linspace(0.0, 1.0, 7)},
    "knots without rows": {
        "chart_rows": np.empty((0, 0, 0)),
        "chart_knots": np.linspace(0.0, 1.0, 7),
    },
    "knots descending": {
        "chart_rows": lambda a: np.repeat(a, 8, axis=0),
        "chart_knots": np.linspace(1.0, 0.0, 14),
    },
    "knots all the same": {
        "chart_rows": lambda a: np.repeat(a, 8, axis=0),
        "chart_knots": np.zeros(14),
    },
}


@pytest.mark.parametrize("case", BROKEN)
def test_a_broken_chart_is_an_error(case, saved_file):
    with_parts(saved_file, **BROKEN[case])
    with pytest.raises(
        ResultFileError, match=r"the result file is broken|not a brachis result"
    ) as caught:
        Trajectory.load(saved_file)
    assert caught.value.where == str(saved_file)


def test_a_chart_that_is_not_broken_is_read(saved_file):
    """The same rows as splines."""
    knots = np.concatenate([np.zeros(6), [0.4, 0.6], np.ones(6)])
    with_parts(
        saved_file, chart_rows=lambda a: np.repeat(a, 8, axis=0), chart_knots=knots
    )
    assert len(Trajectory.load(saved_file).chart_knots) == 14


@pytest.mark.parametrize(
    "robot, space, by",
    [
        ("scara3", ["x", "y"], [-0.3, 0.2]),
        ("gen3", "pose", [0.0, 0.1, -0.1]),
    ],
)
def test_a_singular_start_is_an_error(robot, space, by):
    start = [0.0] * getattr(brachis.robots, robot).n
    with pytest.raises(StartError, match="singular"):
        brachis.plan(robot, start=start, task_space=space, path=brachis.Line(by=by))


def test_numeric_guesses_need_a_closed_form():
    with pytest.raises(DecompositionError):
        brachis.plan(
            "gen3",
            start=[0.3, 0.4, 0.3, -1.2, 0.3, -0.9, 0.2],
            task_space="pose",
            path=brachis.Line(by=[0.0, 0.05, -0.05]),
            search={"guesses": "numeric"},
        )
