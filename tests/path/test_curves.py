"""Every curve: its derivatives against finite differences, and the geometry it promises."""

import numpy as np
import pytest
import yaml
from hypothesis import given
from hypothesis import strategies as st
from numpy.testing import assert_allclose, assert_array_equal

from brachis.errors import PathError
from support.arrays import assert_near
from support.poses import row_path

XY, XYZ, XYW = ["x", "y"], ["x", "y", "z"], ["x", "z", "pitch"]


def curve_of(segment, start, rows=XY):
    return row_path([segment], start, rows).spans[0].curve


def spline_of(points, start=(0, 0), **keys):
    return curve_of({"spline": {"through": points, **keys}}, start)


CURVES = {
    "line": ("line: {to: [1, 2]}", [0.3, 0.4], XY),
    "line with yaw": ("line: {by: [1, 2, -3]}", [0.3, 0.4, 0.5], XYW),
    "yaw alone": ("line: {by: [0, 0, -3]}", [0.3, 0.4, 0.5], XYW),
    "heading": ("line: {length: 2, angle_deg: 30}", [0.3, 0.4], XY),
    "arc": ("arc: {center: [1, 0], angle_deg: -130}", [0.3, 0.4], XY),
    "arc in space": (
        "arc: {center: [1, 0, 0], angle_deg: 80, normal: [0, 2, -1]}",
        [0, 0.5, 1],
        XYZ,
    ),
    "arc via": ("arc: {via: [1, 0, 1], to: [2, 1, 3]}", [0, 0, 0], XYZ),
    "arc along the tangent": (
        "arc: {center: [1, 0], angle_deg: 130, yaw: tangent}",
        [0, 0, 1],
        XYW,
    ),
    "circle": ("circle: {center: [0.2, 0], turns: -2.5}", [0, 0], XY),
    "helix": (
        "helix: {center: [0.2, 0, 1], pitch: -0.1, normal: [0, 0, 2], turns: 2.5}",
        [0, 0, 1],
        XYZ,
    ),
    "spline, one waypoint": ("spline: {through: [[1, 2]]}", [0, 0], XY),
    "spline, two": ("spline: {through: [[1, 2], [2, 1]]}", [0, 0], XY),
    "spline, three": ("spline: {through: [[1, 2], [2, 1], [2.5, 3]]}", [0, 0], XY),
    "spline, seven, with yaw": (
        (
            "spline: {through: [[1, 0.841, 0.54], [2, 0.909, -0.416], [3, 0.141, -0.99], [4, -0.757, -0.654], [5,"
            " -0.959, 0.284], [6, -0.279, 0.96], [7, 0.657, 0.754]]}"
        ),
        [0, 0, 1],
        XYW,
    ),
    "spline in one row": ("spline: {through: [[1], [0.5], [2]]}", [0], ["x"]),
}


@pytest.mark.parametrize("name", CURVES)
def test_derivatives_are_the_slopes_of_those_below(name):
    segment, start, rows = CURVES[name]
    curve = curve_of(yaml.safe_load(segment), start, rows)
    sigma = np.random.default_rng(1).uniform(-0.1, 1.1, 50) * curve.length
    exact = curve.derivatives(sigma, 4)
    h = 1e-5 * curve.length
    ahead, behind = (curve.derivatives(sigma + step, 3) for step in (h, -h))
    scale = 1 + np.abs(exact[1:]).max(axis=(1, 2), keepdims=True)
    assert np.abs(((ahead - behind) / (2 * h) - exact[1:]) / scale).max() < 1e-6
    for order in range(4):
        assert_near(curve.derivatives(sigma, order), exact[: order + 1], 1e-12)
    first = curve.derivatives(np.zeros(1), 0)[0, 0]
    assert_allclose(first, start, atol=1e-12)
    assert curve.knots[0] == 0
    assert curve.knots[-1] == pytest.approx(curve.length)


coordinates = st.lists(st.floats(-5, 5), min_size=3, max_size=3).map(np.array)


@given(
    coordinates,
    st.floats(-720, 720).filter(lambda angle: abs(angle) > 1e-3),
    coordinates,
)
def test_an_arc_keeps_its_radius_and_turns_by_its_angle(center, angle, aside):
    normal = np.array([0.3, -0.5, 0.8]) / np.linalg.norm([0.3, -0.5, 0.8])
    outward = np.cross(normal, aside)
    if np.linalg.norm(outward) < 1e-2:
        outward = np.cross(normal, [1.0, 0, 0])
    radius = np.linalg.norm(outward)
    arc = {"center": center, "angle_deg": angle, "normal": 2 * normal}
    curve = curve_of({"arc": arc}, center + outward, XYZ)
    assert curve.length == pytest.approx(radius * np.deg2rad(abs(angle)))
    z, velocity = curve.derivatives(np.linspace(0, curve.length, 30), 1)
    assert_allclose(np.linalg.norm(z - center, axis=1), radius, rtol=1e-9)
    assert_allclose((z - center) @ normal, 0, atol=1e-9)
    assert_allclose(np.linalg.norm(velocity, axis=1), 1.0)
    turn = np.deg2rad(angle)
    turned = np.cos(turn) * outward + np.sin(turn) * np.cross(normal, outward)
    assert_allclose(z[-1], center + turned, atol=1e-8)


@given(st.floats(0.05, 0.95), st.floats(0.1, 6.2), st.booleans(), st.integers(2, 3))
def test_an_arc_passes_via_and_then_ends(fraction, angle, clockwise, rows):
    center = np.array([0.3, -0.2, 0.5])[:rows]
    u = np.array([0.6, 0.8, 0.0])[:rows]
    v = np.array([0.8, -0.6] if rows == 2 else [0.48, -0.36, 0.8])
    sign = -1 if clockwise else 1

    def on_circle(phi):
        return center + 1.5 * (np.cos(phi) * u + sign * np.sin(phi) * v)

    via, end = on_circle(fraction * angle), on_circle(angle)
    curve = curve_of({"arc": {"via": via, "to": end}}, on_circle(0.0), XYZ[:rows])
    assert curve.length == pytest.approx(1.5 * angle, rel=1e-6)
    z = curve.derivatives(np.array([fraction, 1.0]) * curve.length, 0)[0]
    assert_allclose(z, [via, end], atol=1e-6)


@pytest.mark.parametrize("turns", [1, -1.25])
def test_yaw_turns_with_the_tangent(turns):
    circle = {"center": [0, 0], "turns": turns}
    curve, fixed = (
        curve_of({"circle": circle | yaw}, [2, 0, 0.7], XYW)
        for yaw in ({"yaw": "tangent"}, {})
    )
    z, velocity = curve.derivatives(np.linspace(0, curve.length, 40), 1)
    # By the right-hand rule about y, which turns z towards x.
    heading = -np.unwrap(np.arctan2(velocity[:, 1], velocity[:, 0]))
    assert_allclose(z[:, 2] - 0.7, heading - heading[0], atol=1e-12)
    assert z[-1, 2] - 0.7 == pytest.approx(-2 * np.pi * turns)
    assert_array_equal(fixed.derivatives(np.array([0.0, 1.0]), 0)[0, :, 2], 0.7)


@pytest.mark.parametrize("count", [2, 3, 5, 12])
def test_a_spline_passes_its_waypoints_and_is_c4(count):
    rng = np.random.default_rng(count)
    points = np.cumsum(rng.uniform(0.1, 1.0, (count, 2)), axis=0)
    curve = spline_of(points)
    knots = curve.knots
    assert_allclose(curve.derivatives(knots, 0)[0, 1:], points, atol=1e-12)
    assert_allclose(
        np.diff(knots), np.linalg.norm(np.diff([[0, 0], *points], axis=0), axis=1)
    )
    h = 1e-9
    jump = curve.derivatives(knots[1:-1] + h, 4) - curve.derivatives(knots[1:-1] - h, 4)
    fifth = np.abs(curve.derivatives(np.linspace(0, curve.length, 100), 5)).max(
        axis=(1, 2)
    )
    for k in range(5):
        assert np.abs(jump[k]).max() <= 4 * h * fifth[k + 1] + 1e-9 * (1 + fifth[k])


@pytest.mark.parametrize(
    "points", [[[1e-4, 0], [1, 0.5]], [[0.5, 1], [0.5, 1.0001], [2, 0]]]
)
def test_a_spline_bears_short_chords(points):
    curve = spline_of(points)
    assert_allclose(curve.derivatives(curve.knots, 0)[0, 1:], points, atol=1e-10)


def test_a_spline_may_state_its_start():
    waypoints = [[1.5, 0], [2, 1]]
    start = [1, -1]
    plain = spline_of(waypoints, start)
    stated = spline_of(waypoints, start, starts_at=[1, -1.00009])
    moved = spline_of([[4.5, 4], [5, 5]], start, starts_at=[4, 3], relative=True)
    sigma = np.linspace(0, plain.length, 9)
    for curve in (stated, moved):
        assert_allclose(curve.derivatives(sigma), plain.derivatives(sigma), atol=1e-12)


def test_a_centre_of_few_digits_is_moved_into_the_plane_of_the_arc():
    start = np.array([0.5, 0.0, 0.18959559])

    def around(height):
        center = [0.3, 0.0, height]
        arc = {"center": center, "angle_deg": 360.0, "normal": [0, 0, 1]}
        return row_path([{"arc": arc}], start, XYZ).sample(np.linspace(0, 1, 9)).target

    places = around(0.18959)
    assert_allclose(places[:, 2], start[2], atol=1e-15)
    assert_allclose(places[[0, -1]], [start, start], atol=1e-12)
    with pytest.raises(
        PathError, match=r"Move the centre by 0\.00959559 m along the normal"
    ):
        around(0.18)


def test_a_helix_climbs_by_its_pitch():
    shape = "{center: [0.3, 0, 1], pitch: 0.1, normal: [0, 0, 2], turns: -2.5}"
    curve = curve_of({"helix": yaml.safe_load(shape)}, [0.5, 0.0, 1.0], XYZ)
    length = 2.5 * np.hypot(2 * np.pi * 0.2, 0.1)
    assert curve.length == pytest.approx(length)
    places = curve.derivatives(np.array([0.0, length / 2.5, length]), 0)[0]
    expected = [[0.5, 0.0, 1.0], [0.5, 0.0, 1.1], [0.1, 0.0, 1.25]]
    assert_allclose(places, expected, atol=1e-12)
    tangents = curve.derivatives(np.linspace(0.0, length, 20), 1)[1]
    assert_allclose(np.linalg.norm(tangents, axis=1), 1.0)
    assert tangents[0, 1] < 0.0, "against the right-hand rule about the normal"
