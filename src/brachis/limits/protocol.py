"""The interface of a limit on the motion: one object, which the search, the optimiser and the reports use unchanged.

A limit has c values at every moment of the motion, which must stay between `lower` and `upper`. Most values are ratios
to a figure, with the bounds -1 and 1. The *violation* of a value v says how far the value is outside its bounds. The
*ratio* of the value says how much of the limit is used: 1 at the upper bound, -1 at the lower bound. With the
`violation_scale` k and the `centre` c,

    violation = max(k (v - upper), k (lower - v))
    ratio     = (v - c) / (upper - c)         between c and the upper bound; towards the lower bound likewise, to -1
              = 1 + violation                 above the upper bound; below the lower bound -(1 + violation)
              = max(1 + violation, 0)         if the upper bound is the only one; its negative for a lower bound
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
"""Approximate distance by which splines deviate from a joint path, rad or m."""
_LARGEST_INSET = 0.1
"""Maximum inset of joint paths in a narrow range, as a violation."""


class Guarantee(Enum):
    """Where a limit is met; each value is the text that a user reads."""

    AT_ALL_INSTANTS = "met at all instants of a verified motion, to 1e-4"
    AT_COLLOCATION_POINTS = (
        "met at the collocation points of the optimiser, but not verified"
    )
    AS_MEAN = "met as a mean over the whole motion"
    """The values have to be squares f^2: the optimiser derives their curvature from this form
    (`brachis.optimise.means`)."""

    @property
    def is_mean(self) -> bool:
        """Whether the limit applies to the means of the values over the motion, not to the values at every moment."""
        return self is Guarantee.AS_MEAN


class JointStates(Protocol):
    """Joint motion at K moments, such as states of the optimiser or samples of a trajectory.

    Attributes
    ----------
    q, qdot, qddot, qdddot : (K, n) ndarray
        Positions, rad or m, and their derivatives with respect to time in seconds.
    s : (K,) ndarray
        Path coordinate; NaN if there is no path, or if the coordinate is unknown.
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
        """Return the joint torques, (K, n), which are computed only once."""
        ...

    def torque_derivatives(self, robot: Robot) -> TorqueDerivatives:
        """Return the derivatives of `torque`, which are computed only once."""
        ...


@dataclass(frozen=True)
class Moments(SharedTorques):
    """Joint motion at K moments, given by arrays; see `JointStates`."""

    q: np.ndarray
    qdot: np.ndarray
    qddot: np.ndarray
    qdddot: np.ndarray
    s: np.ndarray

    @classmethod
    def at_rest(cls, q: np.ndarray) -> Moments:
        """Return the motion of an arm that rests in postures, (K, n), somewhere on the path."""
        still = np.zeros_like(q)
        return cls(q, still, still, still, np.full(len(q), np.nan))


class Role(Enum):
    """What a limit belongs to: the robot, the process, the surroundings, or the numerical method."""

    ROBOT = "robot"
    """A limit of the drives and joints."""
    PROCESS = "process"
    """A limit of the process, which restricts the tool."""
    SCENE = "scene"
    """A limit due to the objects around the robot."""
    SAFEGUARD = "safeguard"
    """A numerical limit, not a physical one. Small violations are ignored, and the verification does not check it."""


@dataclass(frozen=True)
class Bound:
    """A figure that the user could change, and its effect on the bounds of one value.

    Attributes
    ----------
    column : int
        Index of the value among the limit's c values.
    figure : float
        The figure, in the unit of the value's label.
    full_scale : float
        The change of the figure that counts as 100 %: for most limits the figure itself, for a position the width of
        its range.
    per_unit : float
        Distance by which the bounds of the value move outwards when the figure is relaxed by one unit: 1 / figure for
        a ratio.
    side : {"lower", "upper"} or None
        The bound that the figure moves; None if it moves both. An infinite bound stays infinite, so None also serves
        for a ratio that has an upper bound only.
    """

    column: int
    figure: float
    full_scale: float
    per_unit: float
    side: str | None = None


@dataclass(frozen=True)
class Partials:
    """Partial derivatives of a limit's c values at K moments, (K, c, n) each; None means zeros.

    `s`, (K, c), is the derivative with respect to the path coordinate, if a value depends on it directly.
    """

    q: np.ndarray | None = None
    qdot: np.ndarray | None = None
    qddot: np.ndarray | None = None
    qdddot: np.ndarray | None = None
    s: np.ndarray | None = None

    @property
    def by_joints(self) -> tuple[np.ndarray | None, ...]:
        """The derivatives with respect to q, qdot, qddot and qdddot."""
        return self.q, self.qdot, self.qddot, self.qdddot

    @property
    def size(self) -> int:
        """Number of values, c."""
        return next(
            array.shape[1] for array in vars(self).values() if array is not None
        )

    def map(self, change: Callable[[np.ndarray], np.ndarray]) -> Partials:
        """Apply a function to the derivatives with respect to q, qdot, qddot and qdddot."""
        changed = (None if array is None else change(array) for array in self.by_joints)
        return Partials(*changed)


class HasLatticeWeights(ABC):
    """Additional base class of limits by which the lattice measures joint steps between postures.

    It is for limits that are linear in the joint accelerations or in the joint velocities while the arm is at rest,
    such as torques. Other limits have no effect on the length of a step.
    """

    @abstractmethod
    def lattice_weights(
        self, q: np.ndarray
    ) -> tuple[np.ndarray | None, np.ndarray | None]:
        """Return the rows A and B, (K, c, n), in postures q, (K, n); None for zeros.

        A qddot is the fraction of the limit that joint accelerations use; B qdot is the fraction that joint velocities
        use.
        """


class Description:
    """The properties of a limit apart from its values.

    Attributes
    ----------
    kind : str
        Name of the kind of limit. The names of the built-in kinds are reserved.
    labels : tuple of Label
        A label for each of the c values.
    lower, upper : (c,) ndarray
        Bounds of the values; -inf and inf where there is no bound. The values should be of the order of 1.
    guarantee : Guarantee
        Where the limit is guaranteed to be met.
    role : Role
        What the limit belongs to; see `Role`.
    longer_time : {"relieves", "neither"}
        Effect of a longer end time on the values. It relieves everything that grows with speed, such as a velocity,
        an acceleration or an energy.
    at_rest : {"nothing", "posture", "turns"}
        What the limit restricts while the arm rests. "posture": only the posture, so that an angle and the same angle
        plus 2 pi count alike; an example is the torque that holds the arm against gravity. "turns": also the number of
        turns; an example is a range of joint positions.
    is_of_tool_speed : bool
        Whether the values are ratios of the tool's speed to its maximum.
    breaks : (b,) ndarray
        Path coordinates at which the limit changes abruptly, so that the motion must be checked exactly there.
    order : int
        Order of the highest time derivative of q in the values: 2, or 3 for the jerk. The degree of the splines must be
        at least as high.
    violation_scale : (c,) ndarray or float
        Violation of a value divided by its distance from the bound that it exceeds: 1 for ratios.
    inset : (c,) ndarray or float
        Distance, as a violation, that joint paths keep from the bounds of a limit on postures, because splines deviate
        slightly from joint paths. 0 if the deviation is not known.
    refusal : str
        Words that follow "the ... limit" in a message about an arm that violates the limit at rest.
    """

    kind: str
    labels: tuple[Label, ...]
    lower: np.ndarray
    upper: np.ndarray
    guarantee: Guarantee = Guarantee.AT_ALL_INSTANTS
    role: Role = Role.ROBOT
    longer_time: Literal["relieves", "neither"] = "neither"
    at_rest: Literal["nothing", "posture", "turns"] = "nothing"
    is_of_tool_speed: bool = False
    breaks: np.ndarray = np.empty(0)
    order: int = 2
    violation_scale: np.ndarray | float = 1.0
    inset: np.ndarray | float = 0.0
    refusal: str = "is exceeded at rest"

    origin: str = ""
    """Place where the user gives the limit, for messages. brachis sets it, and only for limits that are not built
    in."""

    @property
    def name(self) -> str:
        """The kind of limit, in words."""
        return self.kind.replace("_", " ")

    @property
    def is_checked_at_points(self) -> bool:
        """Whether a violation at a single point of the motion counts."""
        return self.role is not Role.SAFEGUARD and not self.guarantee.is_mean

    @property
    def is_of_postures(self) -> bool:
        """Whether the limit depends on the posture alone, whatever the timing."""
        has_posture = self.at_rest != "nothing" and self.longer_time == "neither"
        return self.is_checked_at_points and has_posture

    @property
    def centre(self) -> np.ndarray:
        """Values, (c,), at which the ratios are 0; by default the middle between two finite bounds."""
        with np.errstate(invalid="ignore"):  # -inf + inf
            return 0.5 * self.lower + 0.5 * self.upper

    @cached_property
    def bounds(self) -> tuple[Bound, ...]:
        """The figures that the user could change; by default each finite bound is a figure."""
        return tuple(
            Bound(column, level, max(abs(level), 1.0), 1.0, side)
            for side in ("lower", "upper")
            for column, level in enumerate(getattr(self, side).tolist())
            if np.isfinite(level)
        )


def compute_inset(measure: np.ndarray | float) -> np.ndarray | float:
    """Return the inset of positions whose violations are counted in units of `measure`, rad or m."""
    return np.minimum(_DEVIATION / measure, _LARGEST_INSET)


def _name_failures_of(method: Callable[..., _Found]) -> Callable[..., _Found]:
    """Wrap a method of a plug-in's limit so that an error in the method names the plug-in."""

    @wraps(method)
    def call(limit: Limit, motion: JointStates) -> _Found:
        """Call the method."""
        if not limit.origin:
            return method(limit, motion)
        with name_failures(limit.origin, method.__name__):
            return method(limit, motion)

    return call


class Limit(Description, ABC):
    """Bounds on c values of the joint motion at every moment, or on the means of these values over time.

    Attributes
    ----------
    robot : Robot
        The robot of the limit, which `bind` sets.
    """

    robot: Robot

    def __init_subclass__(cls, **keywords: Any) -> None:
        """Wrap the methods of a plug-in's limit so that errors in them name the plug-in."""
        super().__init_subclass__(**keywords)
        for name in ("values", "partials"):
            if name in vars(cls):
                setattr(cls, name, _name_failures_of(vars(cls)[name]))

    def bind(self, robot: Robot) -> Self:
        """Return the limit for a robot: a copy with the attribute `robot`.

        Override this method to check the robot, or to compute values that depend on the robot in advance.
        """
        bound = copy.copy(self)
        object.__setattr__(bound, "robot", robot)  # it may be frozen
        return bound

    @abstractmethod
    def values(self, motion: JointStates) -> np.ndarray:
        """Compute the values.

        Parameters
        ----------
        motion : JointStates
            Motion at K moments, in rad or m, and seconds.

        Returns
        -------
        (K, c) ndarray
            The values, in the unit of `lower` and `upper`, of the order of 1.

        Examples
        --------
        The speed of the first joint as a ratio to 2 rad/s:

        >>> def values(self, motion):
        ...     return motion.qdot[:, :1] / 2.0
        """

    @abstractmethod
    def partials(self, motion: JointStates) -> Partials:
        """Differentiate `values` with respect to q, qdot, qddot, qdddot and s, as if these were independent.

        Parameters
        ----------
        motion : JointStates
            Motion at K moments, in rad or m, and seconds.

        Returns
        -------
        Partials
            Derivatives with respect to q, qdot, qddot and qdddot, (K, c, n) each, per rad or m, rad/s or m/s, and so
            on; and with respect to s, (K, c). None stands for zeros.

        Examples
        --------
        The partial derivatives for the example of `values`:

        >>> def partials(self, motion):
        ...     first = np.eye(self.robot.n)[None, :1] / 2.0
        ...     return Partials(qdot=np.repeat(first, len(motion.q), axis=0))
        """

    def kernel_quantity(self, chain: Chain) -> Quantity | None:
        """Describe the values as a quantity that the kernel computes for a chain; None if it does not compute them."""
        return None

    def restrict_to(self, q: np.ndarray) -> Limit | None:
        """Return the part of the limit that matters close to postures, (K, n); None if no part does."""
        return self

    def select_from(self, limit: Limit) -> Limit:
        """Return the values of this limit from the same limit of a changed robot or task."""
        return limit

    def holds_at_rest(self, q: np.ndarray, slack: float) -> np.ndarray:
        """Tell in which postures, (K, n), the resting arm violates the limit by at most `slack`, (K,) bool."""
        values = self.values(Moments.at_rest(q))
        return np.all(self.violation(values) <= slack, axis=1)

    def holds_between(
        self, first: np.ndarray, last: np.ndarray, slack: float
    ) -> np.ndarray:
        """Tell for each straight step between two postures, (E, n), if the limit is met as at its ends, (E,) bool."""
        return np.ones(len(first), dtype=bool)

    def relax(self, bound: Bound, amount: float) -> Self:
        """Return the limit with one figure relaxed by `amount`, in the unit of the figure."""
        relaxed = copy.copy(self)
        step = np.zeros(len(self.lower))
        step[bound.column] = bound.per_unit * amount
        if bound.side != "upper":
            relaxed.lower = self.lower - step
        if bound.side != "lower":
            relaxed.upper = self.upper + step
        return relaxed

    def keep_inside(self, ends: np.ndarray) -> Self:
        """Return the limit with bounds that are narrower by the inset, as far as the postures `ends`, (K, n), allow."""
        ends = ends[np.isfinite(ends).all(axis=1)]
        beyond = self.violation(self.values(Moments.at_rest(ends)))
        room = -beyond.max(axis=0, initial=-np.inf)
        by = np.clip(room, 0.0, self.inset) / self.violation_scale
        narrowed = copy.copy(self)
        narrowed.lower = self.lower + by
        narrowed.upper = self.upper - by
        return narrowed

    def violation(self, values: np.ndarray) -> np.ndarray:
        """Compute the violations, (K, c), of values, (K, c); negative inside the bounds. See the module."""
        beyond = np.maximum(values - self.upper, self.lower - values)
        return beyond * self.violation_scale

    def ratio(self, values: np.ndarray) -> np.ndarray:
        """Compute the ratios, (K, c), of values, (K, c), to their bounds; see the module."""
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
        """Compute the ratios of a whole motion to the bounds, (K, c), at dense, ascending times t, (K,), s.

        If the limit applies to a mean over the motion, the ratio is the same at all times.
        """
        values = self.values(motion)
        if self.guarantee.is_mean:
            mean = np.trapezoid(values, t, axis=0) / (t[-1] - t[0])
            values = np.broadcast_to(mean, values.shape)
        return self.ratio(values)
