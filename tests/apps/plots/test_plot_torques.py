import numpy as np
from numpy.testing import assert_allclose

from brachis.apps.plots import plot_torques
from support.figures import lines_by_label

INF = float("inf")


def test_lines_cover_the_motion_and_miss_no_knot(line_trajectory):
    t = lines_by_label(plot_torques(line_trajectory).axes[0])["j1"].get_xdata()
    assert t[0] == 0.0
    assert t[-1] == line_trajectory.t_end
    knots = np.unique(line_trajectory.knots) * line_trajectory.t_end
    assert len(knots) > 2
    assert np.abs(t[:, None] - knots).min(axis=0).max() < 1e-12


def test_joints_without_torque_limit_are_left_out(line_trajectory, with_limits):
    ax = plot_torques(
        with_limits(line_trajectory, torque=np.array([10.0, INF, 10.0]))
    ).axes[0]
    assert list(lines_by_label(ax)) == ["j1", "j3"]
    full = lines_by_label(plot_torques(line_trajectory).axes[0])
    assert lines_by_label(ax)["j3"].get_color() == full["j3"].get_color()


def test_torques_and_forces_without_limits_have_axes_of_their_own(
    spatial_trajectory, with_limits
):
    turning, sliding = plot_torques(
        with_limits(spatial_trajectory, torque=np.full(7, INF))
    ).axes
    assert (turning.get_ylabel(), sliding.get_ylabel()) == (r"$\tau$ (Nm)", "$F$ (N)")
    drawn = lines_by_label(sliding) | lines_by_label(turning)
    assert list(drawn) == list(spatial_trajectory.joint_names)
    for joint, line in enumerate(drawn.values()):
        t, values = line.get_data()
        assert_allclose(values, spatial_trajectory.torque(t)[:, joint], atol=1e-9)


def test_torques_are_measured_by_the_limit_of_their_direction(
    line_trajectory, with_limits
):
    lower, upper = np.array([-20.0, -5.0, -10.0]), np.array([10.0, 20.0, 5.0])
    trajectory = with_limits(line_trajectory, torque_lower=lower, torque_upper=upper)
    drawn = lines_by_label(plot_torques(trajectory).axes[0])
    assert list(drawn) == ["j1", "j2", "j3"]
    tau = trajectory.torque(drawn["j1"].get_xdata())
    expected = np.where(tau > 0.0, tau / upper, -tau / lower)
    ratios = np.transpose([line.get_ydata() for line in drawn.values()])
    assert_allclose(ratios, expected, atol=1e-15)  # rounding at zero torque


def test_a_torque_beyond_the_limit_stays_in_view(line_trajectory, with_limits):
    ax = plot_torques(
        with_limits(line_trajectory, torque=np.array([4.0, 4.0, 4.0]))
    ).axes[0]
    peak = max(np.abs(line.get_ydata()).max() for line in lines_by_label(ax).values())
    assert peak > 2.0
    assert ax.get_ylim()[1] > peak
