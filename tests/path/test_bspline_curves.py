"""Curves given by knots and control points, as fits make them: moved to their start, joined, with speeds along them."""

import numpy as np
import pinocchio as pin
import pytest
from numpy.testing import assert_allclose
from scipy.spatial.transform import Rotation

from brachis.errors import PathError, TaskError
from brachis.path import build_path
from brachis.path.from_curve import feed_tables
from brachis.robot.task_map.protocol import POSE_ROWS
from brachis.task import fit_path, load_task, task_with
from support.poses import pose, rotations
from support.seams import bent, brute_distances, wave

MM = 1e-3
S = np.linspace(0.0, 1.0, 2_001)


def test_the_path_with_its_blends_is_within_the_tolerance_of_all_points():
    position, _ = bent(900, 0.01 * MM)
    segments = fit_path(position, tolerance={"position": "0.1 mm", "corner": "0.5 mm"})
    path = build_path(segments, position[0], ["x", "y", "z"])
    assert len(segments) == 3
    assert len(path.breaks) == 6
    distances = brute_distances(
        position, path.sample(np.linspace(0.0, 1.0, 5_001)).target
    )
    assert distances.max() <= 0.5 * MM
    away = np.array([corner.row for corner in segments[0].bspline.fit.corners])
    beside = np.abs(np.arange(len(position))[:, None] - away).min(axis=1) > 10
    assert distances[beside].max() <= 0.1 * MM
    assert distances[~beside].max() > 0.2 * MM


def poses(count=300):
    """Positions and orientations, and both as matrices."""
    t = np.linspace(0.0, 1.0, count)
    rotation_vectors = np.column_stack([0.4 * t, np.sin(t), 3.0 - 0.0 * t])
    turns = Rotation.from_rotvec(rotation_vectors)
    matrices = np.tile(np.eye(4), (count, 1, 1))
    matrices[:, :3, :3] = turns.as_matrix()
    matrices[:, :3, 3] = wave(count)
    return matrices[:, :3, 3], turns, matrices


NEAR = {"position": "0.02 mm"}


def test_all_forms_of_poses_give_the_same_path():
    position, turns, matrices = poses()
    tolerance = {**NEAR, "orientation": "0.05 deg"}
    forms = [
        (matrices, None),
        ([pin.SE3(matrix) for matrix in matrices], None),
        (position, turns.as_matrix()),
        (position.tolist(), turns),
    ]
    ends = np.array([pose(position[i], turns[i]) for i in (0, -1)])
    targets = []
    for points, orientations in forms:
        path = fit_path(points, tolerance=tolerance, orientations=orientations)
        targets.append(build_path(path, ends[0], POSE_ROWS).sample(S).target)
        assert_allclose(targets[-1], targets[0], atol=1e-9)
    assert_allclose(targets[0][[0, -1]], ends, atol=1e-9)


def test_a_relative_curve_moves_and_turns_to_the_start():
    position, turns, matrices = poses()
    segments = fit_path(matrices, tolerance=NEAR, relative=True)
    start, turn = np.array([3.0, 2.0, 1.0]), Rotation.from_rotvec([1.0, -0.4, 0.2])
    recorded, moved = (
        build_path(segments, pose(*first), POSE_ROWS).sample(S).target
        for first in ((position[0], turns[0]), (start, turn))
    )
    assert_allclose(moved[:, :3], recorded[:, :3] - position[0] + start, atol=1e-9)
    change = turn * turns[0].inv()
    gaps = rotations(moved).inv() * change * rotations(recorded)
    assert_allclose(gaps.magnitude(), 0.0, atol=1e-9)


def test_a_start_elsewhere_is_an_error():
    position, turns, matrices = poses()
    segments = fit_path(matrices, tolerance=NEAR)
    turned = Rotation.from_rotvec([0.0, 0.01, 0.0]) * turns[0]
    for start, message in (
        (
            pose(position[0] + [0.0, 0.02, 0.0], turns[0]),
            r"control_points\[0\]: .*, 0.02 m off; allowed: at most 0.0001 m",
        ),
        (pose(position[0], turned), r"control_points\[0\]: .*, 0.01 rad off"),
    ):
        with pytest.raises(PathError, match=message):
            build_path(segments, start, POSE_ROWS)


def test_speeds_follow_the_path_over_its_blends():
    position, _ = bent(900)
    speed = np.where(np.arange(900) < 450, 0.1, 0.2)
    segments = fit_path(
        position, tolerance={"position": "0.05 mm", "corner": "1 mm"}, speed=speed
    )
    path = build_path(segments, position[0], ["x", "y", "z"])
    (table,) = feed_tables(segments, path)
    assert (table.s[0], table.s[-1]) == pytest.approx((0.0, 1.0))
    assert np.all(np.diff(table.s) > 0.0)
    middle = path.sample(S).target
    nearest = np.array(
        [np.argmin(np.linalg.norm(position - place, axis=1)) for place in middle]
    )
    clear = np.abs(nearest - 450) > 2
    assert_allclose(np.interp(S, table.s, table.speed)[clear], speed[nearest[clear]])


def test_stretches_without_speed_have_no_table():
    position = wave(100)
    speed = np.full(100, 0.1)
    speed[40:60] = np.nan
    segments = fit_path(position, tolerance={"position": "0.05 mm"}, speed=speed)
    path = build_path(segments, position[0], ["x", "y", "z"])
    first, second = feed_tables(segments, path)
    inner = [first.s[-1], second.s[0]]
    assert inner == pytest.approx([39 / 99, 59 / 99], abs=0.01)


def test_a_quaternion_of_length_zero_at_the_start_is_no_crash():
    curve = {
        "knots": [0.0] * 6 + [1.0] * 6,
        "control_points": [[0.1 * i, 0, 0, 0, 0, 0, 0] for i in range(6)],
    }
    with pytest.raises(TaskError, match="the quaternion's length is 0"):
        task_with(start="free", task_space="pose", path=[{"bspline": curve}])


def test_a_task_with_a_fit_comes_back():
    *_, matrices = poses()
    path = fit_path(matrices, tolerance=NEAR, speed=np.full(300, 0.1))
    task = task_with(start="free", task_space="pose", path=path)
    assert load_task(task.to_dict()) == task
    assert task.fits[0].points == 300


WRONG = [
    (
        {"points": np.zeros((5, 4, 3))},
        r"the points have the wrong shape; found \(5, 4, 3\)",
    ),
    ({"points": [[0.0, np.nan], [1.0, 1.0]]}, r"points: row 0: not finite"),
    ({"points": ["a"]}, r"not an array of numbers"),
    (
        {"points": wave(5), "orientations": np.zeros((5, 4))},
        r"an array of quaternions does not say whether w is first",
    ),
    (
        {"points": wave(5), "orientations": np.ones((5, 3, 3))},
        r"row 0: not a rotation matrix",
    ),
    (
        {"points": wave(5), "orientations": np.ones((5, 2))},
        r"the orientations have the wrong shape",
    ),
    (
        {"points": wave(5), "orientations": np.ones(4)},
        r"the numbers of points and of rows of orientations differ; found 4; allowed: 5",
    ),
    ({"points": np.zeros((5, 4))}, r"wrong shape; found \(5, 4\)"),
    ({"points": np.empty((0, 3))}, r"wrong shape; found \(0, 3\)"),
    (
        {"points": wave(5), "speed": np.full(5, np.inf)},
        r"row 0: a speed must be positive and finite",
    ),
    ({"points": wave(5), "speed": -np.ones(5)}, r"row 0: a speed must be positive"),
    (
        {"points": wave(5), "speed": np.ones((5, 3))},
        r"the speeds have the wrong shape; found \(5, 3\)",
    ),
    (
        {"points": wave(5), "speed": np.ones(4)},
        r"the numbers of points and of rows of speed differ",
    ),
    (
        {"points": wave(5), "speed": np.ones(5)},
        "feed rates need a path fitted within a tolerance",
    ),
    (
        {"points": wave(5), "tolerance": {"position": "5 kg"}},
        r"tolerance.position: this is not a number with a unit; found '5 kg'.*0.05 mm",
    ),
    ({"points": wave(5), "tolerance": {"positions": 1.0}}, r"tolerance"),
    ({"points": wave(5), "units": {"length": "furlong"}}, r"units.length"),
    (
        {
            "points": bent(300)[0],
            "tolerance": {"position": "0.1 mm"},
            "corner": "refuse",
        },
        r"2 corners; found 8\d.* deg at row",
    ),
]


@pytest.mark.parametrize("keywords, message", WRONG)
def test_the_error_names_what_is_wrong_with_arrays(keywords, message):
    with pytest.raises(TaskError, match=message):
        fit_path(**keywords)
