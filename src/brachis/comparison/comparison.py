"""Two motions along one path, side by side."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

from brachis.result import Result
from brachis.summary import Summary
from brachis.trajectory import Trajectory
from brachis.verify import Check, Verification


@dataclass(frozen=True)
class Use:
    """How much of a limit both motions use.

    Attributes
    ----------
    limit : str
        Its kind.
    today, planned : float
        Largest ratio to it; 1 is all of it.
    today_at, planned_at : str
        What comes nearest to it: a joint, or the tool.
    """

    limit: str
    today: float
    today_at: str
    planned: float
    planned_at: str


@dataclass(frozen=True, repr=False)
class Comparison(Summary):
    """A motion of today and the one planned in its place.

    Attributes
    ----------
    today : Trajectory
        With the path recovered from it.
    verification : Verification
        Of today's motion.
    result : Result
        Of the plan along the same path, within the same limits.

    Examples
    --------
    >>> import tempfile
    >>> import brachis
    >>> result = brachis.plan(brachis.examples.scara_line, redundant_joints=["j1"], effort="single", intervals=8)
    >>> with tempfile.TemporaryDirectory() as folder:
    ...     brachis.export.write(result.trajectory, f"{folder}/today.csv", dt=0.004)
    ...     found = brachis.compare(f"{folder}/today.csv", task=result.task)
    >>> [use.limit for use in found.uses], isinstance(found, brachis.Comparison)
    (['torque'], True)
    """

    today: Trajectory
    verification: Verification
    result: Result

    @property
    def saved(self) -> float:
        """Part of today's time that the plan saves; negative where it takes longer."""
        return 1.0 - self.result.t_end / self.today.t_end

    @property
    def uses(self) -> tuple[Use, ...]:
        """How much of every limit both motions use."""
        planned = {check.name: check for check in self.result.verification.checks}
        return tuple(
            Use(
                check.name.removesuffix(" ratio"),
                check.value,
                check.subject or "",
                planned[check.name].value,
                planned[check.name].subject or "",
            )
            for check in self.verification.checks
            if check.of_limit and check.name in planned
        )

    @property
    def exceeded(self) -> tuple[Check, ...]:
        """Limits that today's motion exceeds, beyond the task's tolerance."""
        return tuple(check for check in self.verification.checks if check.of_limit and not check.passed)

    @property
    def verdict(self) -> str:
        """Say in one line what is gained."""
        times = f"{self.result.t_end:.4f} s instead of {self.today.t_end:.4f} s"
        if not self.result.verified:
            return f"no verified motion was found along the path of today's ({times})"
        return f"{100.0 * abs(self.saved):.1f} % {'faster' if self.saved >= 0.0 else 'slower'}: {times}"

    @property
    def remarks(self) -> tuple[str, ...]:
        """Say what of today's motion has to be known beside the times."""
        jumps = "today's rows begin or end with an acceleration, so the plan may do so as well (rest: velocity)"
        exceeded = (
            f"today's motion exceeds the {check.name.removesuffix(' ratio')} limit of {check.subject or 'the robot'} "
            f"by {100.0 * (check.value - 1.0):.2g} % at {check.time or 0.0:.4f} s, as far as its rows tell"
            for check in self.exceeded
        )
        return (*exceeded, *([jumps] if self.today.task.spline.rest != "full" else []))

    def summary(self) -> dict[str, object]:
        """Return what is shown."""
        uses = (
            f"{use.limit} {100.0 * use.today:.1f} % today, {100.0 * use.planned:.1f} % planned" for use in self.uses
        )
        return {"verdict": self.verdict, "limits used": "; ".join(uses), "remarks": "; ".join(self.remarks) or "none"}

    def __str__(self) -> str:
        """Say all in plain words."""
        lines = [self.verdict, *self.remarks]
        lines += [
            f"{use.limit}: {100.0 * use.today:.1f} % used today ({use.today_at}), "
            f"{100.0 * use.planned:.1f} % in the plan ({use.planned_at})"
            for use in self.uses
        ]
        assert self.today.recovered is not None  # noqa: S101  (it was imported)
        return "\n".join([*lines, *self.today.recovered.told])

    def to_dict(self) -> dict[str, Any]:
        """Return the figures as plain data for JSON."""
        assert self.today.recovered is not None  # noqa: S101
        return {
            "t_end": self.result.t_end,
            "t_end_today": self.today.t_end,
            "saved": self.saved,
            "verdict": self.verdict,
            "verified": self.result.verified,
            "today_within_limits": not self.exceeded,
            "remarks": list(self.remarks),
            "limits": [vars(use) for use in self.uses],
            "recovered": self.today.recovered.to_dict(),
            "verification_today": self.verification.to_dict(),
            "plan": self.result.to_dict(),
        }
