"""Figures of the page on the mathematics; see make_figures.py."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
from matplotlib.figure import Figure

import brachis
from brachis.apps.plots import style
from brachis.apps.plots.postures import skeleton
from brachis.ik import find
from brachis.robot import bind

ROOT = Path(__file__).parents[1]
LINE = ROOT / "examples/01_scara_line.yaml"
POSTURES = 9


def mathematics(save: Callable[[Figure, str], None]) -> None:
    """Make all of them."""
    save(self_motion(), "self_motion")
    save(control_points(), "control_points")
    save(refinement(), "refinement")
    save(active_limits(), "active_limits")


def self_motion() -> Figure:
    """Draw postures of the planar arm with one tool position, each given by its redundant joint alone."""
    robot, task_map = bind(
        brachis.Robot.from_urdf(ROOT / "robots/scara3/robot.urdf", tool_frame="tool"),
        ["x", "y"],
    )
    solver = find(robot, task_map, ["j3"]).solver
    q_r = np.linspace(-2.6, 2.6, POSTURES)
    tool = np.array([1.7, 0.4])
    q_nr = solver.solve(np.tile(tool, (POSTURES, 1)), q_r[:, None])[:, :, 0]
    figure = style.new_figure(style.PAGE_WIDTH, 62.0)
    for ax, branch in zip(
        figure.subplots(1, len(solver.branches), sharey=True), range(2), strict=True
    ):
        for k, bend in enumerate(q_r):
            if np.isnan(q_nr[k, branch]).any():
                continue
            bones = skeleton(robot, np.array([[*q_nr[k, branch], bend]]))[0, :, :2]
            shade = (k / (POSTURES - 1), 0.35, 1.0 - k / (POSTURES - 1))
            ax.plot(
                *bones.T,
                "-o",
                color=shade,
                markersize=3.0,
                linewidth=1.5,
                label=f"{bend:.2f}",
            )
        ax.plot(*tool, "*", color="black", markersize=8.0, zorder=9.0)
        ax.set_aspect("equal", adjustable="datalim")
        ax.set_title(f"branch {solver.branches[branch]}", fontsize=style.LABEL_SIZE)
        style.dress(ax, "$x$ (m)", "$y$ (m)" if branch == 0 else "")
        ax.legend(
            title="$q_3$ (rad)",
            title_fontsize=6.0,
            fontsize=6.0,
            loc="center right",
            frameon=False,
        )
    return figure


def trajectory_of(**changes: Any) -> brachis.Result:
    """Plan the paper's line with some keys of the task changed."""
    return brachis.plan({**brachis.load_task(LINE).to_dict(), **changes})


def control_points() -> Figure:
    """Draw the splines of a plan over their control points and knots."""
    trajectory = brachis.plan(LINE).trajectory
    figure = style.new_figure(style.PAGE_WIDTH, 62.0)
    splines = (
        (trajectory.path_spline, "$s$"),
        (trajectory.redundant_spline, "$q_3$ (rad)"),
    )
    for ax, (spline, label) in zip(figure.subplots(1, 2), splines, strict=True):
        knots, degree = spline.t, spline.k
        greville = np.array(
            [knots[i + 1 : i + 1 + degree].mean() for i in range(len(spline.c))]
        )
        t = np.linspace(knots[0], knots[-1], 400)
        ax.plot(t, spline(t), **style.joint_style(0))
        ax.plot(
            greville,
            np.ravel(spline.c),
            "--o",
            color=style.GREY,
            markersize=2.5,
            linewidth=0.6,
        )
        ax.vlines(
            np.unique(knots),
            *ax.get_ylim(),
            color=style.FAINT,
            linewidth=0.5,
            zorder=0.0,
        )
        style.dress(ax, "time (s)", label)
    return figure


def refinement() -> Figure:
    """Draw the torque of one joint before and after refinement, with the collocation points of the first solve."""
    figure = style.new_figure(style.PAGE_WIDTH, 62.0)
    ax = figure.subplots()
    for number, (name, rounds) in enumerate(
        (("first collocation points", 0), ("refined", 10))
    ):
        trajectory = trajectory_of(refinement={"max_rounds": rounds}).trajectory
        t = np.linspace(0.0, trajectory.t_end, 3000)
        worst = np.abs(trajectory.torque(t) / trajectory.robot.limits.torque).max(
            axis=1
        )
        ax.plot(
            t,
            worst,
            label=f"{name}: {trajectory.t_end:.4f} s, at most {worst.max():.4f}",
            **style.joint_style(number),
        )
    ax.axhline(1.0, color="black", linewidth=0.6)
    ax.set_ylim(0.85, 1.08)
    style.dress(ax, "time (s)", "largest torque over its limit")
    style.legend_above(ax, style.PAGE_WIDTH)
    return figure


def active_limits() -> Figure:
    """Draw how many limits are active over time: degree of redundancy plus one, almost everywhere."""
    trajectory = trajectory_of(
        spline={"intervals": "auto", "rest": "velocity"}
    ).trajectory
    t = np.linspace(0.0, trajectory.t_end, 2000)
    ratio = trajectory.torque(t) / trajectory.robot.limits.torque
    figure = style.new_figure(style.PAGE_WIDTH, 62.0)
    ax = figure.subplots()
    for joint, name in enumerate(trajectory.joint_names):
        ax.plot(t, ratio[:, joint], label=name, **style.joint_style(joint))
    style.dress(ax, "time (s)", "torque over its limit")
    style.dress_time(
        ax, trajectory.t_end, np.unique(trajectory.knots) * trajectory.t_end
    )
    style.legend_above(ax, style.PAGE_WIDTH)
    return figure
