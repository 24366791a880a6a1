"""Profiles of controllers, which are read from YAML files."""

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
"""Maximum size of a profile, bytes."""

AngleUnit = Literal["rad", "deg"]
LengthUnit = Literal["m", "mm"]


class Axis(Model):
    """One axis of the controller, and the joint of the URDF that it moves."""

    joint: Name
    """Joint name in the URDF."""
    name: Name | None = None
    """Axis name. Default: the next one of arm or external."""
    sign: Literal[-1, 1] = 1
    """-1: axis and joint turn in opposite directions."""
    zero: Number = 0.0
    """Position of the joint at which the axis is 0, rad (m)."""
    external: Flag = False
    """Whether the axis is external, such as a rail."""


class AxisGroup(Model):
    """Names and units of the axes of the arm, or of the external axes."""

    names: tuple[Name, ...] = ()
    """Names of the axes, in order. Default: joint names."""
    angle: AngleUnit = "rad"
    """Unit of rotary axes, rad or deg."""
    length: LengthUnit = "m"
    """Unit of linear axes, m or mm."""


class Language(Model):
    """The language in which programs of positions are written for a controller."""

    suffix: Annotated[Name, Field(pattern=r"^\.[a-z0-9]+$")]
    """Suffix of the program file."""
    external_axes: Flag = True
    """Whether positions can include external axes."""
    duration_step: Positive = 1e-6
    """Resolution of durations, s."""
    percent_step: Positive | None = None
    """Resolution of percent, if joint moves have speeds in percent. Null: they have durations."""
    template: Name
    """Jinja template. Variables: name (of the motion), robot, title, date, t_end (s), is_linear, report.positions,
    report.place (m, rad), report.time (s), axes.names, axes.units, axes.external, velocities (maxima of the axes from
    the URDF), steps. Each step has values (in axis units), duration (s), wait (s; 0: a move), speed (m/s), percent (of
    velocities), passes (whether the arm does not stop), zone (m), event."""


class Profile(CheckedModel):
    """Description of a controller: the motions that it accepts, and how it runs them.

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
    """Name of controller and interface."""
    sources: NonEmpty[Name]
    """Sources of the figures."""
    unknown: tuple[Name, ...] = ()
    """Facts that are not publicly documented."""
    period: Annotated[Positive, Field(le=0.1)]
    """Time between samples, s."""
    fixed_period: Flag = True
    """Whether the controller accepts only this period."""
    interpolation: Literal["hold", "linear", "cubic", "quintic"]
    """Motion between samples: hold, linear (straight joint lines), cubic, or quintic (with accelerations)."""
    formats: NonEmpty[Name] = ("csv",)
    """Accepted export formats."""
    columns: NonEmpty[Literal["q", "qd", "qdd", "tau"]] = ("q",)
    """Quantities in tables: q, qd, qdd, tau."""
    arm: AxisGroup = AxisGroup()
    """Names and units of these axes."""
    external: AxisGroup = AxisGroup()
    """Names and units of these axes."""
    axes: tuple[Axis, ...] = ()
    """Axes, in the controller's order. Default: the arm joints, then linear joints before them as external axes."""
    coupled: dict[Name, dict[Name, Number]] = Field(default_factory=dict)
    """Multiples of other axes to add: {J3: {J2: -1}} if J3 is the angle above the horizontal."""
    program: Language | None = None
    """Language of programs of positions."""
    limits: LimitSpec = Field(default_factory=LimitSpec)
    """Limits that the controller checks, as in robot.limits; lists in the order of the arm axes."""
    rest: Literal["velocity", "full"] = "velocity"
    """Derivatives that must be zero at both ends: velocity, or full (also the acceleration)."""
    decimals: Annotated[Count, Field(ge=0, le=12)] | None = None
    """Number of decimals of positions in tables. Null: all digits."""
    path_tolerance: Positive = 1e-4
    """Maximum deviation of the tool from the path, m and rad."""
    events: dict[Name, Name] = Field(default_factory=dict)
    """Instructions at the begin and end of a process speed, and at events of a program: {process_on: ..., arc_on: ...}.
    """

    @property
    def is_sampled(self) -> bool:
        """Whether the motion is known only at the samples, not between them."""
        return self.interpolation in ("hold", "linear")

    @property
    def last(self) -> str:
        """How the time of the last sample is chosen; see `Trajectory.sample`."""
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
            if name.startswith("process_") and name not in EVENTS:
                yield "events", "there is no event with this name", ", ".join(EVENTS)


EVENTS: Final = ("process_on", "process_off")
"""Names of the events at process speeds; a program may have others."""


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
        Name of an included profile, or a YAML file. A file may begin with ``extends: NAME`` and then state only the
        keys that differ from the profile NAME.

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
    """Read the keys of a profile, merged with the keys of the profile that it extends."""
    check_kind(path, "a profile", TaskError)
    text = read_text(path, where=where, folder=Path.cwd(), largest=_LARGEST)
    content = read_yaml(text, str(path))
    if not isinstance(content, dict) or "extends" not in content:
        return content
    name = content["extends"]
    check_names("profile", [str(name)], profile_names(), f"{path}: extends")
    changes = {key: value for key, value in content.items() if key != "extends"}
    return merge(_read(_FOLDER / f"{name}.yaml", where), changes)
