"""The differences of successive samples, which controllers limit in place of derivatives."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

import numpy as np
from numpy.lib.stride_tricks import sliding_window_view

from brachis.trajectory import Trajectory
from brachis.verify import Check
from brachis.verify.limits.tool import largest_speeds
from brachis.verify.mechanics import real_tool_placements
from brachis.verify.motion import CheckedMotion

DERIVATIVES = ("velocity", "acceleration", "jerk")
"""Limits on the derivatives of the joint positions."""
_Ratios = Iterator[tuple[str, int, np.ndarray, Sequence[str]]]
"""Limits, orders of differences, their ratios, (K', c), and their c subjects; 0 without a limit."""


def check_differences(
    t: np.ndarray, listed: _Ratios, tolerance: float
) -> Iterator[Check]:
    """Check the differences of successive samples, divided by the period, as controllers do."""
    for limit, order, ratios, subjects in listed:
        if not ratios.any():
            continue
        row, column = map(int, np.unravel_index(np.argmax(ratios), ratios.shape))
        yield Check(
            f"{limit} by differences",
            ratios[row, column],
            1.0 + tolerance,
            "-",
            subjects[column],
            t[np.clip(row - order + 2, 0, len(t) - 1)],
            limit=limit,
        )


def joint_ratios(run: Trajectory) -> _Ratios:
    """Yield the ratios of the joints' derivatives; a difference over two parts meets the higher limit of both."""
    names = run.joint_names
    for order, kind in enumerate(DERIVATIVES, 1):
        limits = np.empty((len(run.times), 2, len(names)))
        for component, rows, _ in run.split_times(run.times):
            limits[rows] = component.robot.limits.both_ways(kind)[:, : len(names)]
        # The controller holds the first position before the motion, and the last one after it.
        held = np.pad(np.arange(len(run.times)), order - 1, mode="edge")
        rates = np.diff(run.q[held], order, axis=0) / run.times[1] ** order
        lower, upper = sliding_window_view(limits[held], order + 1, 0).swapaxes(0, 1)
        ratios = np.maximum(rates / upper.max(-1), rates / lower.min(-1))
        yield kind, order, ratios, names


def part_ratios(motion: CheckedMotion) -> _Ratios:
    """Yield the ratios of a part that also depend on its payload or path."""
    robot = motion.robot
    states = motion.states
    period = states.t[1]
    if robot.has_masses:
        names = robot.joint_names
        heat = np.cumsum(states.tau**2, axis=0) / len(states.t)
        yield "rms torque", 1, np.sqrt(heat) / robot.limits.rms_torque, names
        lower, upper = robot.limits.both_ways("torque_rate")
        rates = np.diff(states.tau, axis=0) / period
        yield "torque rate", 1, np.maximum(rates / upper, rates / lower), names
    tool, _ = real_tool_placements(robot, *states.joints)
    steps = np.linalg.norm(np.diff(tool, axis=0), axis=1)
    largest = largest_speeds(motion.task, states.s, np.maximum)
    allowed = period * np.maximum(largest[1:], largest[:-1])
    yield "tool speed", 1, (steps / allowed)[:, None], ("tool",)
