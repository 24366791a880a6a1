"""Limits on the motion of the tool."""

from __future__ import annotations

from pydantic import Field

from brachis.task.fields import Model, Positive


class ToolLimits(Model):
    """Limits on the motion of the tool frame's origin."""

    speed: Positive | None = Field(default=None, ge=1e-6, le=1e12, description="Largest speed, m/s. Null: none.")
