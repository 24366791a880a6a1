"""The report as one self-contained HTML file, which contains all data, pictures and programs."""

from __future__ import annotations

import base64
import gzip
import html
import json
import os
from collections.abc import Iterator
from dataclasses import dataclass
from functools import cache
from pathlib import Path
from typing import Any

from brachis.apps.export.rows import require_library
from brachis.apps.plots import as_html, plot_candidates, plot_fit, plot_overview
from brachis.apps.plots.panels import joint_rows_of
from brachis.apps.report import tables
from brachis.apps.report.figures import motion_figure, scene, timeline_figure
from brachis.apps.report.motion import ReportedMotion, reported_motion
from brachis.common.files import BEGINNINGS, atomic_write, check_suffix
from brachis.search.planned import PlannedMotion
from brachis.trajectory import Trajectory, phase_table


@dataclass(frozen=True, repr=False)
class Report:
    """A report as HTML.

    Attributes
    ----------
    html : str
        Text of the whole page.
    verified : bool
        Whether the motion passed the verification.
    """

    html: str
    verified: bool

    def save(self, path: str | os.PathLike[str]) -> None:
        """Write the page to a file. An older report is replaced; if writing fails, the older report is kept.

        Raises
        ------
        InputError
            The suffix is not html, the file cannot be written, or an existing file is not a report.
        """
        check_report_name(path)
        with atomic_write(path, BEGINNINGS[".html"]) as stream:
            stream.write(self.content)

    @property
    def size(self) -> int:
        """Size of the file, bytes."""
        return len(self.content)

    @property
    def content(self) -> bytes:
        """Content of the file."""
        # File names in the page are not always valid Unicode.
        return self.html.encode(errors="backslashreplace")

    def __repr__(self) -> str:
        """Return a short description without the content."""
        return f"Report({'verified' if self.verified else 'NOT verified'}, {1e-6 * self.size:.1f} MB)"

    def _repr_html_(self) -> str:
        """Show the page in a notebook."""
        frame = 'style="width:100%;height:80vh;border:1px solid #8888" sandbox="allow-scripts"'
        return f'<iframe {frame} srcdoc="{html.escape(self.html)}"></iframe>'


def check_report_name(path: str | os.PathLike[str]) -> None:
    """Raise an error if the suffix of a file is not that of a report.

    Raises
    ------
    InputError
    """
    check_suffix(path, ".html", "A browser can print the HTML file as PDF")


def make_report(
    motion: PlannedMotion | Trajectory, *, title: str = "", degrees: bool = False
) -> Report:
    """Make a page that helps a person to decide whether to run a motion.

    Parameters
    ----------
    motion : Result or Trajectory
        A result of `brachis.plan`, or a trajectory, for example from a file. A trajectory is verified again.
    title : str, optional
        Title of the page. Default: the robot's name, or "motion" if it has none.
    degrees : bool, optional
        Whether the tables and the interactive figures show angles in degrees. The pictures always use rad.

    Returns
    -------
    Report

    Raises
    ------
    NotInstalledError
        Jinja2 or Plotly is not installed.

    Examples
    --------
    >>> import brachis
    >>> from brachis.apps.report import make_report
    >>> page = make_report(brachis.Trajectory.load("out/result.npz"))  # doctest: +SKIP
    >>> page.save("out/report.html")  # doctest: +SKIP
    """
    template = _template()
    plotly = _plotly()
    reported = reported_motion(motion, degrees=degrees)
    sections = {
        "motion": motion_figure(reported),
        "timeline": timeline_figure(reported),
        "scene": scene(reported),
    }
    _, phase_columns, _ = phase_table(reported.trajectory)
    data = json.dumps(sections, allow_nan=False, separators=(",", ":"))
    page = template.render(
        title=title or reported.trajectory.robot.name or "motion",
        motion=reported,
        tables=tables,
        phase_columns=(*phase_columns, "active limits"),
        kinds=joint_rows_of(reported.trajectory),
        pictures=_pictures(reported),
        data=data.replace("<", "\\u003c"),  # so that no text can end the script element
        plotly=plotly,
    )
    return Report(page, reported.verification.passed)


def _pictures(reported: ReportedMotion) -> Iterator[tuple[str, str]]:
    """Yield captions and pictures; the pictures can be printed and need no JavaScript."""
    trajectory = reported.trajectory
    caption = "Overview of the motion. Dashed lines are limits; faint ticks are the knots of the splines."
    yield caption, as_html(plot_overview(trajectory))
    if len(reported.candidates) > 1:
        caption = "End times of all candidates of the search"
        yield caption, as_html(plot_candidates(reported.candidates))
    if any(fit.profile for fit in trajectory.task.fits):
        caption = "Distance of the points from the path that was fitted to them"
        yield caption, as_html(plot_fit(trajectory))


def _template() -> Any:
    """Read the template of the page, including its style and program.

    Inserted text is escaped unless the template marks it as safe.
    """
    jinja2 = require_library("jinja2", "a report", library="Jinja2", extra="report")
    environment = jinja2.Environment(
        autoescape=True,
        trim_blocks=True,
        lstrip_blocks=True,
        undefined=jinja2.StrictUndefined,
        loader=jinja2.FileSystemLoader(Path(__file__).parent),
    )
    return environment.get_template("page.html")


@cache
def _plotly() -> str:
    """Compress Plotly's program from 4.8 MB to 1.5 MB."""
    plotly = require_library(
        "plotly.offline", "a report", library="Plotly", extra="report"
    )
    program = plotly.get_plotlyjs().encode()
    return base64.b64encode(gzip.compress(program, mtime=0)).decode()
