"""Postures of the robot along the path, drawn as stick figures by forward kinematics."""

from __future__ import annotations

import itertools
from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

import numpy as np
import pinocchio as pin

from brachis.apps.bottleneck.saturation import dense_samples
from brachis.apps.plots import style
from brachis.common import tolerances
from brachis.robot import Robot, task_map_of
from brachis.robot.chain import path_frame_in_world
from brachis.trajectory import Samples, Trajectory, of_motion

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure
    from matplotlib.gridspec import SubplotSpec


def skeleton(robot: Robot, q: np.ndarray) -> np.ndarray:
    """Return postures `q`, (K, n), as polylines in the world frame, (K, 2 n + 2, 3), m.

    A polyline goes from the base, or from the workpiece, through every joint to the tool. Each joint has two points,
    before and after its motion; for a revolute joint, they are the same.
    """
    model = robot.model
    base = model.getFrameId(robot.base_frame, pin.FrameType.BODY)
    bones = np.empty((len(q), 2 * robot.n + 2, 3))
    for points, data in zip(bones, robot.place_joints(q), strict=True):
        seen = path_frame_in_world(data, robot.world)
        points[0] = seen.act(model.frames[base].placement.translation)
        for joint in range(1, robot.n + 1):
            before = data.oMi[model.parents[joint]] * model.jointPlacements[joint]
            points[2 * joint - 1] = seen.act(before.translation)
            points[2 * joint] = seen.act(data.oMi[joint].translation)
        points[-1] = seen.act(data.oMf[robot.frame_id].translation)
    return bones


def tool_in_world(robot: Robot, samples: Samples) -> np.ndarray:
    """Return the tool's positions in the world, (K, 3), m."""
    if robot.settings.workpiece_frame is None:
        return samples.tool_position
    return skeleton(robot, robot.of_real_joints(samples.q))[:, -1]


def drawing_plane(robot: Robot, axes: Sequence[int]) -> tuple[int, int] | None:
    """Return the world axes (0, 1, 2) of the plane in which a planar chain moves; None for other chains.

    Parameters
    ----------
    robot : Robot
    axes : sequence of int
        World axes of the task space's position rows. Two axes determine the plane; a single axis leaves a choice.
    """
    chain = robot.chain
    sizes = np.abs(chain.axes)
    # How far each joint's direction of motion is from that of a planar chain, for each possible normal.
    tilts = np.where(chain.revolute[:, None], 1.0 - sizes, sizes)
    is_normal = np.all(tilts < tolerances.LENGTH, axis=0)
    for normal in (2, 1, 0):
        if normal not in axes[:2] and is_normal[normal]:
            first, second = (axis for axis in range(3) if axis != normal)
            return first, second
    return None


_SHADES = [
    tuple(shade) for shade in np.linspace([0.72, 0.83, 0.91], [0.03, 0.23, 0.39], 7)
]
"""Colours of the postures, from the first posture to the last."""
_PATH: dict[str, Any] = {"color": style.COLOURS[1], "linewidth": 1.4}
_JOINT: dict[str, Any] = {"linestyle": "", "markersize": 4.5}
_REDUNDANT = style.COLOURS[4]
_VIEWS = tuple(
    itertools.product(
        (15.0, 22.0, 30.0), (-75.0, -65.0, -55.0, -45.0, -35.0, -25.0, -15.0)
    )
)
"""Elevations and azimuths, degrees, from which the direction of view of axes in space is chosen."""


@of_motion
def plot_postures(trajectory: Trajectory) -> Figure:
    """Plot the robot as a stick figure at equidistant times, with the path of its tool (Fig. 1 of the paper).

    Parameters
    ----------
    trajectory : Trajectory, Result or path

    Returns
    -------
    Figure
        Figure one column wide, with equal scales. A planar chain is projected onto its plane; any other chain is drawn
        in space. Later postures are darker. Squares are prismatic joints, and filled markers are redundant joints.
    """
    figure = style.new_figure(style.COLUMN_WIDTH, 80.0)
    place = figure.add_gridspec()[0]
    ax = draw_postures(figure, trajectory, dense_samples(trajectory), place)
    style.legend_above(ax, style.COLUMN_WIDTH - 5.0)
    return figure


def draw_postures(
    figure: Figure, trajectory: Trajectory, samples: Samples, place: SubplotSpec
) -> Axes:
    """Draw the tool path and the postures into new axes, which show the robot's plane or space."""
    plane = plane_of(trajectory)
    in_space = {} if plane else {"projection": "3d", "computed_zorder": False}
    ax: Any = figure.add_subplot(place, **in_space)
    view = list(plane or (0, 1, 2))
    tool = tool_in_world(trajectory.robot, samples)[:, view]
    times = np.linspace(0.0, trajectory.t_end, len(_SHADES))
    postures = skeleton(trajectory.robot, trajectory.position(times))[:, :, view]
    ax.plot(*tool.T, label="tool path", zorder=20.0, gid="tool path", **_PATH)
    last = len(_SHADES) - 1
    labels = {0: "start", last: "end"}
    for k, (bones, shade) in enumerate(zip(postures, _SHADES, strict=True)):
        ax.plot(
            *bones.T,
            color=shade,
            label=labels.get(k),
            linewidth=2.2 if k in labels else 1.0,
            solid_capstyle="round",
            solid_joinstyle="round",
            zorder=2.0 + k,
            gid=f"posture {k}",
        )
        for joint, name in enumerate(trajectory.joint_names):
            is_redundant = name in trajectory.redundant_joints
            ax.plot(
                *bones[2 * joint + 2, :, None],
                label="redundant" if is_redundant and k == last else None,
                marker="o" if trajectory.robot.revolute[joint] else "s",
                markeredgecolor=shade,
                markerfacecolor=_REDUNDANT if is_redundant else "white",
                zorder=2.5 + k,
                **_JOINT,
            )
    ax.plot(*tool[-1:].T, "o", color=_PATH["color"], markersize=3.0, zorder=21.0)
    ground = ((0.0, 0.0), (-0.7, -1.0), (0.7, -1.0))
    base = postures[0, :1].T
    ax.plot(*base, marker=ground, color=style.GREY, markersize=12.0, zorder=0.5)
    style.dress(ax, *(f"${'xyz'[axis]}$ (m)" for axis in view[:2]))
    if plane is None:
        _dress_space(ax, postures.reshape(-1, 3), tool)
    else:
        ax.set_aspect("equal", adjustable="datalim")
        ax.margins(0.06)
    return ax


def plane_of(trajectory: Trajectory) -> tuple[int, int] | None:
    """Return the world axes of the plane in which a motion is drawn; None if it is drawn in space."""
    task_map = task_map_of(trajectory.robot, trajectory.task.task_space)
    return drawing_plane(trajectory.robot, task_map.axes)


def _dress_space(ax: Any, points: np.ndarray, tool: np.ndarray) -> None:
    """Set labels, equal scales and a floor for axes in space, viewed so that points, (p, 3), fill the frame best.

    The tool's path, (K, 3), casts a shadow on the floor.
    """
    from matplotlib.ticker import MaxNLocator

    floor = min(0.0, points[:, 2].min())
    shadow = {"color": "#C8C8C8", "zorder": 1.0, "gid": "shadow"}
    ax.plot(*tool[:, :2].T, np.full(len(tool), floor), linewidth=1.4, **shadow)
    ax.set_zlabel("$z$ (m)", fontsize=style.LABEL_SIZE, labelpad=-4.0)
    ax.xaxis.labelpad = ax.yaxis.labelpad = -4.0
    ax.tick_params(pad=-2.0)
    ax.set_proj_type("ortho")
    limits = np.array([ax.get_xlim(), ax.get_ylim(), ax.get_zlim()])
    spans = np.ptp(limits, axis=1).clip(1e-3)
    corners = np.array(list(itertools.product(*limits)))
    ax.set_box_aspect(spans)

    def look_from(elevation: float, azimuth: float) -> tuple[float, float]:
        """Turn the axes; return the fraction of the frame that the points fill, and the extent of the box."""
        ax.view_init(elevation, azimuth)
        extent = _spans(ax, corners).max()
        return np.prod(_spans(ax, points)) / extent**2, extent

    best = max(_VIEWS, key=lambda view: look_from(*view)[0])
    _, extent = look_from(*best)
    ax.set_box_aspect(spans, zoom=0.78 / extent)  # labels fill the rest of the frame
    for axis in (ax.xaxis, ax.yaxis, ax.zaxis):
        axis.set_pane_color((1.0, 1.0, 1.0, 0.0))
        axis.set_major_locator(MaxNLocator(4, steps=[1, 2, 5, 10]))
    ax.grid(visible=False)
    _draw_floor(ax, floor)


def _draw_floor(ax: Any, z: float) -> None:
    """Draw a grid at the ticks on the floor, up to the edges of the axes."""
    x = ax.get_xlim()
    y = ax.get_ylim()
    grid = np.meshgrid(
        np.union1d(x, np.clip(ax.get_xticks(), *x)),
        np.union1d(y, np.clip(ax.get_yticks(), *y)),
    )
    look = {"color": style.FAINT, "linewidth": 0.6, "zorder": 0.1, "gid": "floor"}
    ax.plot_wireframe(*grid, np.full_like(grid[0], z), **look)
    ax.set(xlim=x, ylim=y)


def _spans(ax: Any, points: np.ndarray) -> np.ndarray:
    """Return the fractions of the frame's width and height that points in space, (p, 3), cover."""
    from mpl_toolkits.mplot3d import proj3d

    across, up, _ = proj3d.proj_transform(*points.T, ax.get_proj())
    return np.array([np.ptp(across) / ax.viewLim.width, np.ptp(up) / ax.viewLim.height])
