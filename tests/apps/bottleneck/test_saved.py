"""Reports of saved motions against those of the plans that they come from."""

import dataclasses

import numpy as np
import pytest

import brachis
from brachis import ik
from brachis.errors import DecompositionError, InputError, PlanningError
from brachis.limits import Label, Limit, Partials


def save_and_load(result, folder):
    result.trajectory.save(folder / "result.npz")
    return brachis.Trajectory.load(folder / "result.npz")


def check_saved_report(result, folder, **keywords):
    """The saved motion has the report of its plan."""
    motion = save_and_load(result, folder)
    saved = brachis.bottleneck.report(motion, **keywords)
    fresh = brachis.bottleneck.report(result)
    assert saved.t_end == fresh.t_end
    shares, expected = (
        {str(entry.label): entry.share for entry in report.saturations}
        for report in (saved, fresh)
    )
    assert shares == pytest.approx(expected, abs=1e-3)
    assert saved.sensitivities.reliable
    costs = fresh.sensitivities.limits
    assert any(entry.change(0.1) < -1e-5 for entry in costs)
    for entry in costs:
        label = entry.label
        again = saved.sensitivities.of(label.subject, label.kind, entry.side)
        assert again.change(0.1) == pytest.approx(entry.change(0.1), rel=1e-3, abs=1e-6)


@pytest.mark.parametrize("joint", ["j1", "j3"])
def test_the_same_report(joint, scara, tmp_path):
    check_saved_report(scara(joint), tmp_path)


def test_other_knots_and_boundary_conditions(slide, tmp_path):
    check_saved_report(slide(intervals=12, rest="velocity", degree=2), tmp_path)


def test_a_motion_that_is_no_optimum_is_an_error(slide, tmp_path):
    trajectory = save_and_load(slide(intervals=10, rest="full"), tmp_path)
    slow = dataclasses.replace(
        trajectory,
        times=2.0 * trajectory.times,
        phase_ends=2.0 * trajectory.phase_ends,
    )
    with pytest.raises(PlanningError, match="a faster motion was found") as caught:
        brachis.bottleneck.report(slow)
    assert f"{trajectory.t_end:.3f}"[:4] in caught.value.found
    assert "larger search.time_limit" in caught.value.hint
    slow = dataclasses.replace(slow, own_limits=("heat",))
    with pytest.raises(PlanningError, match=r"report\(motion, own_limits=\[...\]\)"):
        brachis.bottleneck.report(slow)


def test_a_time_limit_that_is_too_short_is_no_other_optimum(slide, tmp_path):
    trajectory = save_and_load(slide(intervals=10, rest="full"), tmp_path)
    search = trajectory.task.search.model_copy(update={"time_limit": 1e-4})
    task = trajectory.task.model_copy(update={"search": search})
    with pytest.raises(PlanningError, match="within the time limit") as caught:
        brachis.bottleneck.report(dataclasses.replace(trajectory, task=task))
    assert "Raise search.time_limit" in caught.value.hint


def test_a_motion_of_another_branch_is_an_error(scara, tmp_path):
    trajectory = save_and_load(scara("j3"), tmp_path)
    with pytest.raises(InputError, match="branch"):
        brachis.bottleneck.report(dataclasses.replace(trajectory, branch="sideways"))


class ElbowRange(Limit):
    """|q3| stays below a figure, rad."""

    kind = "elbow_range"
    labels = (Label("j3", "elbow range", "rad"),)
    lower = -np.full(1, 1.95)
    upper = np.full(1, 1.95)

    def bind(self, _robot):
        return self

    def values(self, motion):
        return motion.q[:, 2:]

    def partials(self, motion):
        return Partials(q=np.tile([[0.0, 0.0, 1.0]], (len(motion.q), 1, 1)))


def test_own_limits_are_passed_again(tmp_path):
    keywords = {"own_limits": [ElbowRange()]}
    result = brachis.plan(
        brachis.examples.scara_line,
        redundant_joints=["j3"],
        intervals=10,
        effort="single",
        start={"joints": [0.5236, -1.9, 1.9]},
        **keywords,
    )
    check_saved_report(result, tmp_path, **keywords)


def test_a_closed_form_of_the_users_own_is_passed_again(tmp_path):
    @ik.ik_family("left and right", source="this test")
    def family(geometry, task_map, redundant):
        planar = {known.name: known for known in ik.BUILTIN}["planar"]
        solver = planar.build(geometry, task_map, redundant)
        solver.branches = ("left", "right")
        return solver

    result = brachis.plan(
        brachis.examples.scara_line,
        redundant_joints=["j3"],
        intervals=8,
        effort="single",
        families=[family],
    )
    motion = save_and_load(result, tmp_path)
    assert motion.branch in {"left", "right"}
    with pytest.raises(DecompositionError, match=r"report\(motion, families=\[...\]\)"):
        brachis.bottleneck.report(motion)
    check_saved_report(result, tmp_path, families=[family])
