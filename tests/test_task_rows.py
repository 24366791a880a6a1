"""Rows of position with an angle, and the tool's axis: plans against analytic times and Pinocchio."""

import numpy as np
import pinocchio as pin
import pytest
from numpy.testing import assert_allclose

import brachis
from brachis.ik import default_task_space, find_all
from brachis.path import build_path
from brachis.robot import Robot, bind, task_map_of
from brachis.task import task_with
from support.chains import Joint, chain_urdf

AXES = {"x": (1.0, 0.0, 0.0), "y": (0.0, 1.0, 0.0), "z": (0.0, 0.0, 1.0)}
SCARA, PALLETISER, GANTRY = "ZZzZ", "ZzxZ", "xyzZ"
YAWING = ["x", "y", "z", "yaw"]


def chain(word, tool=(0.1, 0.0, -0.1)):
    """Make a robot from letters: slides along x, y, z and turns about X, Y, Z."""
    joints = []
    for letter in word:
        slides = letter.islower()
        bound = 1.5 if slides else 3.1
        limit = {"lower": -bound, "upper": bound, "velocity": 4.0, "effort": 200.0}
        kind = "prismatic" if slides else "revolute"
        turned = bool(joints) and joints[-1].kind == "revolute"
        offset = (0.4 if turned else 0.05, 0.0, 0.03)
        joints.append(Joint(kind, AXES[letter.lower()], offset, limit=limit))
    return Robot.from_urdf("chain", urdf_text=chain_urdf(joints, tool=tool))


QUICK = {
    "search": {"effort": "single", "least_motion": False},
    "spline": {"intervals": 8},
}


def plan(robot, start, space, path, **keywords):
    """Plan with little search."""
    settings = {**QUICK, **keywords}
    return brachis.plan(robot, start=start, task_space=space, path=path, **settings)


def tool_along(trajectory):
    """Path coordinates, and placements of the tool's frame by Pinocchio, along a saved motion."""
    model = pin.buildModelFromXML(trajectory.urdf)
    data = model.createData()
    frame = model.getFrameId(trajectory.robot.settings.tool_frame or "tool")
    samples = trajectory.sample(trajectory.t_end / 200)
    placements = []
    for q in samples.q[:, : model.nq]:
        pin.framesForwardKinematics(model, data, q)
        placements.append(data.oMf[frame].copy())
    return samples.s, placements


@pytest.mark.parametrize(
    "word, start, by",
    [
        (SCARA, [0.3, 1.2, 0.1, 0.2], [-0.1, 0.12, 0.05, 0.8]),
        (SCARA, [0.3, 1.2, 0.1, 0.2], [0.0, 0.0, 0.0, -1.5]),
        (PALLETISER, [0.3, 0.3, 0.2, 0.2], [-0.1, 0.12, -0.05, -1.0]),
        (GANTRY, [0.1, 0.1, 0.1, 0.2], [0.3, 0.1, -0.1, 1.0]),
        ("zZZZ", [0.1, 0.3, 1.2, -0.4], [-0.1, 0.02, 0.05, 0.4]),
        ("ZZzZZ", [0.3, 0.9, 0.1, 0.4, 0.2], [-0.1, 0.12, 0.05, 0.8]),
    ],
)
def test_position_and_yaw_follow_the_line(word, start, by, tmp_path):
    result = plan(chain(word), start, YAWING, [{"line": {"by": by}}])
    assert result.verified
    file = tmp_path / "motion.npz"
    result.trajectory.save(file)
    s, placements = tool_along(brachis.Trajectory.load(file))
    first = placements[0]
    moved = [placed.translation - first.translation for placed in placements]
    assert_allclose(moved, np.outer(s, by[:3]), atol=1e-8)
    turned = [pin.log3(placed.rotation @ first.rotation.T) for placed in placements]
    assert_allclose(turned, np.outer(s, [0.0, 0.0, by[3]]), atol=1e-8)


LIMITS = {"torque": None, "velocity": 20.0}
BANG_BANG = [
    # The joint that takes longest from rest to rest decides: t = 2 sqrt(d / a).
    (GANTRY, [0.0, 0.0, 0.1, 0.2], [0.5, 0.4, 0.1, 1.0], [3.0, 2.0, 4.0, 10.0]),
    (SCARA, [0.3, 1.2, 0.1, 0.2], [0.0, 0.0, 0.3, 0.5], [20.0, 20.0, 5.0, 40.0]),
]


@pytest.mark.parametrize("word, start, by, accelerations", BANG_BANG)
def test_the_time_where_one_joint_decides(word, start, by, accelerations):
    tool = (0.0, 0.0, -0.1)  # on the last axis
    robot = chain(word, tool).with_limits(**LIMITS, acceleration=accelerations)
    result = plan(robot, start, YAWING, [{"line": {"by": by}}], spline={})
    assert result.verified
    exact = max(2.0 * np.sqrt(np.abs(by) / accelerations))
    assert result.t_end == pytest.approx(exact, rel=1e-3)
    assert result.t_end >= exact * (1.0 - 1e-6)


def test_the_time_of_a_quill_by_its_force():
    robot = chain(SCARA, (0.0, 0.0, -0.1)).with_limits(torque={"j3": 120.0})
    line = [{"line": {"by": [0.0, 0.0, 0.3, 0.0]}}]
    start = [0.3, 1.2, 0.1, 0.2]
    at_rest = {"rest": "velocity"}
    result = plan(robot, start, YAWING, line, search={}, spline=at_rest)
    mass = 4.0  # two bodies of 2 kg
    up = 120.0 / mass - 9.81
    down = 120.0 / mass + 9.81
    exact = np.sqrt(2.0 * 0.3 * (1.0 / up + 1.0 / down))
    assert result.t_end == pytest.approx(exact, rel=1e-3)


@pytest.mark.parametrize(
    "word, rows, family",
    [
        (SCARA, YAWING, "planar"),
        (SCARA, ["z", "y", "x", "yaw"], "planar"),
        (PALLETISER, YAWING, "planar"),
        (GANTRY, YAWING, "planar"),
        ("xyzY", ["x", "y", "z", "pitch"], "planar"),
        ("zZZZ", YAWING, "planar"),
        ("yYYY", ["x", "y", "z", "pitch"], "planar"),
        ("YYY", ["x", "z", "pitch"], "planar"),
        (SCARA, ["x", "z", "yaw"], None),
        (SCARA, ["z", "yaw"], None),
    ],
)
def test_closed_forms(word, rows, family):
    robot = chain(word)
    found = find_all(robot, task_map_of(robot, rows))
    assert {choice.family for choice in found} == {family}


@pytest.mark.parametrize(
    "word, rows, start, by",
    [
        (SCARA, ["x", "z", "yaw"], [0.3, 1.2, 0.1, 0.2], [-0.1, 0.1, 0.3]),
        (SCARA, ["yaw"], [0.3, 1.2, 0.1, 0.2], [1.0]),
        ("YYYY", ["x", "z", "pitch"], [0.3, 0.8, 0.4, 0.3], [-0.1, 0.1, 0.5]),
    ],
)
def test_charts_serve_rows_without_a_closed_form(word, rows, start, by):
    result = plan(chain(word), start, rows, brachis.Line(by=by))
    assert result.verified
    s, placements = tool_along(result.trajectory)
    space = task_map_of(chain(word), rows)
    positions = np.array([tool.translation for tool in placements])
    rotations = np.array([tool.rotation for tool in placements])
    values = space.of_placements(positions, rotations)
    missed = space.difference(values, values[0] + np.outer(s, by))
    assert np.abs(missed).max() < 1e-8


IIWA = [0.1, 0.5, 0.2, -1.2, 0.3, 0.9, 0.1]
ABOUT_Y = {"rotate": {"axis": [0, 1, 0], "angle_deg": 20}}


@pytest.mark.parametrize(
    "space, segment, by",
    [
        ("axis", {"turn": ABOUT_Y}, []),
        (
            ["y", "x", "axis"],
            {"line": {"by": [0.1, 0.05]}, "orientation": ABOUT_Y},
            [0.1, 0.05],
        ),
    ],
    ids=["axis", "y, x, axis"],
)
def test_the_axis_of_the_tool_and_rows_of_its_position(space, segment, by):
    robot = brachis.robots.iiwa14
    result = plan(robot, IIWA, space, [segment])
    assert result.verified
    sample = result.sample(result.t_end / 100)
    positions, rotations = robot.tool_placements(sample.q[:, : robot.n])
    axes = rotations[:, :, 2]
    about = [pin.exp3(s * np.deg2rad([0.0, 20.0, 0.0])) for s in sample.s]
    assert_allclose(axes, np.array(about) @ axes[0], atol=1e-8)
    moved = (positions - positions[0])[:, [1, 0]]
    assert not by or np.abs(moved - np.outer(sample.s, by or [0, 0])).max() < 1e-8


@pytest.mark.parametrize("rows", [["axis"], ["z", "axis"], ["y", "x", "axis"]], ids=str)
def test_rows_with_the_axis_against_differences(rows):
    robot, task_map = bind(brachis.robots.iiwa14, rows)
    rng = np.random.default_rng(2)
    q, qdot, qddot = rng.normal(size=(3, 4, robot.n))
    h = 1e-5

    def at(t):
        """Postures on a parabola."""
        return q + t * qdot + 0.5 * t * t * qddot

    velocity = task_map.difference(task_map.values(at(h)), task_map.values(at(-h)))
    slopes = task_map.derivatives(task_map.twists(q), qdot, qddot).velocity_q

    def rate_at(t):
        """Task velocities of the postures there, with the rates of the first."""
        slopes = task_map.jacobian(task_map.twists(q + t * qdot))
        return np.einsum("kmn,kn->km", slopes, qdot)

    assert_allclose(rate_at(0.0), velocity / (2.0 * h), atol=1e-7)
    changed = (rate_at(h) - rate_at(-h)) / (2.0 * h)
    bias = np.einsum("kmn,kn->km", slopes, qdot)
    assert_allclose(bias, changed, atol=1e-6)


def test_samples_of_a_path_with_the_axis_against_differences():
    rows = ["x", "y", "axis"]
    _, task_map = bind(brachis.robots.iiwa14, rows)
    turning = {"rotate": {"axis": [1, 2, 0.5], "angle_deg": 80, "profile": "smooth"}}
    line = brachis.Line(by=[0.1, 0.2], orientation=turning)
    segments = task_with(start=IIWA, task_space=rows, path=line).path
    path = build_path(segments, task_map.value(np.append(IIWA, 0.0)), task_map.rows)
    s, h = np.linspace(0.1, 0.9, 7), 1e-5
    before, here, after = (path.sample(s + step) for step in (-h, 0.0, h))
    velocity = task_map.difference(after.target, before.target) / (2.0 * h)
    assert_allclose(here.xi, velocity, atol=1e-7)
    assert_allclose(here.xi_ds, (after.xi - before.xi) / (2 * h), atol=1e-7)
    assert_allclose(here.xi_dds, (after.xi_ds - before.xi_ds) / (2 * h), atol=1e-6)


@pytest.mark.parametrize(
    "word, space",
    [
        (SCARA, YAWING),
        (PALLETISER, YAWING),
        (GANTRY, YAWING),
        ("xyzY", ["x", "y", "z", "pitch"]),
        ("zzzZ", ["x", "y", "z"]),
        ("YYY", ["x", "z"]),
        ("ZZz", ["x", "y", "z"]),
    ],
)
def test_the_task_space_that_a_robot_has_by_default(word, space):
    assert default_task_space(chain(word)) == space


TURN = [{"turn": ABOUT_Y}]


@pytest.mark.parametrize(
    "word, space, path, texts",
    [
        ("zZz", ["x", "y", "yaw"], None, ["x, y of the tool depend", "moved by j2", "[x, yaw]"]),
        ("ZZZZ", YAWING, None, ["no joint changes z", "allowed: [x, y, yaw]"]),
        (SCARA, ["x", "y", "axis"], [{"line": {"by": [0.1, 0.0]}}], ["no joint changes rx, ry", "prescribe rows"]),
        ("YYYY", "axis", TURN, ["rx, rz of the tool depend", "tool_roll"]),
        (SCARA, "pose", [{"line": {"by": [0.1, 0, 0]}}], ["such as [x, y, z, yaw]"]),
        (PALLETISER, ["x", "y", "pitch"], None, ["with j1, j4 about other axes", "[x, y, yaw]"]),
        ("ZYZ", "axis", [{"line": {"by": [0.1]}}], ["task space has no position rows", "turn: {rotate"]),
    ],
)  # fmt: skip
def test_rows_that_are_errors(word, space, path, texts):
    robot = chain(word)
    path = path or [{"line": {"by": [0.1] * len(space)}}]
    with pytest.raises(brachis.BrachisError) as caught:
        plan(robot, [0.3] * robot.n, space, path)
    for text in texts:
        assert text in str(caught.value)


def test_rows_with_the_axis_have_one_name():
    for rows, name in (
        ("axis", ("axis",)),
        (["axis"], ("axis",)),
        (["x", "y", "z", "axis"], "pose_free_roll"),
    ):
        task = task_with(start=IIWA, task_space=rows, path=TURN)
        assert task.task_space == name
