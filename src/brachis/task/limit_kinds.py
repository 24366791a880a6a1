"""The table of kinds of joint limits, used by task models, robot, limits, verification, messages and plots.

A new kind of joint limit is a row of `LIMIT_KINDS`, its keyword in `LimitKeywords`, a class in `brachis.limits.joint`
and a formula in `brachis.verify.limits.joint`. A new kind of limit on the whole robot is a row of `ROBOT_LIMITS`, its
keyword, a class in `brachis.limits.drives` that `brachis.limits` lists, and a formula.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any, Final, Literal, Protocol, TypedDict

from pydantic import Field, create_model

from brachis.task.fields import AnyPositive, Model


class Array(Protocol):
    """A NumPy array or scalar, described by one method, because this module does not import NumPy."""

    def tolist(self) -> Any:
        """Return the value as plain numbers."""


PerUnit = dict[str, float]
"""A number for revolute joints, ``rad``, and one for prismatic joints, ``m``."""


@dataclass(frozen=True)
class UsualLimit:
    """Usual magnitudes of limits of one kind; a larger limit was probably written in a different unit.

    Attributes
    ----------
    mistaken_unit : dict of str to str
        Unit in which a larger limit was probably written, by position unit of the joint.
    largest : dict of str to float
        Largest usual limit of any robot, by position unit of the joint.
    urdf_kind : str
        Kind of limit in the URDF with which the limit is compared; empty for none.
    urdf_factor : float
        Largest usual ratio to the limit of the URDF.
    urdf_least : float
        Limits below this value are plausible, whatever the URDF states.
    compares_weight : bool
        Whether the limit is compared with the torque needed to hold the arm.
    overridden : bool
        Whether the speed override scales limits of this kind.
    by_curve : bool
        Whether a torque-speed curve replaces limits of this kind.
    """

    mistaken_unit: dict[str, str]
    largest: PerUnit
    urdf_kind: str = ""
    urdf_factor: float = math.inf
    urdf_least: float = 0.0
    compares_weight: bool = False
    overridden: bool = False
    by_curve: bool = False


@dataclass(frozen=True)
class LimitKind:
    """A kind of joint limit.

    Attributes
    ----------
    name : str
        Key below ``robot.limits``.
    units : dict of str to str
        Units of the limit, by position unit of the joint.
    description : str
        Description of the key below ``robot.limits``.
    form : {"number", "pair", "range"}
        Allowed values for a joint. ``number``: a number > 0 for both directions. ``pair``: such a number, or a pair
        [lower, upper] around zero. ``range``: a range.
    scale : str
        Limits to which the factor below ``robot.limits.scale`` applies, in words; empty for no factor.
    urdf : str
        Attribute of ``<limit>`` in a URDF that states the limit; empty for none.
    usual : UsualLimit or None
    needs_masses : bool
        Whether the quantity depends on the masses of the robot.
    """

    name: str
    units: dict[str, str]
    description: str
    form: Literal["number", "pair", "range"] = "number"
    scale: str = ""
    urdf: str = ""
    usual: UsualLimit | None = None
    needs_masses: bool = False

    def in_words(self, position_unit: str) -> str:
        """Return the name of the limited quantity for a joint; the torque of a prismatic joint is called force."""
        words = self.name.replace("_", " ")
        return words if position_unit == "rad" else words.replace("torque", "force")

    @property
    def ends(self) -> tuple[str, ...]:
        """Names of the arrays of this kind in `Limits`: two for lower and upper limits, or one for both."""
        if self.form == "number":
            return (self.name,)
        return (f"{self.name}_lower", f"{self.name}_upper")


@dataclass(frozen=True)
class RobotLimit:
    """A kind of limit on the whole robot, whose masses must be known.

    Attributes
    ----------
    unit : str
    description : str
        Description of the key below ``robot.limits``.
    scale : str
        Key below ``robot.limits.scale`` of the factor that also applies to the limit; empty for none.
    """

    unit: str
    description: str
    scale: str = ""


FASTEST: Final[PerUnit] = {"rad": 60.0, "m": 50.0}
"""Largest usual speeds, rad/s or m/s: axes of small SCARA and delta robots reach 50 rad/s, and rails 10 m/s."""
_ANY = {"rad": math.inf, "m": math.inf}
_TORQUE = {"rad": "Nm", "m": "N"}
_USUAL_TORQUE = UsualLimit(
    {"rad": "mNm", "m": "mN"}, _ANY, "torque", 100.0, compares_weight=True
)

_ROWS = (
    LimitKind(
        "torque",
        _TORQUE,
        "Maximum torque, N m (force, N).",
        form="pair",
        scale="torque and force limits and torque-speed curves",
        urdf="effort",
        usual=replace(_USUAL_TORQUE, by_curve=True),
        needs_masses=True,
    ),
    LimitKind(
        "velocity",
        {"rad": "rad/s", "m": "m/s"},
        "Maximum speed, rad/s (m/s).",
        form="pair",
        scale="velocity limits",
        urdf="velocity",
        usual=UsualLimit(
            {"rad": "degrees per second", "m": "mm per second"},
            FASTEST,
            "velocity",
            10.0,
            10.0,
            overridden=True,
        ),
    ),
    LimitKind(
        "acceleration",
        {"rad": "rad/s^2", "m": "m/s^2"},
        "Maximum acceleration, rad/s^2 (m/s^2).",
        scale="acceleration limits",
        # Wrists of small robots reach 200 rad/s^2, and delta robots 150 m/s^2.
        usual=UsualLimit(
            {"rad": "degrees per second^2", "m": "mm/s^2"}, {"rad": 500.0, "m": 300.0}
        ),
    ),
    LimitKind(
        "position",
        {"rad": "rad", "m": "m"},
        "Range [low, high], rad (m). null means an open end.",
        form="range",
    ),
    LimitKind(
        "power",
        {"rad": "W", "m": "W"},
        "Maximum mechanical power (torque x speed), drawn or returned, W.",
        scale="power limits, also total_power",
        needs_masses=True,
    ),
    LimitKind(
        "rms_torque",
        _TORQUE,
        "Maximum root-mean-square torque over the motion, N m (force, N), to limit motor heating.",
        scale="limits of root-mean-square torques",
        usual=_USUAL_TORQUE,
        needs_masses=True,
    ),
    LimitKind(
        "jerk",
        {"rad": "rad/s^3", "m": "m/s^3"},
        "Maximum jerk, rad/s^3 (m/s^3).",
        scale="jerk limits",
    ),
    LimitKind(
        "torque_rate",
        {"rad": "Nm/s", "m": "N/s"},
        "Maximum rate of change of the torque, N m/s (force, N/s).",
        scale="limits of torque rates",
        needs_masses=True,
    ),
)
LIMIT_KINDS: Final = {row.name: row for row in _ROWS}
"""Kinds of joint limits by key below ``robot.limits``, in the order in which limits are built and checked."""
ROBOT_LIMITS: Final = {
    "total_power": RobotLimit(
        "W",
        "Maximum sum of the powers of all joints, drawn or returned, W.",
        scale="power",
    ),
}
"""Limits on the whole robot, by key below ``robot.limits``."""

# Values that a program may pass; NumPy arrays are accepted as lists and numbers.
_StatedPair = Array | Sequence[float | None] | None
StatedLimit = (
    float
    | Array
    | Sequence[float | _StatedPair]
    | Mapping[str, float | _StatedPair]
    | str
    | None
)
StatedCurves = Mapping[str, Array | Sequence[_StatedPair] | None] | None
StatedRange = Array | Sequence[_StatedPair] | Mapping[str, _StatedPair] | str | None

_FACTORS: dict[str, Any] = {
    row.name: (
        AnyPositive,
        Field(default=1.0, description=f"Factor on all {row.scale}."),
    )
    for row in _ROWS
    if row.scale
}
_Factors: Any = create_model("_Factors", __base__=Model, **_FACTORS)


class LimitScale(_Factors):  # type: ignore[misc]
    """Factors that reduce limits as a safety margin: one for each kind in `LIMIT_KINDS` except the position."""


class LimitKeywords(TypedDict, total=False):
    """Arguments of `LimitSpec`: a keyword for each row of `LIMIT_KINDS` and `ROBOT_LIMITS`, and further keywords."""

    torque: StatedLimit
    velocity: StatedLimit
    acceleration: StatedLimit
    position: StatedRange
    power: StatedLimit
    rms_torque: StatedLimit
    jerk: StatedLimit
    torque_rate: StatedLimit
    total_power: float | None
    scale: Mapping[str, float] | LimitScale | None
    torque_speed: StatedCurves
