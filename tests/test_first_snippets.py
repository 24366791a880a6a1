"""What a new user writes first runs, and means what the task file means."""

from __future__ import annotations

import copy
import pickle
import runpy
import warnings
from dataclasses import fields
from pathlib import Path

import numpy as np
import pinocchio as pin
import pytest
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


def test_the_script_of_a_new_user_runs(tmp_path, capsys):
    runpy.run_path(str(ROOT / "tests/user_script.py"))["main"](tmp_path)
    assert "verified: True" in capsys.readouterr().out
    assert {path.name for path in tmp_path.iterdir()} == {"result.npz", "overview.png"}


def test_all_forms_of_a_plan_are_the_same_plan(tmp_path):
    urdf = ROOT / "robots/scara3/robot.urdf"
    content = {
        "brachis": 1,
        "robot": {"urdf": str(urdf)},
        "start": {"joints": Q0},
        "task_space": ["x", "y"],
        "path": [{"line": {"by": [0.0, 0.3]}}],
        "redundant_joints": ["j1"],
        "spline": {"intervals": 8},
        "search": {"effort": "single"},
    }
    (tmp_path / "task.yaml").write_text(str(content))
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
    with pytest.raises(TaskError, match="task_space: this key is required"):
        brachis.plan("scara3", path=brachis.Line(by=[0.0, 1.0]), start=Q0)
    with pytest.raises(TaskError, match=r"start\.joints\[0\]"):
        task_with(**{**LINE, "start": ["a", 0.0, 0.0]})


def test_segments_are_those_of_the_task_file():
    content = {
        "brachis": 1,
        "start": {"joints": [0.0]},
        "task_space": "pose",
        "path": [
            {
                "line": {"to": [0.5, 0.0, 0.3]},
                "orientation": {"to": {"quaternion_wxyz": [1, 0, 0, 0]}},
                "blend": 0.01,
            },
            {"arc": {"center": [0.4, 0.0, 0.3], "angle_deg": 90, "normal": [0, 0, 1]}},
            {"circle": {"center": [0.4, 0.0, 0.3], "turns": 2, "normal": [0, 0, 1]}},
            {"helix": {"center": [0.4, 0.0, 0.3], "pitch": 0.01, "normal": [0, 0, 1]}},
            {
                "spline": {
                    "through": [[0.1, 0.2, 0.3], [0.2, 0.2, 0.3]],
                    "orientations": [{"quaternion_wxyz": [1, 0, 0, 0]}] * 2,
                }
            },
        ],
    }
    here, up = [0.4, 0.0, 0.3], np.array([0, 0, 1])
    poses = [pin.SE3(np.eye(3), np.array([x, 0.2, 0.3])) for x in (0.1, 0.2)]
    joined = (
        brachis.Line(to=pin.SE3(np.eye(3), np.array([0.5, 0.0, 0.3])), blend=0.01)
        + brachis.Arc(center=here, angle_deg=90, normal=up)
        + brachis.Circle(np.array(here), turns=2, normal=up)
        + brachis.Helix(here, pitch=0.01)
        + brachis.Spline(through=poses)
    )
    assert joined == brachis.load_task(content).path
    assert brachis.Spline(through=[pose.homogeneous for pose in poses]) == joined[-1]
    assert (
        brachis.Spline(through=np.stack([pose.homogeneous for pose in poses]))
        == joined[-1]
    )


@pytest.mark.parametrize(
    ("make", "parts"),
    [
        (brachis.Line, ["Line", "exactly one of its forms"]),
        (lambda: brachis.Line(to=[1], by=[1]), ["Line", "exactly one of its forms"]),
        (lambda: brachis.Line(by=["a", 1]), ["Line", "line.by[0]"]),
        (lambda: brachis.Helix([0, 0, 0], pitch=0.1, turns=0), ["helix.turns"]),
        (lambda: brachis.Spline(through=[]), ["Spline", "spline.through"]),
        (lambda: brachis.Spline(through=[pin.SE3.Identity(), 3.0]), ["spline.through"]),
    ],
)
def test_wrong_segments_are_errors(make, parts):
    with pytest.raises(TaskError) as caught:
        make()
    assert all(part in str(caught.value) for part in parts), str(caught.value)
    with pytest.raises(TypeError):
        _ = brachis.Line(by=[1.0]) + 3


def test_a_robot_with_other_limits_keeps_the_rest():
    robot = brachis.robots.tx90l_rail
    changed = robot.with_limits(
        torque={"joint_1": 100.0}, velocity=1.0, scale={"torque": 0.5}
    )
    assert changed.limits.torque[1] == 50.0
    assert_array_equal(changed.limits.torque[2:], 0.5 * robot.limits.torque[2:])
    assert_array_equal(changed.limits.velocity, 1.0)
    assert_array_equal(changed.limits.position_lower, robot.limits.position_lower)
    again = changed.with_limits(torque={"joint_2": 20.0}).with_payload(2.0).limits
    assert again.torque[1:3].tolist() == [50.0, 20.0]
    assert robot.limits.torque[1] == 318.0
    with pytest.raises(UnknownNameError, match="torque"):
        robot.with_limits(torques=3.0)
    with pytest.raises(UnknownNameError, match="joint_1"):
        robot.with_limits(torque={"joint1": 3.0})
    with pytest.raises(TaskError, match=r"limits.torque: out of range"):
        robot.with_limits(torque=-3.0)


def test_a_robot_whose_tool_rolls_may_have_other_limits():
    robot, _ = bind(brachis.robots.iiwa14, "pose_free_roll")
    changed = robot.with_limits(velocity=1.0)
    assert changed.tool_joints
    assert changed.limits.velocity.tolist() == [1.0] * 7 + [np.inf]
    assert not robot.with_payload(1.0).tool_joints


def test_samples_carry_the_tool():
    result = brachis.plan("scara3", **LINE)
    samples = result.sample(0.01)
    placement = result.trajectory.robot.tool_placement(samples.q[30])
    assert_allclose(samples.tool_position[30], placement.translation, atol=1e-12)
    rotation = pin.Quaternion(*samples.tool_quaternion[30]).matrix()
    assert_allclose(rotation, placement.rotation, atol=1e-12)
    step = 1e-6
    before, behind = result.trajectory.at([0.3 - step, 0.3 + step]).tool_position
    speed = result.trajectory.at(0.3).tool_speed
    assert_allclose(speed, np.linalg.norm(behind - before) / (2 * step), rtol=1e-6)
    held = result.sample(0.01, last="hold")
    assert held.tool_speed[-1] == 0.0


def test_many_plans_keep_their_order_and_failures_are_values():
    tasks = [
        {"brachis": 1},
        ("scara3", task_with(**LINE)),
        (None, brachis.examples.scara_line),
    ]
    told = []
    outcomes = brachis.plan_many(
        tasks,
        jobs=2,
        progress=lambda done, total, _: told.append((done, total)),
        **QUICK,
    )
    assert [type(outcome).__name__ for outcome in outcomes] == [
        "TaskError",
        "Result",
        "Result",
    ]
    assert told == [(1, 3), (2, 3), (3, 3)]
    assert outcomes[1].t_end == pytest.approx(
        brachis.plan("scara3", **LINE).t_end, rel=1e-9
    )
    assert outcomes[2].bottleneck().sensitivities.limits


def test_a_line_tells_of_many_plans(capsys):
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        (outcome,) = brachis.plan_many([{"brachis": 1}], progress=True)
    assert isinstance(outcome, TaskError)
    assert "planned 1 of 1 task" in capsys.readouterr().err


def test_every_key_of_a_task_is_a_keyword():
    sections = {
        "robot": RobotSettings,
        "boundary": BoundarySettings,
        "spline": SplineSettings,
        "search": SearchSettings,
    }
    keys = {key for model in (Task, *sections.values()) for key in model.model_fields}
    left = {
        "brachis",
        "urdf",
        "limits_file",
        "tolerance",
        "shortest_interval",
        "guesses",
        "jobs",
    }
    assert keys - set(TaskKeywords.__annotations__) == left, "in whole sections alone"
    assert set(TaskKeywords.__annotations__) <= keys
    assert set(LimitKeywords.__annotations__) == {
        each.name for each in fields(LimitSpec)
    }


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
    "brachis.plan()": (TaskError, "task_space: What the path prescribes"),
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
        "keys out of degree, intervals",
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
    "result.export": (AttributeError, "'brachis.export.write'"),
    "result.trajectory.duration": (AttributeError, "'t_end'"),
    "result.trajectory.qd": (AttributeError, "'qdot'"),
    "result.sample(0.1).time": (AttributeError, "'t'"),
    "result.task.effort": (AttributeError, "'search.effort'"),
    "brachis.robots.scara3.dof": (AttributeError, "'n'"),
}


@pytest.fixture(scope="module")
def result():
    return brachis.plan("scara3", **LINE)


@pytest.mark.parametrize("snippet", ANSWERS)
def test_what_strangers_type_is_answered_with_the_right_name(snippet, result):
    kind, answer = ANSWERS[snippet]
    with pytest.raises(kind) as caught:
        eval(snippet, {**globals(), "result": result})  # noqa: S307
    assert answer in str(caught.value)


def test_what_is_there_is_not_hidden_by_answers(result):
    assert not hasattr(result, "_repr_png_")
    assert pickle.loads(pickle.dumps(result.trajectory.task)) == result.trajectory.task  # noqa: S301
    assert copy.deepcopy(result.task).path == result.task.path
    assert (
        brachis.Robot.from_urdf(
            result.trajectory.robot.source, limits={"torque": 12}
        ).limits.torque[0]
        == 12
    )
    with pytest.raises(AttributeError, match=r"no attribute 'xylophone'$"):
        _ = result.xylophone


def test_a_solvers_name_keeps_the_solvers_other_settings():
    file = {**LINE, "solver": {"tolerance": 1e-7}}
    assert task_with(task_with(**file), solver="uno_interior").solver.model_dump(
        exclude_defaults=True
    ) == {
        "name": "uno_interior",
        "tolerance": 1e-7,
    }
    assert (
        brachis.load_task(
            {**task_with(**LINE).to_dict(), "solver": "uno_interior"}
        ).solver.name
        == "uno_interior"
    )
