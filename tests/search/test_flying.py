"""Parts that pass on to the next without a stop: known optima, continuity, and what is refused."""

import numpy as np
import pytest

import brachis
from brachis.errors import TaskError
from brachis.optimise.extraction import compose
from brachis.problem.program import bind_task
from support.effort import QUICK
from support.slides import X, slides

MASS = 2.0
FORCE = 16.0
"""Of a slide, N."""
AHEAD = 0.1
"""Distance of the slide's tool from its origin, m."""
HOME = [0.0, 0.5, 0.0, -1.2, 0.0, 1.0, 0.3]
SEAM = {
    "path": [{"line": {"to": [0.5, 0.15, 0.4]}}],
    "path_start": {"position": [0.5, -0.15, 0.4], "rpy_deg": [180, 0, 0]},
}


@pytest.fixture(scope="module")
def slide():
    return slides([X], [FORCE], MASS, gravity=[0, 0, 0])


def least_time(distance):
    """Of a slide from rest to rest, by full force either way, s."""
    return 2.0 * np.sqrt(distance * MASS / FORCE)


def plan_slide(slide, parts, **keys):
    settings = {"rest": "velocity", "start": [0.0], "task_space": ["x"], **QUICK}
    return brachis.plan(slide, program=parts, **settings | keys)


def to(position, **keys):
    return {"move": {"joints": [position]}, **keys}


def line(by, begin, **keys):
    return {"path": [{"line": {"by": [by]}}], "path_start": [begin + AHEAD], **keys}


def test_two_moves_that_fly_are_as_fast_as_one(slide):
    result = plan_slide(slide, [to(0.3, fly=True), to(0.5)])
    assert result.verified
    assert result.t_end == pytest.approx(least_time(0.5), rel=1e-3)
    assert result.t_end > least_time(0.5) * (1.0 - 1e-4)


@pytest.mark.parametrize("rest", ["velocity", "full"])
def test_a_cycle_that_flies_through_paths_and_moves(slide, rest):
    parts = [
        to(0.3, fly=True),
        line(0.2, 0.3, fly=True),
        {"move": "next", "fly": True},
        line(-0.1, 0.3, fly=True),
        to(0.0, fly=True),
    ]
    result = plan_slide(slide, parts, end="start", rest=rest)
    assert result.verified
    assert result.t_end == pytest.approx(2.0 * least_time(0.5), rel=2e-3)


def test_velocities_go_on_where_parts_meet(slide):
    """By differences of positions of the whole motion, on both sides."""
    motion = plan_slide(slide, [to(0.3, fly=True), to(0.5)]).trajectory
    meeting = motion.parts[0].end
    step = 1e-5
    q = motion.position(meeting + step * np.array([-2.0, -1.0, 1.0, 2.0]))[:, 0]
    before, after = (q[1] - q[0]) / step, (q[3] - q[2]) / step
    assert before > 1.0
    assert after == pytest.approx(before, abs=1e-3)


def test_a_jump_of_the_velocity_is_not_verified(slide):
    """The arm reaches the posture at rest, and leaves it in motion."""
    flying = plan_slide(slide, [to(0.3, fly=True), to(0.5)]).trajectory
    stopping = plan_slide(slide, [to(0.3), to(0.5)]).trajectory
    problem = bind_task(flying.robot, flying.task)
    parts = [stopping.components[0][1], flying.components[1][1]]
    verification = brachis.verify_trajectory(compose(problem, parts))
    failed = [check.name for check in verification.checks if not check.passed]
    assert "motion of the parts" in failed


def test_a_free_speed_at_the_end_of_a_path(slide):
    """The slide accelerates all the way: x = F t^2 / (2 m)."""
    keys = {"path": [{"line": {"by": [0.3]}}], "start": [0.0], "task_space": ["x"]}
    result = brachis.plan(slide, **keys, end_speed="free", rest="velocity", **QUICK)
    assert result.verified
    assert result.t_end == pytest.approx(np.sqrt(2 * 0.3 * MASS / FORCE), rel=1e-3)


def test_a_process_speed_holds_on_the_whole_path_if_the_arm_flies(slide):
    speed = {"process_speed": [{"speed": 0.5, "s": [0, 1]}]}
    parts = [to(0.3, fly=True), line(0.2, 0.3, fly=True, tool_limits=speed), to(0.7)]
    result = plan_slide(slide, parts, effort="fast")
    assert result.verified
    assert result.trajectory.parts[1].duration == pytest.approx(0.2 / 0.5, rel=1e-9)


def test_no_flight_is_slower_than_stopping():
    times = []
    for fly in (False, True):
        move = {"move": "next", "fly": fly}
        program = [move, {**SEAM, "fly": fly}, {"move": {"joints": HOME}}]
        keys = {"task_space": "pose_free_roll", "start": HOME, "end": "start"}
        result = brachis.plan("iiwa14", program=program, **keys, **QUICK)
        assert result.verified
        times.append(result.t_end)
    assert times[1] < 0.99 * times[0]


def test_a_piece_of_a_cycle_in_motion_does_not_close(slide):
    program = [to(0.3, fly=True), line(0.2, 0.3, fly=True), to(0.0, fly=True)]
    keys = {"start": {"joints": [0.0]}, "end": "start", "task_space": ["x"]}
    task = brachis.load_task(
        {"brachis": 1, "robot": {"urdf": "slide"}, **keys, "program": program}
    )
    problem = bind_task(slide, task)
    assert [join[:2] for join in problem.joins] == [(0, 1), (1, 2), (2, 0)]
    assert [join[:2] for join in problem.piece([0, 1]).joins] == [(0, 1)]


def test_a_saved_flight_is_verified_again(slide, tmp_path):
    result = plan_slide(slide, [to(0.3, fly=True), to(0.0, fly=True)], end="start")
    result.save(tmp_path / "cycle.npz")
    assert brachis.verify_trajectory(tmp_path / "cycle.npz").passed


@pytest.mark.parametrize(
    "parts, where",
    [
        ([to(0.3, fly=True), {"dwell": 0.1}, to(0.0)], "program[0].fly"),
        ([to(0.3), to(0.5, fly=True)], "program[1].fly"),
        ([to(0.3, fly=True), {"payload": None}, to(0.0)], "program[0].fly"),
        ([line(0.1, 0.0, fly=True), line(0.1, 0.1)], "program[0].fly"),
    ],
)
def test_where_the_arm_has_to_stop(slide, parts, where):
    with pytest.raises(TaskError, match="cannot pass on without a stop") as caught:
        plan_slide(slide, parts)
    assert where in caught.value.where


def test_a_program_states_no_speeds_at_its_ends(slide):
    with pytest.raises(TaskError, match="boundary"):
        plan_slide(slide, [to(0.3)], end_speed="free")
