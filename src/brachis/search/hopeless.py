"""Refuse loads and speeds that are out of reach for every motion along the known joint paths.

Speeds are given for parts of the path and for its ends. Without friction, if the limits allow a motion and the arm can
hold its postures, the limits also allow the same motion at a lower speed: its (u, x) lies between that of the motion
and rest (see `brachis.search.phase_plane`). So a speed can be too high for two reasons. Either it is too high by
itself, along its part of the path or at its end, or an adjacent leg is too short to reach this speed or to brake from
it. A redundant robot may have better joint paths than the known ones, so only what is far from possible is refused
before a plan is tried.

The phase plane accounts neither for limits on the jerk nor for friction. Friction helps to brake, so that with friction
a part close to the path's end may be travelled faster.
"""

from __future__ import annotations

import itertools
import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import cache, cached_property

import numpy as np

from brachis.common import tolerances
from brachis.errors import PlanningError, Remedy
from brachis.optimise.motion import follow_law
from brachis.path.legs import key_of_speed
from brachis.path.sequence import tool_distance
from brachis.problem.problem import Problem
from brachis.search.holding import explain_holding
from brachis.search.phase_plane import phase_plane_on, postures_along
from brachis.search.stages import InitialGuess
from brachis.search.stations import spread_stations
from brachis.timing import Timing

_EXACT = 0.97
"""If the phase plane is exact and allows only a smaller fraction of a speed than this, the speed is impossible."""
_UNLIKELY = 0.4
"""The same fraction for a redundant robot: below it, no other joint path makes up the difference."""
_REACHED = 0.92
"""Fraction of the highest speed in the phase plane that is advised; splines over the first mesh do not reach that
speed."""
_LEAST = 1e-4
"""Fraction of a speed that is possible wherever the arm can hold its postures."""


def refuse_hopeless(guesses: Sequence[InitialGuess]) -> None:
    """Refuse loads and speeds far out of reach along the joint paths of all guesses, before any plan is tried.

    Raises
    ------
    PlanningError
    """
    problem = guesses[0].problem
    # Friction may help to hold the arm, and a motion between different speeds may be a fall, so such plans are tried.
    if not _has_friction(problem).any() and not any(problem.end_rates):
        failure = explain_holding(guesses, everywhere=True)
        if failure is not None:
            raise failure
    failure = explain_speeds(guesses)
    if failure is not None:
        raise failure


def _has_friction(problem: Problem) -> np.ndarray:
    """Tell which joints have friction, (n,) bool."""
    friction = problem.robot.friction
    return friction.viscous + friction.coulomb > 0.0


@dataclass(frozen=True)
class _Speed:
    """A speed that the task gives.

    Attributes
    ----------
    key, name : str
        Key of the speed in the task, and its name in words.
    figure : float
        Value, in `unit`.
    unit : str
    leg : int
        Number of the leg that has the speed, or at whose end the speed is given.
    side : int or None
        End of the leg at which the speed is given, 0 or -1; None if it is given all along the leg.
    """

    key: str
    name: str
    figure: float
    unit: str
    leg: int
    side: int | None = None

    def __str__(self) -> str:
        """Return the speed with its unit."""
        return f"{self.figure:g} {self.unit}"

    def lower_to(self, figure: float, *, is_known: bool = False) -> Remedy:
        """Return the remedy that lowers this speed."""
        return Remedy(self.key, self.figure, figure, self.unit, is_known)


def speeds_of(problem: Problem) -> list[_Speed]:
    """List the process speeds of a task, and the speeds at its ends unless these are at a process speed."""
    speeds = []
    speed_legs = [i for i, leg in enumerate(problem.legs) if leg.speed is not None]
    process_speeds = problem.task.tool_limits.process_speed
    for number, (process_speed, leg) in enumerate(
        zip(process_speeds, speed_legs, strict=True)
    ):
        key = key_of_speed(process_speed, number, ".speed")
        speeds.append(_Speed(key, "process speed", process_speed.speed, "m/s", leg))
    last = len(problem.legs) - 1
    unit = problem.task.speed_unit
    ends = (("start", 0, 0), ("end", last, -1))
    for (name, leg, side), figure in zip(
        ends, problem.task.boundary.given_speeds, strict=True
    ):
        key = f"boundary.{name}_speed"
        if figure and leg not in speed_legs:
            speeds.append(_Speed(key, f"{name} speed", figure, unit, leg, side))
    return speeds


class _SpeedCheck:
    """Check of which fractions of a task's speeds a joint path allows.

    Parameters
    ----------
    guess : InitialGuess
    speeds : sequence of _Speed
        At least one.
    s : (S,) ndarray
        Path coordinates, including the ends of the legs.
    q : (S, n) ndarray
        Postures at these coordinates.
    """

    def __init__(
        self,
        guess: InitialGuess,
        speeds: Sequence[_Speed],
        s: np.ndarray,
        q: np.ndarray,
    ) -> None:
        self.problem = guess.problem
        self.speeds = speeds
        self.is_redundant = guess.joint_map.r > 0
        self.planes = [
            phase_plane_on(self.problem, leg, s, q) for leg in self.problem.legs
        ]
        self.caps = [self._find_cap(speed) for speed in speeds]
        self._solve = [cache(plane.solve) for plane in self.planes]

    def _find_cap(self, speed: _Speed) -> tuple[float, float, str]:
        """Return the largest possible fraction of a speed alone, and the place and the limit that allow no more."""
        plane = self.planes[speed.leg]
        law = self.problem.time_laws[speed.leg]
        if law is not None:
            _, rate, acceleration = follow_law(law, plane.path.s)
            return plane.speed_factor(rate, acceleration)
        assert speed.side is not None
        largest, label = plane.largest_rate(speed.side)
        task_rate = self.problem.leg_rates[speed.leg][speed.side]
        return largest / task_rate, float(plane.path.s[speed.side]), label

    def speed_at(self, leg: int, side: int) -> int | None:
        """Return the number of the speed that is given at an end of a leg; None at rest."""
        beside = self.problem.leg_beside(leg, side)
        for number, speed in enumerate(self.speeds):
            if (speed.leg, speed.side) in ((leg, side), (beside, None)):
                return number if self.problem.leg_rates[leg][side] else None
        return None

    def is_possible(self, shares: np.ndarray) -> bool:
        """Tell whether these fractions of the speeds, (k,), are possible together."""
        pairs = zip(self.caps, shares, strict=True)
        if any(cap[0] < share for cap, share in pairs):
            return False
        return all(self.pass_leg(leg, shares) is not None for leg in self.free_legs)

    @cached_property
    def free_legs(self) -> list[int]:
        """Numbers of the legs whose speed is free, except at the ends of a periodic motion, where it is unknown."""
        free = [leg for leg, law in enumerate(self.problem.time_laws) if law is None]
        if self.problem.task.boundary.periodic and not any(self.problem.end_rates):
            return [leg for leg in free if leg not in (0, len(self.problem.legs) - 1)]
        return free

    def pass_leg(self, leg: int, shares: np.ndarray) -> Timing | None:
        """Time a leg whose speed is free, between fractions of the speeds, (k,); None if the leg is too short."""
        rates = []
        for side in (0, -1):
            number = self.speed_at(leg, side)
            share = 0.0 if number is None else float(shares[number])
            rates.append(share * self.problem.leg_rates[leg][side])
        return self._solve[leg](tuple(rates))

    def lower_one(self, number: int, least: float) -> float | None:
        """Find the largest fraction of a speed, above `least`, that is possible with the other speeds, or None."""
        shares = np.ones(len(self.speeds))

        def is_possible(share: float) -> bool:
            shares[number] = share
            return self.is_possible(shares)

        # Between other speeds, a speed that is too low may be as impossible as one that is too high.
        tried = np.geomspace(1.0, least, 20).tolist()
        for above, share in itertools.pairwise(tried):
            if is_possible(share):
                return _largest_share(is_possible, share, above)
        return None

    def allows(self, share: float) -> bool:
        """Tell whether this fraction is possible for all speeds together."""
        return self.is_possible(np.full(len(self.speeds), share))


def _largest_share(
    is_possible: Callable[[float], bool], low: float, high: float
) -> float:
    """Find the largest possible fraction between a fraction that is possible and one that is not."""
    while high - low > 1e-3 * high:
        middle = 0.5 * (low + high)
        low, high = (middle, high) if is_possible(middle) else (low, middle)
    return low


def explain_speeds(
    guesses: Sequence[InitialGuess], *, are_tried: bool = False
) -> PlanningError | None:
    """Tell which speeds of the task are out of reach along the joint paths of all guesses; None if all may be reached.

    Parameters
    ----------
    guesses : sequence of InitialGuess
    are_tried : bool, optional
        Whether plans from these guesses failed. Then a speed that is too high is the most likely reason; otherwise it
        has to be far out of reach.
    """
    if not guesses:
        return None
    problem = guesses[0].problem
    speeds = speeds_of(problem)
    if not speeds:
        return None
    s = spread_stations(problem)
    driven = np.isfinite(problem.robot.limits.torque_upper)
    has_friction = (_has_friction(problem) & driven).any()
    best = None
    share = _LEAST
    for guess in guesses:
        q = postures_along(guess, s)
        if q is None:
            return None
        check = _SpeedCheck(guess, speeds, s, q)
        # The phase plane is exact if there are no other joint paths, and no friction helps to brake.
        is_exact = not check.is_redundant and not has_friction
        enough = 1.0 if are_tried else (_EXACT if is_exact else _UNLIKELY)
        if not check.allows(_LEAST) or check.allows(enough):
            return None
        if best is None or check.allows(share):
            share = _largest_share(check.allows, share, enough)
            best = check
    assert best is not None
    return _explain(best, share)


def _explain(check: _SpeedCheck, share: float) -> PlanningError:
    """Tell which speeds are too high, if only this fraction of all speeds together is possible."""
    every = np.ones(len(check.speeds))
    shares = {number: cap[0] for number, cap in enumerate(check.caps)}
    number = min(shares, key=lambda number: shares[number])
    _, place, label = check.caps[number]
    why = f"for the {label} limit at s = {place:.3g}"
    short = [leg for leg in check.free_legs if check.pass_leg(leg, every) is None]
    if short and shares[number] > share + 0.01:
        # One speed alone may be to blame.
        alone = (
            (speed_number, check.lower_one(speed_number, 0.9 * share))
            for speed_number in shares
        )
        lower = {
            speed_number: _REACHED * speed_share
            for speed_number, speed_share in alone
            if speed_share is not None
        }
        shares = lower or dict.fromkeys(shares, _REACHED * share)

        def reach(leg: int) -> float:
            """Return the largest fraction of its end speeds that a leg allows."""
            return _largest_share(
                lambda trial: check.pass_leg(leg, trial * every) is not None, share, 1.0
            )

        leg = min(short, key=reach)
        ends = [check.speed_at(leg, side) for side in (0, -1)]
        number = max(shares, key=lambda number: (number in ends, shares[number]))
        why = _explain_short_leg(check, leg, reach(leg))
    possible = {
        speed_number: round_to_three_digits(
            speed_share * check.speeds[speed_number].figure, down=True
        )
        for speed_number, speed_share in shares.items()
        if speed_share < _EXACT or speed_number == number
    }
    remedies = [
        check.speeds[speed_number].lower_to(figure, is_known=True)
        for speed_number, figure in possible.items()
    ]
    speed = check.speeds[number]
    found = str(speed)
    if speed.unit == "m/s" and speed.figure > 10.0:
        found += f" ({speed.figure / 1e3:g} m/s, if mm/s were meant)"
    error = PlanningError(
        f"the {speed.name} is too high {why}",
        where=speed.key,
        found=found,
        allowed=f"about {possible[number]:g} {speed.unit}",
        hint="Raise the limits that hold the motion back",
    )
    return error.with_remedies(*remedies)


def _explain_short_leg(check: _SpeedCheck, leg: int, share: float) -> str:
    """Say between which speeds a leg is too short, because of which limit, and how long it would have to be.

    The leg allows this fraction of the speeds. Under a constant acceleration the length grows with the square of speed.
    """
    ends = [check.speed_at(leg, side) for side in (0, -1)]
    first, last = ("rest" if end is None else str(check.speeds[end]) for end in ends)
    timing = check.pass_leg(leg, np.full(len(check.speeds), share))
    assert timing is not None
    active = check.planes[leg].active_limit(timing.rate)
    interval = check.problem.legs[leg]
    length = tool_distance(check.problem.task_map, check.problem.leg_paths[leg])
    needed = ""
    if length > tolerances.LENGTH:
        needed = f": that takes about {length / share**2:.3g} m, and it is {length:.3g} m long"
    return (
        f"for the {active} limit: the path from s = {interval.begin:.3g} to {interval.end:.3g} "
        f"is too short to get from {first} to {last}{needed}"
    )


def round_to_three_digits(value: float, *, down: bool) -> float:
    """Round a number down, or up; zero and negative numbers are returned unchanged."""
    if value <= 0.0:
        return value
    digits = 2 - math.floor(math.log10(value))
    scaled = value * 10.0**digits
    slack = 1e-9 * scaled  # 1.13 times 100 is a little less than 113
    rounded = math.floor(scaled + slack) if down else math.ceil(scaled - slack)
    return rounded / 10.0**digits
