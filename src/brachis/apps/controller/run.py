"""The motion as a controller will run it: sampled, rounded, interpolated as in the profile, and verified again.

If the controller receives only positions (``hold``, ``linear``), the drives determine the motion between samples. The
limits are then checked at the samples, with differences of successive samples in place of derivatives, as controllers
do. The tool is also checked on the straight joint lines between samples.
"""

from __future__ import annotations

from bisect import bisect_left
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from brachis.apps.controller.axes import ControllerAxes, bind_axes
from brachis.apps.controller.differences import (
    DERIVATIVES,
    check_differences,
    joint_ratios,
    part_ratios,
)
from brachis.apps.controller.limits import robot_with_profile, without_scale
from brachis.apps.controller.profile import Profile, load_profile
from brachis.common.arrays import interpolate_columns, spread
from brachis.errors import InputError
from brachis.path import Path, path_of
from brachis.robot import TaskMap, bind
from brachis.robot.custom_limits import LimitModel
from brachis.trajectory import (
    MotionSource,
    Samples,
    Trajectory,
    change_robots,
    motion_of,
)
from brachis.verify import Check, Verification, VerifyOptions
from brachis.verify.checks import check_joints
from brachis.verify.limits import check_limits
from brachis.verify.mechanics import joint_placements
from brachis.verify.motion import CheckedMotion
from brachis.verify.verify import path_errors, place_in_program

_MOVING = 1e-6
"""Joint velocity below which an end of a motion counts as at rest, rad/s or m/s."""
_STILL = 1e-9
"""A joint that moves by less than this counts as standing still, rad or m."""
_REST = 1e-6
"""Maximum acceleration that counts as rest, as a fraction of the largest acceleration of the motion."""
_DIVISORS = (2, 4, 8)
"""Divisors of the period to try when a run fails: three halvings of 10 ms, as for ROS 2, stay above 1 ms."""


@dataclass(frozen=True, repr=False, kw_only=True)
class RunReport(Verification):
    """Verification of a motion as a controller will run it: limits of the task and of the profile, path, and both ends.

    Attributes
    ----------
    controller : str
        Name of the controller and its interface.
    period : float
        Time between samples, s.
    remedies : tuple of str
        Changes, each of which is verified to make the run pass; empty if it passes anyway.

    Examples
    --------
    >>> import brachis
    >>> result = brachis.plan(brachis.examples.scara_line, redundant_joints=["j1"], effort="single", intervals=8)
    >>> brachis.verify_run(result, "ros2_control", period=0.001).period
    0.001
    """

    controller: str
    period: float
    remedies: tuple[str, ...] = ()

    def summary(self) -> Mapping[str, object]:
        """Return the entries shown to the user: every check with its worst value."""
        return {
            "controller": f"{self.controller}, every {1e3 * self.period:g} ms",
            **super().summary(),
            "remedies": "; ".join(self.remedies) or "none needed",
        }


def verify_run(
    trajectory: MotionSource,
    profile: Profile | str,
    *,
    period: float | None = None,
    own_limits: Sequence[LimitModel] = (),
) -> RunReport:
    """Verify a motion as a controller will run it.

    The run is checked against the limits without the factors in ``robot.limits.scale``, because these are margins for
    deviations that the controller adds to the plan.

    Parameters
    ----------
    trajectory : Trajectory, Result or path
    profile : Profile, str or path
        Profile of the controller; see `load_profile`.
    period : float, optional
        Time between samples, s. By default the period of the profile.
    own_limits : sequence of LimitModel, optional
        The user's own limits with which the motion was planned.

    Returns
    -------
    RunReport
        A failed run raises no error: `failures` lists the failed checks, and `remedies` the changes that help.

    Raises
    ------
    InputError
        The profile does not fit the robot, a joint that moves has no axis, or the controller does not accept the
        period.

    Examples
    --------
    >>> import brachis
    >>> result = brachis.plan(brachis.examples.scara_line, redundant_joints=["j1"], effort="single", intervals=8)
    >>> brachis.verify_run(result, "kuka_rsi_4ms").passed
    True
    """
    motion = motion_of(trajectory)
    profile = load_profile(profile)
    axes = axes_for(motion, profile)
    period = profile.period if period is None else period
    if profile.fixed_period and period != profile.period:
        raise InputError(
            "the controller does not accept this period",
            where="dt",
            found=f"{period:g} s",
            allowed=f"{profile.period:g} s ({profile.title})",
        )
    motion = with_profile(motion, profile, axes)
    run = _Run(motion, profile, axes, tuple(own_limits), period)
    report = run.verify()
    if report.passed:
        return report
    return replace(report, remedies=tuple(_find_remedies(run)))


def with_profile(
    motion: Trajectory, profile: Profile, axes: ControllerAxes
) -> Trajectory:
    """Return a motion whose robots have the limits of a profile too, without the factors on their limits."""
    return change_robots(
        motion,
        lambda robot: robot_with_profile(without_scale(robot), profile, axes),
    )


def axes_for(trajectory: Trajectory, profile: Profile) -> ControllerAxes:
    """Return the axes of a profile, bound to the robot of a motion.

    Raises
    ------
    InputError
        The profile does not fit the robot, or a joint that moves has no axis.
    """
    ends = np.abs(trajectory.qdot[[0, -1]]).max()
    if ends > _MOVING:
        raise InputError(
            "a motion for a controller must start and end at rest",
            where="boundary",
            found=f"{ends:.3g} rad/s or m/s at an end",
            allowed="neither start_speed nor end_speed, and not periodic",
        )
    axes = bind_axes(profile, trajectory.robot)
    names = trajectory.robot.urdf_joints
    travel = np.ptp(trajectory.q[:, : len(names)], axis=0)
    missing = [
        name
        for name, distance in zip(names, travel, strict=True)
        if distance > _STILL and name not in axes.joints
    ]
    if missing:
        raise InputError(
            "a joint that moves has no axis in the profile",
            where="profile.axes",
            found=", ".join(missing),
            allowed="an axis for every joint that moves; external: true for a rail or a positioner",
        )
    return axes


@dataclass(frozen=True, eq=False)
class _Run:
    """A motion and the way a controller runs it, with a period, s."""

    motion: Trajectory
    profile: Profile
    axes: ControllerAxes
    own_limits: tuple[LimitModel, ...]
    period: float

    def verify(self) -> RunReport:
        """Verify the run."""
        profile = self.profile
        samples = self.motion.sample(self.period, last=profile.last)
        q = samples.q.copy()
        if profile.decimals is not None:
            values = np.round(self.axes.encode(q), profile.decimals)
            q[:, self.axes.index] = self.axes.decode(values)
        worst_checks: dict[str, Check] = {}
        points = 0
        run = interpolate(self.motion, samples, q, profile.interpolation)
        for begin, part in self._split(run):
            motion = self._with_path(part)
            points += len(motion.states.t)
            for check in self._check(motion):
                before = worst_checks.get(check.name)
                if before is None or check.share > before.share:
                    placed = place_in_program(self.motion, begin, check)
                    worst_checks[check.name] = placed
        checks = list(worst_checks.values())
        if profile.is_sampled:
            tolerance = self.motion.task.refinement.tolerance
            differences = check_differences(run.times, joint_ratios(run), tolerance)
            checks += [place_in_program(self.motion, 0.0, item) for item in differences]
        ratios = [check for check in checks if check.limit]
        errors = [check.value for check in checks if check.name == "path error"]
        if profile.rest == "full":
            plan = self.motion
            ends = [0, -1]
            allowed = _REST * max(np.abs(plan.qddot).max(), 1.0)
            name = "acceleration at the ends"
            instants = (plan.qddot[ends], plan.times[ends])
            kind = "acceleration"
            whole = self._with_path(plan)
            checks.append(check_joints(whole, name, *instants, kind, allowed))
        worst = max((check.value for check in ratios), default=0.0)
        return RunReport(
            checks=tuple(checks),
            points=points,
            worst_ratio=worst,
            path_error=max(errors, default=0.0),
            controller=profile.title,
            period=self.period,
        )

    def _split(self, run: Trajectory) -> Iterator[tuple[float, Trajectory]]:
        """Yield the run of every component, with the time at which it begins, s; it consists of the nodes within."""
        if not run.components:
            yield 0.0, run
        for begin, component in run.components:
            local = run.times - begin
            (rows,) = np.nonzero((local >= 0.0) & (local <= component.t_end))
            if len(rows) <= 1:  # there is no motion to check
                continue
            t = local[rows]
            plan = component.at(t)
            times = t - t[0]
            nodes: dict[str, Any] = {}
            for name in ("q", "qdot", "qddot", "qddot_before"):
                virtual = getattr(plan, name.removesuffix("_before"))
                joints = getattr(run, name)[rows]
                if self.profile.is_sampled and name != "q":
                    # Differences at an end would be those of two parts.
                    joints[[0, -1]] = virtual[[0, -1], : joints.shape[1]]
                nodes[name] = np.hstack([joints, virtual[:, joints.shape[1] :]])
            inner = replace(
                component,
                times=times,
                degree=1,
                knots=np.pad(times / times[-1], 1, mode="edge"),
                control_points=plan.s[None],
                phase_ends=times[-1:],
                **nodes,
            )
            yield begin + t[0], inner

    def _with_path(self, run: Trajectory) -> CheckedMotion:
        """Return a run with its path, for the checks."""
        task = run.task
        robot, task_map = bind(run.robot, task.task_space, task.tolerances)
        return CheckedMotion(
            run,
            robot,
            task_map,
            path_of(task_map, task),
            VerifyOptions(ratio_tolerance=task.refinement.tolerance),
            is_sampled=self.profile.is_sampled,
        )

    def _check(self, motion: CheckedMotion) -> list[Check]:
        """Check the path, and the limits."""
        ratios = check_limits(motion, self.own_limits)
        if self.profile.is_sampled:
            rows = part_ratios(motion)
            tolerance = motion.options.ratio_tolerance
            differences = list(check_differences(motion.states.t, rows, tolerance))
            replaced = {check.limit for check in differences} | set(DERIVATIVES)
            ratios = [check for check in ratios if check.limit not in replaced]
            ratios += differences
        return [_check_path(motion, self.profile), *ratios]


def interpolate(
    motion: Trajectory, samples: Samples, q: np.ndarray, interpolation: str
) -> Trajectory:
    """Return the motion between samples.

    For ``hold`` and ``linear``, only the nodes, which are the samples, have a meaning. Their velocities and
    accelerations are central differences, with rest before the first and after the last sample.

    Parameters
    ----------
    motion : Trajectory
        The plan.
    samples : Samples
        Samples of the plan at K times.
    q : (K, n) ndarray
        Positions sent to the controller, rad or m.
    interpolation : {"hold", "linear", "cubic", "quintic"}

    Returns
    -------
    Trajectory
        The interpolated motion, with the path coordinate of the plan.
    """
    t = samples.t
    nodes: dict[str, Any] = {"times": t, "q": q, "qdot": samples.qdot}
    if interpolation == "quintic":
        nodes |= {"qddot": samples.qddot, "qddot_before": samples.qddot}
    elif interpolation == "cubic":
        from scipy.interpolate import CubicHermiteSpline

        rates, begins = CubicHermiteSpline(t, q, samples.qdot).derivative(2).c
        ends = begins + rates * np.diff(t)[:, None]
        nodes["qddot"] = np.concatenate([begins, ends[-1:]])
        nodes["qddot_before"] = np.concatenate([begins[:1], ends])
    else:
        mirrored = np.pad(q, ((1, 1), (0, 0)), mode="reflect")
        nodes["qdot"] = (mirrored[2:] - mirrored[:-2]) / (2.0 * t[1])
        qddot = np.diff(mirrored, 2, axis=0) / t[1] ** 2
        nodes |= {"qddot": qddot, "qddot_before": qddot}
        # The plan may end before the last sample; its path coordinate is that of the samples, too.
        knots = np.pad(t / t[-1], 1, mode="edge")
        nodes |= {"knots": knots, "control_points": samples.s[None]}
        motion = replace(motion, degree=1, phase_ends=t[-1:])
    return replace(motion, **nodes)


def _check_path(motion: CheckedMotion, profile: Profile) -> Check:
    """Check the distance of the tool from the path, between bare samples along straight joint lines."""
    t = motion.states.t
    q = motion.states.q
    if motion.is_sampled:
        # A short line is farthest from the path in its middle.
        middles = spread(t, 2)
        q = interpolate_columns(middles, t, q)
        t = middles
    s = motion.trajectory.path_spline(t).clip(0.0, 1.0)
    # A tool that is early or late on the path has not left the path.
    s = nearest_on_path(motion.path, motion.task_map, motion.task_map.values(q), s)
    errors = path_errors(motion, q, s, joint_placements(motion.robot, q))
    worst = int(np.argmax(errors))
    recovered = motion.trajectory.recovered
    allowed = profile.path_tolerance + (recovered.tolerance if recovered else 0.0)
    return Check("path error", errors[worst], allowed, "m, rad", time=t[worst])


def nearest_on_path(
    path: Path,
    task_map: TaskMap,
    values: np.ndarray,
    s: np.ndarray,
    ends: tuple[float, float] = (0.0, 1.0),
    steps: int = 2,
) -> np.ndarray:
    """Return the path coordinates, (K,), of the points of a path that are closest to task coordinates, (K, c).

    The search begins at `s`, (K,), close to them, and stays between two path coordinates, `ends`.
    """
    for _ in range(steps if values.size else 0):
        sample = path.sample(s)
        miss = task_map.difference(values, sample.target)
        along = sample.xi
        shift = np.sum(miss * along, axis=1) / np.sum(along**2, axis=1)
        s = np.clip(s + shift, *ends)
    return s


def _find_remedies(run: _Run) -> Iterator[str]:
    """Yield the smallest changes that let a run pass, each of them verified."""
    profile = run.profile
    decimals = range(10 if profile.decimals is None else profile.decimals + 1, 10)
    divisors = () if profile.fixed_period else _DIVISORS
    periods = [1e3 * run.period / divisor for divisor in divisors]
    has_speeds = run.motion.task.tool_limits.process_speed
    speeds = () if has_speeds else [0.1 * number for number in range(999, 499, -1)]

    changes: tuple[tuple[str, Sequence[float], Callable[[Any], _Run]], ...] = (
        (
            "{} decimals",
            decimals,
            lambda value: replace(
                run, profile=profile.model_copy(update={"decimals": value})
            ),
        ),
        (
            "a period of {:g} ms",
            periods,
            lambda value: replace(run, period=1e-3 * value),
        ),
        (
            "{:g} % of the speed",
            speeds,
            lambda value: replace(run, motion=slow_down(run.motion, 100.0 / value)),
        ),
    )
    for text, values, change in changes:
        index = _find_smallest(values, change)
        if index < len(values):
            yield f"the motion passes with {text.format(values[index])}"
    yield "to plan a motion that passes, plan with the profile (--profile)"


def _find_smallest(values: Sequence[float], change: Callable[[Any], _Run]) -> int:
    """Return the index of a small change that passes; the number of values if none is found.

    Steps double until a change passes. Larger changes need not pass too: samples fall on other places of the motion.
    """

    def has_passed(value: float) -> bool:
        return change(value).verify().passed

    failed = 0
    index = 0
    while index < len(values) and not has_passed(values[index]):
        failed = index + 1
        index = 2 * index + 1
    return bisect_left(values, 1, failed, min(index, len(values)), key=has_passed)


def slow_down(motion: Trajectory, factor: float) -> Trajectory:
    """Return the motion slowed down by a factor on its duration."""
    components = tuple(
        (factor * begin, slow_down(component, factor))
        for begin, component in motion.components
    )
    parts = tuple(
        replace(part, begin=factor * part.begin, end=factor * part.end)
        for part in motion.parts
    )
    return replace(
        motion,
        components=components,
        parts=parts,
        events=tuple(
            replace(event, time=factor * event.time) for event in motion.events
        ),
        times=motion.times * factor,
        qdot=motion.qdot / factor,
        qddot=motion.qddot / factor**2,
        qddot_before=motion.qddot_before / factor**2,
        phase_ends=motion.phase_ends * factor,
    )
