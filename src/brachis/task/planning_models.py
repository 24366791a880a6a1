"""How to plan, as the task file says it: splines, search, solver, refinement."""

from __future__ import annotations

from typing import Annotated, Final, Literal

from pydantic import Field, model_validator

from brachis.task.fields import (
    ByForm,
    Count,
    Flag,
    Model,
    Name,
    NonNegative,
    Positive,
    Share,
    refuse,
)

_VANISHING: Final = {"velocity": 1, "full": 2, "jerk": 3}
Intervals = Annotated[
    Literal["auto"] | Annotated[Count, Field(ge=4, le=10_000)],
    ByForm("auto, or a whole number"),
]


class SplineSettings(Model):
    """The B-splines of the path coordinate and the redundant joints."""

    degree: Count = Field(
        default=3,
        ge=2,
        le=7,
        description="Degree; 3 gives continuous torque, 4 continuous torque rate.",
    )
    intervals: Intervals = Field(
        default="auto",
        description="Number of knot intervals; auto halves those that lose most time until two rounds together gain "
        "less than half the tolerance. A number plans sooner, and gives a slower motion; knots: free needs one.",
    )
    tolerance: Positive = Field(
        default=1.0e-3,
        le=0.1,
        description="With intervals: auto, how near, as a fraction of t_E, the end time is to be to that of many.",
    )
    knots: Literal["uniform", "free"] = Field(
        default="uniform",
        description="Equal intervals, or their lengths as variables of the optimisation.",
    )
    shortest_interval: Positive = Field(
        default=0.1,
        lt=1.0,
        description="With knots: free, the least length of an interval, in mean intervals; never less than 5e-5 t_E.",
    )
    rest: Literal["velocity", "full", "jerk"] = Field(
        default="full",
        description="What vanishes at both ends: velocity alone; velocity and acceleration (full); or velocity, "
        "acceleration and jerk, and with them the rates of the torques (jerk; degree 4 at least).",
    )
    points_per_interval: Count = Field(
        default=3, ge=1, le=100, description="Collocation points per knot interval."
    )

    @property
    def vanishing(self) -> int:
        """How many derivatives of the joint positions vanish at both ends."""
        return _VANISHING[self.rest]

    @model_validator(mode="after")
    def _rest_needs_degree(self) -> SplineSettings:
        order = self.vanishing
        if order > 1 and self.degree <= order:
            last = {2: "acceleration", 3: "jerk"}[order]
            lower = " or ".join(
                f"rest: {word}"
                for word, level in _VANISHING.items()
                if level < min(order, self.degree)
            )
            raise refuse(
                f"rest: {self.rest} asks for a continuous {last} that is zero at the ends: "
                f"degree {self.degree} cannot give it",
                key=".degree",
                found=self.degree,
                allowed=f">= {order + 1}, or {lower}",
            )
        return self

    @model_validator(mode="after")
    def _free_knots_need_a_number(self) -> SplineSettings:
        if self.knots == "free" and self.intervals == "auto":
            raise refuse(
                "knots: free needs a number of intervals; auto is the default",
                key=".intervals",
                found="auto",
                allowed="a number such as 12, or knots: uniform",
            )
        return self


class SearchSettings(Model):
    """The search over redundant joints, branches and initial guesses."""

    effort: Literal["single", "fast", "thorough", "exhaustive"] = Field(
        default="fast",
        description="How far the search goes: single plans once, from the most promising guess, and goes on only if "
        "that fails.",
    )
    guesses: Literal["lattice", "numeric"] = Field(
        default="lattice",
        description="Where initial guesses come from: a lattice of postures, or numeric inverse kinematics "
        "from the start posture.",
    )
    jobs: Count = Field(
        default=1,
        ge=1,
        description="Processes that plan at the same time; no more than there are processors are used.",
    )
    time_limit: Positive = Field(
        default=60.0,
        le=1e6,
        description="Time from the call after which the best motion so far is returned, s; one that is not verified "
        "where none is, a second later perhaps.",
    )
    seed: Count = Field(default=0, ge=0, description="Seed of what is drawn at random.")
    least_motion: Flag = Field(
        default=True,
        description="Whether, of motions that are as fast as the fastest one to 1e-4, the calmest one is taken: that "
        "with the least joint accelerations.",
    )
    slower: Share = Field(
        default=0.0,
        description="How much slower the calmest motion may be, for example 1 %, or 0.01.",
    )

    @model_validator(mode="after")
    def _slower_is_for_least_motion(self) -> SearchSettings:
        if self.slower and not self.least_motion:
            raise refuse(
                "a slower motion is of use for least motion alone",
                key=".slower",
                found=self.slower,
                allowed="0, or least_motion: true",
            )
        return self


class SolverSettings(Model):
    """The solver of the optimisation problem and its bounds."""

    name: Name = Field(
        default="auto", description="Solver; auto takes the best one installed."
    )
    max_iterations: Count = Field(
        default=300, ge=1, le=1_000_000, description="Largest number of iterations."
    )
    time_limit: Positive = Field(
        default=20.0,
        le=1e6,
        description="Largest time of one solve, s; search.time_limit bounds the whole plan.",
    )
    tolerance: Positive = Field(
        default=1.0e-6, description="Tolerance of the optimality conditions."
    )


class RefinementSettings(Model):
    """Adding collocation points until the limits hold in between them as well."""

    tolerance: Positive = Field(
        default=1.0e-4,
        ge=1.0e-5,
        le=0.01,
        description="Largest relative violation of a limit, anywhere; of a position, beyond its range, in rad (m), or "
        "in half ranges where these are shorter. What is less than 1e-5 the checks do not show.",
    )
    density: Count = Field(
        default=10,
        ge=10,
        le=1000,
        description="Grid points for checking limits, per collocation point.",
    )
    max_rounds: Count = Field(
        default=10,
        ge=0,
        le=1000,
        description="Largest number of rounds; 0 switches refinement off.",
    )


def expand_solver_name(solver: object) -> object:
    """Read ``solver: ipopt`` as the solver's name."""
    return {"name": solver} if isinstance(solver, str) else solver


class BoundarySettings(Model):
    """Speeds at both ends of the path, or a motion that goes round for ever."""

    start_speed: NonNegative = Field(
        default=0.0,
        le=1e6,
        description="Speed along the path at its start, m/s (rad/s where the position stands still; along a path of "
        "joints the norm of their velocities). At an end in motion the redundant joints' velocities are free, and "
        "spline.rest: full says that the speed begins, or ends, constant.",
    )
    end_speed: NonNegative = Field(
        default=0.0, le=1e6, description="As start_speed, at the path's end."
    )
    periodic: Flag = Field(
        default=False,
        description="Whether a closed path is gone round for ever: posture, velocity and acceleration at its end are "
        "those at its start (with spline.degree: 2 the acceleration jumps).",
    )

    @model_validator(mode="after")
    def _periodic_has_no_ends(self) -> BoundarySettings:
        if self.periodic and (self.start_speed or self.end_speed):
            key = ".start_speed" if self.start_speed else ".end_speed"
            raise refuse(
                "a periodic motion has no ends: how fast it passes the seam is planned",
                key=key,
                found=self.start_speed or self.end_speed,
                allowed="0, or periodic: false",
            )
        return self

    @property
    def in_motion(self) -> bool:
        """Whether an end is passed in motion."""
        return self.periodic or self.start_speed > 0.0 or self.end_speed > 0.0
