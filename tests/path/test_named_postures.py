"""Postures by name: at both ends of a task, and lines that lead to the tool's place in one."""

import numpy as np
import pinocchio as pin
import pytest
from numpy.testing import assert_allclose

import brachis
from brachis.errors import InputError, PathError, StartError, TaskError
from brachis.problem.feasibility import check_regular
from brachis.problem.problem import Problem, decompositions_of
from brachis.task import load_task, task_with
from brachis.task.units import unit_of

HOME = [0.3, 0.4, -0.2, -1.1, 0.5, 0.9, 0.2]
AWAY = [-0.4, 0.7, 0.0, -1.2, 0.0, 1.0, 0.0]
FRAME = pin.SE3(pin.rpy.rpyToMatrix(0.2, -0.4, 1.0), np.array([0.2, 0.1, 0.3]))


def problem(
    space,
    robot=None,
    home=HOME,
    away=AWAY,
    **keys,
):
    """A path from one posture to another one."""
    content = {
        "path": [brachis.Line(to_posture="home")],
        "postures": {"home": home, "away": away},
        "start": "away",
        "task_space": space,
    }
    return Problem.of(robot or brachis.robots.iiwa14, task_with(**content | keys))


def end_of(given):
    return given.path.sample([1.0]).target[0]


@pytest.mark.parametrize(
    "frame", [{}, {"frames": {"user1": FRAME}, "path_frame": "user1"}]
)
@pytest.mark.parametrize("space", ["position", "pose", "pose_free_roll"])
def test_a_line_ends_at_the_tool_s_place(space, frame):
    robot = brachis.robots.iiwa14
    place = robot.tool_placement(HOME)
    names = dict(zip(robot.joint_names, HOME, strict=True))
    for home in (HOME, names):
        end = end_of(problem(space, home=home, **frame))
        assert_allclose(end[:3], place.translation, atol=1e-12)
        if space != "position":
            assert_allclose(end[3:], place.rotation.ravel(), atol=1e-12)


def test_of_joints_it_ends_in_the_posture():
    assert_allclose(end_of(problem("joints")), HOME, atol=1e-14)


@pytest.mark.parametrize("turn", [0.5, 3.0, -3.0])
def test_yaw_turns_the_shorter_way(turn):
    home, away = [0.5 + turn, -2.0, 2.1], [0.5, -2.1, 2.1]
    line = problem(["x", "y", "yaw"], brachis.robots.scara3, home, away)
    first, last = line.path.sample([0.0, 1.0]).target[:, 2]
    assert abs(last - first) < np.pi
    assert np.exp(1j * (last - sum(home))) == pytest.approx(1.0, abs=1e-12)


def test_a_plan_begins_and_ends_in_named_postures():
    result = brachis.plan(
        "scara3",
        path=brachis.Line(by=[0.0, 0.1], stop=True) + brachis.Line(to_posture="home"),
        postures={"home": [0.5, -2.1, 2.1]},
        start="home",
        end="home",
        task_space=["x", "y"],
        intervals=8,
        effort="single",
    )
    assert result.verified
    for q in result.trajectory.q[[0, -1]]:
        assert_allclose(q, [0.5, -2.1, 2.1], atol=1e-9)
    assert result.trajectory.task.start == "home"


def test_a_change_of_a_posture_moves_start_and_path():
    task = problem("position").task
    moved = load_task(task, changes={"postures.home": AWAY, "postures.away": HOME})
    given = Problem.of(brachis.robots.iiwa14, moved)
    assert_allclose(given.start, HOME)
    place = given.robot.tool_placement(AWAY).translation
    assert_allclose(end_of(given), place, atol=1e-12)
    assert load_task(moved.to_dict()) == moved
    assert unit_of("postures.home.joint_1") == "rad (m)"
    assert unit_of("frames.user1.xyz") == unit_of("scene.0.position") == "m"


@pytest.mark.parametrize(
    "keys, message",
    [
        ({"start": "hom"}, r"start: this posture is not defined in postures; found 'hom' .*free, home, away"),
        ({"end": "hom"}, r"end: this posture is not defined in postures"),
        (
            {"path": [brachis.Line(to_posture="free")]},
            r"path\[0\]\.line\.to_posture: this posture is not .*allowed: home, away",
        ),
        ({"postures": {"free": HOME, "away": AWAY, "home": HOME}}, r"postures: free, start and next cannot be"),
        (
            {"path": [{"line": {"to_posture": "home"}, "orientation": "fixed"}]},
            r"path\[0\]\.orientation: the line already has orientations",
        ),
    ],
)  # fmt: skip
def test_wrong_names(keys, message):
    with pytest.raises(TaskError, match=message):
        problem("pose", **keys)


FAR = [*AWAY[:6], 20.0]
STRETCHED = [0.0] * 7
ELSEWHERE = brachis.Line(by=[0.1, 0.0, 0.0])


@pytest.mark.parametrize(
    "keys, key, message",
    [
        ({"away": FAR}, "postures.away", "out of its range"),
        ({"end": "home", "home": FAR, "path": [ELSEWHERE]}, "postures.home", "out of its range"),
        ({"end": "home", "path": [ELSEWHERE]}, "postures.home", "the end posture is off"),
        ({"path_start": [0.1, 0.1, 0.1]}, "postures.away", "the start posture is off"),
        ({"start": {"joints": FAR}, "path": [ELSEWHERE]}, "start.joints", "out of its range"),
        ({"robot": brachis.robots.iiwa14.with_limits(torque=1.0)}, "postures.away", "gravity"),
        ({"away": STRETCHED}, "postures.away", "the start posture is singular"),
        ({"end": {"joints": HOME}, "path": [ELSEWHERE]}, "end.joints", "the end posture is off"),
    ],
)  # fmt: skip
def test_errors_name_the_key_of_a_posture(keys, key, message):
    """Singular ones are refused before the search."""

    def check():
        given = problem("position", **keys)
        check_regular(given.task, given.task_map, given.given_postures)

    with pytest.raises(StartError, match=message) as caught:
        check()
    assert caught.value.where == key


def test_the_branch_of_a_posture_is_refused_by_its_key():
    path = [brachis.Line(to_posture="home")]
    ends = {"start": "away", "end": "home", "path": path}
    robot = brachis.robots.scara3
    ends["redundant_joints"] = ["j1"]
    given = problem(["x", "y"], robot, [0.5, 2.1, 2.1], [0.5, -2.1, -2.1], **ends)
    with pytest.raises(StartError, match=r"set postures\.home to") as caught:
        decompositions_of(given)
    assert caught.value.where == "postures.home"


def test_postures_that_do_not_fit():
    with pytest.raises(InputError, match=r"postures\.home"):
        problem("pose", home=HOME[:6])
    with pytest.raises(InputError, match=r"postures\.home.*joint_8"):
        problem("pose", home={"joint_8": 0.1})
    with pytest.raises(PathError, match="zero length"):
        problem("pose", home=AWAY)
