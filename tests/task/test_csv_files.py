"""Waypoints from CSV files: what a task makes of them, and what every mistake is told."""

import itertools
import json
from pathlib import Path

import numpy as np
import pytest
import yaml
from numpy.testing import assert_allclose
from scipy.spatial.transform import Rotation

from brachis.errors import TaskError
from brachis.path import build_path
from brachis.robot.task_map.protocol import POSE_ROWS
from brachis.task import load_task, task_with
from brachis.task.segments import SplineSegment, SplineThrough
from support.poses import pose

TURNS = Rotation.from_rotvec(
    [[0.1, 0.2, 0.3], [0.2, 0.2, 0.9], [0.5, 0.1, 1.2], [0.9, 0, 1.2]]
)
POINTS = np.array([[0.5, 0.1, 0.3], [0.7, 0.2, 0.3], [0.8, 0.4, 0.5], [1.0, 0.4, 0.6]])
QUATERNIONS = np.roll(TURNS.as_quat(), 1, axis=1)


@pytest.fixture(autouse=True)
def _folder(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)


def write(header, rows, name="poses.csv"):
    lines = [header, *(",".join(repr(float(value)) for value in row) for row in rows)]
    Path(name).write_text("\n".join(lines) + "\n", encoding="utf-8")


def task(space="pose", beside=None, **keys):
    segment = {"csv": {"file": "poses.csv"} | keys, **(beside or {})}
    return task_with(start=[0], task_space=space, path=[segment])


def spline_of(task):
    (segment,) = task.path
    return segment.spline


def turns_of(spline):
    """The orientations at the start and at all waypoints."""
    return [spline.starts_oriented, *(spline.orientations or ())]


def tuples(rows):
    return tuple(map(tuple, rows.tolist()))


def path_of(one, position, turn):
    return build_path(one.path, pose(position, turn), POSE_ROWS)


def test_quaternions():
    write("x,y,z,qw,qx,qy,qz", np.hstack([POINTS, QUATERNIONS]))
    spline = spline_of(task())
    assert (spline.starts_at, *spline.through) == tuples(POINTS)
    quaternions = [turn.quaternion_wxyz for turn in turns_of(spline)]
    assert_allclose(quaternions, QUATERNIONS, atol=1e-15)
    assert not spline.relative


def test_rotation_vectors_in_any_order_of_columns():
    write("rz,ry,rx,z,y,x", np.hstack([POINTS, TURNS.as_rotvec()])[:, ::-1])
    spline = spline_of(task("pose_free_roll", orientation="rotation_vector"))
    assert spline.through == tuples(POINTS[1:])
    assert_allclose(spline.starts_oriented.quaternion_wxyz, QUATERNIONS[0], atol=1e-15)


def test_positions_alone_leave_the_orientation_to_the_segment():
    write("x,y,z", POINTS)
    made = task(beside={"orientation": "tangent"})
    (fit,) = made.fits
    assert (fit.source, fit.points, fit.profile) == ("poses.csv", 4, ())
    first, *through = tuples(POINTS)
    spline = SplineThrough(through=through, starts_at=first, fit=fit)
    assert made.path == (SplineSegment(spline=spline, orientation="tangent"),)
    path_of(made, POINTS[0], TURNS[0])


@pytest.mark.parametrize("rows", [["x", "y"], ["x", "z", "pitch"], "position", ["y"]])
def test_rows(rows):
    names = ["x", "y", "z"] if rows == "position" else rows
    write(",".join(names), POINTS[:, : len(names)])
    made = task(rows)
    path = build_path(made.path, POINTS[0, : len(names)], names)
    assert_allclose(
        path.sample([0.0, 1.0]).target, POINTS[[0, -1], : len(names)], atol=1e-12
    )


@pytest.mark.parametrize("relative", [True, False])
def test_a_loaded_task_needs_the_file_no_more(relative):
    write("x,y,z,qw,qx,qy,qz", np.hstack([POINTS, QUATERNIONS]))
    once = task(relative=relative)
    Path("poses.csv").unlink()
    assert load_task(json.loads(json.dumps(once.to_dict(), allow_nan=False))) == once


def test_the_file_is_relative_to_the_task_file():
    Path("tasks").mkdir()
    write("x,y,z", POINTS, "tasks/poses.csv")
    text = "{brachis: 1, robot: {urdf: a}, start: {joints: [0]}, task_space: pose, path: [{csv: {file: poses.csv}}]}"
    Path("tasks/task.yaml").write_text(text, encoding="utf-8")
    assert spline_of(load_task("tasks/task.yaml")).through == tuples(POINTS[1:])
    Path("tasks/poses.csv").unlink()
    with pytest.raises(TaskError) as caught:
        load_task("tasks/task.yaml")
    assert str(caught.value) == (
        "tasks/task.yaml: path[0].csv.file: the file does not exist; found poses.csv. "
        f"Paths are relative to {Path.cwd() / 'tasks'}"
    )


def test_what_spreadsheets_write_is_read():
    content = '\ufeff# recorded by hand\r\n\r\n x, y ,z\r\n0,0,0\r\n 1, 0,\t0\r\n\r\n"2",1e-1,0\r\n'
    Path("poses.csv").write_bytes(content.encode())
    assert spline_of(task()).through == ((1.0, 0.0, 0.0), (2.0, 0.1, 0.0))


def test_poses_on_the_spot():
    write("x,y,z,rx,ry,rz", np.hstack([POINTS[[0, 0, 0, 0]], TURNS.as_rotvec()]))
    path = path_of(task(orientation="rotation_vector"), POINTS[0], TURNS[0])
    last = path.sample([1.0]).target[0]
    assert_allclose(last, pose(POINTS[0], TURNS[-1]), atol=1e-12)


MISTAKES = [
    (
        "",
        [
            "poses.csv: the file is empty; allowed: x,y,z | x,y,z,qw,qx,qy,qz | x,y,z,q1,q2,q3,q4 | x,y,z,rx,ry,rz"
        ],
    ),
    ("# nothing\n\n", ["poses.csv: the file is empty"]),
    (
        "x,y\n0,0\n1,1",
        [
            "poses.csv: line 1: the columns are wrong; found x, y; allowed: x,y,z | x,y,z,qw"
        ],
    ),
    (
        "t,x,y,z\n0,0,0,0",
        [
            "line 1: the columns are wrong; found t, x, y, z",
            "The first line names the columns",
        ],
    ),
    ("x,y,z,z\n0,0,0,0", ["line 1: the columns are wrong; found x, y, z, z"]),
    ("x,y,z,qx,qy,qz\n0,0,0,0,0,0", ["line 1: the columns are wrong"]),
    (
        "x|y|z\n0|0|0",
        [
            "line 1: the columns are wrong; found x|y|z",
            "separated by commas, semicolons",
        ],
    ),
    ("0,0,0\n1,1,1", ["line 1: the columns are wrong; found 0, 0, 0"]),
    (
        "x,y,z\n0,0,0",
        ["poses.csv: a path needs a start and at least one waypoint; found 1 row of"],
    ),
    (
        "x,y,z\n0,0,0\n1,2\n",
        [
            "poses.csv: line 3: the row has the wrong number of values; found 2; allowed: 3: x, y, z"
        ],
    ),
    (
        "x,y,z\n\n0,0,0\n1,1,one\n",
        ["line 4: the value of column z is not a finite number; found 'one'"],
    ),
    (
        "x,y,z\n0,0,0\n1,,1\n",
        ["line 3: the value of column y is not a finite number; found ''"],
    ),
    (
        "x,y,z\n0,0,nan\n1,1,1\n",
        ["line 2: the value of column z is not a finite number; found 'nan'"],
    ),
    (
        "x,y,z\n0,0,1e308\n1,1,1\n",
        ["line 2: the value of column z is out of range", "'1e308'", "-1e+12 to 1e+12"],
    ),
    (
        "x,y,z\n0,0,0\n1,1,1\n1,1,1\n",
        ["line 4: the row repeats line 3; found line 4, [1, 1, 1] m"],
    ),
    ("x,y,z\n0,0,0\n0,0,0\n1,1,1\n", ["line 3: the row repeats line 2"]),
    (
        "x,y,z\n0,0,0\n1,1,1\n1,1,1.000000001\n2,0,1\n",
        ["line 4: the row repeats line 3", "1e-09 (m or rad) from there"],
    ),
    (
        "x,y,z,rx,ry,rz\n0,0,0,0,0,0\n1,1,1,0,0,0\n1,1,1,0,0,1\n",
        ["line 4: the row repeats line 3", "in position"],
    ),
    (
        "x,y,z,rx,ry,rz\n0,0,0,0,0,0\n0,0,0,0,0,0\n",
        ["line 3: the row repeats line 2", "differ", "orientation"],
    ),
    (
        "x,y,z,qw,qx,qy,qz\n0,0,0,1,0,0,0\n1,1,1,1,1,0,0\n",
        ["line 3: the quaternion's length is 1.41421; found [1.0, 1.0, 0.0, 0.0]"],
    ),
    (
        "x,y,z\n0,0,0\n" + "1" * 200_000,
        ["line 3: not a CSV file: field larger than field limit"],
    ),
]


@pytest.mark.parametrize(
    "content, expected", MISTAKES, ids=[content[:40] for content, _ in MISTAKES]
)
def test_wrong_files(content, expected):
    Path("poses.csv").write_text(content, encoding="utf-8")
    vectors = {"orientation": "rotation_vector"} if "rx" in content else {}
    with pytest.raises(TaskError) as caught:
        task(**vectors)
    assert str(caught.value).startswith(str(Path("poses.csv").absolute()))
    for text in expected:
        assert text in str(caught.value)


def test_columns_of_the_wrong_task_space():
    write("x,y,z,rx,ry,rz", np.hstack([POINTS, TURNS.as_rotvec()]))
    with pytest.raises(
        TaskError,
        match=r"line 1: the columns are wrong; found x, y, z, rx, ry, rz; allowed: x,y,yaw",
    ):
        task(["x", "y", "yaw"])


def test_unreadable_files():
    with pytest.raises(
        TaskError,
        match=r"task: path\[0\].csv.file: the file does not exist; found poses.csv",
    ):
        task()
    Path("poses.csv").write_bytes(b"\xff\xfe\x00")
    with pytest.raises(
        TaskError, match=r"path\[0\].csv.file: not a text file in UTF-8"
    ):
        task()
    Path("poses.csv").unlink()
    Path("poses.csv").mkdir()
    with pytest.raises(TaskError, match=r"path\[0\].csv.file: the file cannot be read"):
        task()


def test_one_word_on_the_orientation():
    write("x,y,z,rx,ry,rz", np.hstack([POINTS, TURNS.as_rotvec()]))
    with pytest.raises(
        TaskError, match=r"path\[0\].orientation: the points already have orientations"
    ):
        task(orientation="rotation_vector", beside={"orientation": "fixed"})


EULER = {
    "kuka_abc": ("a,b,c", "ZYX"),
    "staubli_xyz": ("rx,ry,rz", "XYZ"),
    "fanuc_wpr": ("w,p,r", "xyz"),
    "rpy": ("rx,ry,rz", "xyz"),
    "euler_zyz": ("o,a,t", "ZYZ"),
}


@pytest.mark.parametrize("convention", EULER)
def test_angles_of_the_makers_are_read(convention):
    columns, axes = EULER[convention]
    header = "x,y,z," + ",".join(f"{name}_deg" for name in columns.split(","))
    write(header, np.hstack([POINTS, TURNS.as_euler(axes, degrees=True)]))
    turns = turns_of(spline_of(task(orientation=convention)))
    quaternions = [turn.quaternion_wxyz for turn in turns]
    assert_allclose(quaternions, QUATERNIONS, atol=1e-12)


def test_the_tools_axis_leaves_the_roll_open():
    """The tool's z axis is where the columns say, and the tool does not roll about it between the rows."""
    axes = TURNS.apply([0.0, 0.0, 1.0])
    write("x,y,z,i,j,k", np.hstack([POINTS, axes]))
    spline = spline_of(task("pose_free_roll"))
    turns = [turn.rotation for turn in turns_of(spline)]
    tool_axes = [turn.apply([0.0, 0.0, 1.0]) for turn in turns]
    assert_allclose(tool_axes, axes, atol=1e-12)
    for (before, after), axis in zip(itertools.pairwise(turns), axes, strict=False):
        roll = (after * before.inv()).as_rotvec() @ axis
        assert roll == pytest.approx(0.0, abs=1e-12)
    with pytest.raises(
        TaskError, match=r"i, j, k state the tool's axis .*.*allowed: .*pose_free_roll"
    ):
        task("pose")


AXES = [
    ("0,0,1\n1,0,0,0,0,2", r"line 3: the axis's length is 2"),
    ("0,0,1\n1,0,0,0,0,-1", r"line 3: the tool axis reverses .*rows in"),
]


@pytest.mark.parametrize("rows, message", AXES)
def test_the_error_names_wrong_axes(rows, message):
    Path("poses.csv").write_text(f"x,y,z,i,j,k\n0,0,0,{rows}\n")
    with pytest.raises(TaskError, match=message):
        task("pose_free_roll")


def test_a_tool_that_points_down_may_stay_so():
    write("x,y,z,i,j,k", np.hstack([POINTS, np.tile([0.0, 0.0, -1.0], (4, 1))]))
    spline = spline_of(task("pose_free_roll"))
    down = spline.starts_oriented.rotation.apply([0.0, 0.0, 1.0])
    assert_allclose(down, [0.0, 0.0, -1.0], atol=1e-12)
    assert set(spline.orientations or ()) == {spline.starts_oriented}


def test_quaternions_of_numbered_columns():
    write("x,y,z,q1,q2,q3,q4", np.hstack([POINTS, QUATERNIONS]))
    with pytest.raises(
        TaskError,
        match=r"q1, q2, q3, q4 do not state .* quaternion_wxyz \(quaternion, w first: ABB",
    ):
        task()
    given = spline_of(task(orientation="quaternion_wxyz")).starts_oriented
    write("x,y,z,q1,q2,q3,q4", np.hstack([POINTS, TURNS.as_quat()]))
    assert given == spline_of(task(orientation="quaternion_xyzw")).starts_oriented
    assert_allclose(given.quaternion_wxyz, QUATERNIONS[0], atol=1e-15)


AMBIGUOUS = [
    (
        "x,y,z,rx,ry,rz",
        "",
        (
            r"line 1: the columns rx, ry, rz do not state the convention.*rotation_vector \(axis times angle: "
            r"Universal"
        ),
    ),
    (
        "x,y,z,rx_deg,ry_deg,rz_deg",
        "",
        r"staubli_xyz \(Rx about x.*a wrong convention gives a wrong motion",
    ),
    (
        "x,y,z,a,b,c",
        "",
        r"kuka_abc \(A about z, B about the new y.*rpy \(roll, pitch, yaw about the fixed x",
    ),
    (
        "x,y,z,a,b,c",
        "orientation: kuka_abc",
        "the unit of a is not stated.*Write a_deg in the header",
    ),
    (
        "x,y,z,rx,ry,rz",
        "orientation: kuka_abc",
        "csv.orientation is kuka_abc.*columns a, b, c for kuka_abc",
    ),
    (
        "x,y,z,w,p,r",
        "orientation: rpy",
        r"columns rx, ry, rz \| a, b, c \| roll, pitch, yaw for rpy",
    ),
    (
        "x,y,z",
        "orientation: rpy",
        "csv.orientation is rpy, which does not fit the columns.*Remove csv.orientation",
    ),
    (
        "x,y,z",
        "orientation: kuka",
        r"csv.orientation: this orientation convention is unknown.*kuka_abc \(A",
    ),
]


@pytest.mark.parametrize("header, keys, message", AMBIGUOUS)
def test_the_error_says_what_an_orientation_leaves_open(header, keys, message):
    write(header, np.arange(2.0 * len(header.split(","))).reshape(2, -1))
    with pytest.raises(TaskError, match=message):
        task(**(yaml.safe_load(keys) or {}))
