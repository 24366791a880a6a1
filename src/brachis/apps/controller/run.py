"""The motion as a controller will run it: sampled, rounded, interpolated as in the profile, and verified again.

If the controller receives only positions (``hold``, ``linear``), the drives determine the motion between samples. The
limits are then checked at the samples, with differences of successive samples in place of derivatives, as controllers
do. The tool is also checked on the straight joint lines between samples.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from itertools import islice
from typing import Any

import numpy as np

from brachis.apps.controller.axes import ControllerAxes, bind_axes
from brachis.apps.controller.differences import check_differences, check_tool_speed
from brachis.apps.controller.limits import robot_with_profile, without_scale
from brachis.apps.controller.profile import Profile, load_profile
from brachis.common.arrays import spread
from brachis.common.summary import Summary
from brachis.errors import InputError
from brachis.path import Path, path_of
from brachis.robot import TaskMap, bind
from brachis.robot.custom_limits import LimitModel
from brachis.trajectory import (
    MotionSource,
    Samples,
    Trajectory,
    change_robots,
    join_splines,
    motion_of,
)
from brachis.verify import Check, Verification, VerifyOptions
from brachis.verify.limits import check_limits
from brachis.verify.mechanics import joint_placements
from brachis.verify.motion import CheckedMotion, MotionStates
from brachis.verify.verify import path_errors, place_in_program

_MOVING = 1e-6
"""Joint velocity below which an end of a motion counts as at rest, rad/s or m/s."""
_STILL = 1e-9
"""A joint that moves by less than this counts as standing still, rad or m."""
_REST = 1e-6
"""Maximum acceleration that counts as rest, as a fraction of the largest acceleration of the motion."""
_CHORD_STEPS = 4
"""Number of steps in which the straight joint line between two samples is checked."""
_SLOWER = (1.001, 1.002, 1.005, 1.01, 1.02, 1.05, 1.1, 1.2)
"""Factors on the duration to try when a run fails."""
_SHORTER = (2, 4, 8)
"""Divisors of the period to try when a run fails."""


@dataclass(frozen=True, repr=False)
class RunReport(Summary):
    """Verification of a motion as a controller will run it.

    Attributes
    ----------
    controller : str
        Name of the controller and its interface.
    period : float
        Time between samples, s.
    verification : Verification
        Checks of the limits of the task and of the profile, of the path, and of both ends.
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
    verification: Verification
    remedies: tuple[str, ...] = ()

    @property
    def passed(self) -> bool:
        """Whether every check passed."""
        return self.verification.passed

    @property
    def failures(self) -> tuple[str, ...]:
        """Failed checks, in words."""
        return self.verification.failures

    def to_dict(self) -> dict[str, Any]:
        """Return plain data for JSON."""
        data = {**vars(self), "verification": self.verification.to_dict()}
        return {"passed": self.passed, **data}

    def summary(self) -> Mapping[str, object]:
        """Return the entries shown to the user: every check with its worst value."""
        return {
            "controller": f"{self.controller}, every {1e3 * self.period:g} ms",
            **self.verification.summary(),
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
    period = check_period(profile, period)
    motion = with_profile(motion, profile, axes)
    run = _Run(motion, profile, axes, tuple(own_limits))
    verification = run.verify(period)
    remedies = () if verification.passed else tuple(_find_remedies(run, period))
    return RunReport(profile.title, period, verification, remedies)


def with_profile(
    motion: Trajectory, profile: Profile, axes: ControllerAxes
) -> Trajectory:
    """Return a motion whose robots have the limits of a profile too, without the factors on their limits."""
    return change_robots(
        motion,
        lambda robot: robot_with_profile(without_scale(robot), profile, axes),
    )


def check_period(profile: Profile, period: float | None) -> float:
    """Return the period of the samples for a controller, s; by default the period of the profile.

    Raises
    ------
    InputError
        The controller accepts only its own period.
    """
    if period is None or period == profile.period:
        return profile.period
    if profile.fixed_period:
        raise InputError(
            "the controller does not accept this period",
            where="dt",
            found=f"{period:g} s",
            allowed=f"{profile.period:g} s ({profile.title})",
        )
    return period


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
    """A motion and the way a controller runs it."""

    motion: Trajectory
    profile: Profile
    axes: ControllerAxes
    own_limits: tuple[LimitModel, ...]

    def verify(self, period: float) -> Verification:
        """Verify the run with a given period, s."""
        samples = self.motion.sample(period, last=self.profile.last)
        q = samples.q.copy()
        if self.profile.decimals is not None:
            values = np.round(self.axes.encode(q), self.profile.decimals)
            q[:, self.axes.index] = self.axes.decode(values)
        run = interpolate(self.motion, samples, q, self.profile.interpolation)
        worst: dict[str, Check] = {}
        points = 0
        for begin, part, sampled in self._split(run):
            checks, count = self._check(part, sampled)
            points += count
            for check in checks:
                before = worst.get(check.name)
                if before is None or check.share > before.share:
                    worst[check.name] = place_in_program(run, begin, check)
        worst |= {check.name: check for check in _check_rest(self.motion, self.profile)}
        ratios = (check.value for check in worst.values() if check.of_limit)
        error = worst["path error"].value
        return Verification(
            tuple(worst.values()), points, max(ratios, default=0.0), error
        )

    def _split(self, run: Trajectory) -> Iterator[tuple[float, Trajectory, Trajectory]]:
        """Yield the run, or that of each component, with the time at which it begins, s, and the samples around it.

        The run of a component begins and ends where the plan rests. Samples closer than half a period are left out.
        """
        if not run.components:
            yield 0.0, run, run
        for begin, component in run.components:
            t = run.times - begin
            half = 0.5 * run.times[1]
            inside = (t > half) & (t < component.t_end - half)
            times = np.concatenate([[0.0], t[inside], [component.t_end]])
            samples = component.at(times)
            q = samples.q.copy()
            q[1:-1, : run.q.shape[1]] = run.q[inside]
            part = interpolate(component, samples, q, self.profile.interpolation)
            ends = (-2.0 * half, component.t_end + 2.0 * half)
            around = slice(*np.searchsorted(t, ends))
            rows = {name: getattr(run, name)[around] for name in ("q", "qdot", "qddot")}
            yield begin, part, replace(run, times=t[around], **rows)

    def _check(self, run: Trajectory, sampled: Trajectory) -> tuple[list[Check], int]:
        """Check a run, and its samples by differences; return the number of instants too."""
        task = run.task
        robot, task_map = bind(run.robot, task.task_space, task.tolerances)
        path = path_of(task_map, task)
        options = VerifyOptions(ratio_tolerance=task.refinement.tolerance)
        allowed = 1.0 + options.ratio_tolerance
        differences: list[Check] = []
        kind = CheckedMotion
        if self.profile.is_sampled:
            differences = [
                *check_differences(robot, sampled, allowed),
                *check_tool_speed(run, sampled, allowed),
            ]
            kind = _SampledMotion
        checked = kind(run, robot, task_map, path, options)
        replaced = {
            check.name.replace("by differences", "ratio") for check in differences
        }
        limits = check_limits(checked, self.own_limits)
        ratios = [check for check in limits if check.name not in replaced] + differences
        return [_check_path(checked, self.profile), *ratios], len(checked.states.t)


class _SampledMotion(CheckedMotion):
    """A motion that is known only at its nodes."""

    @cached_property
    def states(self) -> MotionStates:
        """States of the motion at its nodes."""
        last = len(self.pieces.lengths) - 1
        index = np.append(np.arange(last + 1), last)
        u = np.zeros(last + 2)
        u[-1] = 1.0
        return MotionStates(self.pieces, index, u)


def interpolate(
    motion: Trajectory, samples: Samples, q: np.ndarray, interpolation: str
) -> Trajectory:
    """Return the motion between samples.

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
        The interpolated motion, with the path coordinate of the plan. It waits at the end until the last sample.
    """
    t = samples.t
    h = np.diff(t)[:, None]
    slopes = np.diff(q, axis=0) / h
    qdot = samples.qdot
    after = samples.qddot
    before = samples.qddot
    if interpolation == "cubic":
        after = np.zeros_like(q)
        before = np.zeros_like(q)
        after[:-1] = (6.0 * slopes - 4.0 * qdot[:-1] - 2.0 * qdot[1:]) / h
        before[1:] = (2.0 * qdot[:-1] + 4.0 * qdot[1:] - 6.0 * slopes) / h
        after[-1] = before[-1]
        before[0] = after[0]
    elif interpolation != "quintic":
        qdot, after = _central_differences(t, q, samples.qdot[[0, -1]])
        before = after
    splines = motion.phase_splines
    wait = t[-1] - motion.t_end
    if wait > _STILL:
        splines = (*splines, splines[-1].wait(wait))
    knots, control_points = join_splines(splines)
    ends = np.cumsum([spline.t_end for spline in splines])
    ends[-1] = t[-1]
    return replace(
        motion,
        times=t,
        q=q,
        qdot=qdot,
        qddot=after,
        qddot_before=before,
        knots=knots,
        control_points=control_points,
        phase_ends=ends,
    )


def _central_differences(
    t: np.ndarray, q: np.ndarray, ends: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """Return velocities and accelerations, (K, n), at the samples; `ends`, (2, n), are the velocities at both ends."""
    h = np.diff(t)[:, None]
    slopes = np.diff(q, axis=0) / h
    qdot = np.empty_like(q)
    qdot[1:-1] = (h[1:] * slopes[:-1] + h[:-1] * slopes[1:]) / (h[1:] + h[:-1])
    qdot[[0, -1]] = ends
    qddot = np.empty_like(q)
    qddot[1:-1] = 2.0 * np.diff(slopes, axis=0) / (h[1:] + h[:-1])
    qddot[0] = 2.0 * (slopes[0] - qdot[0]) / h[0]
    qddot[-1] = 2.0 * (qdot[-1] - slopes[-1]) / h[-1]
    return qdot, qddot


def _check_path(motion: CheckedMotion, profile: Profile) -> Check:
    """Check the distance of the tool from the path, between bare samples along straight joint lines."""
    t = motion.states.t
    q = motion.states.q
    if isinstance(motion, _SampledMotion):
        t = spread(motion.trajectory.times, _CHORD_STEPS)
        nodes = motion.trajectory.times
        q = np.column_stack([np.interp(t, nodes, joint) for joint in q.T])
    s = motion.trajectory.path_spline(t).clip(0.0, 1.0)
    # A tool that is early or late on the path has not left the path.
    s = nearest_on_path(motion.path, motion.task_map, motion.task_map.values(q), s)
    errors = path_errors(motion, q, s, joint_placements(motion.robot, q))
    worst = int(np.argmax(errors))
    recovered = motion.trajectory.recovered
    allowed = profile.path_tolerance + (recovered.tolerance if recovered else 0.0)
    return Check("path error", errors[worst], allowed, "m, rad", time=t[worst])


def nearest_on_path(
    path: Path, task_map: TaskMap, values: np.ndarray, s: np.ndarray
) -> np.ndarray:
    """Return the path coordinates, (K,), of the points of a path that are closest to task coordinates, (K, c).

    The search begins at `s`, (K,), close to them.
    """
    for _ in range(2 if values.size else 0):
        sample = path.sample(s)
        miss = task_map.difference(values, sample.target)
        along = sample.xi
        shift = np.sum(miss * along, axis=1) / np.sum(along**2, axis=1)
        s = np.clip(s + shift, 0.0, 1.0)
    return s


def _check_rest(motion: Trajectory, profile: Profile) -> Iterator[Check]:
    """Check that the plan begins and ends as the controller requires."""
    if profile.rest != "full":
        return
    ends = np.abs(motion.qddot[[0, -1]])
    joint = int(np.argmax(ends.max(axis=0)))
    allowed = _REST * max(np.abs(motion.qddot).max(), 1.0)
    yield Check(
        "acceleration at the ends",
        ends[:, joint].max(),
        allowed,
        "rad/s^2, m/s^2",
        motion.joint_names[joint],
    )


def _find_remedies(run: _Run, period: float) -> Iterator[str]:
    """Yield changes that let a run pass, each of them verified."""
    profile = run.profile
    trials: list[list[tuple[str, _Run, float]]] = [[], [], []]
    for decimals in range(10 if profile.decimals is None else profile.decimals + 1, 10):
        finer = profile.model_copy(update={"decimals": decimals})
        text = f"{decimals} decimals"
        trials[0].append((text, replace(run, profile=finer), period))
    for divisor in () if profile.fixed_period else _SHORTER:
        text = f"a period of {1e3 * period / divisor:g} ms"
        trials[1].append((text, run, period / divisor))
    has_speeds = run.motion.task.tool_limits.process_speed
    for factor in () if has_speeds else _SLOWER:
        slower = replace(run, motion=slow_down(run.motion, factor))
        trials[2].append((f"{100.0 / factor:.4g} % of the speed", slower, period))
    for group in trials:
        passing = (text for text, trial, dt in group if trial.verify(dt).passed)
        for text in islice(passing, 1):
            yield f"the motion passes with {text}"
    yield "to plan a motion that passes, plan with the profile (--profile)"


def slow_down(motion: Trajectory, factor: float) -> Trajectory:
    """Return the motion slowed down by a factor on its duration."""
    components = tuple(
        (factor * begin, slow_down(component, factor))
        for begin, component in motion.components
    )
    return replace(
        motion,
        components=components,
        times=motion.times * factor,
        qdot=motion.qdot / factor,
        qddot=motion.qddot / factor**2,
        qddot_before=motion.qddot_before / factor**2,
        phase_ends=motion.phase_ends * factor,
    )
