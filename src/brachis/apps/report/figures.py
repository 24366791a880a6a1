"""The interactive figures of a report for Plotly, and its animation of stick figures."""

from __future__ import annotations

import base64
from collections.abc import Sequence
from dataclasses import replace
from typing import Any

import numpy as np

from brachis.apps.bottleneck import THRESHOLD
from brachis.apps.plots import style
from brachis.apps.plots.motion import knot_times
from brachis.apps.plots.postures import plane_of, skeleton
from brachis.apps.plots.quantities import (
    REACH,
    Quantity,
    joint_quantities,
    kinds_of,
    near_tool_speeds,
    quantities,
)
from brachis.apps.report.motion import ReportedMotion
from brachis.apps.report.tables import NEAR

Figure = dict[str, Any]
"""``data`` and ``layout`` of Plotly."""

_SMALL_PX = 130
_FRAME_PX = 110
_SHOWN = 0.5
"""Limits that the motion never comes this near to have no row."""
_MOST = 1.1
"""Ratio at the upper end of the colours."""


def encode(values: np.ndarray) -> dict[str, Any]:
    """Write an array as Plotly reads it: single precision, base64."""
    data = np.ascontiguousarray(values, dtype="<f4")
    shape = {"shape": ",".join(map(str, data.shape))} if data.ndim > 1 else {}
    return {"dtype": "f4", "bdata": base64.b64encode(data.tobytes()).decode(), **shape}


def motion_figure(motion: ReportedMotion) -> Figure:
    """Positions and their derivatives, torques and forces, and the tool's speed, with their limits.

    Joints in rad and joints in m have panels of their own; a joint is hidden in all panels at once.
    """
    trajectory = motion.trajectory
    samples = motion.samples
    parts = quantities(
        trajectory, samples, *kinds_of(trajectory), degrees=motion.degrees
    )
    panels = [[part] for part in parts]
    shares = _over_their_limits(quantities(trajectory, samples, "torque"))
    if shares:
        panels.append(shares)
    heights = [210 if len(parts[0].joints) > 2 else _SMALL_PX for parts in panels] + [
        _SMALL_PX
    ]
    data = []
    named = set()
    last = len(heights)
    layout = _layout(trajectory.t_end, sum(heights) + _FRAME_PX)
    for row, (parts, domain) in enumerate(
        zip(panels, _domains(heights), strict=False), start=1
    ):
        title = f"{parts[0].name} ({parts[0].unit})"
        layout[_axis("yaxis", row)] = _value_axis(title, domain, _view(parts))
        for part in parts:
            for column, joint in enumerate(part.joints.tolist()):
                name = trajectory.joint_names[joint]
                data += _joint_traces(part, column, name, row, shown=name not in named)
                named.add(name)
    layout[_axis("yaxis", last)] = _value_axis(
        "tool speed (m/s)", _domains(heights)[-1], None
    )
    speed = _curve(
        samples.t,
        samples.tool_speed,
        last,
        line={"color": style.COLOURS[-1], "width": 1.6},
        name="tool",
        showlegend=False,
        hovertemplate="%{y:.4g} m/s<extra>tool</extra>",
    )
    data.append(speed)
    for allowed in near_tool_speeds(trajectory, samples):
        name = "limit of the tool speed"
        data.append(_limit_line(samples.t, allowed, last, style.GREY, name=name))
    layout["xaxis"] |= {"anchor": f"y{last}", "title": {"text": "t (s)"}}
    layout["xaxis"]["minor"] = {
        "tickvals": knot_times(trajectory).tolist(),
        "ticks": "inside",
        "ticklen": 3,
    }
    return {"data": data, "layout": layout}


def _over_their_limits(parts: Sequence[Quantity]) -> list[Quantity]:
    """Divide torques and forces by their limits: a wrist's are smaller than a shoulder's."""
    found = [ratios for part in parts if (ratios := part.over_limits()) is not None]
    names = ", ".join(part.name for part in found)
    return [replace(part, name=names) for part in found]


def _joint_traces(
    part: Quantity, column: int, name: str, row: int, *, shown: bool
) -> list[dict[str, Any]]:
    """Draw one joint's curve, and its limits as thin straight lines."""
    joint = style.joint_style(int(part.joints[column]))
    values = part.values[:, column]
    levels = (part.lower[column], part.upper[column])
    group = {"name": name, "legendgroup": name, "legendrank": int(part.joints[column])}
    hover = f"%{{y:.4g}} {part.unit}"
    look: dict[str, Any] = {**group, "showlegend": shown}
    if np.isfinite(levels).all():
        look["customdata"] = encode(100.0 * np.abs(part.ratios[:, column]))
        hover += f", %{{customdata:.1f}} % of {part.of}"
    look["hovertemplate"] = f"{hover}<extra>{_escape(name)}</extra>"
    look["line"] = {
        "color": joint["color"],
        "width": 1.8,
        "dash": _dash(joint["linestyle"]),
        "simplify": False,
    }
    limits = [
        _limit_line(part.t[[0, -1]], np.full(2, level), row, joint["color"], **group)
        for level in levels
        if np.isfinite(level)
    ]
    return [_curve(part.t, values, row, **look), *limits]


def timeline_figure(motion: ReportedMotion) -> Figure:
    """Draw how near the motion is to every limit over time, a row each: blue, orange where active, red beyond it."""
    ratios = motion.ratios
    tolerance = motion.trajectory.task.refinement.tolerance
    columns = {label: column for column, label in enumerate(ratios.labels)}
    entries = [entry for entry in motion.saturations if entry.peak > _SHOWN][::-1]
    once = np.append(np.diff(ratios.t) > 0.0, True)
    t = ratios.t[once]
    values = np.abs(ratios.values[once])
    part = np.array([values[:, columns[entry.label]] for entry in entries]).reshape(
        len(entries), len(t)
    )
    colours = part.copy()
    for row, entry in enumerate(entries):
        for stretch in entry.active:  # ripple included
            inside = (t >= stretch.begin) & (t <= stretch.end)
            colours[row, inside] = np.maximum(colours[row, inside], THRESHOLD)
    active = THRESHOLD / _MOST
    beyond = (1.0 + tolerance) / _MOST
    layout = _layout(motion.trajectory.t_end, 26 * max(len(entries), 1) + _FRAME_PX)
    layout["xaxis"] |= {"title": {"text": "t (s)"}}
    layout["yaxis"] = {"automargin": True, "fixedrange": True, "ticks": ""}
    layout["hovermode"] = "closest"
    heat = {
        "type": "heatmap",
        "x": encode(t),
        "y": [f"{entry.label}" for entry in entries],
        "z": encode(np.minimum(colours, _MOST)),
        "customdata": encode(100.0 * part),
        "zmin": 0.0,
        "zmax": _MOST,
        "ygap": 3,
        "colorscale": [
            [0.0, "#F7FBFF"],
            [0.5 * active, "#9ECAE1"],
            [active, "#08306B"],
            [active, "#E69F00"],
            [beyond, "#E69F00"],
            [beyond, "#C00000"],
            [1.0, "#C00000"],
        ],
        "colorbar": {
            "title": {"text": "part of the limit"},
            "thickness": 12,
            "tickvals": [0, 0.25, 0.5, 0.75, 1],
        },
        "hovertemplate": "%{y}: %{customdata:.1f} % of its limit at %{x:.4f} s<extra></extra>",
    }
    return {"data": [heat] if entries else [], "layout": layout}


def _curve(t: np.ndarray, values: np.ndarray, row: int, **look: Any) -> dict[str, Any]:
    """Return a curve of the panel with this number."""
    return {
        "type": "scatter",
        "mode": "lines",
        "x": encode(t),
        "y": encode(values),
        "yaxis": f"y{row}",
        **look,
    }


def _limit_line(
    t: np.ndarray, values: np.ndarray, row: int, colour: str, **look: Any
) -> dict[str, Any]:
    """Return a thin dashed line, without an entry in the legend."""
    line = {"color": colour, "width": 1, "dash": "4px,4px"}
    look |= {"line": line, "showlegend": False, "hoverinfo": "skip", "meta": "limit"}
    return _curve(t, values, row, **look)


def _layout(t_end: float, height: float) -> dict[str, Any]:
    """Layout with one time axis; the page sets colours."""
    return {
        "height": height,
        "margin": {"l": 70, "r": 20, "t": 40, "b": 50},
        "hovermode": "x unified",
        "xaxis": {"range": [0.0, t_end], "hoverformat": ".4f"},
        "legend": {"orientation": "h", "y": 1.0, "yanchor": "bottom", "x": 0.0},
    }


def _value_axis(
    title: str, domain: tuple[float, float], view: tuple[float, float] | None
) -> dict[str, Any]:
    axis: dict[str, Any] = {
        "domain": domain,
        "title": {"text": title, "standoff": 8},
        "anchor": "x",
        "zeroline": True,
    }
    if view is not None:
        axis["range"] = view
    return axis


def _view(parts: Sequence[Quantity]) -> tuple[float, float]:
    """Range of values in view: the motion, and the limits that it comes near."""
    low = min(float(part.values.min()) for part in parts)
    high = max(float(part.values.max()) for part in parts)
    reach = REACH * max(high - low, 1e-9)
    levels = np.concatenate(
        [level for part in parts for level in (part.lower, part.upper)]
    )
    near = levels[(levels > low - reach) & (levels < high + reach)]
    low = min([low, *near.tolist()])
    high = max([high, *near.tolist()])
    room = 0.06 * max(high - low, 1e-9)
    return low - room, high + room


def _domains(heights: list[int]) -> list[tuple[float, float]]:
    """Parts of the figure's height for panels, from the top down."""
    whole = float(sum(heights))
    gap = 0.012
    ends = 1.0 - np.cumsum([0.0, *heights]) / whole
    return [
        (float(low) + gap, float(high) - gap)
        for high, low in zip(ends[:-1], ends[1:].clip(0.0), strict=True)
    ]


def _axis(name: str, row: int) -> str:
    return name if row == 1 else f"{name}{row}"


def _dash(linestyle: object) -> str:
    """Write Matplotlib's line style as Plotly's."""
    if not isinstance(linestyle, tuple):
        return "solid"
    return ",".join(f"{1.8 * length:.1f}px" for length in linestyle[1])


def _escape(name: str) -> str:
    """Keep Plotly from reading names as markup."""
    return name.replace("&", "&amp;").replace("<", "&lt;").replace("%{", "% {")


def scene(motion: ReportedMotion) -> dict[str, Any]:
    """Write what the page's animation shows.

    Returns
    -------
    dict
        ``t``, ``s``, ``speed`` (of the tool) at K times; ``bones``, (K, p, 3), m; ``plane``, the two world axes that a
        planar robot moves in, or None; ``joints``, with ``name``, ``redundant`` and, for every quantity, the values
        with their unit and parts of their limits; ``levels``, the parts of a limit from which on values are marked.
    """
    trajectory = motion.trajectory
    samples = trajectory.at(np.linspace(0.0, trajectory.t_end, 240))
    robot = trajectory.robot
    kinds = kinds_of(trajectory)
    joints: list[dict[str, Any]] = []
    for name, unit, parts in zip(
        robot.joint_names,
        robot.position_units,
        joint_quantities(trajectory, samples, *kinds, degrees=motion.degrees),
        strict=True,
    ):
        entries = []
        for part in parts:
            entry = {"unit": part.unit, "values": encode(part.values[:, 0])}
            if part.is_limited[0]:
                entry["ratios"] = encode(np.abs(part.ratios[:, 0]))
            entries.append(entry)
        joint = {
            "name": name,
            "redundant": name in trajectory.redundant_joints,
            "prismatic": unit == "m",
            "quantities": entries,
        }
        joints.append(joint)
    return {
        "t": encode(samples.t),
        "s": encode(samples.s),
        "speed": encode(samples.tool_speed),
        "bones": encode(skeleton(robot, samples.q).bones),
        "plane": plane_of(trajectory),
        "joints": joints,
        "kinds": kinds,
        "levels": {
            "near": NEAR,
            "at": THRESHOLD,
            "beyond": 1.0 + trajectory.task.refinement.tolerance,
        },
    }
