"""Figures that are hardly meant: which are told, how, and that real robots are left in peace."""

import re
import sys
import warnings
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
import yaml
from scipy.spatial.transform import Rotation

import brachis
from brachis import LimitSpec
from brachis.errors import BrachisError, PathError, PlausibilityError, StartError
from brachis.problem.plausibility import of_end_time, of_robot
from brachis.problem.task_plausibility import of_task
from brachis.robot import Robot
from brachis.robot.plausibility import refuse_issues
from brachis.robot.urdf import default_chain, read_file
from support.chains import Joint, chain_urdf
from support.scara import SCARA, START

ROOT = Path(__file__).parents[2]
RAIL = ROOT / "robots/tx90l_rail/robot.urdf"
PACKAGE = "cmeel.prefix/share/example-robot-data/robots"
FOREIGN = sorted(
    file
    for folder in map(Path, sys.path)
    for file in (folder / PACKAGE).rglob("*.urdf")
)
OWN = sorted((ROOT / "robots").rglob("*.urdf"))


def task(robot=None, **changes):
    base = yaml.safe_load("""
    brachis: 1
    task_space: [x, y]
    path: [{line: {length: 0.5, angle_deg: 90}}]
    redundant_joints: [j3]
    spline: {intervals: 10}
    search: {effort: single}
    """)
    robot = with_limits() if robot is None else robot
    return base | {"start": {"joints": START}, "robot": robot} | changes


def with_limits(**limits):
    limits = {"torque": 10, "velocity": None, **limits}
    return {"urdf": str(SCARA), "gravity": [0, 0, 0], "limits": limits}


def path_of_joints(*points):
    path = [{"spline": {"through": points}}]
    return {"task_space": "joints", "redundant_joints": "auto", "path": path}


def remarks_on(**changes):
    return of_task(brachis.load_task(task(**changes)))


def remark_that_refuses(content, **options):
    """The one figure for which a task is refused, and the refusal's hint."""
    with pytest.raises(PlausibilityError) as caught:
        brachis.plan(content, **options)
    (remark,) = caught.value.remarks
    return remark, caught.value.hint


def hint_of(content, kind, message):
    """The hint of the error that a task gives."""
    with pytest.raises(kind, match=message) as caught:
        brachis.plan(content)
    return caught.value.hint


def expect_warning(words):
    return pytest.warns(brachis.PlausibilityWarning, match=words)


def arm(*, length=0.4, mass=2.0, inertia=0.01, slide=False):
    matrix = " ".join(f'{key}="{inertia}"' for key in ("ixx", "iyy", "izz"))
    inertial = f'<inertial><mass value="{mass}"/><inertia {matrix} ixy="0" ixz="0" iyz="0"/></inertial>'
    kinds = ("prismatic" if slide else "revolute", "revolute", "revolute")
    joints = [Joint(kind, xyz=(length, 0.0, 0.0), inertial=inertial) for kind in kinds]
    return Robot.from_urdf(
        "file.urdf", urdf_text=chain_urdf(joints, tool=(length, 0.0, 0.0))
    )


def issues_of(robot):
    return [(remark.where, remark.message) for remark in of_robot(robot)]


UNLIMITED = LimitSpec(torque=None, velocity=None, acceleration=1.0)


@pytest.mark.parametrize(
    "file", [*OWN, *FOREIGN], ids=lambda file: f"{file.parent.name}/{file.name}"
)
def test_the_limits_of_real_urdfs_are_plausible(file):
    try:
        limb = default_chain(read_file(file), file.name)
        robot = Robot.from_urdf(
            file, tool_frame=limb.tool, base_frame=limb.base, limits=UNLIMITED
        )
    except BrachisError:
        assert file not in OWN
        return
    limits = robot.urdf_limits
    speeds = np.array([limit.velocity or np.inf for limit in limits])
    torques = np.array([limit.effort or np.inf for limit in limits])
    for magnitudes in ({"velocity": speeds}, {"torque": torques}):
        limited = robot.limits.with_magnitudes(**magnitudes)
        assert of_robot(replace(robot, limits=limited)) == ()


def test_velocities_and_ranges_in_degrees():
    robot = arm()
    assert issues_of(robot) == []
    fast = robot.with_limits(velocity=[180.0, 29.0, 1000.0])
    assert issues_of(fast) == [
        ("robot.limits.velocity.j1", "the velocity limit looks like degrees per second")
    ]
    wide = robot.with_limits(position=[[-180.0, 180.0], [0.2, 1e4], [-12.0, 12.0]])
    assert issues_of(wide) == [
        ("robot.limits.position.j1", "the position range looks like degrees")
    ]


def test_damping_that_stands_for_a_simulator():
    joints = [
        Joint("revolute", xyz=(0.4, 0.0, 0.0), extra=f"<dynamics damping='{damping}'/>")
        for damping in (19, 21)
    ]
    text = chain_urdf(joints, tool=(0.4, 0.0, 0.0))  # 60 Nm at 3 rad/s
    message = "the damping in the URDF needs more than the maximum torque at the maximum speed"
    assert issues_of(Robot.from_urdf("x", urdf_text=text)) == [
        ("robot.friction.viscous.j2", message)
    ]
    for chosen in (None, 21.5):  # the task's own figure is meant
        friction = {"viscous": chosen}
        robot = Robot.from_urdf("x", urdf_text=text, friction=friction)
        assert issues_of(robot) == []


def test_rails_in_mm():
    ranges = [[-2000.0, 2000.0], [-3.0, 3.0], [-3.0, 3.0]]
    limits = {"velocity": [1500.0, 3.0, 3.0], "position": ranges}
    rail = arm(slide=True).with_limits(**limits)
    assert issues_of(rail) == [
        ("robot.limits.velocity.j1", "the velocity limit looks like mm per second"),
        ("robot.limits.position.j1", "the position range looks like mm"),
    ]


def test_a_placeholder_that_is_scaled_stays_one():
    limits = LimitSpec(velocity=100.0, scale={"velocity": 0.7})
    assert issues_of(Robot.from_urdf(SCARA, limits=limits)) == []


def test_lengths_in_mm():
    message = "the distance from the previous joint looks like mm"
    assert issues_of(arm(length=400.0)) == [
        (f"URDF origin of {name}", message) for name in ("j2", "j3", "tool")
    ]


def test_masses_in_g_and_inertias_in_kg_mm2():
    for robot, expected in (
        (arm(mass=2000.0, inertia=10.0), "the mass looks like g"),
        (arm(mass=2.0, inertia=1e4), "the inertia looks like kg mm^2"),
    ):
        assert {message for _, message in issues_of(robot)} == {expected}


def test_the_masses_of_all_bodies_are_told_of_the_robot():
    issues = of_robot(arm(mass=2000.0))
    (joined,) = refuse_issues(issues, strict=False)
    assert joined.where == "robot"
    assert "URDF inertials that joint j1 moves 2000 kg" in joined.found


@pytest.mark.parametrize(
    "payload, where",
    [
        ({"mass": 500.0}, "robot.payload.mass"),
        ({"mass": 5000.0}, "robot.payload.mass"),
        ({"mass": 2.0, "com": [0.0, 0.0, 120.0]}, "robot.payload.com"),
        (
            {"mass": 2.0, "inertia": {"ixx": 3000, "iyy": 3000, "izz": 3000}},
            "robot.payload.inertia",
        ),
    ],
)
def test_a_payload_in_g_and_mm(payload, where):
    """And the links of the URDF, which are sound, are not blamed for it."""
    robot = brachis.robots.iiwa14
    assert not of_robot(robot.with_payload(14.0, com=[0.0, 0.0, 0.12]))
    assert [key for key, _ in issues_of(robot.with_payload(**payload))] == [where]


@pytest.mark.parametrize(
    "limits, remark",
    [
        (
            "speed: 250.0",
            "tool_limits.speed: the limit looks like mm/s; found 250 m/s; usual: below 50 m/s, or null",
        ),
        (
            "speed: {s: [0.0, 1.0], speed: [0.2, 200.0]}",
            "tool_limits.speed: the limit looks like mm/s; found 200",
        ),
        (
            "process_speed: {speed: 100.0, s: [0.2, 0.8]}",
            "tool_limits.process_speed: the speed looks like mm/s; found 100 m/s; usual: below 50 m/s",
        ),
        (
            "acceleration: 1000.0",
            "tool_limits.acceleration: the limit looks like mm/s^2; found 1000 m/s^2",
        ),
        (
            "angular_speed: 90.0",
            "tool_limits.angular_speed: the limit looks like degrees per second; found 90 rad/s",
        ),
    ],
)
def test_limits_of_the_tool_in_mm_and_degrees(limits, remark):
    (found,) = remarks_on(tool_limits=yaml.safe_load(limits))
    assert str(found).startswith(remark)


def test_usual_limits_of_the_tool_and_no_limit_are_plausible():
    usual = {"speed": 2.0, "acceleration": 20.0, "angular_speed": 3.0}
    assert not remarks_on(tool_limits=usual)
    assert not remarks_on(tool_limits={"speed": 1e6})  # written for "no limit"


def test_a_dwell_in_ms():
    line = {"line": {"by": [0.1, 0.0]}}

    def with_dwell(dwell):
        return remarks_on(path=[{**line, "dwell": dwell}, line])

    (found,) = with_dwell(500.0)
    assert str(found).startswith("path[0].dwell: the time looks like ms; found 500 s")
    assert with_dwell(60.0) == ()


def test_the_least_end_time():
    assert of_end_time(1e-4, 1e-4) != ()
    assert of_end_time(1e-3, 1e-4) == ()
    with expect_warning("the end time is the smallest that the planner allows"):
        result = brachis.plan(task(with_limits(torque=1e12)))
    assert [remark.where for remark in result.warnings] == ["t_end"]


SCALED = with_limits(scale={"velocity": 50})


def test_warnings_are_emitted_and_kept_in_the_result():
    with expect_warning(r"robot\.limits\.scale\.velocity.*found 50") as caught:
        result = brachis.plan(task(SCALED))
    first, slow = caught
    assert first.filename == slow.filename == __file__
    assert slow.category is brachis.SlowTimingWarning
    assert result.to_dict()["warnings"][:1] == [
        {
            "where": "robot.limits.scale.velocity",
            "message": "the factor raises limits far above the stated values",
            "found": "50",
            "usual": "0.1 to 1; a percentage is divided by 100",
            "advice": "",
        }
    ]


def test_a_plausible_plan_has_no_warnings():
    with warnings.catch_warnings():
        warnings.simplefilter("error", brachis.PlausibilityWarning)
        result = brachis.plan(task(), strict=True)
    # Twenty intervals are slow, which is no implausible figure.
    assert [issue.where for issue in result.warnings] == ["spline.intervals"]


def test_strict_refuses_before_the_plan(monkeypatch):
    monkeypatch.setattr("brachis.planner.Search", lambda *_: pytest.fail("planned"))
    with pytest.raises(PlausibilityError, match=r"scale\.velocity") as caught:
        brachis.plan(task(SCALED), strict=True)
    assert caught.value.exit_code == 2
    assert len(caught.value.remarks) == 1


def test_a_posture_in_degrees_where_joints_turn_without_end():
    # 30, -120 and 120 rad are reached all the same: joints of this arm have no range.
    degrees = {"start": {"joints": [30.0, -120.0, 120.0]}}
    remark, hint = remark_that_refuses(task(**degrees))
    assert remark.startswith(
        "start.joints: the position looks like degrees; found j1 30 rad, j2 -120 rad, j3 120 rad;"
    )
    assert "30 degrees are 0.523599 rad; in a task file: !degrees 30" in remark
    assert remark.count("!degrees") == 1, "once, not for every joint"
    for way_out in ("strict: false", "strict=False", "--no-strict"):
        assert way_out in hint
    with expect_warning("looks like degrees"):
        by_keyword = brachis.plan(task(**degrees), strict=False)
    with expect_warning("looks like degrees"):
        in_the_task = brachis.plan(task(**degrees, strict=False))
    assert by_keyword.verified
    for result in (by_keyword, in_the_task):
        places = [issue.where for issue in result.warnings]
        assert places == ["start.joints", "spline.intervals"]


def test_a_posture_in_degrees_is_named_by_its_key():
    home = {"postures": {"home": [30.0, -120.0, 120.0]}, "start": "home"}
    remark, _ = remark_that_refuses(task(**home))
    assert remark.startswith("postures.home: the position looks like degrees; found j1")
    assert "in a task file: !degrees 30" in remark


WAVE = np.linspace(0.0, 1.5, 50)[:, None]


@pytest.mark.parametrize(
    "tolerance, remark",
    [
        (
            0.1,
            (
                "path: points: tolerance.position: the tolerance looks like mm; found 0.1 m; "
                "usual: below 0.005 m; 0.1 m are 100 mm; write '0.1 mm' for mm"
            ),
        ),
        ("0.1 mm", None),
        (0.004, None),
    ],
)
def test_the_tolerance_of_a_fit_in_mm(tolerance, remark):
    """The unit of bare numbers is m, whatever that of the points is."""
    circle = 200.0 * np.hstack([np.cos(WAVE), np.sin(WAVE)])
    path = brachis.fit_path(
        circle, tolerance={"position": tolerance}, units={"length": "mm"}
    )
    issues = remarks_on(path=path)
    assert [str(issue) for issue in issues] == ([remark] if remark else [])


def test_only_the_start_posture_is_an_error_by_default():
    content = task(**path_of_joints([33.0, -2.0, 2.0]))
    with expect_warning(r"path\.j1: the position looks like degrees; found 33 rad"):
        assert brachis.plan(content).verified


def test_yaw_of_the_path_start_in_degrees():
    content = task(
        start="free",
        path_start=[1.7, 0.0, 90.0],
        task_space=["x", "y", "yaw"],
        redundant_joints=[],
        path=[{"line": {"by": [0.0, 0.2, 0.0]}}],
    )
    remark, _ = remark_that_refuses(content, strict=True)
    told = "path_start: the angle looks like degrees; found 90 rad"
    assert remark.startswith(told)


@pytest.mark.parametrize(
    "joints, hint",
    [
        ([0, 17, 11, 86, 11, 69, 6], "It looks like degrees: 17 deg are 0.296706 rad"),
        ([300, 0.3, 0.2, 1.5, 0.2, 1.2, 0.1], "It looks like mm: 300 mm are 0.3 m"),
        (
            [2.5, 0.3, 0.2, 1.5, 0.2, 1.2, 0.1],
            "Change the posture, or the range with robot.limits.position.rail",
        ),
        (
            [0, 4.0, 0.2, 1.5, 0.2, 1.2, 0.1],
            "Change the posture, or the range with robot.limits.position.joint_1",
        ),
    ],
)
def test_the_hint_of_a_posture_out_of_range(joints, hint):
    content = task(
        robot={"urdf": str(RAIL)},
        start={"joints": joints},
        task_space="pose",
        redundant_joints=["rail"],
        path=[{"line": {"by": [0, 0.2, 0]}}],
    )
    assert hint_of(content, StartError, "range") == hint


@pytest.mark.parametrize(
    "line, changes",
    [
        ("{length: 500.0, angle_deg: 90}", {}),
        ("to: [1500.0, 300.0]", {}),
        (
            "{length: 500.0, angle_deg: 90}",
            {"start": "free", "path_start": [1732.05, 0.0]},
        ),
    ],
)
def test_a_path_in_mm_is_out_of_reach_and_the_hint_says_why(line, changes):
    content = task(path=[{"line": yaml.safe_load(line)}], **changes)
    hint = hint_of(content, PathError, "out of reach")
    words = r"The path looks like mm: divided by 1000 it is [\d.]+ m away"
    assert re.match(words, hint)


def test_a_turn_in_degrees_is_out_of_reach_and_the_hint_says_why():
    content = task(task_space=["x", "y", "yaw"], path=[{"line": {"by": [0, 0.3, 90]}}])
    del content["redundant_joints"]
    with expect_warning("looks like degrees"):
        hint = hint_of(content, PathError, "out of reach")
    assert hint == "The turn of the angle looks like degrees: 90 rad"


def test_a_path_that_is_too_long_in_metres_has_no_such_hint():
    content = task(path=[{"line": {"length": 5.0, "angle_deg": 90}}])
    assert "mm" not in hint_of(content, PathError, "out of reach")


def test_a_path_start_in_mm():
    at_tool, beside, in_metres = (
        hint_of(task(path_start=[x, 0.0]), StartError, "off the path")
        for x in (1732.05, 1432.0, 1.7)
    )
    divided = "The path looks like mm: divided by 1000 it is"
    assert at_tool == f"{divided} where the tool is"
    assert beside.startswith(divided)
    assert "mm" not in in_metres


def test_a_robot_in_mm_is_told_before_its_posture_fails():
    text = SCARA.read_text().replace('xyz="1 0 0"', 'xyz="1000 0 0"')
    assert text != SCARA.read_text()
    robot = Robot.from_urdf("mm.urdf", urdf_text=text, gravity=[0, -9.81, 0])
    with expect_warning("looks like mm"), pytest.raises(StartError, match="gravity"):
        brachis.plan(robot, task(robot={}))


@pytest.mark.parametrize(
    "limits, told_of, sound",
    [
        (
            "torque: 320000.0",
            "torque.joint_1: the torque limit looks like mNm",
            "torque: 320.0",
        ),
        (
            "torque: 10000.0",
            "torque.joint_6: the torque limit looks like mNm",
            "torque: 1000.0",
        ),
        (
            "velocity: 50.0",
            "velocity.joint_1: the velocity limit looks like degrees",
            "velocity: 10.0",
        ),
        (
            "acceleration: 573.0",
            "acceleration.joint_1: the acceleration limit looks like",
            "acceleration: 50.0",
        ),
        (
            "position: {joint_1: [-45.0, 45.0]}",
            "position.joint_1: the position range looks like degrees",
            "position: {joint_1: [-6.0, 6.0]}",
        ),
        (
            "torque_speed: {joint_1: [[0, 320], [10, 320], [20, 0]]}",
            (
                "torque_speed.joint_1: the last speed of the curve looks like rpm; found 20 rad/s; usual: below 7.42 "
                "rad/s"
            ),
            "torque_speed: {joint_1: [[0, 320], [1, 320], [2, 0]]}",
        ),
        (
            "torque_speed: {joint_1: [[0, 320000], [2, 0]]}",
            "torque_speed.joint_1: the torque of the curve looks like mNm",
            "torque_speed: {joint_1: [[0, 600], [2, 0]]}",
        ),
    ],
)
def test_limits_beside_those_of_the_urdf(limits, told_of, sound):
    robot = brachis.robots.iiwa14
    assert any(
        str(remark).startswith(f"robot.limits.{told_of}")
        for remark in of_robot(robot.with_limits(**yaml.safe_load(limits)))
    )
    assert of_robot(robot.with_limits(**yaml.safe_load(sound))) == ()


@pytest.mark.parametrize(
    "name, mass", [("scara3", 300.0), ("iiwa14", 100.0), ("tx90l_rail", 300.0)]
)
def test_a_payload_in_g_that_an_arm_of_this_size_could_carry(name, mass):
    robot = getattr(brachis.robots, name)
    assert issues_of(robot.with_payload(mass)) == [
        ("robot.payload.mass", "the mass looks like g")
    ]
    assert issues_of(robot.with_payload(15.0)) == []


def test_the_tool_offset_and_the_mounting_in_mm():
    made = Robot.from_urdf(
        RAIL, tool_offset={"xyz": [0, 0, 120.0]}, mounting={"xyz": [0, 0, 3000.0]}
    )
    places = [where for where, _ in issues_of(made)]
    assert places == ["robot.tool_offset.xyz", "robot.mounting.xyz"]


def test_speeds_of_the_ends_in_mm():
    (found,) = remarks_on(boundary={"end_speed": 100.0})
    told = "boundary.end_speed: the speed looks like mm/s; found 100 m/s"
    assert str(found).startswith(told)


BENT = [0.0, 0.3, 0.0, -1.2, 0.0, 0.8, 0.0]


def test_waypoints_in_degrees_leave_the_range_and_the_hint_says_why():
    content = task(
        robot={"urdf": "iiwa14"},
        start={"joints": BENT},
        **path_of_joints([35.0, 28.0, -17.0, -50.0, 23.0, 35.0, 28.0]),
    )
    message = "joint 'joint_1' is out of its range; found 35 rad at s = 1"
    hint = hint_of(content, PathError, message)
    assert hint == "It looks like degrees: 35 deg are 0.610865 rad"


def test_waypoints_in_degrees_of_joints_without_a_range():
    content = task(**path_of_joints([90.0, -60.0, 45.0]))
    remark, _ = remark_that_refuses(content, strict=True)
    assert remark.startswith(
        "path: the position looks like degrees; found j1 90 rad, j2 -60 rad, j3 45 rad;"
    )
    assert "90 degrees are 1.5708 rad" in remark
    assert "!degrees" not in remark, "waypoints need not be in a task file"


def test_a_path_of_joints_may_wind_and_its_end_speeds_are_in_rad(recwarn):
    path = [{"line": {"by": [4.0 * np.pi, 1.0, 0.5]}}]
    wind = path_of_joints() | {"path": path}
    (slow,) = brachis.plan(task(**wind)).warnings
    assert slow.where == "spline.intervals"
    assert {each.category for each in recwarn} == {brachis.SlowTimingWarning}
    content = task(**wind, boundary={"end_speed": 90.0})
    remark, _ = remark_that_refuses(content, strict=True)
    assert re.search(
        r"end_speed: .* degrees per second; found 90 rad/s \(m/s\)", remark
    )


def test_lengths_of_a_gantry_in_mm():
    content = {
        "brachis": 1,
        "robot": {"urdf": "gantry2"},
        "start": {"joints": [0.0, 0.0]},
        "task_space": ["x", "y"],
    }
    far = {**content, "path": [{"line": {"by": [500.0, 200.0]}}]}
    hint = hint_of(far, PathError, r"out of reach from s = .* at most 1\.6 m")
    assert hint == "The path looks like mm: divided by 1000 it is 0.539 m away"
    corner = [{"line": {"by": [0.5, 0.0]}, "blend": 50.0}, {"line": {"by": [0.0, 0.3]}}]
    hint = hint_of({**content, "path": corner}, PathError, "longer than half")
    assert hint == "It looks like mm: 50 mm are 0.05 m"


def test_points_in_mm_or_in_another_order_do_not_start_where_the_tool_is():
    points = np.array([[1.7320508, 0.0], [1.7, 0.2], [1.6, 0.4], [1.4, 0.6]])
    for given, hint in (
        (
            1000.0 * points,
            "The path looks like mm: divided by 1000 it is where the tool is",
        ),
        (
            points[:, ::-1],
            "The numbers may be in the order y, x: read in this order, they are where the tool is",
        ),
    ):
        content = brachis.load_task(task(path=brachis.fit_path(given)))
        with warnings.catch_warnings(action="ignore"):
            assert hint_of(content, PathError, "does not start where") == hint


def test_a_quaternion_with_its_scalar_last():
    robot = brachis.robots.iiwa14
    placed = robot.tool_placement(np.array(BENT))
    turn = Rotation.from_matrix(placed.rotation).as_quat()
    place = {"position": placed.translation, "quaternion_wxyz": turn}
    ways = {
        "start": BENT,
        "task_space": "pose",
        "path": brachis.Line(by=[0.0, 0.1, 0.0]),
    }
    with pytest.raises(StartError, match="off the path") as caught:
        brachis.plan(robot, path_start=place, **ways)
    advice = "If it is a quaternion x, y, z, w: write quaternion_xyzw"
    assert caught.value.hint == advice


@pytest.mark.parametrize(
    "angle, is_doubted",
    [(1.57, True), (3.14, True), (-0.785, True), (np.pi, True)]
    + [(angle, False) for angle in (0.0, 0.5, 5.5, 11.0, 45.0)],
)
def test_an_angle_in_rad_where_degrees_belong(angle, is_doubted):
    path = [{"line": {"length": 0.5, "angle_deg": angle}}]
    issues = [str(issue) for issue in remarks_on(path=path)]
    said = "path[0].line.angle_deg: the angle looks like rad"
    assert [issue.startswith(said) for issue in issues] == [True] * is_doubted


def test_an_angle_in_rad_of_a_start_a_frame_or_a_body():
    place = {"xyz": [1.0, 0.0, 0.0], "rpy_deg": [0.0, 0.0, 1.5708]}
    issues = remarks_on(
        task_space="pose",
        path_start={"position": [1.0, 0.0, 0.0], "rpy_deg": [3.14159, 0.0, 0.0]},
        frames={"table": place},
        scene=[{"box": [1, 1, 1], "position": [3, 0, 0], "rpy_deg": [0, 0, 1.5708]}],
    )
    assert sorted(issue.where for issue in issues) == [
        "frames.table.rpy_deg[2]",
        "path_start.rpy_deg[0]",
        "scene[0].rpy_deg[2]",
    ]


def test_a_joint_that_is_locked_in_degrees():
    in_degrees, in_rad = (
        issues_of(Robot.from_urdf(SCARA, locked_joints={"j1": position}))
        for position in (90.0, 1.5)
    )
    told = "robot.locked_joints.j1", "the position looks like degrees"
    assert told in in_degrees
    assert not in_rad
