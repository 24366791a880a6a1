"""What a new user writes first runs, and means what the task file means."""

import copy
import pickle
import runpy
import warnings
from dataclasses import fields
from pathlib import Path

import numpy as np
import pinocchio as pin
import pytest
import yaml
from numpy.testing import assert_allclose, assert_array_equal

import brachis
from brachis.errors import InputError, TaskError, UnknownNameError
from brachis.robot import bind
from brachis.task import (
    LimitKeywords,
    LimitSpec,
    RobotSettings,
    SplineSettings,
    Task,
    TaskKeywords,
    task_with,
)
from brachis.task.settings import BoundarySettings, SearchSettings

ROOT = Path(__file__).parents[1]
Q0 = [0.5236, -2.0944, 2.0944]
QUICK = {"redundant_joints": ["j1"], "intervals": 8, "effort": "single"}
LINE = {
    "path": brachis.Line(by=[0.0, 0.3]),
    "start": Q0,
    "task_space": ["x", "y"],
    **QUICK,
}


@pytest.fixture(scope="module")
def result():
    return brachis.plan("scara3", **LINE)


def test_the_script_of_a_new_user_runs(tmp_path, capsys):
    runpy.run_path(str(ROOT / "tests/user_script.py"))["main"](tmp_path)
    assert "verified: True" in capsys.readouterr().out
    assert {path.name for path in tmp_path.iterdir()} == {"result.npz", "overview.png"}


def test_all_forms_of_a_plan_are_the_same_plan(tmp_path):
    urdf = ROOT / "robots/scara3/robot.urdf"
    text = f"""
    brachis: 1
    robot: {{urdf: {urdf}}}
    start: {{joints: {Q0}}}
    task_space: [x, y]
    path: [{{line: {{by: [0.0, 0.3]}}}}]
    redundant_joints: [j1]
    spline: {{intervals: 8}}
    search: {{effort: single}}
    """
    content = yaml.safe_load(text)
    (tmp_path / "task.yaml").write_text(text)
    ends = [
        brachis.plan(tmp_path / "task.yaml").t_end,
        brachis.plan(urdf, content).t_end,
        brachis.plan("scara3", **LINE).t_end,
        brachis.plan(brachis.robots.scara3, **{**LINE, "start": np.array(Q0)}).t_end,
    ]
    assert ends == pytest.approx(ends[:1] * 4, rel=1e-6)


def test_keywords_change_a_task():
    task = task_with(
        brachis.examples.payload_friction_jerk,
        payload={"mass": 2.0},
        intervals=7,
        periodic=False,
    )
    file = brachis.load_task(brachis.examples.payload_friction_jerk)
    assert task.robot.payload.mass == 2.0
    assert task.robot.limits == file.robot.limits
    assert task.spline.intervals == 7
    assert task.path == file.path
    assert task_with(file) is file
    assert task_with(file.to_dict(), effort="single").search.effort == "single"


def test_a_wrong_keyword_is_answered_with_the_nearest():
    with pytest.raises(UnknownNameError, match="intervals"):
        brachis.plan("scara3", **LINE, interval=8)
    with pytest.raises(TaskError, match="task_space: this required key is missing"):
        brachis.plan("scara3", path=brachis.Line(by=[0.0, 1.0]), start=Q0)
    with pytest.raises(TaskError, match=r"start\.joints\[0\]"):
        task_with(**{**LINE, "start": ["a", 0.0, 0.0]})


def test_segments_are_those_of_the_task_file():
    content = yaml.safe_load("""
    - {line: {to: [0.5, 0, 0.3]}, orientation: {to: {quaternion_wxyz: [1, 0, 0, 0]}}, blend: 0.01}
    - arc: {center: [0.4, 0, 0.3], angle_deg: 90, normal: [0, 0, 1]}
    - circle: {center: [0.4, 0, 0.3], turns: 2, normal: [0, 0, 1]}
    - helix: {center: [0.4, 0, 0.3], pitch: 0.01, normal: [0, 0, 1]}
    - spline:
        through: [[0.1, 0.2, 0.3], [0.2, 0.2, 0.3]]
        orientations: [{quaternion_wxyz: [1, 0, 0, 0]}, {quaternion_wxyz: [1, 0, 0, 0]}]
    """)
    here, up = [0.4, 0.0, 0.3], np.array([0, 0, 1])
    places = ([0.5, 0.0, 0.3], [0.1, 0.2, 0.3], [0.2, 0.2, 0.3])
    end, *poses = (pin.SE3(np.eye(3), np.array(place)) for place in places)
    joined = (
        brachis.Line(to=end, blend=0.01)
        + brachis.Arc(center=here, angle_deg=90, normal=up)
        + brachis.Circle(np.array(here), turns=2, normal=up)
        + brachis.Helix(here, pitch=0.01)
        + brachis.Spline(through=poses)
    )
    assert joined == task_with(start=[0.0], task_space="pose", path=content).path
    matrices = [pose.homogeneous for pose in poses]
    for through in (matrices, np.stack(matrices)):
        assert brachis.Spline(through=through) == joined[-1]


@pytest.mark.parametrize(
    "kind, keys, parts",
    [
        ("Line", {}, ["Line", "exactly one of its forms"]),
        ("Line", {"by": ["a", 1]}, ["Line", "line.by[0]"]),
        ("Helix", {"center": [0, 0, 0], "pitch": 0.1, "turns": 0}, ["helix.turns"]),
        ("Spline", {"through": []}, ["Spline", "spline.through"]),
        ("Spline", {"through": [pin.SE3.Identity(), 3.0]}, ["spline.through"]),
    ],
    ids=["no form", "text", "turns", "empty", "a number"],
)
def test_wrong_segments_are_errors(kind, keys, parts):
    with pytest.raises(TaskError) as caught:
        getattr(brachis, kind)(**keys)
    assert all(part in str(caught.value) for part in parts), str(caught.value)


def test_segments_are_joined_with_segments_alone():
    with pytest.raises(TypeError):
        _ = brachis.Line(by=[1.0]) + 3


def test_a_robot_with_other_limits_keeps_the_rest():
    robot = brachis.robots.tx90l_rail
    changes = {"torque": {"joint_1": 100.0}, "velocity": 1.0, "scale": {"torque": 0.5}}
    changed = robot.with_limits(**changes)
    before, after = robot.limits, changed.limits
    assert after.torque[1] == 50.0
    assert_array_equal(after.torque[2:], 0.5 * before.torque[2:])
    assert_array_equal(after.velocity, 1.0)
    assert_array_equal(after.position_lower, before.position_lower)
    again = changed.with_limits(torque={"joint_2": 20.0}).with_payload(2.0).limits
    assert again.torque[1:3].tolist() == [50.0, 20.0]
    assert before.torque[1] == 318.0
    for wrong, kind, match in (
        ({"torques": 3.0}, UnknownNameError, "torque"),
        ({"torque": {"joint1": 3.0}}, UnknownNameError, "joint_1"),
        ({"torque": -3.0}, TaskError, r"limits.torque: out of range"),
    ):
        with pytest.raises(kind, match=match):
            robot.with_limits(**wrong)


def test_a_robot_whose_tool_rolls_may_have_other_limits():
    robot, _ = bind(brachis.robots.iiwa14, "pose_free_roll")
    changed = robot.with_limits(velocity=1.0)
    assert changed.tool_joints
    assert changed.limits.velocity.tolist() == [1.0] * 7 + [np.inf]
    assert not robot.with_payload(1.0).tool_joints


def test_samples_carry_the_tool(result):
    samples = result.sample(0.01)
    placement = result.trajectory.robot.tool_placement(samples.q[30])
    assert_allclose(samples.tool_position[30], placement.translation, atol=1e-12)
    rotation = pin.Quaternion(*samples.tool_quaternion[30]).matrix()
    assert_allclose(rotation, placement.rotation, atol=1e-12)
    before, after = result.trajectory.at([0.3 - 1e-6, 0.3 + 1e-6]).tool_position
    speed = np.linalg.norm(after - before) / 2e-6
    assert_allclose(result.trajectory.at(0.3).tool_speed, speed, rtol=1e-6)
    assert result.sample(0.01, last="hold").tool_speed[-1] == 0.0


def test_many_plans_keep_their_order_and_failures_are_values(result):
    tasks = [
        {"brachis": 1},
        ("scara3", task_with(**LINE)),
        (None, brachis.examples.scara_line),
    ]
    counts = []
    failure, first, second = brachis.plan_many(
        tasks,
        jobs=2,
        progress=lambda done, total, _: counts.append((done, total)),
        **QUICK,
    )
    assert isinstance(failure, TaskError)
    assert counts == [(1, 3), (2, 3), (3, 3)]
    assert first.t_end == pytest.approx(result.t_end, rel=1e-9)
    assert second.bottleneck().sensitivities.limits


def test_a_line_tells_of_many_plans(capsys):
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        (outcome,) = brachis.plan_many([{"brachis": 1}], progress=True)
    assert isinstance(outcome, TaskError)
    assert "planned 1 of 1 task" in capsys.readouterr().err


def test_every_key_of_a_task_is_a_keyword():
    models = (Task, RobotSettings, BoundarySettings, SplineSettings, SearchSettings)
    keys = {key for model in models for key in model.model_fields}
    keywords = set(TaskKeywords.__annotations__)
    in_sections = "brachis urdf limits_file tolerance shortest_interval guesses jobs"
    assert keys - keywords == set(in_sections.split()), "in whole sections alone"
    assert keywords <= keys
    limits = {field.name for field in fields(LimitSpec)}
    assert set(LimitKeywords.__annotations__) == limits


def test_a_misspelt_robot_is_told_from_a_missing_file():
    for name in ("iiwa", "gen3_rail", "scara4"):
        with pytest.raises(UnknownNameError, match="there is no robot"):
            brachis.plan(name, **LINE)
    for name in ("gantry2_result", "task"):
        with pytest.raises(TaskError, match="the file does not exist"):
            brachis.plan(name)


FIRST = [0.0, 0.3, 0.0, -1.2, 0.0, 0.6, 0.0]
JOINTS = np.add(
    FIRST,
    [
        [0.0] * 7,
        [0.2, 0.1, 0.1, 0.2, 0.1, -0.1, 0.2],
        [0.3, 0.3, 0.2, 0.1, 0.0, -0.2, 0.1],
    ],
)
SHORT = {"effort": "single", "intervals": 8, "least_motion": False}
ARM = {"task_space": "joints", **SHORT}
POINTS = np.array([[1.73205, 0.0], [1.72, 0.1], [1.7, 0.2]])
NAMED = {"j1": Q0[0], "j2": Q0[1], "j3": Q0[2]}
WORKS = {
    "an array of joints": lambda: brachis.plan("iiwa14", path=JOINTS, **ARM),
    "an array of points": lambda: brachis.plan("scara3", **{**LINE, "path": POINTS}),
    "a spline through all waypoints": lambda: brachis.plan(
        "iiwa14", path=brachis.Spline(JOINTS), **ARM
    ),
    "a mapping for a segment": lambda: brachis.plan(
        "scara3", **{**LINE, "path": {"line": {"by": [0.0, 0.3]}}}
    ),
    "a tuple": lambda: brachis.plan("scara3", **{**LINE, "start": tuple(Q0)}),
    "joints by name": lambda: brachis.plan("scara3", **{**LINE, "start": NAMED}),
    "the task by name": lambda: brachis.plan(
        "scara3", task=brachis.examples.scara_line, **QUICK
    ),
    "limits as a mapping": lambda: brachis.plan(
        "scara3", **LINE, limits={"torque": 12}
    ),
    "a solver's name": lambda: brachis.plan("scara3", **LINE, solver="uno_interior"),
}


@pytest.mark.parametrize("snippet", WORKS)
def test_what_strangers_type_works(snippet):
    result = WORKS[snippet]()
    assert result.verified
    assert result.duration == result.t_end


SEGMENT = brachis.Line(by=[0.0, 0.3])
SCARA = {"start": Q0, "task_space": ["x", "y"]}
ANSWERS = {
    'brachis.Robot("a.urdf")': (InputError, "from_urdf"),
    'brachis.plan("a.urdf")': (brachis.errors.UrdfError, "the file does not exist"),
    "brachis.plan()": (TaskError, "task_space: Coordinates that the path prescribes"),
    'brachis.plan(robot="scara3", path=SEGMENT, **SCARA)': (
        InputError,
        "brachis.plan('scara3', path=...)",
    ),
    'brachis.plan("scara3", path=SEGMENT, q0=Q0)': (UnknownNameError, "'start'"),
    'brachis.plan("scara3", start=Q0, goal=Q0)': (UnknownNameError, "'end'"),
    'brachis.plan("scara3", waypoints=POINTS)': (UnknownNameError, "'path'"),
    'brachis.plan("scara3", timeout=3)': (UnknownNameError, "'time_limit'"),
    'brachis.plan("scara3", verbose=True)': (UnknownNameError, "'progress'"),
    'brachis.plan("scara3", torque=12)': (UnknownNameError, "limits={'torque': ...}"),
    'brachis.plan("scara3", velocity_limits=2)': (
        UnknownNameError,
        "limits={'velocity': ...}",
    ),
    'brachis.plan("scara3", n_intervals=12)': (UnknownNameError, "'intervals'"),
    "brachis.plan_many([], workers=2)": (UnknownNameError, "'jobs'"),
    'brachis.plan("scara3", path=SEGMENT, **SCARA, solver="IPOPT")': (
        UnknownNameError,
        "Did you mean 'ipopt'",
    ),
    'brachis.plan("scara3", path=SEGMENT, **SCARA, spline=30)': (
        TaskError,
        "keys among degree, intervals",
    ),
    'brachis.plan("scara3", path=np.sin, **SCARA)': (
        TaskError,
        "brachis.bspline_segment",
    ),
    'brachis.plan("gen3", path=[pin.SE3.Identity()] * 2, task_space="pose", start="free")': (
        TaskError,
        "brachis.Spline",
    ),
    'brachis.plan("iiwa14", path=[0.1] * 7, task_space="joints")': (
        TaskError,
        "two points or more",
    ),
    'brachis.plan("iiwa14", path=brachis.Line(by=[0.1] * 7), task_space="joints")': (
        TaskError,
        "start posture",
    ),
    'brachis.plan("<robot>\\n</robot>")': (TaskError, "urdf_text"),
    "brachis.Line(end=[0, 1])": (UnknownNameError, "'to'"),
    "brachis.load": (AttributeError, "'load_task'"),
    "brachis.optimize": (AttributeError, "'plan'"),
    "brachis.version": (AttributeError, "'__version__'"),
    "brachis.plot": (AttributeError, "'plots'"),
    "result.success": (AttributeError, "'verified'"),
    "result.q": (AttributeError, "'trajectory.q'"),
    "result.torque": (AttributeError, "'trajectory.torque'"),
    "result.positions": (AttributeError, "'trajectory.q'"),
    "result.t": (AttributeError, "'trajectory.times'"),
    "result.trajectory.duration": (AttributeError, "'t_end'"),
    "result.trajectory.qd": (AttributeError, "'qdot'"),
    "result.sample(0.1).time": (AttributeError, "'t'"),
    "result.task.effort": (AttributeError, "'search.effort'"),
    "brachis.robots.scara3.dof": (AttributeError, "'n'"),
}


@pytest.mark.parametrize("snippet", ANSWERS)
def test_what_strangers_type_is_answered_with_the_right_name(snippet, result):
    kind, answer = ANSWERS[snippet]
    with pytest.raises(kind) as caught:
        eval(snippet, {**globals(), "result": result})  # noqa: S307
    assert answer in str(caught.value)


def test_what_is_there_is_not_hidden_by_answers(result):
    assert not hasattr(result, "_repr_png_")
    task = result.trajectory.task
    assert pickle.loads(pickle.dumps(task)) == task  # noqa: S301
    assert copy.deepcopy(result.task).path == result.task.path
    source = result.trajectory.robot.source
    robot = brachis.Robot.from_urdf(source, limits={"torque": 12})
    assert robot.limits.torque[0] == 12
    with pytest.raises(AttributeError, match=r"no attribute 'xylophone'$"):
        _ = result.xylophone


def test_a_solvers_name_keeps_the_solvers_other_settings():
    task = task_with(**LINE, solver={"tolerance": 1e-7})
    solver = task_with(task, solver="uno_interior").solver
    assert (solver.name, solver.tolerance) == ("uno_interior", 1e-7)
    content = {**task_with(**LINE).to_dict(), "solver": "uno_interior"}
    assert brachis.load_task(content).solver.name == "uno_interior"
