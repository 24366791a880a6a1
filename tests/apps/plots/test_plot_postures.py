import numpy as np
import pytest
from numpy.testing import assert_allclose

from brachis.apps.plots import plot_postures
from brachis.apps.plots.postures import drawing_plane
from brachis.robot import Robot
from support.chains import Joint, chain_urdf

POSTURES = 7


def find_line(figure, gid):
    (line,) = [line for line in figure.axes[0].get_lines() if line.get_gid() == gid]
    return line


def planar_arm(q):
    """Elbow, wrist and tool of the paper's arm, links of 1 m."""
    angles = np.cumsum(q)
    return np.cumsum(np.column_stack([np.cos(angles), np.sin(angles)]), axis=0)


def test_postures_are_the_arm_at_equidistant_times(line_trajectory):
    figure = plot_postures(line_trajectory)
    for k, t in enumerate(np.linspace(0.0, line_trajectory.t_end, POSTURES)):
        bones = np.column_stack(find_line(figure, f"posture {k}").get_data())
        expected = np.vstack([[0.0, 0.0], planar_arm(line_trajectory.position(t))])
        corners = bones[
            np.append(True, np.linalg.norm(np.diff(bones, axis=0), axis=1) > 1e-9)
        ]
        assert_allclose(corners, expected, atol=1e-12)


def test_the_tool_path_is_the_prescribed_line(line_trajectory):
    x, y = find_line(plot_postures(line_trajectory), "tool path").get_data()
    assert_allclose(x, np.sqrt(3.0), atol=1e-9)
    assert_allclose([y[0], y[-1]], [0.0, 1.0], atol=1e-9)
    assert len(y) > 100


def test_scales_are_equal(line_trajectory):
    figure = plot_postures(line_trajectory)
    figure.draw_without_rendering()
    ax = figure.axes[0]
    box = ax.get_window_extent()
    assert box.width / np.ptp(ax.get_xlim()) == pytest.approx(
        box.height / np.ptp(ax.get_ylim()),
        rel=0.006,  # Matplotlib leaves half a per cent as it is
    )


def test_a_spatial_chain_is_drawn_in_space_with_equal_scales(spatial_trajectory):
    figure = plot_postures(spatial_trajectory)
    ax = figure.axes[0]
    assert ax.name == "3d"
    end = np.column_stack(find_line(figure, f"posture {POSTURES - 1}").get_data_3d())
    tool = spatial_trajectory.robot.tool_placement(spatial_trajectory.q[-1]).translation
    assert_allclose(end[-1], tool, atol=1e-12)
    path = np.column_stack(find_line(figure, "tool path").get_data_3d())
    assert_allclose(path[-1], tool, atol=1e-12)
    spans = np.ptp([ax.get_xlim(), ax.get_ylim(), ax.get_zlim()], axis=1)
    ratios = np.array(ax._box_aspect) / spans
    assert_allclose(ratios, ratios[0])


AXES = {"x": (1.0, 0.0, 0.0), "y": (0.0, 1.0, 0.0), "z": (0.0, 0.0, 1.0)}
KINDS = {"turn": "revolute", "slide": "prismatic"}


@pytest.mark.parametrize(
    "joints, axes, plane",
    [
        ("turn z, turn z", (0, 1), (0, 1)),
        ("turn z, turn z", (1, 0), (0, 1)),
        ("turn y, slide x", (0, 2), (0, 2)),
        ("turn y, slide y", (0, 2), None),
        ("turn z, turn y", (0, 1), None),
        ("turn z, turn z", (0, 2), None),
        ("slide x, slide z", (0,), (0, 2)),
        ("slide x, slide y", (0, 1, 2), (0, 1)),
    ],
)
def test_drawing_plane(joints, axes, plane):
    words = [joint.split() for joint in joints.split(", ")]
    chain = [Joint(KINDS[kind], AXES[axis], (0.5, 0.0, 0.1)) for kind, axis in words]
    text = chain_urdf(chain, tool=(0.15, 0.0, 0.0))
    assert drawing_plane(Robot.from_urdf("chain", urdf_text=text), axes) == plane
