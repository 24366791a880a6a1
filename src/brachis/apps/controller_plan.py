"""Plans whose motion meets its limits when a controller runs it."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Unpack

import numpy as np

from brachis.apps.controller import (
    Profile,
    RunReport,
    bind_axes,
    load_profile,
    robot_with_profile,
    verify_run,
)
from brachis.common.progress import Listener, ignore
from brachis.errors import BrachisError, InputError
from brachis.planner import RobotOrTask, plan, read_arguments
from brachis.result import Result
from brachis.robot import Robot
from brachis.robot.custom_limits import LimitModel
from brachis.robot.from_task import replace_limits
from brachis.robot.limits import MAGNITUDES
from brachis.task import LimitSpec, Source, TaskKeywords

_ROUNDS = 4
"""Maximum number of further plans, each with lower limits than the previous one.

It was enough for 41 of 42 random plans for ROS 2, KUKA and FANUC (benchmarks/controllers.py); 34 needed no more than 1.
"""
_FULL_REST = 2
"""Number of derivatives (velocity, acceleration) that vanish at the ends."""
_MARGIN = 1e-3
"""Fraction by which a limit is reduced in addition to the excess."""


def plan_for_controller(
    profile: Profile | str,
    robot_or_task: RobotOrTask = None,
    /,
    task: Source | None = None,
    *,
    own_limits: Sequence[LimitModel] = (),
    listener: Listener | None = None,
    **keywords: Unpack[TaskKeywords],
) -> tuple[Result, RunReport]:
    """Plan a motion that meets its limits when a controller runs it.

    The limits of the profile and its conditions at both ends are added to the task. If the sampled motion then exceeds
    a limit, this limit is reduced by the excess, and the task is planned again.

    Parameters
    ----------
    profile : Profile, str or path
        Profile, name of an included profile, or profile file.
    robot_or_task, task
        As for `brachis.plan`.
    own_limits : sequence of LimitModel, optional
        As for `brachis.plan`.
    listener : callable, optional
        Called with a line of text about each step.
    **keywords
        As for `brachis.plan`.

    Returns
    -------
    Result
        The last plan.
    RunReport
        Verification of the planned motion as the controller runs it.

    Raises
    ------
    InputError, PlanningError
        As for `brachis.plan`; also if the profile does not fit the robot.

    Examples
    --------
    >>> import brachis
    >>> result, run = brachis.plan_for_controller(
    ...     "ros2_control", brachis.examples.scara_line, effort="single", intervals=8
    ... )
    >>> run.passed
    True
    """
    report = listener or ignore
    profile = load_profile(profile)
    robot, loaded = read_arguments(robot_or_task, task, keywords)
    boundary = loaded.boundary
    if boundary.start_speed or boundary.end_speed or boundary.periodic:
        raise InputError(
            "a motion for a controller must start and end at rest",
            where="boundary",
            allowed="neither start_speed nor end_speed, and not periodic",
        )
    robot = robot_with_profile(robot, profile, bind_axes(profile, robot))
    if profile.rest == "full" and loaded.spline.vanishing < _FULL_REST:
        spline = loaded.spline.model_copy(update={"rest": "full"})
        loaded = loaded.model_copy(update={"spline": spline})

    def plan_and_run(
        robot: Robot, start_from: Result | None
    ) -> tuple[Result, RunReport]:
        """Plan the task for a robot, and verify the motion as the controller runs it."""
        result = plan(
            robot,
            loaded.model_copy(update={"robot": robot.settings}),
            start_from=None if loaded.program else start_from,
            own_limits=own_limits,
            listener=listener,
        )
        return result, verify_run(result, profile, own_limits=own_limits)

    result, run = plan_and_run(robot, None)
    for _ in range(_ROUNDS):
        smaller = _find_factors(run, robot)
        if not smaller:
            break
        report(f"run by {profile.title}: {'; '.join(run.failures)}; planning again")
        scale = robot.settings.limits.scale
        factors = {kind: smaller[kind] * getattr(scale, kind) for kind in smaller}
        robot = replace_limits(robot, LimitSpec(scale=factors))
        try:
            result, run = plan_and_run(robot, result)
        except BrachisError:
            break
    return result, run


def _find_factors(run: RunReport, robot: Robot) -> dict[str, float]:
    """Return factors on the limits of the robot that compensate for the excess of a run."""
    factors: dict[str, float] = {}
    for check in run.checks:
        excess = check.value / check.allowed
        kind = check.limit.replace(" ", "_")
        if check.name == "path error":
            # The deviation of a straight line from the curve grows as the square of the speed.
            kind = "velocity"
            excess = excess**0.5
        is_limited = kind in MAGNITUDES and np.isfinite(robot.limits.both_ways(kind)[1])
        if not check.passed and np.any(is_limited):
            factor = (1.0 - _MARGIN) / excess
            factors[kind] = min(factor, factors.get(kind, 1.0))
    return factors
