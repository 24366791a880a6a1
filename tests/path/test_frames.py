"""Paths in the frame of a workpiece: where the tool is, by Pinocchio, and what is refused."""

from __future__ import annotations

import itertools
from pathlib import Path
from typing import Any

import numpy as np
import pinocchio as pin
import pytest

import brachis
from brachis.errors import PathError, StartError, TaskError
from brachis.path import build_path
from brachis.path.sequence import PathFrame
from brachis.robot.task_map.protocol import POSE_ROWS
from brachis.task import Placement, load_task
from brachis.task.settings import place_frame
from brachis.trajectory import Trajectory

PLACE = {"xyz": [0.6, -0.2, 0.4], "rpy_deg": [20.0, -35.0, 110.0]}
WORKPIECE = pin.SE3(
    pin.rpy.rpyToMatrix(*np.radians(PLACE["rpy_deg"])), np.array(PLACE["xyz"])
)
FLAT = {"xyz": [0.3, 0.4, 0.7], "rpy_deg": [0.0, 0.0, 30.0]}
S = np.linspace(0.0, 1.0, 30)
SEGMENTS: list[dict[str, Any]] = [
    {
        "line": {"by": [0.3, 0, 0]},
        "orientation": {"rotate": {"axis": [0, 0, 1], "angle_deg": 50}},
        "blend": 0.05,
    },
    {
        "line": {"to": [0.5, 0.4, 0.1]},
        "orientation": {"to": {"kuka_abc_deg": [80, 10, 20]}},
        "blend": 0.05,
    },
    {
        "arc": {"center": [0.5, 0.3, 0.1], "angle_deg": 90, "normal": [0, 0, 1]},
        "orientation": "tangent",
        "blend": 0.05,
    },
    {
        "line": {"by": [-0.2, 0, 0.1]},
        "orientation": {"tangent": {"up": [0, 1, 0]}},
        "blend": 0.05,
    },
    {
        "spline": {
            "through": [[0.6, 0.2, 0.4], [0.8, 0.1, 0.4]],
            "orientations": [{"rpy_deg": [9, 0, 90]}] * 2,
        }
    },
]


def written(path: list[dict[str, Any]], **keys: Any) -> brachis.Task:
    content = {
        "brachis": 1,
        "start": {"joints": [0.0]},
        "task_space": "pose",
        "path": path,
    }
    return load_task(
        content | {"frames": {"workpiece": PLACE}, "path_frame": "workpiece"} | keys
    )


def coordinates(placement: pin.SE3) -> np.ndarray:
    return np.concatenate([placement.translation, placement.rotation.ravel()])


def placements(targets: np.ndarray) -> list[pin.SE3]:
    return [pin.SE3(target[3:].reshape(3, 3), target[:3]) for target in targets]


def test_every_kind_of_segment_and_orientation_is_in_the_frame() -> None:
    here = pin.SE3(pin.rpy.rpyToMatrix(0.3, 0.2, -0.4), np.array([0.1, 0.05, 0.0]))
    segments = written(SEGMENTS).path
    frame = PathFrame.of(Placement.model_validate(PLACE), POSE_ROWS)
    local = build_path(segments, coordinates(here), POSE_ROWS).sample(S)
    world = build_path(
        segments, coordinates(WORKPIECE * here), POSE_ROWS, frame
    ).sample(S)
    for found, wanted in zip(
        placements(world.target), placements(local.target), strict=True
    ):
        np.testing.assert_allclose(
            found.homogeneous, (WORKPIECE * wanted).homogeneous, atol=1e-12
        )
    for name in (
        "xi",
        "xi_ds",
        "xi_dds",
    ):  # twists are those of the tool frame, whatever the frame of the path
        np.testing.assert_allclose(
            getattr(world, name), getattr(local, name), atol=1e-9
        )


@pytest.mark.parametrize(
    "rows", [["x", "y"], ["x", "y", "yaw"], "position", ["y", "z"]]
)
def test_rows_are_turned_and_moved(rows: Any) -> None:
    names = ["x", "y", "z"] if rows == "position" else rows
    place = {"y": {"xyz": [0.3, 0.4, 0.7], "rpy_deg": [30.0, 0.0, 0.0]}}.get(
        names[0], FLAT
    )
    placement = Placement.model_validate(place)
    through = np.random.default_rng(3).uniform(-0.5, 0.5, (4, len(names)))
    segments = written(
        [{"spline": {"through": through.tolist()}}], task_space=rows
    ).path
    frame = PathFrame.of(placement, names)
    local = build_path(segments, np.zeros(len(names)), names).sample(S)
    world = build_path(segments, frame.to_world(np.zeros(len(names))), names, frame)
    rotation = pin.rpy.rpyToMatrix(*np.radians(placement.rpy_deg))
    axes = ["xyz".index(name) for name in names if name != "yaw"]
    points = np.zeros((len(S), 3))
    points[:, axes] = local.target[:, : len(axes)]
    expected = points @ rotation.T + placement.xyz
    target = world.sample(S).target
    np.testing.assert_allclose(target[:, : len(axes)], expected[:, axes], atol=1e-12)
    if "yaw" in names:
        np.testing.assert_allclose(
            target[:, 2], local.target[:, 2] + np.radians(30.0), atol=1e-12
        )
    step = 1e-6
    slopes = (world.sample(S + step).target - world.sample(S - step).target) / (
        2.0 * step
    )
    np.testing.assert_allclose(world.sample(S).xi, slopes, atol=1e-6)


def tool_of(motion: Trajectory, frame: str) -> list[pin.SE3]:
    """Where Pinocchio has the tool, from the URDF and the positions of a motion alone."""
    model = pin.buildModelFromXML(motion.urdf)
    data = model.createData()
    found = []
    for q in motion.position(np.linspace(0.0, motion.t_end, 15)):
        turns = [
            model.joints[i + 1].nq == 2 for i in range(len(q))
        ]  # continuous joints have cosine and sine
        angles = [
            [np.cos(x), np.sin(x)] if turn else [x]
            for x, turn in zip(q, turns, strict=True)
        ]
        pin.framesForwardKinematics(model, data, np.concatenate(angles))
        found.append(data.oMf[model.getFrameId(frame)].copy())
    return found


def test_the_tool_is_where_the_frame_of_a_workpiece_says(tmp_path: Path) -> None:
    robot = brachis.robots.iiwa14
    posture = np.array([0.3, 0.6, 0.2, -1.2, 0.1, 0.9, 0.4])
    tool = robot.tool_placement(posture)
    start = pin.SE3(pin.rpy.rpyToMatrix(np.pi, 0.1, 0.0), np.array([0.02, 0.03, 0.05]))
    workpiece = tool * start.inverse()
    result = brachis.plan(
        robot,
        frames={"pallet": FLAT, "workpiece": workpiece},
        path_frame="workpiece",
        path=brachis.Line(
            by=[0.1, 0.0, 0.0],
            orientation={"rotate": {"axis": [0, 0, 1], "angle_deg": 20}},
        ),
        path_start=start,
        start=posture,
        task_space="pose",
        intervals=8,
        effort="single",
    )
    assert result.verified
    result.trajectory.save(tmp_path / "result.npz")
    in_workpiece = [
        workpiece.actInv(each)
        for each in tool_of(Trajectory.load(tmp_path / "result.npz"), robot.tool_frame)
    ]
    for each in in_workpiece:
        np.testing.assert_allclose(
            each.translation[1:], start.translation[1:], atol=1e-7
        )
        turned = pin.log3(each.rotation @ start.rotation.T)
        way = each.translation[0] - start.translation[0]
        np.testing.assert_allclose(
            turned, [0.0, 0.0, np.radians(20.0) * way / 0.1], atol=1e-6
        )
    np.testing.assert_allclose(
        in_workpiece[-1].translation, [0.12, 0.03, 0.05], atol=1e-7
    )


def test_files_of_points_and_free_starts_are_in_the_frame(tmp_path: Path) -> None:
    rows = np.column_stack(
        [np.linspace(0.0, 300.0, 40), 20.0 * np.sin(np.linspace(0.0, 3.0, 40))]
    )
    np.savetxt(
        tmp_path / "seam.csv", rows, delimiter=",", header="x_mm,y_mm", comments=""
    )
    tolerance = {"position": "0.01 mm"}
    place = {"xyz": [1.0, 0.6, 0.0], "rpy_deg": [0.0, 0.0, 120.0]}
    task = {
        "brachis": 1,
        "frames": {"table": place},
        "path_frame": "table",
        "start": "free",
        "task_space": ["x", "y"],
        "path": [{"csv": {"file": str(tmp_path / "seam.csv"), "tolerance": tolerance}}],
        "search": {"effort": "single"},
        "spline": {"intervals": 8},
    }
    result = brachis.plan(brachis.robots.scara3, task)
    assert result.verified
    table = pin.SE3(
        pin.rpy.rpyToMatrix(0.0, 0.0, np.radians(120.0)), np.array(place["xyz"])
    )
    points = np.array(
        [table.actInv(each.translation) for each in tool_of(result.trajectory, "tool")]
    )
    away = [
        np.abs(np.interp(x, rows[:, 0] / 1e3, rows[:, 1] / 1e3) - y)
        for x, y in points[:, :2]
    ]
    assert np.max(away) < 1e-4  # of the polyline through the points
    np.testing.assert_allclose(points[[0, -1], :2], rows[[0, -1]] / 1e3, atol=1e-6)


def test_a_start_that_is_elsewhere_in_the_frame_is_refused() -> None:
    task = written(
        [{"line": {"by": [0.1, 0.0]}}],
        task_space=["x", "y"],
        frames={"workpiece": FLAT},
        path_start=[0, 0],
    )
    with pytest.raises(StartError, match="off the path"):
        brachis.plan(brachis.robots.scara3, task, start=[0.5, -2.0, 2.0])


def test_a_path_says_its_frame() -> None:
    apart = written(SEGMENTS)
    together = load_task(
        {
            **apart.model_dump(
                mode="json", exclude={"path", "path_frame"}, exclude_defaults=True
            )
        }
        | {"path": {"frame": "workpiece", "segments": SEGMENTS}}
    )
    assert together == apart


def test_frames_may_be_nested_as_deep_as_one_likes() -> None:
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
    np.testing.assert_allclose(
        place_frame(task.frames, names[-1]).transform.homogeneous,
        whole.homogeneous,
        atol=1e-9,
    )


def test_frames_that_do_not_fit() -> None:
    with pytest.raises(
        TaskError,
        match=r"path_frame: this frame is not defined in frames; found 'table' .*allowed: workpiece",
    ):
        written(SEGMENTS, path_frame="table")
    with pytest.raises(
        TaskError,
        match=r"allowed: frames: \{table: \.\.\.\} in the task",
    ):
        written(SEGMENTS, frames={}, path_frame="table")
    with pytest.raises(
        TaskError,
        match=r"frames\.workpiece\.xy: unknown key; found xy; allowed: xyz, rpy_deg",
    ):
        written(SEGMENTS, frames={"workpiece": {"xy": [0, 0]}})
    with pytest.raises(
        TaskError,
        match=r"path_frame: this frame differs from path.frame; found 'workpiece' "
        r".*allowed: table, or only one of the two keys",
    ):
        written(
            {"frame": "table", "segments": SEGMENTS},
            frames={"workpiece": PLACE, "table": PLACE},
        )  # type: ignore[arg-type]
    with pytest.raises(
        TaskError, match="path_frame: a path of joints cannot be in a frame"
    ):
        written([{"line": {"by": [0.1]}}], task_space="joints")
    with pytest.raises(
        TaskError,
        match=r"path: a path in a frame is .*allowed: \{frame: NAME, segments",
    ):
        written({"frame": "workpiece", "path": SEGMENTS})  # type: ignore[arg-type]
    tilted = written([{"line": {"by": [0.1, 0.0]}}], task_space=["x", "y"])
    with pytest.raises(
        PathError,
        match=r"path_frame: .* turns the path out of the rows .*\[20.0, -35.0, 110.0\] with .*\[x, y\]",
    ):
        brachis.plan(brachis.robots.scara3, tilted, start=[0.5, -2.0, 2.0])


@pytest.mark.parametrize(
    "angles",
    [(0.3, -0.7, 1.1), (0.4, np.pi / 2, 0.2), (0.4, -np.pi / 2, 0.2), (3.0, 0.1, -3.0)],
)
def test_a_placement_may_be_a_transform(angles: tuple[float, float, float]) -> None:
    given = pin.SE3(pin.rpy.rpyToMatrix(*angles), np.array([1.0, 2.0, 3.0]))
    placement = Placement.model_validate(given)
    assert placement.xyz == (1.0, 2.0, 3.0)
    np.testing.assert_allclose(
        pin.rpy.rpyToMatrix(*np.radians(placement.rpy_deg)), given.rotation, atol=1e-12
    )
