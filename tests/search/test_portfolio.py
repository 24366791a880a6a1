"""The search as a whole: what is left open, order, limits, interruptions."""

import dataclasses
import math
import os
import signal
import sys
import time
import types

import numpy as np
import pytest
import yaml
from numpy.testing import assert_allclose

import brachis
from brachis.apps.plots import plot_candidates
from brachis.common import tolerances
from brachis.common.deadline import Deadline
from brachis.errors import PathError, PlanningError, TaskError, UnknownNameError
from brachis.kinematics import CHART
from brachis.optimise.backends import child_process, uno
from brachis.problem.problem import Problem, decompositions_of
from brachis.search import guesses, over_time, pipeline, portfolio, schedule
from brachis.search.failure import explain_reach
from brachis.search.guesses import SEARCH_LEVELS
from brachis.search.joint_path import DeadEnd
from brachis.search.posture_lattice import PostureLattice
from brachis.search.stages import NOT_TRIED, RANKED, SLOW
from brachis.task import load_task
from support.scara import START, scara

FEW_POINTS = {"intervals": 10, "points_per_interval": 1}
"""With so few the limits are exceeded in between by far."""
HERE = [math.sqrt(3.0), 0.0]
BRANCH = {"branch": "elbow_positive"}
"""With a branch asked for, the closed forms of all choices of the redundant joint are searched, not charts."""
EVERY_CHOICE = {"start": "free", "path_start": HERE, **BRANCH}
TIMES = ("estimate", "t_end")
UNFINISHED = "the search that search.effort requires was not completed"
ROBOT = scara()


def task(**changes):
    content = yaml.safe_load("""
    brachis: 1
    task_space: [x, y]
    path: [{line: {length: 0.6, angle_deg: 90}}]
    spline: {intervals: 10}
    """)
    return content | {"start": {"joints": START}} | changes


def plan(**changes):
    return brachis.plan(ROBOT, task(**changes))


@pytest.fixture(scope="module")
def usual():
    """Of the task as it is."""
    return plan()


def without_times(result):
    """Candidates, and their times, (K, 3); the order of equally fast ones differs from process to process."""
    rows = [candidate.to_dict() for candidate in result.candidates]
    rows.sort(key=lambda row: (row["redundant_joints"], row["branch"], row["origin"]))
    times = np.array([[row.pop(name) for name in TIMES] for row in rows])
    return rows, times


@pytest.mark.parametrize(
    "changes, choices",
    [
        ({}, {()}),
        (EVERY_CHOICE, {("j1",), ("j2",), ("j3",)}),
        ({"redundant_joints": ["j1"]}, {("j1",)}),
    ],
)
def test_every_candidate_is_listed_the_fastest_first(usual, changes, choices):
    result = plan(**changes) if changes else usual
    first, *slower = result.candidates
    assert first.verified
    assert first.t_end == result.t_end
    assert first.redundant_joints == result.trajectory.redundant_joints
    assert first.branch == result.trajectory.branch
    if changes:
        assert choices_of(result) == choices
    else:
        assert {candidate.redundant_joints for candidate in slower} <= choices
    every = result.candidates
    keys = {(candidate.redundant_joints, candidate.origin) for candidate in every}
    assert len(keys) == len(every)
    assert result.t_end == min(row.t_end for row in every if row.verified)
    unfinished = [
        candidate.estimate for candidate in slower if candidate.status in {RANKED, SLOW}
    ]
    assert unfinished
    # What was left unfinished could gain no more by its knots.
    assert min(unfinished) >= first.estimate * (1.0 - 2e-3)
    assert len(plot_candidates(result.candidates).axes) == 1


@pytest.mark.usefixtures("wall_clock")
@pytest.mark.parametrize("changes", [{}, BRANCH, {"spline": {"intervals": "auto"}}])
def test_the_same_candidates_whatever_the_number_of_processes(usual, changes):
    alone = plan(search={"jobs": 1}, **changes) if changes else usual
    shared = plan(search={"jobs": 2}, **changes)
    assert alone.t_end == pytest.approx(shared.t_end, rel=1e-6)
    (first, times), (second, times_shared) = without_times(alone), without_times(shared)
    assert first == second
    assert_allclose(times_shared, times, rtol=1e-6)
    assert_allclose(
        alone.trajectory.control_points, shared.trajectory.control_points, atol=1e-5
    )


def test_more_effort_is_never_slower(usual):
    single, thorough = (
        plan(search={"effort": name}) for name in ("single", "thorough")
    )
    assert len(single.candidates) == 1
    assert 1 < len(usual.candidates) < len(thorough.candidates)
    assert thorough.t_end <= usual.t_end * (1.0 + 2e-4) <= single.t_end * (1.0 + 4e-4)


def test_a_free_start_is_faster_and_on_the_path(usual):
    free = plan(start="free", path_start=HERE)
    assert free.verified
    assert free.t_end < 0.9 * usual.t_end
    first = ROBOT.tool_placement(free.trajectory.q[0]).translation[:2]
    np.testing.assert_allclose(first, HERE, atol=1e-9)
    assert {candidate.branch for candidate in free.candidates} == {CHART}


def test_a_branch_can_be_asked_for():
    free = {"start": "free", "path_start": HERE, "redundant_joints": ["j1"]}
    for label in ("elbow_positive", "elbow_negative"):
        result = plan(**free, branch=label, spline={"intervals": 8})
        assert result.trajectory.branch == label
        assert {candidate.branch for candidate in result.candidates} == {label}
    with pytest.raises(UnknownNameError, match="elbow_up"):
        plan(**free, branch="elbow_up")


def test_a_free_start_needs_a_place_and_no_numeric_guess():
    with pytest.raises(TaskError, match=r"path_start: .* allowed: \[x, y\]"):
        plan(start="free")
    with pytest.raises(TaskError, match=r"search\.guesses"):
        plan(start="free", path_start=HERE, search={"guesses": "numeric"})


def test_numeric_guesses_stay_an_option():
    result = plan(search={"guesses": "numeric"})
    assert result.verified
    assert all(row.origin.startswith("numeric") for row in result.candidates)
    assert choices_of(result) == {("j1",), ("j2",), ("j3",)}


def choices_of(result):
    return {candidate.redundant_joints for candidate in result.candidates}


class NoPosture:
    """A lattice that ends halfway."""

    def __init__(self, *_arguments, **_options):
        pass

    def joint_paths(self, _most):
        return DeadEnd(0.5, "nothing")


def test_closed_forms_step_in_where_the_lattice_of_all_postures_has_no_joint_path(
    monkeypatch,
):
    monkeypatch.setattr(guesses, "PostureLattice", NoPosture)
    result = plan()
    assert result.verified
    assert choices_of(result) == {(), ("j1",), ("j2",), ("j3",)}
    assert result.t_end <= 1.001 * plan(redundant_joints=["j1"]).t_end
    in_charts = [
        candidate.status for candidate in result.candidates if not candidate.branch
    ]
    assert in_charts == ["from s = 0.5 on nothing"]


@pytest.mark.parametrize(
    "changes, lattices", [({}, 4), ({"redundant_joints": ["j2"]}, 1)]
)
def test_numeric_guesses_step_in_where_no_lattice_has_a_joint_path(
    monkeypatch, changes, lattices
):
    monkeypatch.setattr(guesses, "ClosedFormLattice", NoPosture)
    monkeypatch.setattr(guesses, "PostureLattice", NoPosture)
    result = plan(**changes)
    assert result.verified
    assert result.candidates[0].origin.startswith("numeric")
    statuses = [candidate.status for candidate in result.candidates]
    assert statuses.count("from s = 0.5 on nothing") == lattices


@pytest.mark.usefixtures("wall_clock")
def test_a_real_ctrl_c_ends_worker_processes():
    """Pressed as soon as a motion is verified, while another process plans on."""

    def listener(text):
        if text.endswith(", verified"):
            os.kill(os.getpid(), signal.SIGINT)

    changes = task(search={"effort": "exhaustive", "jobs": 2})
    result = brachis.plan(ROBOT, changes, listener=listener)
    assert result.verified
    assert result.interrupted
    assert result.not_completed[-1] == UNFINISHED
    assert plan(search={"jobs": 2}).verified, "a new search has processes again"


@pytest.fixture
def ctrl_c_before_refinement(monkeypatch):
    """Ctrl-C as the first motion is finished; the second call is the last look at it."""
    honest, calls = pipeline.finish_candidate, []

    def interrupt(*arguments):
        calls.append(1)
        if len(calls) == 1:
            raise KeyboardInterrupt
        return honest(*arguments)

    monkeypatch.setattr(pipeline, "finish_candidate", interrupt)


@pytest.fixture
def splines_are_too_fast(monkeypatch):
    """A solve over time ends faster than the limits allow."""
    honest = pipeline.solve_over_time

    def hurry(*arguments):
        solved = honest(*arguments)
        x = solved.program.scale_time(solved.x, 0.6)
        report = dataclasses.replace(solved.report, x=x)
        return dataclasses.replace(solved, reports=(report,))

    monkeypatch.setattr(pipeline, "solve_over_time", hurry)


@pytest.mark.usefixtures("ctrl_c_before_refinement", "splines_are_too_fast")
def test_ctrl_c_before_anything_is_verified_tells_of_the_best_motion(monkeypatch):
    monkeypatch.setattr("brachis.optimise.refine._LONGEST_IF_LATE", 0.0)
    with pytest.raises(
        KeyboardInterrupt,
        match=r"takes \d\.\d{4} s, and exceeds a limit by \d.* % \(unverified\)",
    ):
        plan(spline={**FEW_POINTS, "intervals": 5})


@pytest.mark.usefixtures("ctrl_c_before_refinement", "splines_are_too_fast")
def test_ctrl_c_before_refinement_lengthens_the_best_motion():
    result = plan(spline=FEW_POINTS)
    assert result.interrupted
    assert result.verified
    assert 1.1 < result.candidate.time_scaled <= 2.0


class Clock:
    """The clock of deadlines, which jumps by a minute and a half at the event that a test chooses."""

    def __init__(self, monkeypatch):
        self.now = 0.0
        self._monkeypatch = monkeypatch
        monkeypatch.setattr("brachis.common.deadline.time.monotonic", lambda: self.now)

    def jump(self, where, name, *, at, by=90.0):
        """Jump at the end of the `at`-th call of a function, and of every later one; the calls are counted."""
        honest, calls = getattr(where, name), []

        def count(*arguments):
            calls.append(1)
            made = honest(*arguments)
            self.now += by * (len(calls) >= at)
            return made

        self._monkeypatch.setattr(where, name, count)
        return calls


@pytest.fixture
def clock(monkeypatch):
    return Clock(monkeypatch)


def test_the_time_limit_gives_the_best_motion_so_far(clock):
    calls = clock.jump(pipeline, "finish_candidate", at=1)
    result = plan(search={"effort": "exhaustive"})
    assert len(calls) == 1
    assert result.verified
    assert result.interrupted
    assert result.to_dict()["undone"] == list(result.not_completed)
    assert result.not_completed[-1] == UNFINISHED


@pytest.mark.parametrize(
    "changes, solved, remark",
    [
        ({}, 1, "of 2 candidates, 1 remained untried"),
        (BRANCH, 2, "of 5 candidates, 3 remained untried, 1 remained unfinished"),
    ],
)
@pytest.mark.usefixtures("splines_are_too_fast")
def test_before_anything_is_verified_the_time_limit_gives_an_unverified_motion(
    clock, monkeypatch, changes, solved, remark
):
    monkeypatch.setattr(schedule, "_SIZE", 4)
    monkeypatch.setattr("brachis.optimise.refine._LONGEST_IF_LATE", 0.0)
    clock.jump(pipeline, "rank_candidate", at=solved)
    result = plan(spline=FEW_POINTS, **changes)
    assert result.interrupted
    assert not result.verified
    assert result.verification.worst_ratio > 1.0
    tried = [row for row in result.candidates if row.status != NOT_TRIED]
    assert len(tried) == solved
    fastest = min(candidate.estimate for candidate in tried)
    assert result.t_end == pytest.approx(fastest, rel=0.1)
    assert remark in result.not_completed


def test_time_is_kept_for_a_first_motion_while_nothing_is_verified(clock):
    clock.jump(portfolio.Search, "_rank", at=1, by=56.0)  # of 60 s
    result = plan()
    assert result.interrupted
    assert result.verified
    assert any("only for a first motion" in text for text in result.not_completed)


def test_without_a_first_motion_the_search_goes_on_for_a_moment(clock, monkeypatch):
    finish = pipeline.finish_candidate
    ends: list[float] = []

    def note(candidate, to_beat, until, *others):
        ends.append(until.at)
        return finish(candidate, to_beat, until, *others)

    monkeypatch.setattr(pipeline, "finish_candidate", note)
    monkeypatch.setattr(portfolio, "find_first_motion_of", lambda *_: None)
    clock.jump(pipeline, "rank_candidate", at=1, by=1.6)
    problem = Problem.of(ROBOT, load_task(task(search={"effort": "single"})))
    portfolio.Search(problem, [], Deadline(1.5), lambda _text: None).run()
    assert ends[0] == pytest.approx(1.7)


def test_a_time_limit_that_is_too_short_for_the_lattice_of_all_postures(clock):
    calls = clock.jump(PostureLattice, "_next", at=5)
    message = r"within the time limit of 60 s: the lattice of all postures was not searched completely; .*\. Raise"
    with pytest.raises(PlanningError, match=message):
        plan()
    assert len(calls) == 5


def test_no_solve_begins_without_time_and_its_start_is_the_motion(clock):
    calls = clock.jump(over_time, "initial_guess", at=1)
    joints = """
    task_space: joints
    path: [{spline: {through: [[0.6, -2.0, 2.0]]}}]
    solver: {name: uno}
    """
    result = plan(**yaml.safe_load(joints))
    assert result.interrupted
    assert result.verified
    assert any("far from the fastest" in text for text in result.not_completed)
    assert len(calls) == 1


def test_the_search_for_a_reason_ends_with_the_time():
    problem = Problem.of(
        ROBOT, load_task(task(path=[{"line": {"length": 3.0, "angle_deg": 0}}]))
    )
    decomposition = decompositions_of(problem, ())[0]
    assert "s = 0" in str(explain_reach(decomposition))
    assert "raise search.time_limit" in explain_reach(decomposition, Deadline(0.0))


def test_a_lattice_that_is_cut_leaves_the_motions_of_the_level_before(usual, clock):
    clock.jump(PostureLattice, "_first_layer", at=2)
    result = plan(search={"effort": "thorough"})
    assert result.verified
    assert result.interrupted
    told = "the lattice of all postures was not searched completely"
    assert told in result.not_completed
    assert len(result.candidates) == len(usual.candidates)


def test_a_time_limit_that_is_too_short_says_what_was_left_undone(clock):
    clock.jump(schedule, "lattice_guesses", at=1)
    message = (
        r"within the time limit of 60 s: the lattice of j. \| j. was not searched completely; "
        r"of \d+ candidates, \d+ remained untried; .*\. Raise search\.time_limit"
    )
    with pytest.raises(PlanningError, match=message):
        plan(**EVERY_CHOICE)


def test_starts_from_their_part_of_the_time_have_plans(clock):
    clock.jump(schedule, "lattice_guesses", at=1, by=30.0)
    result = plan(**EVERY_CHOICE)
    assert result.verified
    assert len({candidate.redundant_joints for candidate in result.candidates}) == 1
    assert any(undone.startswith("the lattice of") for undone in result.not_completed)


@pytest.mark.usefixtures("wall_clock")
@pytest.mark.skipif(
    not sys.platform.startswith("linux"),
    reason="what is patched here is only forked there",
)
def test_a_solver_that_does_not_come_back_leaves_a_coarser_motion(monkeypatch):
    honest = uno.call_uno

    def hanging(watch, x, *rest):
        return time.sleep(1e6) if len(x) > 80 else honest(watch, x, *rest)

    monkeypatch.setattr(uno, "call_uno", hanging)
    monkeypatch.setattr(child_process, "ENTRIES", 60 * 300)
    changes = task(
        redundant_joints=["j1"],
        spline={"intervals": 100, "degree": 4},
        search={"time_limit": 12.0},
    )
    result = brachis.plan(scara({"jerk": 2000.0}), changes)
    assert result.verified
    told = "the motion has 25 intervals, and was not solved with all 100"
    assert told in result.not_completed


def test_within_other_workers_no_processes_start():
    joblib = pytest.importorskip("joblib")
    handler = signal.getsignal(signal.SIGINT)
    changes = task(search={"jobs": 2}, redundant_joints=["j1"])
    for backend in ("threading", "loky"):
        work = [joblib.delayed(brachis.plan)(ROBOT, changes) for _ in range(2)]
        first, second = joblib.Parallel(n_jobs=2, backend=backend)(work)
        assert first.t_end == pytest.approx(second.t_end, rel=1e-9)
    assert signal.getsignal(signal.SIGINT) is handler


def test_the_rule_that_leaves_plans_unfinished_loses_nothing(usual, monkeypatch):
    (fast,) = SEARCH_LEVELS["fast"]
    level = dataclasses.replace(fast, refined=100)
    monkeypatch.setitem(SEARCH_LEVELS, "fast", (level,))
    never_enough = types.SimpleNamespace(GAIN=-100.0, END_TIME=tolerances.END_TIME)
    monkeypatch.setattr(portfolio, "tolerances", never_enough)
    every = plan()
    few, finished = (
        [candidate for candidate in result.candidates if math.isfinite(candidate.t_end)]
        for result in (usual, every)
    )
    assert len(finished) > len(few)
    assert all(
        candidate.t_end >= candidate.estimate * (1.0 - 1e-6) for candidate in finished
    )
    assert usual.t_end <= every.t_end * (1.0 + 2e-4)


def test_a_motion_no_faster_over_its_first_knots_gets_no_mesh(monkeypatch):
    robot = scara({"jerk": 2000.0})
    finish = pipeline.finish_candidate
    meshes = []
    tried = []
    adapt = pipeline.adapt_mesh

    def note(*arguments, **settings):
        meshes.append(len(tried))
        return adapt(*arguments, **settings)

    def against_faster(candidate, to_beat, *arguments):
        given = dataclasses.replace(to_beat, begun=0.0) if tried else to_beat
        tried.append(finish(candidate, given, *arguments))
        return tried[-1]

    monkeypatch.setattr(portfolio.Search, "_may_win", lambda *_: True)
    monkeypatch.setattr(pipeline, "adapt_mesh", note)
    monkeypatch.setattr(pipeline, "finish_candidate", against_faster)
    changes = task(start="free", path_start=HERE, spline={"intervals": "auto"})
    result = brachis.plan(robot, changes)
    assert result.verified
    assert meshes == [0]
    first, *rest = tried
    assert first.adapted < first.begun
    assert rest
    assert {each.status for each in rest} == {SLOW}
    assert all(math.isinf(each.adapted) for each in rest)


def test_a_search_without_time_says_where_its_lattices_end(clock):
    tool = ROBOT.tool_placement(START).translation
    post = brachis.Cylinder(0.1, 1.0, name="post", position=[tool[0] - 0.6, tool[1], 0])
    calls = clock.jump(schedule, "_guess_on_some_branches", at=1)
    with pytest.raises(PathError, match=r"post .*search\.time_limit") as refused:
        brachis.plan(
            ROBOT,
            start=START,
            task_space=["x", "y"],
            path=[brachis.Line(by=[-1.2, 0.0])],
            scene=[post],
            collisions={"self_collision": False},
        )
    assert len(calls) == 1
    first, last = refused.value.s_interval
    assert first < 0.5 < last
