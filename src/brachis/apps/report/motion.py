"""What a report is made of: a motion, its verification, and what holds it back."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

from brachis.apps import bottleneck
from brachis.apps.bottleneck import LimitRatios, Saturation, limit_ratios
from brachis.apps.bottleneck.report import write_active
from brachis.apps.bottleneck.saturation import dense_samples, saturations
from brachis.errors import BrachisError
from brachis.limits import Limit, Role, describe_guarantees, limits_of
from brachis.optimise.candidate import Candidate
from brachis.problem.plausibility import of_robot, of_task
from brachis.robot.plausibility import Issue
from brachis.trajectory import Samples, Trajectory
from brachis.verify import Verification, verify_trajectory

if TYPE_CHECKING:
    from brachis.search.planned import PlannedMotion


@dataclass(frozen=True, eq=False)
class ReportedMotion:
    """A motion with everything that a report shows of it.

    Attributes
    ----------
    trajectory : Trajectory
    samples : Samples
        Dense ones.
    verification : Verification
    ratios : LimitRatios
    saturations : tuple of Saturation
        Those active longest first.
    held_back : tuple of str
        What holds the motion back, a sentence each.
    remarks : tuple of Issue
        What is implausible in robot and task.
    not_completed : tuple of str
        What the search did not complete.
    candidates : tuple of Candidate
        What the search looked at; none for a saved motion.
    guarantees : dict of str to str
        Where each limit holds, by its name.
    planned : dict of str to str
        How the motion was planned, if that is known.
    degrees : bool
        Whether angles are shown in degrees.
    """

    trajectory: Trajectory
    samples: Samples
    verification: Verification
    ratios: LimitRatios
    saturations: tuple[Saturation, ...]
    held_back: tuple[str, ...]
    remarks: tuple[Issue, ...]
    not_completed: tuple[str, ...]
    candidates: tuple[Candidate, ...]
    guarantees: dict[str, str]
    planned: dict[str, str]
    degrees: bool


def reported_motion(
    motion: PlannedMotion | Trajectory, *, degrees: bool = False
) -> ReportedMotion:
    """Gather what there is to say of a motion; a saved one is verified again."""
    limits: list[Limit] = []
    not_completed: tuple[str, ...] = ()
    candidates: tuple[Candidate, ...] = ()
    planned = {}
    if isinstance(motion, Trajectory):
        trajectory = motion
        verification = verify_trajectory(motion)
        remarks = of_robot(motion.robot) + of_task(motion.task)
    else:
        trajectory = motion.trajectory
        verification = motion.verification
        remarks = motion.warnings
        candidates = motion.candidates
        planned = _describe_plan(motion)
        refined = motion.candidate.refined
        if refined is not None:
            every = refined.program.limits
            limits = [limit for limit in every if limit.role is not Role.SAFEGUARD]
        not_completed = motion.not_completed
        if motion.interrupted:
            early = "the search was ended early: a faster motion may have been missed"
            not_completed = (early, *not_completed)
    if not limits:
        robot = trajectory.robot
        limits += limits_of(robot, trajectory.task)
    ratios = limit_ratios(trajectory, limits)
    found = saturations(ratios)
    return ReportedMotion(
        trajectory=trajectory,
        samples=dense_samples(trajectory),
        verification=verification,
        ratios=ratios,
        saturations=found,
        held_back=_held_back(motion, found, degrees=degrees),
        remarks=remarks,
        not_completed=not_completed,
        candidates=candidates,
        guarantees=describe_guarantees(limits),
        planned=planned,
        degrees=degrees,
    )


def _held_back(
    source: PlannedMotion | Trajectory, found: tuple[Saturation, ...], *, degrees: bool
) -> tuple[str, ...]:
    """Say what the limits cost; where that cannot be known, when they are active and why no more is known."""
    try:
        return tuple(bottleneck.report(source).text(degrees=degrees).splitlines())
    except BrachisError as error:
        return (*write_active(found), f"What the limits cost is not known: {error}")


def _describe_plan(result: PlannedMotion) -> dict[str, str]:
    """Say how a motion was planned."""
    report = result.solver_report
    least = result.least_motion
    return {
        "solver": f"{report.solver}, {report.status.value}",
        "collocation points": str(result.candidate.collocation_points),
        "planning time": f"{result.timing['total']:.2f} s",
        "least motion": "off" if least is None else least.status,
        "timing": str(result.timing_gap or "no timing of this joint path is known"),
    }
