"""Animations of motions: the robot as a stick figure beside its torques, as a GIF; see make_figures.py."""

from __future__ import annotations

import io
from pathlib import Path

import numpy as np
from matplotlib.figure import Figure
from mpl_toolkits.mplot3d.axes3d import Axes3D
from PIL import Image

import brachis
from brachis.plots.skeleton import drawing_plane, skeleton
from brachis.plots.style import COLOURS, joint_style

FRAMES_PER_SECOND = 20
HELD = 12  # frames at the end
COLOURS_OF_GIF = 128


def animate(trajectory: brachis.Trajectory, path: Path, slower: float = 1.0) -> None:
    """Write a GIF of a motion, played `slower` times as long as it takes."""
    frames = max(2, round(slower * trajectory.t_end * FRAMES_PER_SECOND))
    t = np.linspace(0.0, trajectory.t_end, frames)
    draw = _Scene(trajectory, t, slower)
    images = [draw.frame(k) for k in range(frames)]
    palette = images[frames // 2].quantize(COLOURS_OF_GIF)
    first, *others = [image.quantize(palette=palette, dither=Image.Dither.NONE) for image in images]
    durations = [1000 // FRAMES_PER_SECOND] * (frames - 1) + [HELD * 1000 // FRAMES_PER_SECOND]
    first.save(path, save_all=True, append_images=others, duration=durations, loop=0, optimize=True)


class _Scene:
    """A figure whose moving parts are set anew for every frame."""

    def __init__(self, trajectory: brachis.Trajectory, t: np.ndarray, slower: float) -> None:
        robot, task_map = trajectory.robot, brachis.task_map_of(trajectory.robot, trajectory.task.task_space)
        plane = drawing_plane(robot, trajectory.q[0], task_map.axes)
        self.view = list(plane or (0, 1, 2))
        self.t, self.bones = t, skeleton(robot, trajectory.position(t)).bones[:, :, self.view]
        self.joints = skeleton(robot, trajectory.position(t)).joints[:, :, self.view]
        self.figure = Figure(figsize=(6.4, 3.2), dpi=100, facecolor="white", layout="constrained")
        places = self.figure.add_gridspec(1, 2, width_ratios=(1.15, 1.0))
        self.ax = self.figure.add_subplot(places[0], **({} if plane else {"projection": "3d"}))
        self._draw_robot(trajectory)
        self._draw_torques(trajectory, self.figure.add_subplot(places[1]), slower)

    def _draw_robot(self, trajectory: brachis.Trajectory) -> None:
        ax, corners = self.ax, self.bones.reshape(-1, len(self.view))
        ax.plot(*self.bones[:, -1].T, color=COLOURS[1], linewidth=1.5)
        if not trajectory.robot.revolute[0]:  # the slide's whole travel
            ax.plot(*self.bones[[0, -1], 2].T, color="#999999", linewidth=5.0, solid_capstyle="butt")
        (self.arm,) = ax.plot(*self.bones[0].T, color="#12395f", linewidth=4.0, solid_joinstyle="round")
        (self.dots,) = ax.plot(*self.joints[0].T, "o", color="#56B4E9", markersize=4.0)
        (self.tool,) = ax.plot(*self.bones[0, -1:].T, "o", color=COLOURS[1], markersize=5.0)
        low, high = corners.min(axis=0), corners.max(axis=0)
        if isinstance(ax, Axes3D):
            ax.set(xlim=(low[0], high[0]), ylim=(low[1], high[1]), zlim=(low[2], high[2]))
            ax.set_box_aspect(np.maximum(high - low, 0.2), zoom=1.15)
            ax.view_init(elev=18.0, azim=-35.0)
            ax.set(xticklabels=[], yticklabels=[], zticklabels=[])
        else:
            ax.set_aspect("equal", adjustable="datalim")
            ax.set_xlabel("m", fontsize=8.0)
            ax.tick_params(labelsize=7.0)

    def _draw_torques(self, trajectory: brachis.Trajectory, ax: object, slower: float) -> None:
        dense = np.linspace(0.0, trajectory.t_end, 400)
        ratio = trajectory.torque(dense) / trajectory.robot.limits.torque
        for joint, name in enumerate(trajectory.joint_names):
            ax.plot(dense, ratio[:, joint], label=name, **joint_style(joint))
        ax.axhline(1.0, color="k", linewidth=0.8), ax.axhline(-1.0, color="k", linewidth=0.8)
        self.cursor = ax.axvline(0.0, color="#999999", linewidth=1.0)
        ax.set(xlim=(0.0, trajectory.t_end), ylim=(-1.15, 1.15))
        ax.set_xlabel("time (s)", fontsize=8.0)
        ax.set_title("torque / limit" + (f", {slower:g} times slower" if slower != 1.0 else ""), fontsize=8.0)
        ax.tick_params(labelsize=7.0)
        ax.legend(fontsize=6.5, loc="upper center", bbox_to_anchor=(0.5, -0.17), ncols=4, frameon=False)

    def frame(self, k: int) -> Image.Image:
        """Draw the frame at the k-th time."""
        for artist, points in ((self.arm, self.bones[k]), (self.dots, self.joints[k]), (self.tool, self.bones[k, -1:])):
            if isinstance(self.ax, Axes3D):
                artist.set_data_3d(*points.T)
            else:
                artist.set_data(*points.T)
        self.cursor.set_xdata([self.t[k]] * 2)
        content = io.BytesIO()
        self.figure.savefig(content, format="png")
        return Image.open(content).convert("RGB")
