"""Paths in the frame of a workpiece: where the tool is, by Pinocchio, and what is refused."""

import itertools

import numpy as np
import pinocchio as pin
import pytest
import yaml
from numpy.testing import assert_allclose

import brachis
from brachis.errors import PathError, TaskError
from brachis.path import build_path
from brachis.path.sequence import PathFrame
from brachis.robot.task_map.protocol import POSE_ROWS
from brachis.task import Placement, task_with
from brachis.task.settings import place_frame
from brachis.trajectory import Trajectory

PLACE = {"xyz": [0.6, -0.2, 0.4], "rpy_deg": [20.0, -35.0, 110.0]}
WORKPIECE = pin.SE3(
    pin.rpy.rpyToMatrix(*np.radians(PLACE["rpy_deg"])), np.array(PLACE["xyz"])
)
FLAT = {"xyz": [0.3, 0.4, 0.7], "rpy_deg": [0.0, 0.0, 30.0]}
S = np.linspace(0.0, 1.0, 30)
SEGMENTS = yaml.safe_load("""
- line:
    by: [0.3, 0, 0]
  orientation:
    rotate:
      axis: [0, 0, 1]
      angle_deg: 50
  blend: 0.05
- line:
    to: [0.5, 0.4, 0.1]
  orientation:
    to:
      kuka_abc_deg: [80, 10, 20]
  blend: 0.05
- arc:
    center: [0.5, 0.3, 0.1]
    angle_deg: 90
    normal: [0, 0, 1]
  orientation: tangent
  blend: 0.05
- line:
    by: [-0.2, 0, 0.1]
  orientation:
    tangent:
      up: [0, 1, 0]
  blend: 0.05
- spline:
    through:
    - [0.6, 0.2, 0.4]
    - [0.8, 0.1, 0.4]
    orientations:
    - rpy_deg: [9, 0, 90]
    - rpy_deg: [9, 0, 90]
""")


def written(path, **keys):
    frame = {"frames": {"workpiece": PLACE}, "path_frame": "workpiece"}
    content = {"start": [0.0], "task_space": "pose", "path": path}
    return task_with(**(content | frame | keys))


def test_every_kind_of_segment_and_orientation_is_in_the_frame():
    here = pin.SE3(pin.rpy.rpyToMatrix(0.3, 0.2, -0.4), np.array([0.1, 0.05, 0.0]))
    segments = written(SEGMENTS).path
    frame = PathFrame.of(Placement.model_validate(PLACE), POSE_ROWS)
    local, world = (
        build_path(
            segments,
            np.append(start.translation, start.rotation.ravel()),
            POSE_ROWS,
            own_frame,
        ).sample(S)
        for start, own_frame in ((here, None), (WORKPIECE * here, frame))
    )
    assert_allclose(
        world.target[:, :3],
        local.target[:, :3] @ WORKPIECE.rotation.T + WORKPIECE.translation,
        atol=1e-12,
    )
    outer, inner = (sample.target[:, 3:].reshape(-1, 3, 3) for sample in (world, local))
    assert_allclose(outer, WORKPIECE.rotation @ inner, atol=1e-12)
    # Twists are those of the tool frame, whatever the frame of the path.
    for name in ("xi", "xi_ds", "xi_dds"):
        assert_allclose(getattr(world, name), getattr(local, name), atol=1e-9)


@pytest.mark.parametrize(
    "names, place",
    [
        (["x", "y"], FLAT),
        (["x", "y", "yaw"], FLAT),
        (["x", "y", "z"], FLAT),
        (["y", "z"], {"xyz": [0.3, 0.4, 0.7], "rpy_deg": [30.0, 0.0, 0.0]}),
    ],
    ids=lambda names: "".join(names) if isinstance(names, list) else "",
)
def test_a_frame_turns_and_moves_rows(names, place):
    placement = Placement.model_validate(place)
    through = np.random.default_rng(3).uniform(-0.5, 0.5, (4, len(names)))
    segments = written(brachis.Spline(through=through), task_space=names).path
    frame = PathFrame.of(placement, names)
    start = np.zeros(len(names))
    local = build_path(segments, start, names).sample(S)
    world = build_path(segments, frame.to_world(start), names, frame)
    rotation = pin.rpy.rpyToMatrix(*np.radians(placement.rpy_deg))
    axes = ["xyz".index(name) for name in names if name != "yaw"]
    points = np.zeros((len(S), 3))
    points[:, axes] = local.target[:, : len(axes)]
    expected = points @ rotation.T + placement.xyz
    target = world.sample(S).target
    assert_allclose(target[:, : len(axes)], expected[:, axes], atol=1e-12)
    if "yaw" in names:
        assert_allclose(target[:, 2], local.target[:, 2] + np.radians(30.0), atol=1e-12)
    before, here, after = (world.sample(S + step) for step in (-1e-6, 0.0, 1e-6))
    assert_allclose(here.xi, (after.target - before.target) / 2e-6, atol=1e-6)


def test_the_tool_is_where_the_frame_of_a_workpiece_says(tmp_path):
    """By Pinocchio, from the URDF and the positions of the saved motion alone."""
    robot = brachis.robots.iiwa14
    posture = np.array([0.3, 0.6, 0.2, -1.2, 0.1, 0.9, 0.4])
    start = pin.SE3(pin.rpy.rpyToMatrix(np.pi, 0.1, 0.0), np.array([0.02, 0.03, 0.05]))
    workpiece = robot.tool_placement(posture) * start.inverse()
    turning = {"rotate": {"axis": [0, 0, 1], "angle_deg": 20}}
    result = brachis.plan(
        robot,
        frames={"pallet": FLAT, "workpiece": workpiece},
        path_frame="workpiece",
        path=brachis.Line(by=[0.1, 0.0, 0.0], orientation=turning),
        path_start=start,
        start=posture,
        task_space="pose",
        intervals=8,
        effort="single",
    )
    assert result.verified
    result.trajectory.save(tmp_path / "result.npz")
    motion = Trajectory.load(tmp_path / "result.npz")
    model = pin.buildModelFromXML(motion.urdf)
    data = model.createData()
    frame = model.getFrameId(robot.tool_frame)
    for q in motion.position(np.linspace(0.0, motion.t_end, 15)):
        pin.framesForwardKinematics(model, data, q)
        tool = workpiece.actInv(data.oMf[frame])
        assert_allclose(tool.translation[1:], start.translation[1:], atol=1e-7)
        turned = pin.log3(tool.rotation @ start.rotation.T)
        distance = tool.translation[0] - start.translation[0]
        angle = np.radians(20.0) * distance / 0.1
        assert_allclose(turned, [0.0, 0.0, angle], atol=1e-6)
    assert_allclose(tool.translation, [0.12, 0.03, 0.05], atol=1e-7)


def test_a_path_says_its_frame():
    path = {"frame": "workpiece", "segments": SEGMENTS}
    assert written(path, path_frame=None) == written(SEGMENTS)


def test_frames_may_be_nested_as_deep_as_one_likes():
    count = 1500
    place = pin.SE3(pin.rpy.rpyToMatrix(0.1, -0.2, 0.3), np.array([0.1, 0.2, 0.3]))
    inner = {"xyz": [0.1, 0.2, 0.3], "rpy_deg": np.degrees([0.1, -0.2, 0.3]).tolist()}
    names = [f"f{number}" for number in range(count)]
    frames = {names[0]: inner}
    frames |= {
        name: {**inner, "frame": outer} for outer, name in itertools.pairwise(names)
    }
    task = written(SEGMENTS, frames=frames, path_frame=names[-1])
    whole = pin.SE3(pin.exp6(count * pin.log6(place)))
    placed = place_frame(task.frames, names[-1]).transform
    assert_allclose(placed.homogeneous, whole.homogeneous, atol=1e-9)


TABLE = {"frame": "table", "segments": SEGMENTS}
TWO_FRAMES = {"workpiece": PLACE, "table": PLACE}


@pytest.mark.parametrize(
    "path, keys, message",
    [
        (
            SEGMENTS,
            {"path_frame": "table"},
            r"path_frame: this frame is not defined in frames; found 'table' .*allowed: workpiece",
        ),
        (
            SEGMENTS,
            {"frames": {}, "path_frame": "table"},
            r"allowed: frames: \{table: \.\.\.\} in the task",
        ),
        (
            SEGMENTS,
            {"frames": {"workpiece": {"xy": [0, 0]}}},
            r"frames\.workpiece\.xy: unknown key; found xy; allowed: xyz, rpy_deg",
        ),
        (
            TABLE,
            {"frames": TWO_FRAMES},
            r"path_frame: this frame differs from path.frame; found 'workpiece' .*allowed: table, or only one",
        ),
        (
            [{"line": {"by": [0.1]}}],
            {"task_space": "joints"},
            "path_frame: a joint path cannot be in a frame",
        ),
        (
            {"frame": "workpiece", "path": SEGMENTS},
            {},
            r"path: a path in a frame needs .*allowed: \{frame: NAME, segments",
        ),
    ],
)
def test_the_error_names_the_key_of_a_frame_that_does_not_fit(path, keys, message):
    with pytest.raises(TaskError, match=message):
        written(path, **keys)


def test_a_frame_cannot_turn_the_path_out_of_its_rows():
    tilted = written([{"line": {"by": [0.1, 0.0]}}], task_space=["x", "y"])
    told = r"path_frame: .* turns the path out of the rows .*\[20.0, -35.0, 110.0\] with .*\[x, y\]"
    with pytest.raises(PathError, match=told):
        brachis.plan(brachis.robots.scara3, tilted, start=[0.5, -2.0, 2.0])


@pytest.mark.parametrize(
    "angles",
    [(0.3, -0.7, 1.1), (0.4, np.pi / 2, 0.2), (0.4, -np.pi / 2, 0.2), (3.0, 0.1, -3.0)],
)
def test_a_placement_may_be_a_transform(angles):
    given = pin.SE3(pin.rpy.rpyToMatrix(*angles), np.array([1.0, 2.0, 3.0]))
    placement = Placement.model_validate(given)
    assert placement.xyz == (1.0, 2.0, 3.0)
    assert_allclose(
        pin.rpy.rpyToMatrix(*np.radians(placement.rpy_deg)), given.rotation, atol=1e-12
    )
