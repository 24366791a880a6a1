"""Comparison of a recorded run, in the units of a controller, with the plan that was run."""

from __future__ import annotations

import os
from collections.abc import Mapping
from dataclasses import asdict, dataclass
from typing import Any

import numpy as np

from brachis.apps.controller import (
    FACTORS,
    ControllerAxes,
    Profile,
    axes_for,
    load_profile,
)
from brachis.apps.recording.recording import check_units, read_recording
from brachis.common.summary import Summary
from brachis.errors import InputError
from brachis.trajectory import MotionSource, Trajectory, motion_of

_DELAYS = 401
"""Number of delays that are tried before the best one is refined: steps of 0.5 % of the longer duration."""
_ANOTHER = 1.0
"""Error of a joint, rad or m, above which a recording is not a run of the plan."""


@dataclass(frozen=True, repr=False)
class AxisTracking:
    """Deviation of one joint from the plan.

    Attributes
    ----------
    joint, axis : str
        Names of the joint in the URDF and of the axis in the controller.
    largest, rms : float
        Largest error and root-mean-square error of the joint, in `unit`.
    time : float
        Time of the largest error in the plan, s.
    unit : str
        Unit of the axis: ``rad``, ``deg``, ``m`` or ``mm``.
    torque : float or None
        Largest difference between the torques, Nm or N; None if the torque was not recorded.
    """

    joint: str
    axis: str
    largest: float
    rms: float
    time: float
    unit: str
    torque: float | None


@dataclass(frozen=True, repr=False)
class Tracking(Summary):
    """Deviations of a machine from the plan that it ran.

    Attributes
    ----------
    axes : tuple of AxisTracking
    delay : float
        Time from the file's first row to the start of the plan, s, at which the errors are smallest.
    t_end, t_end_planned : float
        Durations of the motion in the recording and in the plan, s.
    tool : float
        Largest distance of the tool from its planned position, m.
    tool_time : float
        Time of the largest distance in the plan, s.

    Examples
    --------
    >>> import tempfile
    >>> import brachis
    >>> result = brachis.plan(brachis.examples.scara_line, redundant_joints=["j1"], effort="single", intervals=8)
    >>> with tempfile.TemporaryDirectory() as folder:
    ...     run = result.export(f"{folder}/run.csv", profile="ur_servoj_500hz")
    ...     tracking = brachis.compare_run(f"{folder}/run.csv", result, "ur_servoj_500hz")
    >>> isinstance(tracking, brachis.Tracking), tracking.axes[0].axis
    (True, 'base')
    """

    axes: tuple[AxisTracking, ...]
    delay: float
    t_end: float
    t_end_planned: float
    tool: float
    tool_time: float

    def to_dict(self) -> dict[str, Any]:
        """Return plain data for JSON."""
        return asdict(self)

    def summary(self) -> Mapping[str, object]:
        """Return the entries shown to the user."""
        rows = {
            f"{axis.joint} ({axis.axis})": f"{axis.largest:.3g} {axis.unit} at {axis.time:.4g} s, "
            f"root mean square {axis.rms:.3g} {axis.unit}"
            + ("" if axis.torque is None else f", torque {axis.torque:.3g} off")
            for axis in self.axes
        }
        return {
            "duration": f"{self.t_end:.4f} s, planned {self.t_end_planned:.4f} s",
            "delay": f"{self.delay:.4f} s",
            "tool": f"{self.tool:.3g} m off at {self.tool_time:.4g} s",
            **rows,
        }


def compare_run(
    recorded: str | os.PathLike[str],
    planned: MotionSource,
    profile: Profile | str,
    *,
    units: Mapping[str, str | None] | None = None,
) -> Tracking:
    """Compare a recording of a run with the plan.

    Parameters
    ----------
    recorded : path
        CSV file with the time, a column for each axis (``A1``, ``q_A1 [deg]``, ...) and, if known, torques
        (``tau_A1``).
    planned : Trajectory, Result or path
        The motion that was run.
    profile : Profile, str or path
        Profile with the names and units of the axes.
    units : mapping, optional
        Units that differ from the profile's, as for `import_motion`.

    Raises
    ------
    TaskError
        The file cannot be read; the message names line and column.
    InputError
        The profile does not fit the robot, or the recording is not a run of the plan.

    Examples
    --------
    >>> import tempfile
    >>> import brachis
    >>> result = brachis.plan(brachis.examples.scara_line, redundant_joints=["j1"], effort="single", intervals=8)
    >>> with tempfile.TemporaryDirectory() as folder:
    ...     run = result.export(f"{folder}/run.csv", profile="kuka_rsi_4ms")
    ...     tracking = brachis.compare_run(f"{folder}/run.csv", result, "kuka_rsi_4ms")
    >>> tracking.tool < 1e-6
    True
    """
    motion = motion_of(planned, "planned")
    profile = load_profile(profile)
    axes = axes_for(motion, profile)
    recording = read_recording(recorded, axes, check_units(units or {}))
    factors = np.array([FACTORS[unit] for unit in axes.units])
    q = axes.decode(recording.q * factors)
    delay = _find_delay(motion, axes, recording.t, q)
    plan_times = np.clip(recording.t - delay, 0.0, motion.t_end)
    planned_q = motion.position(plan_times)
    run_q = planned_q.copy()
    run_q[:, axes.index] = q
    errors = np.abs(q - planned_q[:, axes.index])
    if errors.max() > _ANOTHER:
        joint = axes.joints[int(np.argmax(errors.max(axis=0)))]
        raise InputError(
            "this recording is not a run of the plan",
            where=str(recorded),
            found=f"{joint} deviates by {errors.max():.3g} rad or m from the plan",
            allowed=f"at most {_ANOTHER:g} rad or m; check the profile and the units",
        )
    torques: list[float | None] = [None] * len(axes.names)
    if recording.tau is not None and motion.robot.has_masses:
        planned_tau = axes.encode_torques(motion.torque(plan_times))
        torques = np.abs(recording.tau - planned_tau).max(axis=0).tolist()
    robot = motion.robot
    run_places, _ = robot.tool_placements(robot.of_real_joints(run_q))
    planned_places, _ = robot.tool_placements(robot.of_real_joints(planned_q))
    away = np.linalg.norm(run_places - planned_places, axis=1)
    worst = int(np.argmax(away))
    rows = map(
        AxisTracking,
        axes.joints,
        axes.names,
        (factors * errors.max(axis=0)).tolist(),
        (factors * np.sqrt(np.mean(errors**2, axis=0))).tolist(),
        plan_times[errors.argmax(axis=0)].tolist(),
        axes.units,
        torques,
    )
    return Tracking(
        axes=tuple(rows),
        delay=delay + recording.begin,
        t_end=float(recording.t[-1]),
        t_end_planned=motion.t_end,
        tool=float(away[worst]),
        tool_time=float(plan_times[worst]),
    )


def _find_delay(
    motion: Trajectory, axes: ControllerAxes, t: np.ndarray, q: np.ndarray
) -> float:
    """Find the delay, s, with which joints q, (K, m), rad or m, at times t, (K,), s, are closest to a motion."""
    from scipy.optimize import minimize_scalar

    def miss(delay: float) -> float:
        """Return the mean error of the joints; a single large error hardly shifts it."""
        planned = motion.position(np.clip(t - delay, 0.0, motion.t_end))
        return float(np.mean(np.abs(q - planned[:, axes.index])))

    longest = 0.5 * max(t[-1], motion.t_end)
    coarse = np.linspace(-longest, longest, _DELAYS)
    near = coarse[np.argmin([miss(delay) for delay in coarse])]
    step = coarse[1] - coarse[0]
    bounds = (near - step, near + step)
    return float(minimize_scalar(miss, bounds=bounds, options={"xatol": 1e-9}).x)
