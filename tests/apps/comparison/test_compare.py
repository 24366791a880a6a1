"""Motions that run today beside their plans: never slower, along the same path, within the same limits."""

import dataclasses
import importlib.util
import json
import sys
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest
from numpy.testing import assert_allclose

import brachis
from brachis.apps import comparison
from brachis.apps.comparison import compare, plot_both_motions
from brachis.apps.comparison.comparison import tasks_of
from brachis.robot import bind
from support.effort import QUICK

ROOT = Path(__file__).parents[3]
SEED, DT = 4, 0.002


@pytest.fixture(scope="module")
def today_benchmark():
    pytest.importorskip("toppra")
    with pytest.MonkeyPatch.context() as patch:
        patch.syspath_prepend(str(ROOT / "benchmarks"))
        return _load()


def _load():
    spec = importlib.util.spec_from_file_location("today", ROOT / "studies/today.py")
    module = importlib.util.module_from_spec(spec)
    sys.modules["today"] = module  # dataclasses look their module up
    spec.loader.exec_module(module)
    return module


@pytest.fixture(scope="module")
def today(today_benchmark):
    return today_benchmark.case(SEED)


@pytest.fixture(scope="module")
def file(today, tmp_path_factory):
    path = tmp_path_factory.mktemp("today") / "today.csv"
    today.write(path, DT)
    return path


@pytest.fixture(scope="module")
def task(today):
    return {
        **today.content,
        "spline": {"intervals": 12},
        "search": QUICK,
        "start": {"joints": [0.0]},
        "path": [{"line": {"by": [1.0]}}],
    }


@pytest.fixture(scope="module")
def both_motions(file, task):
    return compare(file, task=task)


def test_the_path_is_recovered_and_the_plan_is_faster(both_motions, today):
    assert today.miss(both_motions.recorded, DT) < 1e-6
    assert both_motions.result.verified
    assert 0.05 < both_motions.saved < 0.5
    ratio = both_motions.result.t_end / both_motions.recorded.t_end
    assert both_motions.saved == 1.0 - ratio
    assert both_motions.verdict.startswith(f"{100 * both_motions.saved:.1f} % faster: ")


def test_both_begin_in_one_posture_and_end_in_one_place(both_motions):
    planned, recorded = both_motions.result.trajectory, both_motions.recorded
    assert_allclose(planned.q[0], recorded.q[0], atol=1e-9)
    _, task_map = bind(recorded.robot, recorded.task.task_space)
    ends = (task_map.value(motion.q[-1]) for motion in (planned, recorded))
    assert np.abs(task_map.difference(*ends)).max() < 1e-6
    assert np.abs(planned.q[-1] - recorded.q[-1]).max() > 0.01


def test_the_limits_are_the_same_and_remarks_name_what_exceeds_them(
    both_motions, today
):
    kinds = [use.limit for use in both_motions.uses]
    assert kinds == ["torque", "velocity", "acceleration"]
    assert all(use.planned <= 1.0 + 1e-4 for use in both_motions.uses)
    worst = max(use.recorded for use in both_motions.uses)
    assert worst == pytest.approx(
        today.largest_ratio(), abs=1e-3
    )  # what the rows prove
    assert all(use.recorded <= use.recorded_up_to for use in both_motions.uses)
    *exceeded, jumps = both_motions.remarks  # as toppra's accelerations do at both ends
    assert "the plan may do so too" in jumps
    assert bool(both_motions.exceeded) == (worst > 1.0 + 1e-4) == bool(exceeded)
    assert all("the recorded motion exceeds the" in remark for remark in exceeded)
    data = json.loads(json.dumps(both_motions.to_dict()))
    assert data["t_end_today"] == both_motions.recorded.t_end
    assert data["today_within_limits"] is (not both_motions.exceeded)
    assert both_motions.verdict in str(both_motions)


def test_what_may_be_between_rows_of_few_digits_is_no_fact(
    both_motions, today, task, tmp_path
):
    t = np.append(np.arange(0.0, today.motion.duration, 0.008), today.motion.duration)
    file = tmp_path / "today.csv"
    header = ",".join(["t", *today.robot.joint_names])
    rows = np.column_stack([t, today.motion(t)])
    np.savetxt(file, rows, delimiter=",", header=header, comments="", fmt="%.4f")
    rough = brachis.import_motion(file, task=task)
    verification = brachis.verify_trajectory(rough)
    coarse = dataclasses.replace(
        both_motions,
        recorded=rough,
        proven=comparison.bound_ratios(rough),
        verification=verification,
    )
    assert verification.worst_ratio > 1.02  # the overshoot of a smoothing spline
    assert not coarse.exceeded
    assert not any("exceeds" in remark for remark in coarse.remarks)
    use = max(coarse.uses, key=lambda use: use.recorded_up_to)
    assert use.recorded_up_to == verification.worst_ratio
    percent = f"{100 * use.recorded_up_to:.1f} %"
    assert use.recorded_text.endswith(f", between the rows up to {percent}")
    assert f"{use.limit}: {use.recorded_text} used by the recorded" in str(coarse)
    (band,) = plot_both_motions(coarse).axes[-1].collections
    highest = band.get_paths()[0].vertices[:, 1].max()
    assert highest == pytest.approx(use.recorded_up_to, rel=0.02)


@pytest.mark.parametrize("factor, is_doubted", [(2.0, False), (1000.0, True)])
def test_a_remark_doubts_a_recorded_motion_far_faster_than_its_limits_allow(
    both_motions, factor, is_doubted
):
    slow = SimpleNamespace(
        t_end=factor * both_motions.recorded.t_end,
        verification=both_motions.result.verification,
    )
    remarks = dataclasses.replace(both_motions, result=slow).remarks
    said = f"{factor:.0f} times as fast as the plan: the unit of its times may not"
    assert any(said in remark for remark in remarks) == is_doubted


def test_the_figure_shows_both(both_motions):
    figure = plot_both_motions(both_motions)
    _, speed, ratio = figure.axes
    expected = [both_motions.result.t_end, both_motions.recorded.t_end]
    for ax in figure.axes:
        ends = sorted(line.get_xdata()[-1] for line in ax.lines[:2])
        assert ends == pytest.approx(expected)
    t, speeds = speed.lines[1].get_data()
    motion = both_motions.result.trajectory.at(t)
    assert_allclose(speeds, motion.tool_speed)
    assert max(ratio.lines[1].get_ydata()) == pytest.approx(1.0, abs=1e-3)


def test_a_plan_may_keep_the_end_posture(both_motions):
    kept = compare(both_motions.recorded, keep_end=True)
    assert_allclose(
        kept.result.trajectory.q[-1], both_motions.recorded.q[-1], atol=1e-6
    )
    assert kept.saved <= both_motions.saved + 1e-3


def test_other_plans_follow_a_slower_first_one(both_motions, monkeypatch):
    """The motion of a plan cannot be beaten with the same intervals: finer ones come next, then its own joint path."""
    tasks = []

    def plan(_robot, task, **_):
        tasks.append((task.spline.intervals, task.task_space))
        raise brachis.PlanningError("none") if len(tasks) < 3 else Planned

    class Planned(Exception):  # noqa: N818
        pass

    monkeypatch.setattr(sys.modules["brachis.apps.comparison.comparison"], "plan", plan)
    with pytest.raises(Planned):
        compare(both_motions.recorded)
    assert tasks == [(12, ("x", "y")), (36, ("x", "y")), (36, "joints")]


def test_the_joint_path_of_today_has_a_timing(both_motions):
    *_, last = tasks_of(both_motions.recorded, keep_end=False)
    result = brachis.plan(both_motions.recorded.robot, last)
    assert result.verified
    assert result.t_end < 1.02 * both_motions.recorded.t_end
    assert brachis.compare is comparison.compare
