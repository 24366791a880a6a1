"""The legs of a path: between stops, and with given speeds; what is refused of these."""

from __future__ import annotations

import re
from typing import Any

import numpy as np
import pytest

import brachis
from brachis.errors import PathError
from brachis.path import Leg, legs_of, path_of
from brachis.problem.problem import Problem
from brachis.robot import Robot, bind
from brachis.task import load_task
from support.chains import gantry_robot, planar_robot

RIGHT: dict[str, Any] = {"line": {"by": [0.2, 0.0, 0.0]}}
UP: dict[str, Any] = {"line": {"by": [0.0, 0.0, 0.2]}}
STOPPING = [{**RIGHT, "stop": True}, {**UP, "dwell": 0.5}, RIGHT]


def legs(
    path: list[dict[str, Any]],
    parts: Any = (),
    boundary: Any = None,
    space: Any = "position",
    robot: Robot | None = None,
    **keys: Any,
) -> tuple[Leg, ...]:
    content = {
        "brachis": 1,
        "start": "free",
        "path_start": [0.4, 0.0, 0.5][: 3 if space == "position" else len(space)],
        "task_space": space,
        "path": path,
        "boundary": boundary or {},
        "tool_limits": {"process_speed": parts},
        **keys,
    }
    task = load_task(content)
    robot, task_map = bind(robot or brachis.robots.iiwa14, task.task_space)
    return legs_of(task, task_map, path_of(task_map, task))


def part(speed: float, begin: float, end: float) -> dict[str, Any]:
    return {"speed": speed, "s": [begin, end]}


def test_most_tasks_have_one_leg() -> None:
    assert legs([RIGHT]) == (Leg(0.0, 1.0),)


def test_stops_and_speeds_cut_the_path() -> None:
    third = pytest.approx(1 / 3)
    two_thirds = pytest.approx(2 / 3)
    assert legs(STOPPING, [part(0.1, 0.1, 0.3), part(0.2, 0.7, 0.9)]) == (
        Leg(0.0, 0.1),
        Leg(0.1, 0.3, speed=0.1),
        Leg(0.3, third, stops=True),  # type: ignore[arg-type]
        Leg(third, two_thirds, stops=True, dwell=0.5),  # type: ignore[arg-type]
        Leg(two_thirds, 0.7),  # type: ignore[arg-type]
        Leg(0.7, 0.9, speed=0.2),
        Leg(0.9, 1.0),
    )


def test_a_path_may_begin_and_end_at_the_speed() -> None:
    ends = {"start_speed": 0.1, "end_speed": 0.2}
    found = legs([RIGHT], [part(0.1, 0.0, 0.3), part(0.2, 0.7, 1.0)], ends)
    assert [leg.speed for leg in found] == [0.1, None, 0.2]
    whole = legs([RIGHT], part(0.1, 0.0, 1.0), {"start_speed": 0.1, "end_speed": 0.1})
    assert whole == (Leg(0.0, 1.0, speed=0.1),)


@pytest.mark.parametrize(
    ("parts", "boundary", "key", "said"),
    [
        (part(0.1, 0.2, 0.5), {}, "[0].s", "cut the part in two"),
        (
            part(0.1, 0.1, 1 / 3),
            {},
            "[0].s",
            "Leave room before and behind s = 0.333333",
        ),
        (
            part(0.1, 1 / 3, 0.5),
            {},
            "[0].s",
            "Leave room before and behind s = 0.333333",
        ),
        (part(0.1, 0.0, 0.2), {}, "[0].s[0]", "Set boundary.start_speed to 0.1"),
        (part(0.1, 0.8, 1.0), {}, "[0].s[1]", "Set boundary.end_speed to 0.1"),
        (
            part(0.1, 0.8, 1.0),
            {"end_speed": 0.1001},
            "[0].s[1]",
            "found 0.1001 m/s, by boundary.end_speed; allowed: 0.1 m/s",
        ),
    ],
)
def test_a_speed_that_does_not_fit_is_refused(
    parts: Any, boundary: dict[str, float], key: str, said: str
) -> None:
    with pytest.raises(PathError) as caught:
        legs(STOPPING, parts, boundary)
    assert f"tool_limits.process_speed{key}: " in str(caught.value)
    assert said in str(caught.value)


def test_a_tool_that_turns_on_the_spot_has_no_speed() -> None:
    turn = {"turn": {"rotate": {"axis": [0, 0, 1], "angle_deg": 90}}, "stop": True}
    path = [{**RIGHT, "stop": True}, turn, RIGHT]
    start = {"position": [0.4, 0.0, 0.5], "rpy_deg": [180, 0, 0]}
    with pytest.raises(PathError, match=r"stands still; .*at s = 0.5"):
        legs(path, part(0.1, 0.5, 0.6), space="pose", path_start=start)


def test_the_whole_position_must_be_prescribed() -> None:
    """By as many rows as the tool can move in."""
    line = [{"line": {"by": [0.1, 0.0]}}]
    speed = part(0.1, 0.2, 0.8)
    with pytest.raises(PathError, match=r"task_space \[x, z\], which leaves y free"):
        legs(line, speed, space=["x", "z"])
    assert len(legs(line, space=["x", "z"])) == 1
    assert (
        len(legs(line, speed, space=["x", "z"], robot=planar_robot("RRR", "xz"))) == 3
    )
    slides = gantry_robot([[1.0, 0.0, 0.0]])
    assert len(legs([{"line": {"by": [0.1]}}], speed, space=["x"], robot=slides)) == 3
    with pytest.raises(PathError, match=r"task_space \[x\], which leaves z free"):
        legs(
            [{"line": {"by": [0.1]}}],
            speed,
            space=["x"],
            robot=planar_robot("RRR", "xz"),
        )


def test_the_speed_at_the_start_of_a_path_of_joints_is_advised() -> None:
    """It is the norm of joint velocities there, and the advice has digits enough to be taken."""
    joints = {"joints": [0.0, 0.5, 0.0, -1.0, 0.0, 0.5, 0.0]}
    through = [[0.3, 0.7, 0.1, -1.2, 0.2, 0.7, 0.1], [0.6, 0.6, 0.3, -1.0, 0.4, 0.5, 0]]
    task = {
        "brachis": 1,
        "start": joints,
        "task_space": "joints",
        "path": [{"spline": {"through": through}}],
        "tool_limits": {"process_speed": part(0.1, 0.0, 0.5)},
    }
    robot = brachis.robots.iiwa14
    with pytest.raises(PathError) as caught:
        Problem.of(robot, load_task(task))
    advice = re.search(r"boundary.start_speed to (\S+),", str(caught.value))
    assert advice
    boundary = {"start_speed": float(advice[1])}
    given = Problem.of(robot, load_task({**task, "boundary": boundary}))
    first = given.path.sample([0.0]).xi[0]
    rate = float(advice[1]) / np.linalg.norm(first)
    assert given.leg_rates[0][0] == pytest.approx(rate, rel=1e-6)


CIRCLE = {"circle": {"center": [0.5, 0.0, 0.5], "normal": [0, 0, 1]}}


def test_a_periodic_motion_has_one_speed_at_its_seam() -> None:
    periodic = {"periodic": True}
    with pytest.raises(
        PathError, match=r"process_speed\[1\].speed: .* changes at once"
    ):
        legs([CIRCLE], [part(0.1, 0.0, 0.3), part(0.2, 0.6, 1.0)], periodic)
    found = legs([CIRCLE], [part(0.1, 0.0, 0.3), part(0.1, 0.6, 1.0)], periodic)
    assert [leg.speed for leg in found] == [0.1, None, 0.1]


def problem(
    path: list[dict[str, Any]], parts: Any = (), boundary: Any = None
) -> Problem:
    content = {
        "brachis": 1,
        "start": "free",
        "path_start": [0.4, 0.0, 0.5],
        "task_space": "position",
        "path": path,
        "boundary": boundary or {},
        "tool_limits": {"process_speed": parts},
    }
    return Problem.of(brachis.robots.iiwa14, load_task(content))


def test_rates_where_legs_meet() -> None:
    """On lines ds/dt is the speed over the path's length."""
    ends = {"start_speed": 0.3, "end_speed": 0.06}
    given = problem(STOPPING, part(0.12, 0.8, 0.9), ends)
    expected = [0.3 / 0.6, 0.0, 0.0, 0.2, 0.2, 0.1]
    assert [rates[0] for rates in given.leg_rates] == pytest.approx(expected[:-1])
    assert [rates[1] for rates in given.leg_rates] == pytest.approx(expected[1:])
    assert [law is None for law in given.time_laws] == [True, True, True, False, True]
    assert [path.breaks[0] for path in given.leg_paths] == [
        leg.begin for leg in given.legs
    ]
    np.testing.assert_allclose(
        given.leg_paths[0].sample([given.legs[0].end]).xi, [[0.6, 0.0, 0.0]], atol=1e-12
    )


def test_rates_at_the_seam_of_a_periodic_motion() -> None:
    rate = 0.1 / (0.2 * np.pi)
    for parts in (part(0.1, 0.0, 0.5), part(0.1, 0.5, 1.0)):
        given = problem([CIRCLE], parts, {"periodic": True})
        flat = [rate for rates in given.leg_rates for rate in rates]
        assert flat == pytest.approx([rate] * 4)
    free = problem([CIRCLE], part(0.1, 0.2, 0.5), {"periodic": True})
    assert free.leg_rates[0] == pytest.approx((0.0, rate))
