"""The legs of a path: between stops, and with given speeds; what is refused of these."""

import numpy as np
import pytest
from numpy.testing import assert_allclose

import brachis
from brachis.errors import PathError, TaskError
from brachis.path import Leg, legs_of, path_of
from brachis.problem.problem import Problem
from brachis.robot import bind, task_map_of
from brachis.task import load_task, task_with
from support.chains import gantry_robot, planar_robot

RIGHT = {"line": {"by": [0.2, 0.0, 0.0]}}
UP = {"line": {"by": [0.0, 0.0, 0.2]}}
STOPPING = [{**RIGHT, "stop": True}, {**UP, "dwell": 0.5}, RIGHT]


def part(speed, begin, end):
    return {"speed": speed, "s": [begin, end]}


def task_of(path, parts=(), boundary=None, **keys):
    """A task whose tool starts at one place, with speeds over parts of the path."""
    limits = {"process_speed": parts, **keys.pop("limits", {})}
    content = {"path_start": [0.4, 0.0, 0.5], "task_space": "position", **keys}
    return task_with(
        start="free", path=path, boundary=boundary or {}, tool_limits=limits, **content
    )


def legs(path, parts=(), boundary=None, robot=None, **keys):
    task = task_of(path, parts, boundary, **keys)
    _, task_map = bind(robot or brachis.robots.iiwa14, task.task_space)
    return legs_of(task, task_map, path_of(task_map, task))


def problem(path, parts=(), boundary=None, **keys):
    return Problem.of(brachis.robots.iiwa14, task_of(path, parts, boundary, **keys))


def speeds_of(planned):
    """Speed, begin and end of the legs with a speed."""
    return [(leg.speed, leg.begin, leg.end) for leg in planned.legs if leg.speed]


def test_most_tasks_have_one_leg():
    assert legs([RIGHT]) == (Leg(0.0, 1.0),)


def test_stops_and_speeds_cut_the_path():
    third = pytest.approx(1 / 3)
    two_thirds = pytest.approx(2 / 3)
    assert legs(STOPPING, [part(0.1, 0.1, 0.3), part(0.2, 0.7, 0.9)]) == (
        Leg(0.0, 0.1),
        Leg(0.1, 0.3, speed=0.1),
        Leg(0.3, third, stops=True),
        Leg(third, two_thirds, stops=True, dwell=0.5),
        Leg(two_thirds, 0.7),
        Leg(0.7, 0.9, speed=0.2),
        Leg(0.9, 1.0),
    )


def test_a_path_may_begin_and_end_at_the_speed():
    ends = {"start_speed": 0.1, "end_speed": 0.2}
    found = legs([RIGHT], [part(0.1, 0.0, 0.3), part(0.2, 0.7, 1.0)], ends)
    assert [leg.speed for leg in found] == [0.1, None, 0.2]
    whole = legs([RIGHT], part(0.1, 0.0, 1.0), {"start_speed": 0.1, "end_speed": 0.1})
    assert whole == (Leg(0.0, 1.0, speed=0.1),)


LENGTHS = np.array([1.0, 0.6, 0.6])
LEAD = 0.1
"""Length of a lead divided by the speed, s."""


@pytest.mark.parametrize(
    "parts, boundary, held",
    [
        # Lengths along the path of three lines of 0.2 m, in m.
        (part(0.1, 0.0, 0.2), {}, [(0.1, 0.01, 0.12)]),
        (part(0.1, 0.0, 0.2), {"start_speed": 0.1}, [(0.1, 0.0, 0.12)]),
        (part(0.1, 0.0, 0.2), {"start_speed": 0.3}, [(0.1, 0.03, 0.12)]),
        (part(0.1, 0.8, 1.0), {}, [(0.1, 0.48, 0.59)]),
        (part(0.1, 0.8, 1.0), {"end_speed": 0.1001}, [(0.1, 0.48, 0.58999)]),
        (part(0.1, 0.1, 1 / 3), {}, [(0.1, 0.06, 0.19)]),
        (part(0.1, 0.1, 0.3333338), {}, [(0.1, 0.06, 0.19)]),
        (part(0.1, 0.2, 0.5), {}, [(0.1, 0.12, 0.19), (0.1, 0.21, 0.3)]),
    ],
)
def test_a_part_leaves_leads_at_stops_and_ends(parts, boundary, held):
    bound = problem(STOPPING, parts, boundary)
    assert_allclose(speeds_of(bound) * LENGTHS, held, atol=1e-9)
    again = Problem.of(bound.robot, load_task(bound.task.to_dict()))
    ends, expected = (
        [(leg.begin, leg.end) for leg in planned.legs] for planned in (again, bound)
    )
    assert_allclose(ends, expected, atol=1e-12)


SEAM = {**RIGHT, "speed": 0.1}


@pytest.mark.parametrize(
    "path, expected",
    [
        # A blend of 0.02 m takes 0.0341 of the parameter; a lead takes 0.1 s.
        ([{**RIGHT, "blend": 0.02}, {**UP, "speed": 0.1, "blend": 0.02}, RIGHT], [(0.1, 0.2141, 0.3741)]),
        ([{**SEAM, "blend": 0.02}, {**UP, "speed": 0.1}], [(0.1, 0.01, 0.3841)]),
        ([{**SEAM, "blend": 0.02}, {**UP, "speed": 0.2}], [(0.1, 0.01, 0.18), (0.2, 0.2141, 0.3741)]),
        ([{**SEAM, "stop": True}, {**UP, "speed": 0.1}], [(0.1, 0.01, 0.19), (0.1, 0.21, 0.39)]),
        ([SEAM, {**RIGHT, "speed": 0.2}], [(0.1, 0.01, 0.2), (0.2, 0.22, 0.38)]),
        ([RIGHT, SEAM, RIGHT], [(0.1, 0.2, 0.4)]),
    ],
)  # fmt: skip
def test_segments_have_speeds(path, expected):
    """By lengths of the parameter, which are m but in blends."""
    planned = problem(path)
    lengths = np.array([1.0, planned.path.total, planned.path.total])
    assert_allclose(speeds_of(planned) * lengths, expected, atol=1e-4)


def test_speeds_of_segments_and_of_parts():
    bound = problem([RIGHT, SEAM, RIGHT], part(0.3, 0.1, 0.2))
    assert [leg.speed for leg in bound.legs] == [None, 0.3, None, 0.1, None]
    assert [part.segment for part in bound.task.tool_limits.process_speed] == [None, 1]
    with pytest.raises(TaskError, match=r"a begin of path\[1\]\.speed above 0\.5"):
        problem([RIGHT, SEAM, RIGHT], part(0.3, 0.3, 0.5))
    with pytest.raises(
        TaskError,
        match=r"maximum tool speed is below the process speed of path\[1\]\.speed",
    ):
        problem([RIGHT, SEAM], limits={"speed": 0.05})
    (short,) = (leg for leg in problem([{**RIGHT, "speed": 2.0}]).legs if leg.speed)
    assert (short.begin, short.end) == pytest.approx((0.25, 0.75))


def test_a_file_has_a_speed_between_its_stops(tmp_path):
    """Which replaces its feed rates."""
    file = tmp_path / "seam.nc"
    file.write_text("G21 G90\nG1 X400 Y0 Z500 F600\nG1 X500\nG1 Y100\n")
    segment = {"csv": {"file": str(file), "corner": "stop"}, "speed": 0.05}
    lead = LEAD * 0.05 / 0.2
    expected = [(0.05, lead, 0.5 - lead), (0.05, 0.5 + lead, 1.0 - lead)]
    assert_allclose(speeds_of(problem([segment])), expected)


def test_a_speed_replaces_the_feed_rates_of_points():
    points = np.linspace([0.4, 0.0, 0.5], [0.6, 0.0, 0.5], 20)
    tolerance = {"position": 1e-5}
    (segment,) = brachis.fit_path(points, tolerance=tolerance, speed=np.full(20, 0.2))
    assert problem([segment]).task.tool_limits.feed
    planned = problem([segment.model_copy(update={"speed": 0.05})])
    assert not planned.task.tool_limits.feed
    assert brachis.fit_path(points, speed=0.05)[0].speed == 0.05
    assert [leg.speed for leg in planned.legs] == [None, 0.05, None]


def test_a_tool_that_turns_on_the_spot_has_no_speed():
    turn = {"turn": {"rotate": {"axis": [0, 0, 1], "angle_deg": 90}}, "stop": True}
    path = [{**RIGHT, "stop": True}, turn, RIGHT]
    start = {"position": [0.4, 0.0, 0.5], "rpy_deg": [180, 0, 0]}
    with pytest.raises(PathError, match=r"stands still; .*at s = 0.5"):
        legs(path, part(0.1, 0.5, 0.6), task_space="pose", path_start=start)


PLANAR = planar_robot("RRR", "xz")
SLIDE = gantry_robot([[1.0, 0.0, 0.0]])


def test_a_speed_needs_the_whole_position():
    """By as many rows as the tool can move in."""
    speed = part(0.1, 0.2, 0.8)
    xz = {
        "path": brachis.Line(by=[0.1, 0.0]),
        "task_space": ["x", "z"],
        "path_start": [0.4, 0.0],
    }
    x = {"path": brachis.Line(by=[0.1]), "task_space": ["x"], "path_start": [0.4]}
    assert len(legs(**xz)) == 1
    assert len(legs(**xz, parts=speed, robot=PLANAR)) == 3
    assert len(legs(**x, parts=speed, robot=SLIDE)) == 3
    with pytest.raises(PathError, match=r"task_space \[x, z\], which leaves y free"):
        legs(**xz, parts=speed)
    with pytest.raises(PathError, match=r"task_space \[x\], which leaves z free"):
        legs(**x, parts=speed, robot=PLANAR)


def test_the_speed_at_the_start_of_a_path_of_joints_is_that_of_the_tool():
    """`start_speed` is the norm of joint velocities there."""
    start = [0.0, 0.5, 0.0, -1.0, 0.0, 0.5, 0.0]
    through = [[0.3, 0.7, 0.1, -1.2, 0.2, 0.7, 0.1], [0.6, 0.6, 0.3, -1.0, 0.4, 0.5, 0]]
    task = task_with(
        start=start,
        task_space="joints",
        path=brachis.Spline(through=through),
        tool_limits={"process_speed": part(0.1, 0.0, 0.5)},
    )
    robot = brachis.robots.iiwa14
    from_rest = Problem.of(robot, task)
    first = from_rest.path.sample([0.0]).xi[0]
    tool = task_map_of(robot, "position")
    (jacobian,) = tool.jacobian(tool.twists(np.array([start])))
    slope = np.linalg.norm(jacobian @ first)
    assert from_rest.legs[0].end == pytest.approx(LEAD * 0.1 / slope, rel=1e-9)
    start_speed = 0.1 / slope * np.linalg.norm(first)
    moving = Problem.of(robot, task_with(task, start_speed=float(start_speed)))
    assert moving.legs[0].speed == 0.1
    assert moving.leg_rates[0][0] == pytest.approx(0.1 / slope, rel=1e-6)


CIRCLE = {"circle": {"center": [0.5, 0.0, 0.5], "normal": [0, 0, 1]}}


@pytest.mark.parametrize("last", [0.1, 0.2])
def test_the_seam_of_a_periodic_motion_has_a_lead_between_two_speeds(last):
    parts = [part(0.1, 0.0, 0.3), part(last, 0.6, 1.0)]
    bound = problem([CIRCLE], parts, {"periodic": True})
    speeds = [leg.speed for leg in bound.legs]
    assert speeds == [0.1, None, 0.1] if last == 0.1 else [None, 0.1, None, last]
    if last > 0.1:
        assert bound.legs[0].end == pytest.approx(LEAD * last / bound.path.length)


def test_rates_where_legs_meet():
    """On lines ds/dt is the speed over the path's length."""
    ends = {"start_speed": 0.3, "end_speed": 0.06}
    bound = problem(STOPPING, part(0.12, 0.8, 0.9), ends)
    expected = [0.3 / 0.6, 0.0, 0.0, 0.2, 0.2, 0.1]
    assert [rates[0] for rates in bound.leg_rates] == pytest.approx(expected[:-1])
    assert [rates[1] for rates in bound.leg_rates] == pytest.approx(expected[1:])
    assert [law is None for law in bound.time_laws] == [True, True, True, False, True]
    begins = [path.breaks[0] for path in bound.leg_paths]
    assert begins == [leg.begin for leg in bound.legs]
    first = bound.leg_paths[0].sample([bound.legs[0].end])
    assert_allclose(first.xi, [[0.6, 0.0, 0.0]], atol=1e-12)


def test_rates_at_the_seam_of_a_periodic_motion():
    rate = 0.1 / (0.2 * np.pi)
    for parts in (part(0.1, 0.0, 0.5), part(0.1, 0.5, 1.0)):
        bound = problem([CIRCLE], parts, {"periodic": True})
        flat = [rate for rates in bound.leg_rates for rate in rates]
        assert flat == pytest.approx([rate] * 4)
    free = problem([CIRCLE], part(0.1, 0.2, 0.5), {"periodic": True})
    assert free.leg_rates[0] == pytest.approx((0.0, rate))
