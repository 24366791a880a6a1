"""The legs of a path: between stops, and with given speeds; what is refused of these."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest

import brachis
from brachis.errors import PathError, TaskError
from brachis.path import Leg, legs_of, path_of
from brachis.problem.problem import Problem
from brachis.robot import Robot, bind, task_map_of
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


LEAD = 0.1
"""Length of a lead divided by the speed, s."""


@pytest.mark.parametrize(
    ("parts", "boundary", "held"),
    [
        # Lengths along the path of three lines of 0.2 m, in m.
        (part(0.1, 0.0, 0.2), {}, [(0.1, 0.01, 0.12)]),
        (part(0.1, 0.0, 0.2), {"start_speed": 0.1}, [(0.1, 0.0, 0.12)]),
        (part(0.1, 0.0, 0.2), {"start_speed": 0.3}, [(0.1, 0.03, 0.12)]),
        (part(0.1, 0.8, 1.0), {}, [(0.1, 0.48, 0.59)]),
        (part(0.1, 0.8, 1.0), {"end_speed": 0.1001}, [(0.1, 0.48, 0.58999)]),
        (part(0.1, 0.1, 1 / 3), {}, [(0.1, 0.06, 0.19)]),
        (part(0.1, 0.333333, 0.5), {}, [(0.1, 0.21, 0.3)]),
        (part(0.1, 0.1, 0.3333338), {}, [(0.1, 0.06, 0.19)]),
        (part(0.1, 0.2, 0.5), {}, [(0.1, 0.12, 0.19), (0.1, 0.21, 0.3)]),
    ],
)
def test_a_part_leaves_leads_at_stops_and_ends(
    parts: Any, boundary: dict[str, float], held: list[tuple[float, float, float]]
) -> None:
    given = problem(STOPPING, parts, boundary)
    speeds = [leg for leg in given.legs if leg.speed is not None]
    found = [(leg.speed, 0.6 * leg.begin, 0.6 * leg.end) for leg in speeds]
    np.testing.assert_allclose(found, held, atol=1e-9)
    again = Problem.of(given.robot, load_task(given.task.to_dict()))
    np.testing.assert_allclose(
        [(leg.begin, leg.end) for leg in again.legs],
        [(leg.begin, leg.end) for leg in given.legs],
        atol=1e-12,
    )


SEAM = {**RIGHT, "speed": 0.1}


@pytest.mark.parametrize(
    ("path", "held"),
    [
        # A blend of 0.02 m is 0.0378 m long.
        ([{**RIGHT, "blend": 0.02}, {**UP, "speed": 0.1, "blend": 0.02}, RIGHT], [(1, 0, 0)]),
        ([{**SEAM, "blend": 0.02}, {**UP, "speed": 0.1}], [(0, LEAD, LEAD)]),
        ([{**SEAM, "blend": 0.02}, {**UP, "speed": 0.2}], [(0, LEAD, 0), (1, 0, LEAD)]),
        ([{**SEAM, "stop": True}, {**UP, "speed": 0.1}], [(0, LEAD, LEAD), (1, LEAD, LEAD)]),
        ([SEAM, {**RIGHT, "speed": 0.2}], [(0, LEAD, 0), (1, LEAD, LEAD)]),
        ([RIGHT, SEAM], [(1, 0, LEAD)]),
        ([SEAM, RIGHT], [(0, LEAD, 0)]),
        ([RIGHT, SEAM, RIGHT], [(1, 0, 0)]),
    ],
)  # fmt: skip
def test_segments_have_speeds(path: list[dict[str, Any]], held: Any) -> None:
    given = problem(path)
    spans = given.path.spans
    breaks = dict(
        zip([span.segment for span in spans], given.path.breaks, strict=False)
    )
    ends = dict(
        zip([span.segment for span in spans], given.path.breaks[1:], strict=False)
    )
    found = [leg for leg in given.legs if leg.speed is not None]
    assert len(found) == len(held)
    for leg, (segment, before, after) in zip(found, held, strict=True):
        speed = path[segment]["speed"]
        assert leg.speed == speed
        last = segment
        while (
            len(held) == 1 and path[last + 1 :] and path[last + 1].get("speed") == speed
        ):
            last += 1
        total = given.path.total
        assert leg.begin - breaks[segment] == pytest.approx(
            before * speed / total, abs=1e-9
        )
        assert ends[last] - leg.end == pytest.approx(after * speed / total, abs=1e-9)


def test_speeds_of_segments_and_of_parts() -> None:
    given = problem([RIGHT, SEAM, RIGHT], part(0.3, 0.1, 0.2))
    assert [leg.speed for leg in given.legs] == [None, 0.3, None, 0.1, None]
    assert [part.segment for part in given.task.tool_limits.process_speed] == [None, 1]
    with pytest.raises(TaskError, match=r"a begin of path\[1\]\.speed above 0\.5"):
        problem([RIGHT, SEAM, RIGHT], part(0.3, 0.3, 0.5))
    with pytest.raises(
        TaskError, match=r"largest speed is below the process speed of path\[1\]\.speed"
    ):
        problem([RIGHT, SEAM], limits={"speed": 0.05})
    (short,) = (leg for leg in problem([{**RIGHT, "speed": 2.0}]).legs if leg.speed)
    assert (short.begin, short.end) == pytest.approx((0.25, 0.75))


def test_a_file_has_a_speed_between_its_stops(tmp_path: Path) -> None:
    """Which replaces its feed rates."""
    file = tmp_path / "seam.nc"
    file.write_text("G21 G90\nG1 X400 Y0 Z500 F600\nG1 X500\nG1 Y100\n")
    segment = {"csv": {"file": str(file), "corner": "stop"}, "speed": 0.05}
    given = problem([segment])
    found = [(leg.begin, leg.end, leg.speed) for leg in given.legs]
    lead = LEAD * 0.05 / 0.2
    expected = [(lead, 0.5 - lead, 0.05), (0.5 + lead, 1.0 - lead, 0.05)]
    np.testing.assert_allclose([leg for leg in found if leg[2]], expected)


def test_a_speed_replaces_the_feed_rates_of_points() -> None:
    points = np.linspace([0.4, 0.0, 0.5], [0.6, 0.0, 0.5], 20)
    fitted = brachis.fit_path(
        points, tolerance={"position": 1e-5}, speed=np.full(20, 0.2)
    )
    (segment,) = fitted
    with_feed = problem([segment])
    assert with_feed.task.tool_limits.feed
    given = problem([segment.model_copy(update={"speed": 0.05})])
    assert not given.task.tool_limits.feed
    assert brachis.fit_path(points, speed=0.05)[0].speed == 0.05
    assert [leg.speed for leg in given.legs] == [None, 0.05, None]


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


def test_the_speed_at_the_start_of_a_path_of_joints_is_that_of_the_tool() -> None:
    """`start_speed` is the norm of joint velocities there."""
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
    begun = Problem.of(robot, load_task(task))
    first = begun.path.sample([0.0]).xi[0]
    tool = task_map_of(robot, "position")
    (jacobian,) = tool.jacobian(tool.twists(np.array([joints["joints"]])))
    slope = np.linalg.norm(jacobian @ first)
    assert begun.legs[0].end == pytest.approx(LEAD * 0.1 / slope, rel=1e-9)
    start_speed = 0.1 / slope * np.linalg.norm(first)
    boundary = {"start_speed": float(start_speed)}
    given = Problem.of(robot, load_task({**task, "boundary": boundary}))
    assert given.legs[0].speed == 0.1
    assert given.leg_rates[0][0] == pytest.approx(0.1 / slope, rel=1e-6)


CIRCLE = {"circle": {"center": [0.5, 0.0, 0.5], "normal": [0, 0, 1]}}


@pytest.mark.parametrize("last", [0.1, 0.2])
def test_the_seam_of_a_periodic_motion_has_a_lead_between_two_speeds(
    last: float,
) -> None:
    parts = [part(0.1, 0.0, 0.3), part(last, 0.6, 1.0)]
    given = problem([CIRCLE], parts, {"periodic": True})
    speeds = [leg.speed for leg in given.legs]
    assert speeds == [0.1, None, 0.1] if last == 0.1 else [None, 0.1, None, last]
    if last > 0.1:
        assert given.legs[0].end == pytest.approx(LEAD * last / given.path.length)


def problem(
    path: Any, parts: Any = (), boundary: Any = None, limits: Any = None
) -> Problem:
    content = {
        "brachis": 1,
        "start": "free",
        "path_start": [0.4, 0.0, 0.5],
        "task_space": "position",
        "path": path,
        "boundary": boundary or {},
        "tool_limits": {"process_speed": parts, **(limits or {})},
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
