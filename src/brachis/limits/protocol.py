"""What a limit on the motion is: one object, which everything that plans, refines and reports takes as it is.

A limit has c values at every moment of the motion, held between `lower` and `upper`. Most are ratios to a figure, so
that their bounds are -1 and 1. How far a value v is beyond its bounds is its *violation*, and how near it is its
*ratio*, 1 at the upper bound, -1 at the lower one, with the limit's own `violation_scale` k and `centre` c:

    violation = max(k (v - upper), k (lower - v))
    ratio     = (v - c) / (upper - c)         between c and the upper bound; towards the lower one likewise, down to -1
              = 1 + violation                 beyond the upper bound; beyond the lower one -(1 + violation)
              = max(1 + violation, 0)         where the only bound is the upper one; negative for a lower one
"""

from __future__ import annotations

import copy
from abc import ABC, abstractmethod
from collections.abc import Callable
from dataclasses import dataclass
from enum import Enum
from functools import cached_property, wraps
from typing import Any, Literal, Protocol, Self, TypeVar

import numpy as np

from brachis.common.labels import Label
from brachis.kernel import Chain, Quantity, TorqueDerivatives
from brachis.robot import Robot
from brachis.robot.custom_limits import name_failures
from brachis.robot.dynamics import SharedTorques

_Found = TypeVar("_Found")

_DEVIATION = 3e-5
"""Distance by which splines leave a joint path, about, rad or m."""
_LARGEST_INSET = 0.1
"""Largest violation by which joint paths keep inside a narrow range."""


class Guarantee(Enum):
    """Where a limit is met; each value is the text that a user reads."""

    AT_ALL_INSTANTS = "met at all instants of a verified motion, to 1e-4"
    AT_COLLOCATION_POINTS = (
        "met at the collocation points of the optimiser, but not verified"
    )
    AS_MEAN = "met as a mean over the whole motion"
    """The values have to be squares f^2: the optimiser derives their curvature from that (`brachis.optimise.means`)."""

    @property
    def is_mean(self) -> bool:
        """Whether the means of the values over the motion are held, and not the values at every moment."""
        return self is Guarantee.AS_MEAN


class JointStates(Protocol):
    """Joint motion at K moments; for example states of the optimiser or samples of a trajectory.

    Attributes
    ----------
    q, qdot, qddot, qdddot : (K, n) ndarray
        rad or m, and per second.
    s : (K,) ndarray
        Path coordinate; NaN without a path, or if it is not known.
    """

    @property
    def q(self) -> np.ndarray: ...
    @property
    def qdot(self) -> np.ndarray: ...
    @property
    def qddot(self) -> np.ndarray: ...
    @property
    def qdddot(self) -> np.ndarray: ...
    @property
    def s(self) -> np.ndarray: ...
    def torque(self, robot: Robot) -> np.ndarray:
        """Joint torques, (K, n), computed once."""
        ...

    def torque_derivatives(self, robot: Robot) -> TorqueDerivatives:
        """Differentiate `torque`, once."""
        ...


@dataclass(frozen=True)
class Moments(SharedTorques):
    """Joint motion at K moments, made from arrays; see `JointStates`."""

    q: np.ndarray
    qdot: np.ndarray
    qddot: np.ndarray
    qdddot: np.ndarray
    s: np.ndarray

    @classmethod
    def at_rest(cls, q: np.ndarray) -> Moments:
        """Stand still in postures, (K, n), somewhere on the path."""
        still = np.zeros_like(q)
        return cls(q, still, still, still, np.full(len(q), np.nan))


class Role(Enum):
    """Whose limit it is."""

    ROBOT = "robot"
    """A limit of drives and joints."""
    PROCESS = "process"
    """A limit of what the tool does."""
    SCENE = "scene"
    """A limit of what stands around the robot."""
    SAFEGUARD = "safeguard"
    """Numerical, not physical: small violations are ignored, and the verification does not check it."""


@dataclass(frozen=True)
class Bound:
    """A figure that the user could change, and how it moves the bounds of one value.

    Attributes
    ----------
    column : int
        Of the value, among the limit's c.
    figure : float
        In the unit of the value's label.
    full_scale : float
        What a change by 100 % means: of most limits the figure itself, of a position the width of its range.
    per_unit : float
        How far the bounds of the value move outwards when the figure is relaxed by one unit.
    side : {"lower", "upper"} or None
        Which of the bounds moves; None: both.
    """

    column: int
    figure: float
    full_scale: float
    per_unit: float
    side: str | None = None


@dataclass(frozen=True)
class Partials:
    """Partial derivatives of a limit's c values at K moments, each (K, c, n), or None where they vanish.

    `s`, (K, c), is that by the path coordinate, where a value depends on it besides.
    """

    q: np.ndarray | None = None
    qdot: np.ndarray | None = None
    qddot: np.ndarray | None = None
    qdddot: np.ndarray | None = None
    s: np.ndarray | None = None

    @property
    def by_joints(self) -> tuple[np.ndarray | None, ...]:
        """Partials by q, qdot, qddot and qdddot."""
        return self.q, self.qdot, self.qddot, self.qdddot

    @property
    def size(self) -> int:
        """Number of values, c."""
        arrays = (*self.by_joints, self.s)
        return next(array.shape[1] for array in arrays if array is not None)

    def map(self, change: Callable[[np.ndarray], np.ndarray]) -> Partials:
        """Return the partials by q and its derivatives, changed."""
        changed = (None if array is None else change(array) for array in self.by_joints)
        return Partials(*changed)


class HasLatticeWeights(ABC):
    """A limit by which the lattice measures joint steps between postures."""

    @abstractmethod
    def lattice_weights(
        self, q: np.ndarray
    ) -> tuple[np.ndarray | None, np.ndarray | None]:
        """Rows A and B, (K, c, n), in postures q, (K, n); None where they vanish.

        A qddot is the part of the limit that joint accelerations take, B qdot the part that joint velocities take.
        """


class Description:
    """What is known of a limit besides its values.

    Attributes
    ----------
    kind : str
        Name of the kind; not that of a built-in limit.
    labels : tuple of Label
        Of each of the c values.
    lower, upper : (c,) ndarray
        Bounds of the values; -inf and inf where open. Values should be of the size of 1.
    guarantee : Guarantee
        Where it holds.
    role : Role
        Whose limit it is.
    longer_time : {"relieves", "neither"}
        What a longer end time does: it relieves a velocity, acceleration or torque.
    at_rest : {"nothing", "posture", "turns"}
        What it restricts of an arm at rest: the posture up to turns by 2 pi (torque against gravity), or also the
        turn of an angle (position).
    breaks : (b,) ndarray
        Path coordinates at which it changes abruptly, so that the motion must be checked exactly there.
    order : int
        Highest time derivative of q in the values: 2, or 3 for the jerk. The splines' degree must be at least as high.
    violation_scale : (c,) ndarray or float
        Violation of a value that is beyond its bound by 1 (see the module).
    inset : (c,) ndarray or float
        By how much joint paths keep inside the bounds of a limit on postures, as a violation: splines leave them
        by a little. 0 where that is not known.
    refusal : str
        What a message says of an arm at rest beyond the limit, after "the ... limit".
    """

    kind: str
    labels: tuple[Label, ...]
    lower: np.ndarray
    upper: np.ndarray
    guarantee: Guarantee = Guarantee.AT_ALL_INSTANTS
    role: Role = Role.ROBOT
    longer_time: Literal["relieves", "neither"] = "neither"
    at_rest: Literal["nothing", "posture", "turns"] = "nothing"
    breaks: np.ndarray = np.empty(0)
    order: int = 2
    violation_scale: np.ndarray | float = 1.0
    inset: np.ndarray | float = 0.0
    refusal: str = "is exceeded at rest"

    origin: str = ""
    """Where the user gives it, for messages; brachis sets it for limits that are not its own."""

    @property
    def name(self) -> str:
        """The kind in words."""
        return self.kind.replace("_", " ")

    @property
    def is_checked_at_points(self) -> bool:
        """Whether a violation counts at single points."""
        return self.role is not Role.SAFEGUARD and not self.guarantee.is_mean

    @property
    def is_of_postures(self) -> bool:
        """Whether it is one of postures alone, whatever the timing."""
        has_posture = self.at_rest != "nothing" and self.longer_time == "neither"
        return self.is_checked_at_points and has_posture

    @property
    def centre(self) -> np.ndarray:
        """Value, (c,), that uses nothing of the limit; by default the middle between two finite bounds."""
        with np.errstate(invalid="ignore"):  # -inf + inf
            return 0.5 * self.lower + 0.5 * self.upper

    @cached_property
    def bounds(self) -> tuple[Bound, ...]:
        """The figures that the user could change; by default every finite bound by itself."""
        return tuple(
            Bound(column, level, max(abs(level), 1.0), 1.0, side)
            for side in ("lower", "upper")
            for column, level in enumerate(getattr(self, side).tolist())
            if np.isfinite(level)
        )


def compute_inset(measure: np.ndarray | float) -> np.ndarray | float:
    """Return the inset of positions whose violations are counted in a measure, rad or m."""
    return np.minimum(_DEVIATION / measure, _LARGEST_INSET)


def _name_failures_of(method: Callable[..., _Found]) -> Callable[..., _Found]:
    """Let a method of a limit say which plug-in's it is where it fails."""

    @wraps(method)
    def call(limit: Limit, motion: JointStates) -> _Found:
        """Call the method."""
        if not limit.origin:
            return method(limit, motion)
        with name_failures(limit.origin, method.__name__):
            return method(limit, motion)

    return call


class Limit(Description, ABC):
    """c values of the joint motion at every moment, or their means over time, held between bounds."""

    def __init_subclass__(cls, **keywords: Any) -> None:
        """Let the methods of plug-ins name the plug-in where they fail."""
        super().__init_subclass__(**keywords)
        for name in ("values", "partials"):
            if name in vars(cls):
                setattr(cls, name, _name_failures_of(vars(cls)[name]))

    @abstractmethod
    def values(self, motion: JointStates) -> np.ndarray:
        """Values (K, c)."""

    @abstractmethod
    def partials(self, motion: JointStates) -> Partials:
        """Differentiate `values` with respect to q, qdot, qddot, qdddot and s, each taken as independent."""

    def kernel_quantity(self, chain: Chain) -> Quantity | None:
        """Describe the values as what the kernel computes by itself, of a chain; None where it does not."""
        return None

    def restrict_to(self, q: np.ndarray) -> Limit | None:
        """Return what matters of it while the motion stays close to postures, (K, n); None where nothing does."""
        return self

    def holds_at_rest(self, q: np.ndarray, slack: float) -> np.ndarray:
        """Tell in which postures, (K, n), it holds within a violation of `slack` while the arm rests, (K,)."""
        values = self.values(Moments.at_rest(q))
        return np.all(self.violation(values) <= slack, axis=1)

    def holds_between(
        self, first: np.ndarray, last: np.ndarray, slack: float
    ) -> np.ndarray:
        """Tell on which straight steps from postures to others, (E, n), it holds as at both ends, (E,)."""
        return np.ones(len(first), dtype=bool)

    def relax(self, bound: Bound, amount: float) -> Self:
        """Return the limit with one figure relaxed by `amount`, in its unit."""
        relaxed = copy.copy(self)
        step = np.zeros(len(self.lower))
        step[bound.column] = bound.per_unit * amount
        if bound.side != "upper":
            relaxed.lower = self.lower - step
        if bound.side != "lower":
            relaxed.upper = self.upper + step
        return relaxed

    def keep_inside(self, ends: np.ndarray) -> Self:
        """Return the limit with bounds that are narrower by its inset, as far as postures, (K, n), leave room."""
        ends = ends[np.isfinite(ends).all(axis=1)]
        beyond = self.violation(self.values(Moments.at_rest(ends)))
        room = -beyond.max(axis=0, initial=-np.inf)
        by = np.clip(room, 0.0, self.inset) / self.violation_scale
        narrowed = copy.copy(self)
        narrowed.lower = self.lower + by
        narrowed.upper = self.upper - by
        return narrowed

    def violation(self, values: np.ndarray) -> np.ndarray:
        """How far values, (K, c), are beyond their bounds; negative inside. See the module."""
        beyond = np.maximum(values - self.upper, self.lower - values)
        return beyond * self.violation_scale

    def ratio(self, values: np.ndarray) -> np.ndarray:
        """How near values, (K, c), are to their bounds; see the module."""
        above = (values - self.upper) * self.violation_scale
        below = (self.lower - values) * self.violation_scale
        outside = np.where(
            above >= below, np.maximum(1.0 + above, 0.0), -np.maximum(1.0 + below, 0.0)
        )
        with np.errstate(invalid="ignore"):  # inf - inf
            away = values - self.centre
            reach = np.where(
                away > 0.0, self.upper - self.centre, self.centre - self.lower
            )
        inside = np.isfinite(reach) & (above <= 0.0) & (below <= 0.0)
        return np.divide(away, reach, out=outside, where=inside)

    def ratios(self, motion: JointStates, t: np.ndarray) -> np.ndarray:
        """How near a whole motion is to the bounds at times t, (K,), dense and ascending, s: (K, c).

        A mean over the whole motion is equally near at all times.
        """
        values = self.values(motion)
        if self.guarantee.is_mean:
            mean = np.trapezoid(values, t, axis=0) / (t[-1] - t[0])
            values = np.broadcast_to(mean, values.shape)
        return self.ratio(values)
