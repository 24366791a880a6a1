"""Rows for what a task asks beside its limits: each is compared with a plan of the other task."""

import copy

import numpy as np
import pytest

import brachis
from brachis.kinematics import Newton
from support.effort import QUICK

STEP = 0.01
CORNER = [{"line": {"by": [0.25, 0.0]}, "blend": 0.05}, {"line": {"by": [0.0, 0.25]}}]


def task_of(*, locked, **changes):
    """Return a corner for the planar arm; with a locked joint its motion follows from the path alone."""
    task = copy.deepcopy(brachis.load_task(brachis.examples.scara_line).to_dict())
    task |= {"path": CORNER, "redundant_joints": ["j1"], "search": QUICK}
    task["spline"] = {"intervals": "auto"}
    if locked:
        *joints, last = task["start"]["joints"]
        task["robot"]["locked_joints"] = {"j3": last}
        task |= {"start": {"joints": joints}, "redundant_joints": []}
    return task | changes


@pytest.fixture(scope="module", params=[False, True], ids=["redundant", "locked"])
def corner(request):
    """A corner that is rounded by 5 cm, once with multipliers and once with timings."""
    return request.param, brachis.plan(task_of(locked=request.param))


def least_time(result):
    """Return the least time of its joint path, s: splines are up to 0.1 % slower."""
    return result.timing_gap.least_time


def test_a_larger_blend_saves_what_its_row_says(corner):
    locked, result = corner
    assert (result.sensitivities.source == "timings") is locked
    entry = result.sensitivities.of("path", "blend, 0.05 m")
    first, second = CORNER
    path = [{**first, "blend": (1.0 + STEP) * first["blend"]}, second]
    larger = brachis.plan(task_of(locked=locked, path=path), start_from=result)
    change = least_time(larger) - least_time(result)
    assert entry.change(STEP) == pytest.approx(change, rel=0.05)
    assert entry.change(STEP) < -1e-3
    ((begin, end),) = entry.s
    assert 0.0 < begin < 0.5 < end < 1.0
    assert "a blend of 0.055 m in place of 0.05 m saves" in str(result.bottleneck())


def test_a_blend_that_cannot_be_larger_has_no_row():
    first, second = CORNER
    path = [{**first, "blend": 0.125}, second]
    costs = brachis.plan(task_of(locked=True, path=path)).sensitivities
    assert not [entry for entry in costs.limits if entry.label.subject == "path"]


def row_of(result, words):
    """Return the only row of the task with these words."""
    (saving,) = [row for row in result.sensitivities.task if words in row.change]
    return saving


@pytest.mark.parametrize("end", ["start", "end"])
def test_ends_in_motion_save_what_their_rows_say(corner, end):
    locked, result = corner
    saving = row_of(result, f"boundary.{end}_speed")
    assert saving.accuracy == ("estimate" if locked else "least")
    if not locked:  # a search for another joint path may find more
        return
    speed = 0.1 * float(saving.change.split()[1])
    moving = brachis.plan(task_of(locked=locked, boundary={f"{end}_speed": speed}))
    gained = least_time(result) - least_time(moving)
    assert 0.1 * saving.saved == pytest.approx(gained, rel=0.05)


def test_a_stop_on_a_straight_line_has_a_row():
    half = {"line": {"by": [0.1, 0.1]}}
    path = [{**half, "stop": True}, half]
    stopping = brachis.plan(task_of(locked=True, path=path))
    passing = brachis.plan(task_of(locked=True, path=[half, half]))
    saving = row_of(stopping, "without the stop at s = 0.5")
    gained = least_time(stopping) - least_time(passing)
    assert saving.accuracy == "bound"
    assert gained < saving.saved < 2.0 * gained


@pytest.mark.parametrize("intervals", [10, 40])
def test_accelerations_that_may_jump_at_rest_save_about_what_their_row_says(intervals):
    task = task_of(locked=False, path=[{"line": {"by": [0.3, 0.3]}}])

    def resting(rest):
        return brachis.plan({**task, "spline": {"intervals": intervals, "rest": rest}})

    result = resting("full")
    gained = result.t_end - resting("velocity").t_end
    saving = row_of(result, "spline.rest: velocity in place of full")
    assert saving.accuracy == "estimate"
    assert saving.saved == pytest.approx(gained, rel=0.2)
    assert not [
        row for row in resting("velocity").sensitivities.task if "rest" in row.change
    ]


def test_another_start_posture_saves_about_what_its_row_says():
    line = [{"line": {"length": 1.0, "angle_deg": 0.0}}]
    task = task_of(locked=False, path=line, spline={"intervals": 40})
    result = brachis.plan(task)
    saving = row_of(result, "start posture")
    problem = result.candidate.problem
    words = saving.change.split()
    joint = problem.robot.joint_names.index(words[4])
    turn = float(words[5]) * (1.0 if "higher" in words else -1.0)
    newton = Newton(problem.task_map)
    null = newton.self_motions(problem.start[None])[0][:, 0]
    moved = problem.start + turn / null[joint] * null
    place = problem.path.sample(np.zeros(1)).target
    (start,) = newton.nearest(place, moved[None])
    again = brachis.plan({**task, "start": {"joints": start.tolist()}})
    assert saving.saved == pytest.approx(result.t_end - again.t_end, rel=0.05)
    assert "deg)" in saving.change


def test_corners_of_points_have_one_row():
    side = np.linspace(0.0, 0.2, 41)
    flat = np.zeros(41)
    points = np.concatenate(
        [
            np.column_stack([side, flat]),
            np.column_stack([flat + 0.2, side])[1:],
            np.column_stack([0.2 - side, flat + 0.2])[1:],
        ]
    )

    def plan_through_points(corner):
        tolerance = {"position": 1e-4, "corner": corner}
        path = brachis.fit_path(points, tolerance=tolerance, relative=True)
        return brachis.plan(task_of(locked=True, path=path))

    result = plan_through_points(5e-3)
    (entry,) = [
        entry for entry in result.sensitivities.limits if entry.label.subject == "path"
    ]
    assert len(entry.s) == 2
    assert entry.label.key == "csv.tolerance.corner"
    gained = least_time(plan_through_points(5e-3 * (1.0 + STEP))) - least_time(result)
    assert entry.change(STEP) == pytest.approx(gained, rel=0.05)
    assert "a blend at the corners of points of" in str(result.bottleneck())


def test_a_motion_without_stored_figures_has_about_the_same_costliest_one(corner):
    _, result = corner
    again = brachis.bottleneck.report(result.trajectory).sensitivities
    entry = result.sensitivities.limits[0]
    other = again.of(entry.label.subject, entry.label.kind, entry.side)
    assert other.change(STEP) == pytest.approx(entry.change(STEP), rel=0.05)
