"""The interactive Plotly figures of a report, and the data of its stick-figure animation."""

from __future__ import annotations

import base64
from typing import Any

import numpy as np

from brachis.apps.bottleneck.saturation import THRESHOLD, knot_times
from brachis.apps.plots import style
from brachis.apps.plots.panels import (
    Panel,
    PanelCurve,
    at_distinct_times,
    curves_of,
    joint_rows_of,
    panels_of,
    tool_rows_of,
    torque_panels,
)
from brachis.apps.plots.postures import plane_of, skeleton
from brachis.apps.report.motion import ReportedMotion
from brachis.apps.report.tables import NEAR
from brachis.trajectory import Trajectory

Figure = dict[str, Any]
"""A Plotly figure: its ``data`` and ``layout``."""


def encode(values: np.ndarray) -> dict[str, Any]:
    """Encode an array in the form that Plotly reads: single precision, base64."""
    data = base64.b64encode(values.astype("<f4").tobytes()).decode()
    return {"dtype": "f4", "shape": ",".join(map(str, values.shape)), "bdata": data}


def motion_figure(motion: ReportedMotion) -> Figure:
    """Draw positions and their derivatives, torques and forces, and the tool's speed, with their limits.

    Joints in rad and joints in m have separate panels. The reader can hide a joint in all panels at once. Torques and
    forces are also shown as ratios to their limits, because the torques of a wrist are much smaller than those of a
    shoulder.
    """
    trajectory = motion.trajectory
    samples = motion.samples
    panels = list(motion.panels)
    over_limits = torque_panels(trajectory, samples, motion.ratios)
    panels += [panel for panel in over_limits if panel.is_ratio]
    panels += panels_of(trajectory, samples, *tool_rows_of(trajectory))
    heights = [210 if len(panel.curves) > 2 else 130 for panel in panels]
    ends = 1.0 - np.cumsum([0, *heights]) / sum(heights)
    layout = _layout(trajectory, sum(heights))
    layout["xaxis"] |= {
        "anchor": f"y{len(panels)}",
        "minor": {"tickvals": knot_times(trajectory).tolist()},
    }
    data = []
    named: set[str] = set()
    for row, panel in enumerate(panels):
        number = "" if row == 0 else str(row + 1)
        layout[f"yaxis{number}"] = {
            "domain": (max(ends[row + 1], 0.0) + 0.012, ends[row] - 0.012),
            "title": {"text": panel.heading},
            "range": panel.view(),
        }
        for curve in panel.curves:
            is_new = curve.name in trajectory.joint_names and curve.name not in named
            data += _traces(panel, curve, f"y{number}", is_named=is_new)
            named.add(curve.name)
    return {"data": data, "layout": layout}


def _traces(
    panel: Panel, curve: PanelCurve, axis: str, *, is_named: bool
) -> list[dict[str, Any]]:
    """Draw one curve and its limits. The page shows limits as thin dashed lines."""
    look = style.joint_style(curve.style)
    shared = {"yaxis": axis, "name": curve.name, "legendrank": curve.style}
    hover = f"%{{y:.4g}} {panel.unit}".rstrip()
    lengths = look["linestyle"][1]
    dash = ",".join(f"{1.8 * length:.1f}px" for length in lengths) or "solid"
    line = {
        **shared,
        "x": encode(panel.t),
        "y": encode(curve.values),
        "showlegend": is_named,
        "line": {"color": look["color"], "dash": dash},
    }
    if curve.is_limited and not panel.is_ratio:
        line["customdata"] = encode(100.0 * np.abs(curve.ratios))
        hover += f", %{{customdata:.1f}} % ({panel.ratio_title})"
    # Escape names, so that Plotly does not read them as markup.
    name = curve.name.replace("&", "&amp;").replace("<", "&lt;").replace("%{", "% {")
    line["hovertemplate"] = f"{hover}<extra>{name}</extra>"
    traces = [line]
    for limit in (curve.lower, curve.upper):
        if np.isfinite(limit).any():
            t = panel.t if np.ndim(limit) else panel.t[[0, -1]]
            dashed = {
                **shared,
                "x": encode(t),
                "y": encode(np.where(np.isfinite(limit), limit, np.nan) + 0.0 * t),
                "line": {"color": look["color"]},
                "meta": "limit",
            }
            traces.append(dashed)
    return traces


def timeline_figure(motion: ReportedMotion) -> Figure:
    """Draw how close the motion is to each limit over time, in rows: blue, orange if active, red beyond the limit."""
    ratios = at_distinct_times(motion.ratios)
    used = dict(zip(ratios.labels, np.abs(ratios.values.T), strict=True))
    entries = [entry for entry in motion.saturations if entry.is_drawn][::-1]
    shares = np.array([used[entry.label] for entry in entries])
    colours = shares.copy()
    for row, entry in zip(colours, entries, strict=True):
        for active in entry.active:  # including ripple
            inside = (ratios.t >= active.begin) & (ratios.t <= active.end)
            row[inside] = np.maximum(row[inside], THRESHOLD)
    heat = {
        "x": encode(ratios.t),
        "y": [str(entry.label) for entry in entries],
        "z": encode(colours),
        "customdata": encode(100.0 * shares),
    }
    layout = _layout(motion.trajectory, 26 * max(len(entries), 1))
    return {"data": [heat] if entries else [], "layout": layout}


def _layout(trajectory: Trajectory, height: int) -> dict[str, Any]:
    """Return a layout with one time axis and the given total height of the panels, pixels. The page sets the style."""
    return {"height": height + 110, "xaxis": {"range": [0.0, trajectory.t_end]}}


def scene(motion: ReportedMotion) -> dict[str, Any]:
    """Return the data of the page's animation.

    Returns
    -------
    dict
        ``t``, ``s``, ``speed`` (of the tool) at K times; ``bones``, the polylines of the arm, (K, p, 3), m; ``plane``,
        the two world axes of a planar robot's plane, or None; ``joints``, each with ``name``, ``redundant`` and, for
        every quantity, the values with their unit and their ratios to the limits; ``levels``, the ratios above which
        values are marked.
    """
    trajectory = motion.trajectory
    samples = trajectory.at(np.linspace(0.0, trajectory.t_end, 240))
    robot = trajectory.robot
    rows = joint_rows_of(trajectory)
    panels = panels_of(trajectory, samples, *rows, degrees=motion.degrees)
    joints = []
    for name, unit in zip(robot.joint_names, robot.position_units, strict=True):
        quantities = []
        for panel, curve in curves_of(panels, name):
            entry: dict[str, Any] = {"unit": panel.unit, "values": encode(curve.values)}
            if curve.is_limited:
                entry["ratios"] = encode(np.abs(curve.ratios))
            quantities.append(entry)
        joint = {
            "name": name,
            "redundant": name in trajectory.redundant_joints,
            "prismatic": unit == "m",
            "quantities": quantities,
        }
        joints.append(joint)
    return {
        "t": encode(samples.t),
        "s": encode(samples.s),
        "speed": encode(samples.tool_speed),
        "bones": encode(skeleton(robot, samples.q)),
        "plane": plane_of(trajectory),
        "joints": joints,
        "kinds": rows,
        "phase_ends": trajectory.phase_ends[:-1].tolist(),
        "levels": {
            "near": NEAR,
            "at": THRESHOLD,
            "beyond": 1.0 + trajectory.task.refinement.tolerance,
        },
    }
