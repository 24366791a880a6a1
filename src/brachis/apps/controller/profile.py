"""Profiles of controllers, from YAML files."""

from __future__ import annotations

import os
from collections.abc import Iterator
from pathlib import Path
from typing import Annotated, Any, Final, Literal

from pydantic import Field

from brachis.common.files import check_kind, is_file, read_text
from brachis.errors import TaskError, check_names
from brachis.task import LimitSpec
from brachis.task.fields import (
    CheckedModel,
    Count,
    Flag,
    Mistake,
    Model,
    Name,
    NonEmpty,
    Number,
    Positive,
    Version,
    merge,
)
from brachis.task.limit_kinds import LimitScale
from brachis.task.limit_models import FROM_URDF
from brachis.task.messages import validate
from brachis.task.yaml_reader import read_yaml

_FOLDER: Final = Path(__file__).with_name("profiles")
_LARGEST = 100_000
"""Bytes of a profile."""

AngleUnit = Literal["rad", "deg"]
LengthUnit = Literal["m", "mm"]


class Axis(Model):
    """One axis of the controller, and the joint of the URDF that it moves."""

    joint: Name
    """Joint of the URDF."""
    name: Name | None = None
    """Name. Default: the next one of arm or external."""
    sign: Literal[-1, 1] = 1
    """-1: the axis turns against the joint."""
    zero: Number = 0.0
    """Position of the joint where the axis is 0, rad (m)."""
    external: Flag = False
    """Whether the axis is external, such as a rail."""


class AxisGroup(Model):
    """Names and units of the arm's axes, or of the external ones."""

    names: tuple[Name, ...] = ()
    """Names, in order. Default: those of the joints."""
    angle: AngleUnit = "rad"
    """Unit of turning axes, rad or deg."""
    length: LengthUnit = "m"
    """Unit of sliding axes, m or mm."""


class Language(Model):
    """The language of a controller's programs of positions."""

    suffix: Annotated[Name, Field(pattern=r"^\.[a-z0-9]+$")]
    """Suffix of its files."""
    external_axes: Flag = True
    """Whether a position may have external axes."""
    template: Name
    """Jinja template with the variables name (of the motion), robot, title, date, t_end (s), is_linear,
    report.positions, report.place (m, rad), report.time (s), axes.names, axes.units, axes.external, velocities (largest
    of the axes, by the URDF) and steps. A step has values (in the axes' units), duration (s), speed (m/s), percent (of
    velocities), zone (m; 0: stop) and event."""


class Profile(CheckedModel):
    """How a controller takes a motion, and what it makes of it.

    Examples
    --------
    >>> import brachis
    >>> profile = brachis.load_profile("kuka_rsi_4ms")
    >>> profile.arm.names[0], profile.arm.angle, profile.external.length
    ('A1', 'deg', 'mm')
    """

    brachis_profile: Version
    """Version of the format."""
    title: Name
    """Name of the controller and its interface."""
    sources: NonEmpty[Name]
    """Sources of the figures."""
    unknown: tuple[Name, ...] = ()
    """What is not documented in public."""
    period: Annotated[Positive, Field(le=0.1)]
    """Time between samples, s."""
    fixed_period: Flag = True
    """Whether the controller accepts only this period."""
    interpolation: Literal["hold", "linear", "cubic", "quintic"]
    """Motion between samples: hold, linear (straight joint lines), cubic, or quintic (with accelerations)."""
    formats: NonEmpty[Name] = ("csv",)
    """Export formats that the controller takes."""
    columns: NonEmpty[Literal["q", "qd", "qdd", "tau"]] = ("q",)
    """Columns of tables: q, qd, qdd, tau."""
    arm: AxisGroup = AxisGroup()
    """Names and units of these axes."""
    external: AxisGroup = AxisGroup()
    """Names and units of these axes."""
    axes: tuple[Axis, ...] = ()
    """Axes, in the controller's order. Default: the arm's joints, then, as external axes, sliding ones before them."""
    coupled: dict[Name, dict[Name, Number]] = Field(default_factory=dict)
    """Multiples of axes that are added to others: {J3: {J2: -1}} if J3 is the angle above the horizontal."""
    program: Language | None = None
    """Language of programs of positions."""
    limits: LimitSpec = Field(default_factory=LimitSpec)
    """Limits that the controller checks, as in robot.limits; lists in the order of the arm's axes."""
    rest: Literal["velocity", "full"] = "velocity"
    """What must be zero at both ends: velocity, or full (the acceleration too)."""
    decimals: Annotated[Count, Field(ge=0, le=12)] | None = None
    """Decimals of positions in tables. Null: all digits."""
    path_tolerance: Positive = 1e-4
    """Largest deviation of the tool from the path, m and rad."""
    events: dict[Name, Name] = Field(default_factory=dict)
    """Instructions where a process speed begins and ends: {process_on: ..., process_off: ...}."""

    @property
    def is_sampled(self) -> bool:
        """Whether only the samples are known, and not what is between them."""
        return self.interpolation in ("hold", "linear")

    @property
    def last(self) -> str:
        """Time of the last sample; see `Trajectory.sample`."""
        return "hold" if self.is_sampled else "exact"

    def _mistakes(self) -> Iterator[Mistake]:
        if self.limits.scale != LimitScale():
            yield (
                "limits.scale",
                "a profile cannot contain factors on limits",
                "robot.limits.scale in the task",
            )
        for kind in ("position", "total_power", "torque_speed"):
            if getattr(self.limits, kind) not in (None, FROM_URDF):
                problem = "a profile cannot contain this limit"
                yield f"limits.{kind}", problem, "robot.limits in the task"
        for name in self.events:
            if name not in EVENTS:
                yield "events", "there is no event of this name", ", ".join(EVENTS)


EVENTS: Final = ("process_on", "process_off")
"""Events of a motion."""


def profile_names() -> list[str]:
    """Return the names of the profiles that come with brachis.

    Examples
    --------
    >>> import brachis
    >>> brachis.profile_names()[:2]
    ['abb_egm_4ms', 'fanuc_stream_8ms']
    """
    return sorted(path.stem for path in _FOLDER.glob("*.yaml"))


def load_profile(source: str | os.PathLike[str] | Profile) -> Profile:
    """Load a profile.

    Parameters
    ----------
    source : str, path or Profile
        Name of an included profile, or a YAML file. A file may begin with ``extends: NAME`` and state only what differs
        from the profile NAME.

    Raises
    ------
    UnknownNameError
        No included profile has this name.
    TaskError
        The file is missing or wrong; the message names its key.

    Examples
    --------
    >>> import brachis
    >>> brachis.load_profile("franka_1khz").limits.jerk[0]
    7500.0
    """
    if isinstance(source, Profile):
        return source
    path = Path(source)
    if not path.suffix and not is_file(path):
        check_names("profile", [str(source)], profile_names(), "profile")
        path = _FOLDER / f"{source}.yaml"
    return validate(Profile, _read(path, "profile"), str(path))


def _read(path: Path, where: str) -> Any:
    """Read the keys of a profile, with those of the profile that it extends."""
    check_kind(path, "a profile", TaskError)
    text = read_text(path, where=where, folder=Path.cwd(), largest=_LARGEST)
    content = read_yaml(text, str(path))
    if not isinstance(content, dict) or "extends" not in content:
        return content
    name = content["extends"]
    check_names("profile", [str(name)], profile_names(), f"{path}: extends")
    changes = {key: value for key, value in content.items() if key != "extends"}
    return merge(_read(_FOLDER / f"{name}.yaml", where), changes)
