"""What objects show of themselves fits on a screen, has units, and is escaped in notebooks."""

from dataclasses import replace

import numpy as np
import pytest

import brachis
from brachis.common.summary import COLUMNS, LINES, show_value

PUBLIC = {
    "result": lambda result: result,
    "trajectory": lambda result: result.trajectory,
    "samples": lambda result: result.sample(0.001),
    "candidate": lambda result: result.candidate,
    "verification": lambda result: result.verification,
    "solver report": lambda result: result.solver_report,
    "refined": lambda result: result.candidate.refined,
    "program": lambda result: result.candidate.refined.program,
    "least motion": lambda result: result.least_motion,
    "bottleneck": lambda result: result.bottleneck(),
    "sensitivities": lambda result: result.bottleneck().sensitivities,
    "task": lambda result: result.task,
    "robot": lambda result: result.trajectory.robot,
    "limits": lambda result: result.trajectory.robot.limits,
    "friction": lambda result: result.trajectory.robot.friction,
    "stated": lambda result: result.trajectory.robot.urdf_dynamics,
    "task map": lambda result: brachis.task_map_of(result.trajectory.robot, ["x", "y"]),
    "limit spec": lambda result: result.task.robot.limits,
    "spline": lambda _result: brachis.Spline(
        through=np.random.default_rng(0).normal(size=(5000, 2))
    ),
    "path": lambda result: result.task.path,
}


@pytest.fixture(scope="module")
def result():
    return brachis.plan(
        brachis.examples.scara_line,
        redundant_joints=["j1"],
        intervals=8,
        effort="single",
    )


@pytest.mark.parametrize("name", PUBLIC)
def test_reprs_fit_on_a_screen(name, result):
    text = repr(PUBLIC[name](result))
    assert "0x" not in text
    lines = text.splitlines()
    assert len(lines) <= LINES + 2
    assert sum(1 + len(line) // (COLUMNS + 20) for line in lines) <= LINES + 2, (
        "where a terminal breaks them, too"
    )


def test_a_posture_is_shown_without_rounding_errors_and_kept_with_them(result):
    q = result.trajectory.q.copy()
    q[0, 0] = -7.7e-18
    trajectory = replace(result.trajectory, q=q)
    start = replace(result, trajectory=trajectory).to_dict()["start_posture"]
    assert str(start[0]) == "0.0"
    assert start[1:] == result.to_dict()["start_posture"][1:]
    assert trajectory.position(0.0)[0] == -7.7e-18


def test_figures_have_units(result):
    assert "end time                2.5" in repr(result)
    assert " s\n" in repr(result)
    assert "1500 N, 318 Nm" in repr(brachis.robots.tx90l_rail)
    assert "-2 m, -3.142 rad" in repr(brachis.robots.tx90l_rail)


def test_notebooks_show_a_figure_beside_a_table_and_figures_as_pictures(result):
    html = result._repr_html_()
    assert html.count("<table>") == html.count("</table>") == 1
    assert "data:image/png;base64," in html
    assert result.plot("torques")._repr_png_().startswith(b"\x89PNG")
    assert "<table>" in result.trajectory._repr_html_()
    assert "&lt;" in result.verification._repr_html_(), "signs are escaped"


@pytest.mark.parametrize(
    "value, text",
    [
        (1.23456789, "1.23457"),
        (np.zeros((3, 4)), "array (3, 4)"),
        (np.arange(3), "[0, 1, 2]"),
        (list(range(100)), "100 items"),
        ({"a": 1}, "a: 1"),
        ("x" * 500 + "\n", "x" * 84 + "... (501 characters)"),
    ],
)
def test_long_values_have_short_texts(value, text):
    assert show_value(value) == text


def test_a_plot_that_does_not_exist_is_answered_with_those_that_do(result):
    with pytest.raises(brachis.errors.UnknownNameError, match="overview"):
        result.plot("torque_plot")
    assert result.plot("candidates").axes


def test_a_table_has_the_samples(result):
    pandas = pytest.importorskip("pandas")
    table, samples = result.to_dataframe(0.1), result.sample(0.1)
    assert isinstance(table, pandas.DataFrame)
    np.testing.assert_array_equal(table[["qd_j1", "qd_j2", "qd_j3"]], samples.qdot)
    np.testing.assert_array_equal(
        table[["tool_x", "tool_y", "tool_z"]], samples.tool_position
    )


def test_the_message_says_that_pandas_is_missing(result, monkeypatch):
    monkeypatch.setitem(__import__("sys").modules, "pandas", None)
    with pytest.raises(brachis.errors.NotInstalledError, match=r"whl\[pandas\]"):
        result.to_dataframe(0.1)
