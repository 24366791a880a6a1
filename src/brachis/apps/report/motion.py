"""The content of a report: a motion, its verification, and what slows it down."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import Any

from brachis.apps import bottleneck
from brachis.apps.bottleneck.saturation import (
    LimitRatios,
    Saturation,
    dense_samples,
    limit_ratios,
    limits_in,
)
from brachis.apps.plots.panels import Panel, joint_rows_of, panels_of
from brachis.errors import BrachisError
from brachis.limits import Limit, describe_guarantees, limits_of
from brachis.problem.plausibility import of_robot
from brachis.problem.task_plausibility import of_task
from brachis.robot.plausibility import Issue
from brachis.search.planned import PlannedMotion
from brachis.search.stages import Candidate
from brachis.trajectory import Samples, Trajectory
from brachis.verify import Verification, verify_trajectory


@dataclass(frozen=True, eq=False)
class ReportedMotion:
    """A motion with all the data that its report shows.

    Attributes
    ----------
    trajectory : Trajectory
    samples : Samples
        Dense samples of the motion.
    panels : list of Panel
        Panels of all joint quantities.
    verification : Verification
    ratios : LimitRatios
    saturations : tuple of Saturation
        When each limit is active. Limits that are active longest come first.
    held_back : tuple of str
        Sentences that say what slows the motion down.
    gradients : tuple of (str, str, str)
        Rows of a table of the derivatives of the end time with respect to placements, payload and process speeds.
    remarks : tuple of Issue
        Implausible values found in the robot and the task.
    guarantees : dict of str to str
        Text that says where each limit is met, by the name of the limit.
    degrees : bool
        Whether angles are shown in degrees.
    not_completed : tuple of str
        Steps that the search did not complete.
    candidates : tuple of Candidate
        Candidates of the search; empty for a saved motion.
    planned : dict of str to str
        How the motion was planned, if known.
    """

    trajectory: Trajectory
    samples: Samples
    panels: list[Panel]
    verification: Verification
    ratios: LimitRatios
    saturations: tuple[Saturation, ...]
    held_back: tuple[str, ...]
    gradients: tuple[tuple[str, str, str], ...]
    remarks: tuple[Issue, ...]
    guarantees: dict[str, str]
    degrees: bool
    not_completed: tuple[str, ...] = ()
    candidates: tuple[Candidate, ...] = ()
    planned: dict[str, str] = field(default_factory=dict)


def reported_motion(
    motion: PlannedMotion | Trajectory, *, degrees: bool = False
) -> ReportedMotion:
    """Collect the content of a report. A saved motion is verified again."""
    limits: Sequence[Limit] = ()
    if isinstance(motion, Trajectory):
        trajectory = motion
        known: dict[str, Any] = {
            "verification": verify_trajectory(motion),
            "remarks": of_robot(motion.robot) + of_task(motion.task),
        }
    else:
        trajectory = motion.trajectory
        known = _describe_plan(motion)
        limits = limits_in(motion.candidate.refined.program)
    limits = limits or limits_of(trajectory.robot, trajectory.task)
    ratios = limit_ratios(trajectory, limits)
    unknown = []
    try:
        report = bottleneck.report(motion)
    except BrachisError as error:
        report = bottleneck.report(motion, solve=False)
        unknown = [f"The cost of the limits is unknown: {error}"]
    held_back = (*report.text(degrees=degrees).splitlines(), *unknown)
    costs = report.sensitivities
    gradients = () if costs is None else costs.gradients
    samples = dense_samples(trajectory)
    rows = joint_rows_of(trajectory)
    return ReportedMotion(
        trajectory=trajectory,
        samples=samples,
        panels=panels_of(trajectory, samples, *rows, degrees=degrees),
        ratios=ratios,
        saturations=report.saturations,
        held_back=held_back,
        gradients=tuple(gradient.row for gradient in gradients),
        guarantees=describe_guarantees(limits),
        degrees=degrees,
        **known,
    )


def _describe_plan(result: PlannedMotion) -> dict[str, Any]:
    """Return the entries of the report that are known only for a newly planned motion."""
    report = result.solver_report
    not_completed = result.not_completed
    if result.interrupted:
        early = "the search ended early: a faster motion may have been missed"
        not_completed = (early, *not_completed)
    return {
        "verification": result.verification,
        "remarks": result.warnings,
        "not_completed": not_completed,
        "candidates": result.candidates,
        "planned": {
            "solver": f"{report.solver}, {report.status.value}",
            "collocation points": str(result.candidate.collocation_points),
            "planning time": f"{result.timing['total']:.2f} s",
            "least motion": result.smoothing,
            "timing": str(result.timing_gap or "no timing of this joint path is known"),
        },
    }
