"""Two motions along one path, side by side."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

from brachis.comparison.rows import RatioBounds
from brachis.result import Result
from brachis.summary import Summary
from brachis.trajectory import Trajectory
from brachis.verify import Verification


@dataclass(frozen=True)
class Use:
    """How much of a limit both motions use.

    Attributes
    ----------
    limit : str
        Its kind.
    today : float
        Largest ratio that the rows of today's motion prove; 1 is all of it. See `brachis.comparison.RatioBounds`.
    today_at : str
        What comes nearest to it: a joint, or the tool.
    today_time : float
        When, s.
    today_up_to : float
        Largest ratio of the motion that was made of the rows. What lies between the rows is not known.
    planned : float
        Largest ratio of the plan.
    planned_at : str
    """

    limit: str
    today: float
    today_at: str
    today_time: float
    today_up_to: float
    planned: float
    planned_at: str

    @property
    def today_in_words(self) -> str:
        """Say how much today's motion uses for certain, and how much it may."""
        proven = f"{100.0 * self.today:.1f} %"
        possible = f"{100.0 * self.today_up_to:.1f} %"
        return proven if proven == possible else f"{proven}, between the rows up to {possible}"


@dataclass(frozen=True, repr=False)
class Comparison(Summary):
    """A motion of today and the one planned in its place.

    Attributes
    ----------
    today : Trajectory
        With the path recovered from it.
    verification : Verification
        Of today's motion, as it was made of its rows.
    proven : tuple of RatioBounds
        What its rows alone prove, limit by limit; empty where they are not known.
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
    proven: tuple[RatioBounds, ...]
    result: Result

    @property
    def saved(self) -> float:
        """Part of today's time that the plan saves; negative where it takes longer."""
        return 1.0 - self.result.t_end / self.today.t_end

    @property
    def uses(self) -> tuple[Use, ...]:
        """How much of every limit both motions use."""
        today = {proven.limit: proven.worst for proven in self.proven}
        found = {check.name: check for check in self.verification.checks}
        uses = []
        for check in self.result.verification.checks:
            limit = check.name.removesuffix(" ratio")
            if check.of_limit and limit in today and check.name in found:
                up_to = max(today[limit][0], found[check.name].value)
                uses.append(Use(limit, *today[limit], up_to, check.value, check.subject or ""))
        return tuple(uses)

    @property
    def exceeded(self) -> tuple[Use, ...]:
        """Limits that today's motion exceeds for certain, beyond the task's tolerance."""
        tolerance = self.today.task.refinement.tolerance
        return tuple(use for use in self.uses if use.today > 1.0 + tolerance)

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
            f"today's motion exceeds the {use.limit} limit of {use.today_at} by {100.0 * (use.today - 1.0):.2g} % at "
            f"{use.today_time:.4f} s, as its rows prove; between them it may be by up to "
            f"{100.0 * (use.today_up_to - 1.0):.2g} %"
            for use in self.exceeded
        )
        unknown = "the rows of today's motion are not known: import its CSV file again to compare it with the limits"
        remarks = {jumps: self.today.task.spline.rest != "full", unknown: not self.proven}
        return (*exceeded, *(remark for remark, holds in remarks.items() if holds))

    def summary(self) -> dict[str, object]:
        """Return what is shown."""
        uses = (f"{use.limit} {use.today_in_words} today, {100.0 * use.planned:.1f} % planned" for use in self.uses)
        return {"verdict": self.verdict, "limits used": "; ".join(uses), "remarks": "; ".join(self.remarks) or "none"}

    def __str__(self) -> str:
        """Say all in plain words."""
        lines = [self.verdict, *self.remarks]
        lines += [
            f"{use.limit}: {use.today_in_words} used today ({use.today_at}), "
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
            "today_within_limits": not self.exceeded if self.proven else None,
            "remarks": list(self.remarks),
            "limits": [vars(use) for use in self.uses],
            "recovered": self.today.recovered.to_dict(),
            "verification_today": self.verification.to_dict(),
            "plan": self.result.to_dict(),
        }
