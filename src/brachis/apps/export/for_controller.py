"""Motions in the units, period and format of a controller, verified as the controller runs them."""

from __future__ import annotations

import os
import re
import warnings
from collections.abc import Sequence
from dataclasses import replace
from typing import Any

import numpy as np

from brachis.apps.controller import (
    ControllerAxes,
    Profile,
    RunReport,
    axes_for,
    check_period,
    load_profile,
    verify_run,
    with_profile,
)
from brachis.apps.export.formats import FORMATS
from brachis.apps.export.programs import ProgramReport, write_program
from brachis.apps.export.rows import JointRows
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
    profile = load_profile(profile)
    axes = axes_for(motion, profile)
    name = _name_format(profile, file_name(path, "path").suffix, form)
    if name == PROGRAM:
        report = _write_program(
            motion,
            path,
            profile,
            axes,
            moves=moves,
            tolerance=tolerance,
            time_tolerance=time_tolerance,
        )
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
    period = check_period(profile, dt)
    run = verify_run(motion, profile, period=period, own_limits=own_limits)
    rows = _rows_of(motion, period, profile, axes)
    with atomic_write(path, FORMATS[name].beginning) as stream:
        FORMATS[name].writer(rows, stream)
    _warn(profile, (*run.failures, *run.remedies))
    return run


def _name_format(profile: Profile, suffix: str, form: str | None) -> str:
    """Name the format of a file for a controller: the one that is asked for, or else the first with this suffix."""
    tables = [name for name, known in FORMATS.items() if known.step is None]
    check_names("format of samples", profile.formats, tables, "profile.formats")
    suffixes = {name: FORMATS[name].suffix for name in profile.formats}
    if profile.program is not None:
        suffixes[PROGRAM] = profile.program.suffix
    same = [name for name, known in suffixes.items() if known == suffix]
    name = form or next(iter(same), suffix)
    if name not in suffixes:
        shown = (
            f"{known} ({known_suffix})" for known, known_suffix in suffixes.items()
        )
        raise InputError(
            "the controller does not accept this format",
            where="format",
            found=name or "no suffix",
            allowed=f"{', '.join(shown)}: {profile.title}",
        )
    return name


def _write_program(
    motion: Trajectory,
    path: str | os.PathLike[str],
    profile: Profile,
    axes: ControllerAxes,
    **options: Any,
) -> ProgramReport:
    """Write a program of positions; see `write_program`."""
    name = file_name(path, "path").stem
    text, report = write_program(motion, profile, axes, name, **options)
    first_line = re.escape(text.partition("\n")[0]).encode()
    beginning = rb"(?s)" + first_line + rb".{0,900}planned by brachis"
    with atomic_write(path, beginning) as stream:
        stream.write(text.encode())
    return report


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
    return JointRows(
        axes.names,
        axes.units,
        (),
        end,
        period,
        changed,
        profile.columns,
        motion.parts,
        motion.events,
    )
