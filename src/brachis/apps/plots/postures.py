"""Postures of the robot along the path, as stick figures by forward kinematics."""

from __future__ import annotations

import itertools
from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np
import pinocchio as pin

from brachis.apps.plots import style
from brachis.apps.plots.motion import dense_samples
from brachis.robot import Robot, task_map_of
from brachis.trajectory import Samples, Trajectory, of_motion

if TYPE_CHECKING:
    from matplotlib.artist import Artist
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure, SubFigure
    from matplotlib.gridspec import SubplotSpec

_AXIS_TOLERANCE = 1e-6


@dataclass(frozen=True, eq=False)
class Skeleton:
    """Postures as polylines in the world frame, m.

    Attributes
    ----------
    bones : (K, 2 n + 2, 3) ndarray
        Base, every joint before and after its motion (the same point for a revolute joint), tool.
    joints : (K, n, 3) ndarray
        Origins of the joint frames.
    tool : (K, 3) ndarray
        Tool positions.
    """

    bones: np.ndarray
    joints: np.ndarray
    tool: np.ndarray


def skeleton(robot: Robot, q: np.ndarray) -> Skeleton:
    """Stick figures of the postures `q`, (K, n)."""
    model = robot.model
    tool = robot.frame_id
    base = int(model.getFrameId(robot.base_frame))
    n = robot.n
    bones = np.empty((len(q), 2 * n + 2, 3))
    for points, data in zip(bones, robot.place_joints(q), strict=True):
        points[0] = model.frames[base].placement.translation
        for joint in range(1, n + 1):
            points[2 * joint - 1] = (
                data.oMi[model.parents[joint]] * model.jointPlacements[joint]
            ).translation
            points[2 * joint] = data.oMi[joint].translation
        points[-1] = data.oMf[tool].translation
    return Skeleton(bones, bones[:, 2:-1:2], bones[:, -1])


def drawing_plane(
    robot: Robot, q: np.ndarray, axes: Sequence[int]
) -> tuple[int, int] | None:
    """World axes (0, 1, 2) of the plane in which a planar chain moves; None for other chains.

    Parameters
    ----------
    robot : Robot
    q : (n,) ndarray
        Any posture: joint axes that are parallel in one are so in all.
    axes : sequence of int
        World axes of the task space's position rows. Two of them fix the plane; one leaves a choice.
    """
    data = robot.model.createData()
    columns = np.asarray(pin.computeJointJacobians(robot.model, data, q)).reshape(
        6, robot.n
    )  # (6,) for one joint
    revolute = robot.revolute
    turning = columns[3:, revolute]
    sliding = columns[:3, ~revolute]
    for normal in (2, 1, 0):
        in_plane = [axis for axis in range(3) if axis != normal]
        turns_about = np.abs(turning[in_plane]).max(initial=0.0) < _AXIS_TOLERANCE
        slides_in = np.abs(sliding[normal]).max(initial=0.0) < _AXIS_TOLERANCE
        if normal not in axes[:2] and turns_about and slides_in:
            return in_plane[0], in_plane[1]
    return None


_POSTURES = 7
_FIRST = np.array([0.72, 0.83, 0.91])
_LAST = np.array([0.03, 0.23, 0.39])
_PATH_COLOUR = "#D55E00"
_REDUNDANT_COLOUR = "#E69F00"
_SHADOW_COLOUR = "#C8C8C8"
_GROUND = ((0.0, 0.0), (-0.7, -1.0), (0.7, -1.0))
_WORLD = "xyz"
_ROOM = 0.78
"""Part of the frame that the box of axes in space takes; their labels take the rest."""
_VIEWS = tuple(
    itertools.product(
        (15.0, 22.0, 30.0), (-75.0, -65.0, -55.0, -45.0, -35.0, -25.0, -15.0)
    )
)
"""Elevations and azimuths from which axes in space may be seen, degrees."""


@of_motion
def plot_postures(trajectory: Trajectory) -> Figure:
    """Plot the robot as a stick figure at equidistant times, and the path of its tool (Fig. 1 of the paper).

    Parameters
    ----------
    trajectory : Trajectory, Result or path

    Returns
    -------
    Figure
        One column wide, equal scales. A planar chain is projected onto its plane; any other is drawn in space.
        Later postures are darker. Squares are prismatic joints, filled markers redundant ones.
    """
    figure = style.new_figure(style.COLUMN_WIDTH, 80.0)
    ax = add_posture_axes(figure, trajectory)
    draw_postures(ax, trajectory, dense_samples(trajectory))
    legend_postures(ax, trajectory, style.COLUMN_WIDTH - 5.0)
    return figure


def add_posture_axes(
    figure: Figure | SubFigure, trajectory: Trajectory, place: SubplotSpec | None = None
) -> Axes:
    """Add axes that suit the robot: in its plane, or in space."""
    where = () if place is None else (place,)
    if plane_of(trajectory) is not None:
        return figure.add_subplot(*where)
    axes: Axes = figure.add_subplot(*where, projection="3d", computed_zorder=False)
    return axes


def draw_postures(ax: Axes, trajectory: Trajectory, samples: Samples) -> None:
    """Draw tool path and postures into the axes that `add_posture_axes` made."""
    plane = plane_of(trajectory)
    view = list(plane or (0, 1, 2))
    robot = trajectory.robot
    tool = skeleton(robot, samples.q).tool[:, view]
    figures = skeleton(
        robot, trajectory.position(np.linspace(0.0, trajectory.t_end, _POSTURES))
    )
    for k, shade in enumerate(_shades()):
        _draw_links(ax, figures.bones[k][:, view], tuple(shade), k)
        _draw_joints(ax, trajectory, figures.joints[k][:, view], tuple(shade), k)
    ax.plot(*tool.T, color=_PATH_COLOUR, linewidth=1.4, zorder=20.0, gid="tool path")
    ax.plot(*tool[-1:].T, "o", color=_PATH_COLOUR, markersize=3.0, zorder=21.0)
    ax.plot(
        *figures.bones[0, :1][:, view].T,
        marker=_GROUND,
        color=style.GREY,
        markersize=12.0,
        zorder=0.5,
    )
    style.dress(ax, f"${_WORLD[view[0]]}$ (m)", f"${_WORLD[view[1]]}$ (m)")
    if plane is None:
        _dress_space(ax, figures.bones.reshape(-1, 3), tool)
    else:
        ax.set_aspect("equal", adjustable="datalim")
        ax.margins(0.06)


def legend_postures(ax: Axes, trajectory: Trajectory, width: float) -> None:
    """Put the legend above the axes; `width` is its room, mm."""
    from matplotlib.lines import Line2D

    first, *_, last = _shades()
    lines: dict[str, Artist] = {
        "start": Line2D([], [], color=tuple(first), linewidth=2.2),
        "end": Line2D([], [], color=tuple(last), linewidth=2.2),
        "tool path": Line2D([], [], color=_PATH_COLOUR, linewidth=1.4),
    }
    if trajectory.redundant_joints:
        lines["redundant"] = Line2D(
            [],
            [],
            linestyle="",
            marker="o",
            markersize=4.5,
            markerfacecolor=_REDUNDANT_COLOUR,
            markeredgecolor=tuple(last),
        )
    style.legend_above(ax, width, lines)


def plane_of(trajectory: Trajectory) -> tuple[int, int] | None:
    """World axes of the plane in which a motion is drawn; None where it is drawn in space."""
    task_map = task_map_of(trajectory.robot, trajectory.task.task_space)
    return drawing_plane(trajectory.robot, trajectory.q[0], task_map.axes)


def _shades() -> np.ndarray:
    """Colours (postures, 3) from the first to the last posture."""
    return np.linspace(_FIRST, _LAST, _POSTURES)


def _draw_links(ax: Axes, bones: np.ndarray, shade: tuple[float, ...], k: int) -> None:
    """Draw the links of posture number `k` as one line; later postures lie on top."""
    ax.plot(
        *bones.T,
        color=shade,
        linewidth=2.2 if k in {0, _POSTURES - 1} else 1.0,
        solid_capstyle="round",
        solid_joinstyle="round",
        zorder=2.0 + k,
        gid=f"posture {k}",
    )


def _draw_joints(
    ax: Axes,
    trajectory: Trajectory,
    joints: np.ndarray,
    shade: tuple[float, ...],
    k: int,
) -> None:
    """Draw the joints of posture number `k`."""
    units = trajectory.robot.position_units
    for name, unit, point in zip(trajectory.joint_names, units, joints, strict=True):
        ax.plot(
            *point[:, None],
            linestyle="",
            marker="s" if unit == "m" else "o",
            markersize=4.5,
            markeredgecolor=shade,
            markerfacecolor=_REDUNDANT_COLOUR
            if name in trajectory.redundant_joints
            else "white",
            zorder=2.5 + k,
        )


def _dress_space(ax: Any, points: np.ndarray, tool: np.ndarray) -> None:
    """Labels, equal scales and a floor of axes in space, seen from where points, (p, 3), fill the frame best.

    The tool's path, (K, 3), has its shadow on the floor.
    """
    floor = min(0.0, float(points[:, 2].min()))
    ax.plot(
        *tool[:, :2].T,
        np.full(len(tool), floor),
        color=_SHADOW_COLOUR,
        linewidth=1.4,
        zorder=1.0,
        gid="shadow",
    )
    ax.set_zlabel("$z$ (m)", fontsize=style.LABEL_SIZE, labelpad=-4.0)
    ax.xaxis.labelpad = ax.yaxis.labelpad = -4.0
    ax.tick_params(pad=-2.0)
    ax.set_proj_type("ortho")
    spans = [
        max(np.ptp(limits), 1e-3)
        for limits in (ax.get_xlim(), ax.get_ylim(), ax.get_zlim())
    ]
    ax.set_box_aspect(spans)
    elevation, azimuth = max(_VIEWS, key=lambda view: _fill_factor(ax, points, *view))
    ax.view_init(elevation, azimuth)
    ax.set_box_aspect(spans, zoom=_ROOM / _extent(ax))
    for axis in (ax.xaxis, ax.yaxis, ax.zaxis):
        axis.set_pane_color((1.0, 1.0, 1.0, 0.0))
        axis.set_major_locator(_few_ticks())
    ax.grid(visible=False)
    _draw_floor(ax, floor)


def _draw_floor(ax: Any, z: float) -> None:
    """Draw a grid of the ticks on the floor, up to the edges of the axes."""
    x = ax.get_xlim()
    y = ax.get_ylim()
    inner = [
        [tick for tick in ticks if low < tick < high]
        for ticks, (low, high) in ((ax.get_xticks(), x), (ax.get_yticks(), y))
    ]
    look = {"color": style.FAINT, "linewidth": 0.6, "zorder": 0.1, "gid": "floor"}
    for at in (*x, *inner[0]):
        ax.plot([at, at], y, z, **look)
    for at in (*y, *inner[1]):
        ax.plot(x, [at, at], z, **look)
    ax.set(xlim=x, ylim=y)


def _fill_factor(
    ax: Any, points: np.ndarray, elevation: float, azimuth: float
) -> float:
    """Tell how much of the frame points take when the axes' box just fits into it; dimensionless."""
    ax.view_init(elevation, azimuth)
    return float(np.prod(_spans(ax, points)) / _extent(ax) ** 2)


def _extent(ax: Any) -> float:
    """Part of the axes' frame that the box of 3-D axes takes, in the direction in which it takes more."""
    corners = np.array(
        list(itertools.product(ax.get_xlim(), ax.get_ylim(), ax.get_zlim()))
    )
    return float(_spans(ax, corners).max())


def _spans(ax: Any, points: np.ndarray) -> np.ndarray:
    """Parts of the frame's width and height that points in space, (p, 3), take."""
    from mpl_toolkits.mplot3d import proj3d

    across, up, _ = proj3d.proj_transform(*points.T, ax.get_proj())
    return np.array([np.ptp(across) / ax.viewLim.width, np.ptp(up) / ax.viewLim.height])


def _few_ticks() -> Any:
    from matplotlib.ticker import MaxNLocator

    return MaxNLocator(4, steps=[1, 2, 5, 10])
