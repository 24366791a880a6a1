import numpy as np
import pytest

from brachis.apps.plots import plot_motion, plot_overview
from brachis.task import SpeedTable
from support.figures import lines_by_label
from support.motions import with_tool_speed

INF = float("inf")


def levels(ax):
    return sorted(line.get_ydata()[0] for line in drawn_limits(ax))


def drawn_limits(ax):
    return [line for line in ax.get_lines() if line.get_gid() == "limit"]


def test_panels_show_the_trajectory(line_trajectory):
    positions, velocities, progress, speed = plot_motion(line_trajectory).axes
    for joint, name in enumerate(line_trajectory.joint_names):
        t, q = lines_by_label(positions)[name].get_data()
        assert np.array_equal(q, line_trajectory.position(t)[:, joint])
        t, qdot = lines_by_label(velocities)[name].get_data()
        assert np.array_equal(qdot, line_trajectory.velocity(t)[:, joint])
    t, s = progress.get_lines()[0].get_data()
    assert np.array_equal(s, line_trajectory.path_coordinate(t))
    t, tool = speed.get_lines()[0].get_data()
    places = np.array(
        [
            line_trajectory.robot.tool_placement(q).translation
            for q in line_trajectory.position(t)
        ]
    )
    way = np.linalg.norm(np.diff(places, axis=0), axis=1).sum()
    assert np.trapezoid(tool, t) == pytest.approx(way, rel=1e-3)


def test_what_the_task_allows_the_tool_is_drawn_where_it_comes_near(line_trajectory):
    fastest = line_trajectory.sample(0.001).tool_speed.max()
    for allowed, drawn in ((1.1 * fastest, 1), (2.0 * fastest, 0)):
        *_, speed = plot_motion(with_tool_speed(line_trajectory, allowed)).axes
        assert levels(speed) == [allowed] * drawn
    table = SpeedTable(
        s=[0.0, 0.5, 0.5, 1.0], speed=[fastest, fastest, 0.5 * fastest, 0.5 * fastest]
    )
    *_, speed = plot_motion(with_tool_speed(line_trajectory, table)).axes
    (limit,) = drawn_limits(speed)
    assert (limit.get_ydata()[0], limit.get_ydata()[-1]) == pytest.approx(
        (fastest, 0.5 * fastest)
    )


def test_turning_and_sliding_joints_have_panels_of_their_own(spatial_trajectory):
    turning, sliding, *_ = plot_motion(spatial_trajectory).axes
    assert (turning.get_ylabel(), sliding.get_ylabel()) == ("$q$ (rad)", "$q$ (m)")
    assert list(lines_by_label(sliding)) == ["rail"]


def test_limits_are_drawn_where_the_joint_comes_near(line_trajectory, with_limits):
    peak = np.abs(line_trajectory.qdot).max(axis=0)
    fastest = int(np.argmax(peak))
    velocity = np.full(3, INF)
    velocity[fastest] = 1.05 * peak[fastest]
    ax = plot_motion(with_limits(line_trajectory, velocity=velocity)).axes[1]
    (limit,) = drawn_limits(ax)
    assert abs(limit.get_ydata()[0]) == velocity[fastest]
    assert ax.get_ylim()[0] < limit.get_ydata()[0] < ax.get_ylim()[1]
    assert limit.get_label() == "limit"


@pytest.mark.parametrize(
    "kind, name, panel", [("position", "q", 0), ("velocity", "qdot", 1)]
)
def test_limits_that_differ_by_direction_have_two_lines(
    line_trajectory, with_limits, kind, name, panel
):
    values = getattr(line_trajectory, name)
    lower = values.min(axis=0) - np.array([0.01, 0.02, 0.03])
    upper = values.max(axis=0) + np.array([0.04, 0.05, 0.06])
    limits = {f"{kind}_lower": lower, f"{kind}_upper": upper}
    ax = plot_motion(with_limits(line_trajectory, **limits)).axes[panel]
    assert levels(ax) == sorted([*lower, *upper])


def test_the_overview_has_every_curve(line_trajectory):
    figure = plot_overview(line_trajectory)
    postures, *panels = figure.axes
    gids = [line.get_gid() or "" for line in postures.get_lines()]
    assert sum(gid.startswith("posture") for gid in gids) > 2
    by_label = {ax.get_ylabel(): ax for ax in panels}
    assert {"$s$", "tool speed (m/s)"} < by_label.keys()
    names = list(line_trajectory.joint_names)
    for label in ("$q$ (rad)", r"$\dot{q}$ (rad/s)", r"$\tau / \tau_\mathrm{max}$"):
        assert list(lines_by_label(by_label[label])) == names


def test_labels_of_three_panels_are_wrapped_outside_formulas(
    line_trajectory, with_limits
):
    motion = line_trajectory
    kinds = {
        "velocity": np.abs(motion.qdot).max(axis=0),
        "acceleration": np.abs(motion.qddot).max(axis=0),
    }
    titles = {
        ax.get_ylabel() for ax in plot_overview(with_limits(motion, **kinds)).axes
    }
    wrapped = {"velocity / limit", "acceleration /\nlimit"}
    assert wrapped | {r"$\tau / \tau_\mathrm{max}$"} < titles


def test_the_overview_shows_what_holds_the_motion(line_trajectory, with_limits):
    """Not the torques, where these are far from their limits."""
    held = with_limits(
        line_trajectory,
        torque=np.full(3, 1e3),
        acceleration=np.abs(line_trajectory.qddot).max(axis=0),
    )
    figure = plot_overview(with_tool_speed(held, held.sample(0.001).tool_speed.max()))
    titles = [ax.get_ylabel() for ax in figure.axes]
    assert {"acceleration / limit", "tool speed / limit"} < set(titles)
    assert not [title for title in titles if "tau" in title]
    curves = lines_by_label(figure.axes[titles.index("acceleration / limit")])
    peaks = [np.abs(line.get_ydata()).max() for line in curves.values()]
    assert max(peaks) == pytest.approx(1.0, abs=0.02)
