"""Tables of the viewer's panel as HTML. Names are escaped, because they come from files."""

from __future__ import annotations

import html
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from brachis.apps.plots.panels import curves_of, panels_of
from brachis.search.candidate_table import STATUS, TIMES, WORDS, candidate_rows
from brachis.trajectory import Samples, Trajectory, phase_table

_CELL = "padding:0 0.35em;white-space:nowrap"
_WRAPPED = "padding:0 0.35em 0.2em 0;vertical-align:top;overflow-wrap:anywhere"
_STATE = {"position": 3, "velocity": 3, "torque": 2}
"""Joint quantities that are shown, each with its number of decimals."""


def state_table(trajectory: Trajectory, now: Samples, *, degrees: bool = False) -> str:
    """Return a table of the time, the path coordinate, the tool, and the state of every joint at one instant.

    Parameters
    ----------
    trajectory : Trajectory
    now : Samples
        Sample of the trajectory at a single time.
    degrees : bool, optional
        Whether to show angles in degrees.
    """
    place = ", ".join(f"{value:.4f}" for value in now.tool_position[0])
    lines = [
        f"t = {now.t[0]:.4f} s of {trajectory.t_end:.4f} s, s = {now.s[0]:.4f}",
        f"tool at {place} m, {now.tool_speed[0]:.3f} m/s",
    ]
    title, _, phases = phase_table(trajectory)
    if len(phases) > 1:
        ends = [phase.end for phase in trajectory.parts or trajectory.phases]
        number = int(np.searchsorted(ends[:-1], now.t[0], "right"))
        name = phases[number][0].removeprefix(f"{number + 1} ")
        word = title.removesuffix("s")
        place = "" if trajectory.parts else f" {number + 1} of {len(phases)}"
        lines.append(f"{word}{place}: {name}")
    head = _paragraph(*lines)
    panels = panels_of(trajectory, now, *_STATE, degrees=degrees)
    titles = ("joint", "position", "velocity", "torque, force")
    rows = []
    for name in trajectory.joint_names:
        curves = zip(curves_of(panels, name), _STATE.values(), strict=False)
        cells = [
            f"{curve.values[0]:z.{digits}f} {panel.unit}"
            for (panel, curve), digits in curves
        ]
        rows.append([name, *cells])
    return head + _table(titles[: len(rows[0])], rows)


def phases_table(trajectory: Trajectory) -> str:
    """Return a table of the phases or parts of the motion; for a single phase, it is empty."""
    _, columns, rows = phase_table(trajectory)
    return _table(columns, rows) if len(rows) > 1 else ""


def candidates_table(candidates: Sequence[Mapping[str, Any]]) -> str:
    """Return a table of a search's candidates, given as by `Candidate.to_dict`, with the fastest verified one first."""
    if not candidates:
        return _paragraph(
            "The candidates of the search are unknown here; see result.json in the folder of result.npz."
        )
    rows = candidate_rows(candidates)[:60]
    omitted = len(candidates) - len(rows)
    note = _paragraph(f"and {omitted} more, slower candidates") if omitted else ""
    return _table((*WORDS, *TIMES, STATUS), rows, cell=_WRAPPED) + note


def paragraphs(lines: Sequence[str]) -> str:
    """Return each sentence as a paragraph."""
    return "".join(_paragraph(line) for line in lines)


def speed_legend(stops: Sequence[str], fastest: float) -> str:
    """Return a colour bar for the tool's speed from 0 to `fastest`, m/s. `stops` are CSS colours."""
    marks = "".join(
        f"<span>{fraction * fastest:.3g}</span>"
        for fraction in (0.0, 0.25, 0.5, 0.75, 1.0)
    )
    return (
        '<div style="margin:0.3em 0.8em;font-size:0.8em">tool speed (m/s)'
        f'<div style="height:0.8em;border-radius:2px;background:linear-gradient(to right,{",".join(stops)})"></div>'
        f'<div style="display:flex;justify-content:space-between">{marks}</div></div>'
    )


def summary(
    trajectory: Trajectory, notes: Sequence[str], *, verified: bool | None
) -> str:
    """Return the end time, the outcome of the verification if it is known, and notes for the user."""
    verdict = {
        None: "",
        True: ", verified",
        False: ', <b style="color:#D00000">NOT verified</b>',
    }[verified]
    text = f'<div style="margin:0.3em 0.8em;font-size:0.9em"><b>t_E = {trajectory.t_end:.4f} s</b>{verdict}</div>'
    return text + (_paragraph(*notes) if notes else "")


def _paragraph(*lines: str) -> str:
    text = "<br>".join(html.escape(line) for line in lines)
    return f'<div style="margin:0.3em 0.8em;font-size:0.8em">{text}</div>'


def _table(
    columns: Sequence[str], rows: Sequence[Sequence[str]], cell: str = _CELL
) -> str:
    head = "".join(
        f'<th style="{cell};text-align:left">{html.escape(column)}</th>'
        for column in columns
    )
    body = "".join(
        "<tr>"
        + "".join(f'<td style="{cell}">{html.escape(text)}</td>' for text in row)
        + "</tr>"
        for row in rows
    )
    return (
        '<div style="margin:0.3em 0.8em;overflow-x:auto"><table style="font-size:0.78em;border-collapse:collapse">'
        f"<tr>{head}</tr>{body}</table></div>"
    )
