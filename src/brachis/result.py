"""The result of a plan, with methods to plot, report, explain and view its motion."""

from __future__ import annotations

import os
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

from brachis.errors import NotInstalledError, check_names
from brachis.search.planned import PlannedMotion

if TYPE_CHECKING:
    from matplotlib.figure import Figure

    from brachis.apps.bottleneck import BottleneckReport
    from brachis.apps.controller import Profile, RunReport
    from brachis.apps.export.programs import ProgramReport
    from brachis.apps.report import Report
    from brachis.apps.view import Viewer

CANDIDATES = "candidates"


@dataclass(frozen=True, repr=False)
class Result(PlannedMotion):
    """The result of a plan: the trajectory, its verification, and how they were found.

    Attributes
    ----------
    task : Task
        The complete task, with robot settings and all defaults; ``plan(result.task)`` repeats the plan.
    trajectory : Trajectory
    verification : Verification
    family : str
        Family of the closed form; ``chart`` if no closed form was used.
    candidate : FinishedCandidate
        The fastest candidate, with its solved program and its motion.
    least_motion : LeastMotion or None
        How the smoothest motion of equal speed was found; None if the task did not request it.
    timing : dict of str to float
        Wall time of every stage, s.
    candidates : tuple of Candidate
        All candidates of the search, without their programs. The fastest verified candidate comes first.
    interrupted : bool
        Whether Ctrl-C or ``search.time_limit`` ended the search; a faster motion may then have been missed.
    not_completed : tuple of str
        Steps that were not completed, in plain words.
    warnings : tuple of Issue
        Implausible figures of the robot, the task and the motion, and a timing that is much slower than possible.
    timing_gap : TimingGap or None
        How much faster a different timing of the same joint path could be. None if the phase plane gives no faster
        timing, or if no time was left to compute one.

    Examples
    --------
    >>> import brachis
    >>> result = brachis.plan(brachis.examples.scara_line, redundant_joints=["j1"], effort="single", intervals=8)
    >>> result.verified, result.sample(dt=0.004).q.shape
    (True, (638, 3))
    >>> figure = result.plot("torques")
    >>> print(type(result.bottleneck()).__name__)
    BottleneckReport
    """

    def plot(self, kind: str = "overview") -> Figure:
        """Plot the motion.

        Parameters
        ----------
        kind : str, optional
            A name from `brachis.plots.PLOTS`, or ``candidates`` for all candidates of the search.

        Returns
        -------
        Figure
            A Matplotlib figure. A notebook shows it, and `brachis.plots.save_figure` writes it to a file.

        Raises
        ------
        UnknownNameError
            The plot does not exist.
        """
        from brachis.apps import plots

        if kind == CANDIDATES:
            return plots.plot_candidates(self.candidates)
        check_names("plot", [kind], (*plots.PLOTS, CANDIDATES), "kind")
        return plots.PLOTS[kind](self.trajectory)

    def report(
        self, path: str | os.PathLike[str] | None = None, *, degrees: bool = False
    ) -> Report:
        """Make a page for deciding whether to run the motion, as `brachis.report.make_report` does.

        Parameters
        ----------
        path : path, optional
            HTML file to write.
        degrees : bool, optional
            Whether angles are shown in degrees.

        Raises
        ------
        InputError
            The file cannot be written, or Jinja2 or Plotly is not installed (`NotInstalledError`).
        """
        from brachis.apps import report

        page = report.make_report(self, degrees=degrees)
        if path is not None:
            page.save(path)
        return page

    def export(
        self,
        path: str | os.PathLike[str],
        *,
        profile: Profile | str | None = None,
        **options: Any,
    ) -> RunReport | ProgramReport | None:
        """Write the motion to a file for another program or for a controller.

        Parameters
        ----------
        path : path
            File to write; its suffix sets the format.
        profile : Profile, str or path, optional
            Profile of the controller that will run the file; see `brachis.load_profile`.
        **options
            Options of `brachis.export.write` or, with a profile, of `brachis.export.write_for_controller`.

        Returns
        -------
        RunReport, ProgramReport or None
            With a profile, the verification of the run, or the deviation of a program from the motion.

        Raises
        ------
        InputError
            As for these functions.
        """
        from brachis.apps import export

        motion = self.trajectory
        if profile is not None:
            return export.write_for_controller(motion, path, profile, **options)
        export.write(motion, path, **options)
        return None

    def bottleneck(
        self, *, check: bool = False, reference: bool = False
    ) -> BottleneckReport:
        """Return a report on the limits that cost time, as `brachis.bottleneck.report` does."""
        from brachis.apps import bottleneck

        return bottleneck.report(self, check=check, reference=reference)

    def view(
        self,
        *,
        degrees: bool = False,
        host: str = "127.0.0.1",
        port: int | None = None,
        block: bool | None = None,
    ) -> Viewer:
        """Show the motion and the list of candidates in the browser, as `brachis.view` does."""
        from brachis.apps.view import view

        candidates = [candidate.to_dict() for candidate in self.candidates]
        return view(
            self.explained_trajectory,
            candidates,
            verified=self.verified,
            degrees=degrees,
            host=host,
            port=port,
            block=block,
        )

    def _repr_html_(self) -> str:
        """Show the summary in a notebook, and the overview if Matplotlib is installed."""
        from brachis.apps import plots

        try:
            picture = plots.as_html(self.plot())
        except NotInstalledError:
            return super()._repr_html_()
        return f'<div style="display:flex;align-items:flex-start">{super()._repr_html_()}{picture}</div>'
