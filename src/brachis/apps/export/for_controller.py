"""Motions in the units, period and format of a controller, verified as the controller runs them."""

from __future__ import annotations

import os
import re
import warnings
from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from brachis.apps.controller import (
    ControllerAxes,
    Profile,
    RunReport,
    axes_for,
    load_profile,
    verify_run,
    with_profile,
)
from brachis.apps.export.formats import FORMATS, name_format
from brachis.apps.export.programs import ProgramReport, write_program
from brachis.apps.export.rows import JointRows, check_events
from brachis.common.files import atomic_write, file_name
from brachis.errors import BrachisWarning, InputError, check_names
from brachis.robot.custom_limits import LimitModel
from brachis.trajectory import MotionSource, Trajectory, motion_of
from brachis.verify import verify_trajectory

PROGRAM = "program"
"""Name of the format for programs of positions in the language of the profile."""


class RunWarning(BrachisWarning):
    """A motion exceeds limits when the controller runs it."""


def write_for_controller(
    trajectory: MotionSource,
    path: str | os.PathLike[str],
    profile: Profile | str,
    *,
    form: str | None = None,
    dt: float | None = None,
    moves: str = "joint",
    tolerance: float = 1e-3,
    time_tolerance: float = 0.01,
    own_limits: Sequence[LimitModel] = (),
) -> RunReport | ProgramReport:
    """Write a motion for a controller.

    Parameters
    ----------
    trajectory : Trajectory, Result or path
        A motion, or its file.
    path : path
        File to write. Its suffix sets the format.
    profile : Profile, str or path
        Profile of the controller; see `brachis.load_profile`.
    form : str, optional
        Name of the format; ``program`` for a program of positions.
    dt : float, optional
        Period of samples, s. By default the period of the profile.
    moves : {"joint", "linear"}, optional
        For programs: whether the joints or the tool move on straight lines between positions.
    tolerance, time_tolerance : float, optional
        For programs: maximum distance of the tool from the path, m and rad, and maximum difference in time, s.
    own_limits : sequence of LimitModel, optional
        The user's own limits with which the motion was planned.

    Returns
    -------
    RunReport or ProgramReport
        For samples, their verification as the controller runs them; for a program, its deviation from the motion.

    Raises
    ------
    InputError
        The profile does not fit the robot, or does not allow the format or the period; a joint that moves has no axis;
        no program is within the tolerances; or the file cannot be written.

    Warns
    -----
    RunWarning
        The motion exceeds limits when the controller runs it. The file is still written.

    Examples
    --------
    >>> import brachis
    >>> from brachis import export
    >>> trajectory = brachis.plan("examples/03_tx90l_rail_line.yaml").trajectory
    >>> export.write_for_controller(trajectory, "motion.csv", "kuka_rsi_4ms").passed  # doctest: +SKIP
    True
    """
    motion = motion_of(trajectory)
    check_events(motion)
    profile = load_profile(profile)
    axes = axes_for(motion, profile)
    tables = [known for known, table in FORMATS.items() if table.step is None]
    check_names("format of samples", profile.formats, tables, "profile.formats")
    suffixes = {known: FORMATS[known].suffix for known in profile.formats}
    if profile.program is not None:
        suffixes[PROGRAM] = profile.program.suffix
    name = name_format(path, form, suffixes, f"format of {profile.title}")
    if name == PROGRAM:
        text, report = write_program(
            motion,
            profile,
            axes,
            file_name(path, "path").stem,
            moves=moves,
            tolerance=tolerance,
            time_tolerance=time_tolerance,
        )
        first_line = re.escape(text.partition("\n")[0]).encode()
        beginning = rb"(?s)" + first_line + rb".{0,900}planned by brachis"
        with atomic_write(path, beginning) as stream:
            stream.write(text.encode())
        limited = with_profile(motion, profile, axes)
        verification = verify_trajectory(limited, own_limits=own_limits)
        _warn(profile, verification.failures)
        return replace(report, failures=verification.failures)
    if moves != "joint":
        raise InputError(
            "samples have no moves",
            where="moves",
            found=moves,
            allowed="this option with programs of positions",
        )
    run = verify_run(motion, profile, period=dt, own_limits=own_limits)
    rows = _rows_of(motion, run.period, profile, axes)
    with atomic_write(path, FORMATS[name].beginning) as stream:
        FORMATS[name].writer(rows, stream)
    _warn(profile, (*run.failures, *run.remedies))
    return run


def _warn(profile: Profile, reasons: Sequence[str]) -> None:
    """Warn of limits that a run breaks."""
    if reasons:
        text = "; ".join(reasons)
        warnings.warn(f"{profile.title}: {text}", RunWarning, stacklevel=3)


def _rows_of(
    motion: Trajectory, period: float, profile: Profile, axes: ControllerAxes
) -> JointRows:
    """Sample a motion in the units of a controller's axes."""
    samples = motion.sample(period, last=profile.last)
    q = axes.encode(samples.q)
    if profile.decimals is not None:
        q = np.round(q, profile.decimals) + 0.0
    changed = replace(
        samples,
        q=q,
        qdot=axes.encode_rates(samples.qdot),
        qddot=axes.encode_rates(samples.qddot),
        tau=None if samples.tau is None else axes.encode_torques(samples.tau),
    )
    end = motion.t_end
    rows = JointRows(axes.names, axes.units, (), end, period, changed, profile.columns)
    return replace(rows, parts=motion.parts, events=motion.events)
