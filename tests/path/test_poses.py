"""Paths of poses: the body twist against finite differences, known twists, joins and blends."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation

from brachis.path import PathSample, build_path
from brachis.path.pose import PosePath
from brachis.robot.task_map.protocol import POSE_ROWS
from brachis.task import LineBy, LineSegment
from support.poses import (
    START,
    TURNED,
    central_difference,
    pose,
    pose_path,
    rotations,
    smooth_places,
    twist_by_difference,
)

ROTATE = {"rotate": {"axis": [1, 2, -2], "angle_deg": 140}}
SMOOTH = {
    "rotate": {
        "axis": [1, 2, -2],
        "angle_deg": 140,
        "frame": "tool",
        "profile": "smooth",
    }
}
ALONG: dict[str, Any] = {"line": {"by": [0.6, 0, 0.3]}}
SPLINE: dict[str, Any] = {
    "spline": {"through": [[0.6, 0.3, 0.2], [0.9, 0.4, 0.4], [1.1, 0.8, 0.3]]}
}
CIRCLE: dict[str, Any] = {
    "circle": {"center": [0.2, 0.1, 0.3], "normal": [0, 1, 1], "turns": -1.25}
}
VIA: dict[str, Any] = {"arc": {"via": [0.7, 0.3, 0.3], "to": [0.9, 0.2, 0.5]}}
ATTITUDES = [
    {"rpy_deg": [20, 40, 60]},
    {"rotation_vector": [0.2, 0.9, 1.5]},
    {"quaternion_wxyz": [-0.5, 0.5, -0.5, -0.5]},
]

SEGMENTS: dict[str, list[dict[str, Any]]] = {
    "fixed": [ALONG],
    "rotate": [ALONG | {"orientation": ROTATE}],
    "rotate smoothly": [ALONG | {"orientation": SMOOTH}],
    "rotate along an arc": [VIA | {"orientation": ROTATE}],
    "rotate along a spline": [SPLINE | {"orientation": SMOOTH}],
    "to": [ALONG | {"orientation": {"to": {"rpy_deg": [10, -80, 20]}}}],
    "to, smoothly": [
        ALONG
        | {"orientation": {"to": {"rotation_vector": [2, 0, 1], "profile": "smooth"}}}
    ],
    "tangent of a circle": [CIRCLE | {"orientation": "tangent"}],
    "tangent of an arc, other up": [
        VIA | {"orientation": {"tangent": {"up": [1, 1, 1]}}}
    ],
    "tangent of a spline": [SPLINE | {"orientation": "tangent"}],
    "orientations": [{"spline": SPLINE["spline"] | {"orientations": ATTITUDES}}],
    "two orientations": [
        {
            "spline": {
                "through": [[0.8, 0.1, 0.5], [1, 0.4, 0.3]],
                "orientations": ATTITUDES[:2],
            }
        },
    ],
    "one orientation": [
        {"spline": {"through": [[0.8, 0.1, 0.5]], "orientations": ATTITUDES[:1]}}
    ],
    "orientations on the spot": [
        {"spline": {"through": [START] * 3, "orientations": ATTITUDES}}
    ],
    "turn": [{"turn": ROTATE}],
    "turn to": [{"turn": {"to": {"rpy_deg": [10, -80, 20], "profile": "smooth"}}}],
    "two turns": [
        {"turn": SMOOTH},
        {"turn": {"to": {"rpy_deg": [10, -80, 20], "profile": "smooth"}}},
    ],
    "blends": [
        ALONG | {"orientation": ROTATE, "blend": 0.2},
        {"line": {"by": [0, 0.8, 0.1]}, "blend": 0.2},
        {
            "line": {"by": [0, 0, 0.7]},
            "orientation": {"to": {"rpy_deg": [10, 80, 20]}},
            "blend": 0.2,
        },
        {
            "spline": {"through": [[0.4, 0.2, 0.4], [0.9, 0, 0.5]], "relative": True},
            "orientation": "tangent",
        },
    ],
}


@pytest.fixture(params=SEGMENTS)
def path(request: pytest.FixtureRequest) -> PosePath:
    return pose_path(SEGMENTS[request.param])


def size(values: np.ndarray) -> float:
    return max(float(np.abs(values).max()), 1.0)


def test_the_twist_is_that_of_the_poses(path: PosePath) -> None:
    h = 2e-4
    s = smooth_places(path, 3 * h)
    assert s.size > 20
    exact = path.sample(s)
    assert exact.target.shape == (s.size, 12)
    assert exact.xi.shape == exact.xi_ds.shape == exact.xi_dds.shape == (s.size, 6)
    np.testing.assert_allclose(
        twist_by_difference(path, s, h), exact.xi, atol=1e-8 * size(exact.xi)
    )


def test_derivatives_of_the_twist(path: PosePath) -> None:
    h = 2e-4
    s = smooth_places(path, 3 * h)
    for lower, upper in (("xi", "xi_ds"), ("xi_ds", "xi_dds")):
        exact = getattr(path.sample(s), upper)
        difference = central_difference(
            lambda s, name=lower: getattr(path.sample(s), name), s, h
        )
        np.testing.assert_allclose(
            difference, exact, atol=1e-7 * size(exact), err_msg=upper
        )


def test_targets_are_poses(path: PosePath) -> None:
    matrices = path.sample(np.linspace(0, 1, 50)).target[:, 3:].reshape(-1, 3, 3)
    np.testing.assert_allclose(
        matrices @ np.swapaxes(matrices, 1, 2),
        np.broadcast_to(np.eye(3), (50, 3, 3)),
        atol=1e-12,
    )
    np.testing.assert_allclose(np.linalg.det(matrices), 1.0)
    np.testing.assert_allclose(
        path.sample([0.0]).target[0], pose(START, TURNED), atol=1e-12
    )


def one_sided(path: PosePath) -> tuple[PathSample, PathSample]:
    inner, h = path.breaks[1:-1], 1e-10
    return path.sample(inner - h), path.sample(inner + h)


@pytest.mark.parametrize("name", ["blends", "two turns"])
def test_the_twist_and_two_derivatives_continue_across_joins(name: str) -> None:
    path = pose_path(SEGMENTS[name])
    assert path.breaks.size == (8 if name == "blends" else 3)
    before, after = one_sided(path)
    everywhere = path.sample(np.linspace(0, 1, 2000))
    for what in ("target", "xi", "xi_ds", "xi_dds"):
        jump = np.abs(getattr(after, what) - getattr(before, what)).max()
        assert jump < 1e-6 * np.abs(getattr(everywhere, what)).max(), what


def test_a_smooth_turn_joins_a_constant_orientation() -> None:
    path = pose_path(
        [
            {"line": {"by": [0.3, 0, 0]}},
            {"line": {"by": [0.4, 0, 0]}, "orientation": SMOOTH},
            {"line": {"by": [0.2, 0, 0]}},
        ]
    )
    assert len(path.spans) == 3
    sample = path.sample(path.breaks)
    for what in (sample.xi, sample.xi_ds, sample.xi_dds):
        np.testing.assert_allclose(what[:, 3:], 0.0, atol=1e-9)
    turned = (TURNED.inv() * rotations(sample.target)).magnitude()
    np.testing.assert_allclose(turned, np.deg2rad([0, 0, 140, 140]), atol=1e-12)


def test_the_same_uniform_turn_may_go_on() -> None:
    half = {
        "line": {"by": [0.3, 0, 0]},
        "orientation": {"rotate": {"axis": [0, 0, 1], "angle_deg": 30}},
    }
    other = {
        "line": {"by": [0.6, 0, 0]},
        "orientation": {"rotate": {"axis": [0, 0, 2], "angle_deg": 60}},
    }
    assert len(pose_path([half, other]).spans) == 2


def test_without_continuation_the_turning_rate_would_jump() -> None:
    """The continuity tests above can fail: the same corner, between the segments themselves, is far from continuous."""
    path = pose_path(SEGMENTS["blends"])
    first, last = path.spans[0].curve, path.spans[2].curve
    before = first.derivatives(np.array([first.length]), 1)[1]
    after = last.derivatives(np.zeros(1), 1)[1]
    assert np.linalg.norm((after - before)[:, 3:]) > 1


def test_a_fixed_orientation_has_no_turning() -> None:
    sample = pose_path([ALONG]).sample(np.linspace(0, 1, 9))
    np.testing.assert_array_equal(sample.xi[:, 3:], 0.0)
    np.testing.assert_allclose(
        sample.xi[:, :3],
        np.broadcast_to(TURNED.inv().apply([0.6, 0, 0.3]), (9, 3)),
        atol=1e-12,
    )
    np.testing.assert_allclose(sample.xi_ds, 0.0, atol=1e-12)


@pytest.mark.parametrize("frame", ["path", "tool"])
def test_a_rotation_has_a_constant_angular_velocity(frame: str) -> None:
    axis = np.array([1.0, 2.0, -2.0]) / 3
    orientation = {"rotate": {"axis": 5 * axis, "angle_deg": -400, "frame": frame}}
    sample = pose_path([ALONG | {"orientation": orientation}]).sample(
        np.linspace(0, 1, 30)
    )
    in_tool = TURNED.inv().apply(axis) if frame == "path" else axis
    np.testing.assert_allclose(
        sample.xi[:, 3:],
        np.broadcast_to(-np.deg2rad(400) * in_tool, (30, 3)),
        atol=1e-12,
    )
    turned = Rotation.from_rotvec(-np.deg2rad(400) * axis)
    expected = turned * TURNED if frame == "path" else TURNED * turned
    np.testing.assert_allclose(
        sample.target[-1, 3:], expected.as_matrix().ravel(), atol=1e-12
    )


@pytest.mark.parametrize("profile", ["uniform", "smooth"])
def test_to_ends_there_by_the_shortest_way(profile: str) -> None:
    target = Rotation.from_euler("xyz", [10, -80, 20], degrees=True)
    path = pose_path(
        [
            ALONG
            | {"orientation": {"to": {"rpy_deg": [10, -80, 20], "profile": profile}}}
        ]
    )
    s = np.linspace(0, 1, 11)
    turned = (TURNED.inv() * rotations(path.sample(s).target)).as_rotvec()
    whole = (TURNED.inv() * target).as_rotvec()
    assert np.linalg.norm(whole) < np.pi
    share = s if profile == "uniform" else 35 * s**4 - 84 * s**5 + 70 * s**6 - 20 * s**7
    np.testing.assert_allclose(turned, share[:, None] * whole, atol=1e-12)


def test_to_where_the_tool_is_already() -> None:
    sample = pose_path(
        [ALONG | {"orientation": {"to": {"rotation_vector": [0.3, -0.5, 0.8]}}}]
    ).sample([0.0, 0.5, 1.0])
    np.testing.assert_allclose(sample.xi[:, 3:], 0.0, atol=1e-12)


@pytest.mark.parametrize("segment", [CIRCLE, VIA])
def test_the_tangent_of_a_circle_has_a_constant_twist(segment: dict[str, Any]) -> None:
    path = pose_path([segment | {"orientation": "tangent"}])
    sample = path.sample(np.linspace(0, 1, 40))
    np.testing.assert_allclose(
        sample.xi, np.broadcast_to(sample.xi[0], (40, 6)), atol=1e-11
    )
    np.testing.assert_allclose(sample.xi_ds, 0.0, atol=1e-10)
    angle = path.length * path.spans[0].curve.curve.turn  # type: ignore[attr-defined]
    np.testing.assert_allclose(
        np.linalg.norm(sample.xi, axis=1), np.hypot(path.length, angle), atol=1e-11
    )


def test_along_the_tangent_the_velocity_keeps_its_direction_in_the_tool() -> None:
    path = pose_path(SEGMENTS["tangent of a spline"])
    xi = path.sample(np.linspace(0, 1, 50)).xi[:, :3]
    direction = xi / np.linalg.norm(xi, axis=1)[:, None]
    np.testing.assert_allclose(
        direction, np.broadcast_to(direction[0], (50, 3)), atol=1e-12
    )


def test_along_the_tangent_up_keeps_no_roll() -> None:
    """What is level and square to the tangent at the start stays level and square to it."""
    path = pose_path(SEGMENTS["tangent of a spline"])
    sample = path.sample(np.linspace(0, 1, 50))
    turning = rotations(sample.target)
    tangent = turning.apply(sample.xi[:, :3])
    level = np.cross([0, 0, 1], tangent)
    level /= np.linalg.norm(level, axis=1)[:, None]
    in_tool = turning.inv().apply(level)
    np.testing.assert_allclose(
        in_tool, np.broadcast_to(in_tool[0], (50, 3)), atol=1e-12
    )
    assert np.ptp(tangent[:, 2]) > 0.1


def test_a_line_along_its_tangent_does_not_turn() -> None:
    sample = pose_path([ALONG | {"orientation": "tangent"}]).sample([0.0, 0.5, 1.0])
    np.testing.assert_allclose(sample.xi[:, 3:], 0.0, atol=1e-12)


def test_a_turn_moves_nothing_but_the_orientation() -> None:
    path = pose_path([{"turn": ROTATE}, {"turn": ROTATE}])
    sample = path.sample(np.linspace(0, 1, 9))
    assert path.length == 0.0
    np.testing.assert_array_equal(sample.target[:, :3], np.broadcast_to(START, (9, 3)))
    np.testing.assert_array_equal(sample.xi[:, :3], 0.0)
    np.testing.assert_allclose(
        np.linalg.norm(sample.xi[:, 3:], axis=1), np.deg2rad(280)
    )


def test_positions_are_those_of_the_task_space_of_positions() -> None:
    poses = pose_path(SEGMENTS["blends"])
    plain = [
        {key: value for key, value in one.items() if key != "orientation"}
        for one in SEGMENTS["blends"]
    ]
    alone = pose_path(plain)
    s = np.linspace(0, 1, 50)
    np.testing.assert_allclose(
        poses.sample(s).target[:, :3], alone.sample(s).target[:, :3], atol=1e-12
    )
    assert poses.length == pytest.approx(alone.length)


def test_a_blend_of_a_turn_that_goes_on_keeps_close_to_it() -> None:
    """The polynomial of quaternions turns as the segments do, also by more than half a turn within the blend."""
    turning = {"rotate": {"axis": [0, 0, 1], "angle_deg": 500}}
    path = pose_path(
        [
            {"line": {"by": [1, 0, 0]}, "orientation": turning, "blend": 0.3},
            {"line": {"by": [1, 0, 0]}, "orientation": turning},
        ]
    )
    s = np.linspace(0, 1, 200)
    turned = np.unwrap(
        (rotations(path.sample(s).target) * TURNED.inv()).as_rotvec()[:, 2]
    )
    np.testing.assert_allclose(turned, np.deg2rad(1000) * s, atol=0.1)


@given(
    st.lists(st.floats(-3, 3), min_size=6, max_size=6),
    st.lists(st.floats(-1.5, 1.5), min_size=3, max_size=3),
)
def test_blends_and_splines_do_not_depend_on_the_frames(
    change: list[float], tool: list[float]
) -> None:
    """Another world frame and another tool frame give the same motion."""
    segments = [
        ALONG
        | {
            "orientation": {
                "rotate": {"axis": [0, 1, 1], "angle_deg": 100, "frame": "tool"}
            },
            "blend": 0.1,
        },
        {
            "spline": {
                "through": [[0.4, 0.2, 0.4], [0.9, 0, 0.5]],
                "relative": True,
                "orientations": ATTITUDES[1:],
            }
        },
    ]
    world, turned = Rotation.from_rotvec(change[:3]), Rotation.from_rotvec(tool)
    path = pose_path(segments)

    def moved(vector: Any) -> Any:
        return world.apply(vector)

    def seen(attitude: Rotation) -> dict[str, Any]:
        return {"rotation_vector": (turned.inv() * attitude * turned).as_rotvec()}

    attitudes = [
        Rotation.from_rotvec(ATTITUDES[1]["rotation_vector"]),
        Rotation.from_quat([0.5, -0.5, -0.5, -0.5]),
    ]
    other = pose_path(
        [
            {
                "line": {"by": moved([0.6, 0, 0.3])},
                "orientation": {
                    "rotate": {
                        "axis": turned.inv().apply([0, 1, 1]),
                        "angle_deg": 100,
                        "frame": "tool",
                    },
                },
                "blend": 0.1,
            },
            {
                "spline": {
                    "through": [moved([0.4, 0.2, 0.4]), moved([0.9, 0, 0.5])],
                    "relative": True,
                    "orientations": [seen(one) for one in attitudes],
                }
            },
        ],
        moved(START) + change[3:],
        world * TURNED * turned,
    )
    s = np.linspace(0, 1, 20)
    here, there = path.sample(s).target, other.sample(s).target
    np.testing.assert_allclose(there[:, :3], moved(here[:, :3]) + change[3:], atol=1e-9)
    expected = world * rotations(here) * turned
    np.testing.assert_allclose(
        there[:, 3:], expected.as_matrix().reshape(-1, 9), atol=1e-9
    )


def test_the_start_is_freed_of_rounding() -> None:
    segments = [LineSegment(line=LineBy(by=(1.0, 0.0, 0.0)))]
    rounded = np.round(pose(START, TURNED), 7)
    path = build_path(segments, rounded, POSE_ROWS)
    target = path.sample([0.0]).target[0]
    matrix = target[3:].reshape(3, 3)
    np.testing.assert_allclose(matrix @ matrix.T, np.eye(3), atol=1e-15)
    np.testing.assert_allclose(target, rounded, atol=1e-6)


def test_nan_stays_nan_and_the_path_continues_beyond_its_ends(path: PosePath) -> None:
    sample = path.sample([0.5, np.nan])
    assert np.all(np.isnan(sample.target[1, :3]))
    assert not np.any(np.isnan(sample.xi_dds[0]))
    outside = path.sample([-1e-7, 0.0, 1.0, 1.0 + 1e-7])
    np.testing.assert_allclose(
        np.diff(outside.xi, axis=0)[[0, 2]], 0.0, atol=1e-4 * size(outside.xi)
    )
