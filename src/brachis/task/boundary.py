"""How a motion begins and ends, as the task file writes it."""

from __future__ import annotations

from pydantic import Field, model_validator

from brachis.task.fields import Flag, Model, NonNegative, refuse


class BoundarySettings(Model):
    """Speeds at both ends of the path, or a motion that goes round for ever."""

    start_speed: NonNegative = Field(
        default=0.0,
        le=1e6,
        description="Speed along the path at its start, m/s (rad/s where the position stands still; along a path of "
        "joints the norm of their velocities). At an end in motion the redundant joints' velocities are free, and "
        "spline.rest: full says that the speed begins, or ends, constant.",
    )
    end_speed: NonNegative = Field(default=0.0, le=1e6, description="As start_speed, at the path's end.")
    periodic: Flag = Field(
        default=False,
        description="Whether a closed path is gone round for ever: posture, velocity and acceleration at its end are "
        "those at its start (with spline.degree: 2 the acceleration jumps).",
    )

    @model_validator(mode="after")
    def _periodic_has_no_ends(self) -> BoundarySettings:
        if self.periodic and (self.start_speed or self.end_speed):
            key = ".start_speed" if self.start_speed else ".end_speed"
            problem = "a periodic motion has no ends: how fast it passes the seam is planned"
            raise refuse(problem, key=key, found=self.start_speed or self.end_speed, allowed="0, or periodic: false")
        return self

    @property
    def in_motion(self) -> bool:
        """Whether an end is passed in motion."""
        return self.periodic or self.start_speed > 0.0 or self.end_speed > 0.0
