"""Moves between two postures: known optima, bodies in the way, and moves that cannot be planned.

The full count of moves round bodies is `benchmarks/moves.py`.
"""

import itertools
import sys

import numpy as np
import pytest

import brachis
from brachis.common.deadline import NEVER
from brachis.errors import NotInstalledError, PathError, StartError, TaskError
from brachis.problem.problem import Problem
from brachis.robot.from_task import robot_for
from brachis.search.moves import guess_along, price_moves
from brachis.search.phase_plane import least_time
from brachis.search.sampled_paths import FreeSpace, sample_joint_path
from brachis.task import task_with
from support.chains import Joint, chain_urdf

INERTIA = 0.4
TORQUE = 5.0
VELOCITY = 2.0
INERTIAL = f"""
<inertial><mass value="1.0"/>
  <inertia ixx="0.3" ixy="0" ixz="0" iyy="0.3" iyz="0" izz="{INERTIA}"/></inertial>"""
FIRST = [-0.8, 0.7, 0.0, -1.4, 0.0, 0.8, 0.0]
LAST = [0.8, 0.7, 0.2, -1.2, 0.3, 0.8, 0.5]
POST = {"name": "post", "box": [0.1, 0.1, 1.2], "position": [0.6, 0.0, 0.5]}
WALLS = [
    {"name": "wall", "box": [2.0, 0.02, 4.0], "position": [1.2, 0.0, 0.0]},
    {"name": "wall behind", "box": [2.0, 0.02, 4.0], "position": [-1.2, 0.0, 0.0]},
    {"name": "roof", "box": [5.0, 5.0, 0.02], "position": [0.0, 0.0, 0.7]},
]
BESIDE = [-0.8, 1.2, 0.0, -0.4, 0.0, 0.8, 0.0]
"""Posture beside the walls."""


def turntable(velocity):
    """Make a robot with one joint about its centre of mass."""
    limit = {"lower": -3.0, "upper": 3.0, "velocity": velocity, "effort": TORQUE}
    joint = Joint("revolute", limit=limit, inertial=INERTIAL)
    text = chain_urdf([joint], tool=(0.1, 0.0, 0.0))
    return brachis.Robot.from_urdf("turntable", urdf_text=text, tool_frame="tool")


def move(robot="iiwa14", first=FIRST, last=LAST, **options):
    return brachis.plan(robot, start=first, end=last, task_space="free", **options)


def problem(scene=()):
    task = task_with(
        robot={"urdf": "iiwa14"},
        start=FIRST,
        end=LAST,
        task_space="free",
        scene=list(scene),
    )
    return Problem.of(robot_for(None, task.robot), task)


@pytest.mark.parametrize("angle", [0.3, 2.0])
def test_a_joint_with_limited_torque_is_first_driven_then_braked(angle):
    result = move(turntable(100.0), [0.0], [angle], rest="velocity")
    assert result.verified
    shortest = 2.0 * np.sqrt(angle * INERTIA / TORQUE)
    assert result.t_end == pytest.approx(shortest, rel=1e-3)
    assert result.t_end >= shortest * (1.0 - 1e-4)


def test_a_joint_that_reaches_its_velocity_limit_keeps_it():
    angle = 2.0
    assert np.sqrt(angle * TORQUE / INERTIA) > VELOCITY
    result = move(turntable(VELOCITY), [-1.0], [1.0], rest="velocity")
    shortest = angle / VELOCITY + VELOCITY * INERTIA / TORQUE
    assert result.verified
    assert result.t_end == pytest.approx(shortest, rel=1e-3)


def test_prices_of_turns_are_their_least_times():
    task = task_with(
        robot={"urdf": "unused"}, start=[0.0], end=[1.0], task_space="free"
    )
    part = Problem.of(turntable(VELOCITY), task)
    angles = np.array([[0.0], [0.2], [2.5]])
    by_torque = 2.0 * np.sqrt(0.2 * INERTIA / TORQUE)
    by_velocity = 2.5 / VELOCITY + VELOCITY * INERTIA / TORQUE
    prices = price_moves(part, np.zeros((3, 1)), angles)
    np.testing.assert_allclose(prices, [0.0, by_torque, by_velocity], rtol=1e-9)


def test_a_free_move_is_faster_than_the_straight_joint_line():
    result = move()
    ends = np.array([FIRST, LAST])
    straight = least_time(problem(), np.linspace(0.0, 1.0, 2), ends)
    assert result.verified
    assert result.t_end < 0.99 * straight
    np.testing.assert_allclose(result.trajectory.q[[0, -1]], ends, atol=1e-9)


def test_a_move_round_a_post_keeps_clear_of_it_and_is_repeatable(bench):
    pytest.importorskip("ompl")
    pytest.importorskip("mujoco")
    moves = bench("moves")
    task = problem([POST]).task
    free = move(effort="single")
    unaware = moves.find_smallest(task, free.trajectory, 200)
    assert unaware < 0.0
    result = brachis.plan(task, effort="single")
    assert result.verified
    clearance = moves.find_smallest(task, result.trajectory, 500)
    assert 0.01 - 1e-5 <= clearance < 0.03
    again = brachis.plan(task, effort="single")
    assert again.t_end == result.t_end


@pytest.mark.parametrize("robot", ["iiwa14", "ur10_rail"])
def test_a_seeded_move_is_clear_and_faster_than_the_library_alone(bench, robot):
    pytest.importorskip("ompl")
    pytest.importorskip("mujoco")
    moves = bench("moves")
    seeded = moves.draw_move(robot, 0, 5)
    result = brachis.plan(seeded.task, strict=False)
    assert result.verified
    assert result.t_end < 0.97 * moves.library_time(seeded)
    assert moves.find_smallest(seeded.task, result.trajectory, 500) > 0.01 - 1e-5


def test_sampled_joint_paths_are_free_and_belong_to_their_seed():
    pytest.importorskip("ompl")
    blocked = problem([POST])
    space = FreeSpace.of(blocked)
    assert not space.joins(blocked.start, blocked.end)
    paths = [sample_joint_path(blocked, space, seed, 3000, NEVER) for seed in (1, 2, 1)]
    np.testing.assert_array_equal(paths[0], paths[2])
    assert paths[0].shape != paths[1].shape or np.abs(paths[0] - paths[1]).max() > 0.1
    for q in paths:
        np.testing.assert_allclose(q[[0, -1]], [FIRST, LAST], atol=1e-9)
        assert all(space.joins(*step) for step in itertools.pairwise(q))
        s = np.linspace(0.0, 1.0, 200)
        along = guess_along(blocked, q, "sampled").postures_at(s)
        assert all(limit.holds_at_rest(along, 1e-6).all() for limit in space.limits)


def test_a_move_without_a_joint_path_names_what_is_in_the_way():
    pytest.importorskip("ompl")
    last = [0.8, *BESIDE[1:]]
    with pytest.raises(
        PathError, match=r"no joint path .*'link_. .* and wall'.*near"
    ) as failure:
        move(first=BESIDE, last=last, scene=WALLS)
    first, end = failure.value.s_interval
    assert first < 0.5 < end


def test_only_a_move_round_something_needs_the_library(monkeypatch):
    monkeypatch.setitem(sys.modules, "ompl", None)
    with pytest.raises(NotInstalledError, match="ompl") as failure:
        move(scene=[POST])
    assert failure.value.extra == "moves"
    assert move(scene=[POST | {"position": [-0.7, 0.0, 0.5]}], effort="single").verified


def test_postures_in_collision_and_incomplete_moves_are_refused():
    ball = {"name": "ball", "sphere": 0.2, "position": [0.0, 0.0, 1.0]}
    with pytest.raises(StartError, match=r"end.*'link_5 0 and ball'"):
        move(last=[0.0] * 7, scene=[ball])
    with pytest.raises(TaskError, match="end: a move needs a start posture and an end"):
        brachis.plan("iiwa14", start=FIRST, task_space="free")
    with pytest.raises(TaskError, match="path: a move has no path"):
        move(path=[{"line": {"by": [0.1, 0.0, 0.0]}}])
