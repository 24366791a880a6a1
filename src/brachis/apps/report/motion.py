"""What a report is made of: a motion, its verification, and what holds it back."""

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
from brachis.problem.plausibility import of_robot, of_task
from brachis.robot.plausibility import Issue
from brachis.search.planned import PlannedMotion
from brachis.search.stages import Candidate
from brachis.trajectory import Samples, Trajectory
from brachis.verify import Verification, verify_trajectory


@dataclass(frozen=True, eq=False)
class ReportedMotion:
    """A motion with everything that a report shows of it.

    Attributes
    ----------
    trajectory : Trajectory
    samples : Samples
        Dense ones.
    panels : list of Panel
        Of all quantities of the joints.
    verification : Verification
    ratios : LimitRatios
    saturations : tuple of Saturation
        Those active longest first.
    held_back : tuple of str
        What holds the motion back, a sentence each.
    remarks : tuple of Issue
        What is implausible in robot and task.
    guarantees : dict of str to str
        Where each limit holds, by its name.
    degrees : bool
        Whether angles are shown in degrees.
    not_completed : tuple of str
        What the search did not complete.
    candidates : tuple of Candidate
        What the search looked at; none for a saved motion.
    planned : dict of str to str
        How the motion was planned, if that is known.
    """

    trajectory: Trajectory
    samples: Samples
    panels: list[Panel]
    verification: Verification
    ratios: LimitRatios
    saturations: tuple[Saturation, ...]
    held_back: tuple[str, ...]
    remarks: tuple[Issue, ...]
    guarantees: dict[str, str]
    degrees: bool
    not_completed: tuple[str, ...] = ()
    candidates: tuple[Candidate, ...] = ()
    planned: dict[str, str] = field(default_factory=dict)


def reported_motion(
    motion: PlannedMotion | Trajectory, *, degrees: bool = False
) -> ReportedMotion:
    """Gather what there is to say of a motion; a saved one is verified again."""
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
        unknown = [f"What the limits cost is not known: {error}"]
    held_back = (*report.text(degrees=degrees).splitlines(), *unknown)
    samples = dense_samples(trajectory)
    rows = joint_rows_of(trajectory)
    return ReportedMotion(
        trajectory=trajectory,
        samples=samples,
        panels=panels_of(trajectory, samples, *rows, degrees=degrees),
        ratios=ratios,
        saturations=report.saturations,
        held_back=held_back,
        guarantees=describe_guarantees(limits),
        degrees=degrees,
        **known,
    )


def _describe_plan(result: PlannedMotion) -> dict[str, Any]:
    """Return what is known of a motion that was planned just now."""
    report = result.solver_report
    least = result.least_motion
    not_completed = result.not_completed
    if result.interrupted:
        early = "the search was ended early: a faster motion may have been missed"
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
            "least motion": "off" if least is None else least.status,
            "timing": str(result.timing_gap or "no timing of this joint path is known"),
        },
    }
