"""Rows for a controller: the motion of the joints of a robot at regular times."""

from __future__ import annotations

import importlib
import warnings
from collections.abc import Sequence
from dataclasses import dataclass, replace
from types import ModuleType

import numpy as np

from brachis.apps.controller import FACTORS
from brachis.common.arguments import check_once
from brachis.errors import (
    BrachisWarning,
    InputError,
    NotInstalledError,
    check_names,
)
from brachis.trajectory import Event, MotionPart, Samples, Trajectory
from brachis.trajectory.program import check_times
from brachis.trajectory.samples import COLUMNS

_PER = {"q": "", "qd": "/s", "qdd": "/s^2", "tau": None}
"""Suffix of the position's unit in the units of each kind of column; torques are in SI units."""


class LeftOutWarning(BrachisWarning):
    """A joint that moves is missing from the exported file."""


@dataclass(frozen=True, eq=False)
class JointRows:
    """Motion of some joints at K times.

    Attributes
    ----------
    joints : tuple of str
        Names of the joints, or of the controller's axes, in the order of the columns.
    units : tuple of str
        Units of their positions: ``rad`` or ``m``, ``deg`` or ``mm``.
    left_out : tuple of str
        A sentence for every joint that moves and is not among `joints`.
    t_end, dt : float
        End time and period, s.
    samples : Samples
        The motion of these joints, in their units, and of the tool.
    quantities : tuple of str
        Quantities in a table, as prefixes of `COLUMNS`.
    parts : tuple of MotionPart
        Parts of a program.
    events : tuple of Event
        Events of a program.
    """

    joints: tuple[str, ...]
    units: tuple[str, ...]
    left_out: tuple[str, ...]
    t_end: float
    dt: float
    samples: Samples
    quantities: tuple[str, ...] = tuple(COLUMNS)
    parts: tuple[MotionPart, ...] = ()
    events: tuple[Event, ...] = ()

    @property
    def notes(self) -> tuple[str, ...]:
        """Sentences for the head of a file: on joints that are left out, on the parts, and on the events."""
        parts = (
            f"part {part.name} ({part.kind}): {part.begin:.6f} to {part.end:.6f} s"
            for part in self.parts
        )
        events = (f"event {event.name}: {event.time:.6f} s" for event in self.events)
        return (*self.left_out, *parts, *events)

    def columns(self) -> dict[str, np.ndarray]:
        """Return the columns of a table, (K,), by name: ``t``, then those of the joints with units except SI."""
        columns = {"t": self.samples.t}
        for prefix, quantity in self.samples.columns.items():
            if prefix not in self.quantities:
                continue
            per = _PER[prefix]
            table = getattr(self.samples, quantity).T
            for joint, unit, values in zip(self.joints, self.units, table, strict=True):
                is_si = unit in ("rad", "m") or per is None
                shown = "" if is_si else f" [{unit}{per}]"
                columns[f"{prefix}_{joint}{shown}"] = values
        return columns

    def in_units(self, *, degrees: bool, mm: bool) -> JointRows:
        """Return the rows with angles in degrees, lengths in mm, or both."""
        shown = {"rad": "deg" if degrees else "rad", "m": "mm" if mm else "m"}
        units = tuple(shown[unit] for unit in self.units)
        factors = np.array([FACTORS[unit] for unit in units])
        samples = self.samples
        changed = replace(
            samples,
            q=samples.q * factors,
            qdot=samples.qdot * factors,
            qddot=samples.qddot * factors,
        )
        return replace(self, units=units, samples=changed)


def rows_of(
    trajectory: Trajectory, dt: float, last: str, joints: Sequence[str] | None
) -> JointRows:
    """Sample joints of a trajectory.

    Parameters
    ----------
    trajectory : Trajectory
    dt : float
        Period, s.
    last : {"exact", "hold"}
        How the last sample is chosen; see `Trajectory.sample`.
    joints : sequence of str or None
        Joints to sample, in this order. None: all joints of the robot, without virtual ones.

    Raises
    ------
    InputError
        `dt` or `last` cannot be used, a joint is given twice, or an event is not during the motion.
    UnknownNameError
        A joint does not exist.

    Warns
    -----
    LeftOutWarning
        A joint that moves is not among `joints`.
    """
    check_events(trajectory)
    names = trajectory.joint_names
    real = names[: len(trajectory.robot.urdf_joints)]
    chosen = list(real if joints is None else joints)
    check_names("joint", chosen, names, "joints")
    check_once("joint", chosen, "joints")
    index = [names.index(name) for name in chosen]
    samples = trajectory.sample(dt, last=last)
    left_out = []
    postures = np.vstack([trajectory.q, samples.q])
    units = trajectory.robot.position_units
    for joint, unit, q in zip(names, units, postures.T, strict=True):
        is_still = np.ptp(q) <= 1e-9  # rad or m
        if is_still or joint in chosen or joint not in real:
            continue
        travel = f"{np.ptp(q):.4g} {unit} ({q.min():.4g} to {q.max():.4g} {unit})"
        left_out.append(f"joint {joint} moves by {travel} and is not in this file")
    if left_out:
        hint = "Move the missing joints with their own controller at the same time, or write all joints"
        warnings.warn(f"{'; '.join(left_out)}. {hint}", LeftOutWarning, stacklevel=3)
    columns = {
        name: getattr(samples, name)[:, index] for name in samples.columns.values()
    }
    return JointRows(
        tuple(chosen),
        tuple(units[joint_index] for joint_index in index),
        tuple(left_out),
        trajectory.t_end,
        dt,
        replace(samples, **columns),
        parts=trajectory.parts,
        events=trajectory.events,
    )


def check_events(motion: Trajectory) -> None:
    """Refuse events before or after the motion, by an InputError."""
    for issue in check_times(motion.events, motion.t_end):
        raise InputError(
            issue.message, where=issue.where, found=issue.found, allowed=issue.usual
        )


def require_library(
    module: str, user: str, *, library: str = "", extra: str = "export"
) -> ModuleType:
    """Import a module of a library that only an extra installs.

    Parameters
    ----------
    module : str
    user : str
        Feature that needs the library, for the message.
    library : str, optional
        Name of the library, if it is not the first part of the module name.
    extra : str, optional

    Raises
    ------
    NotInstalledError
    """
    try:
        return importlib.import_module(module)
    except ImportError as error:
        raise NotInstalledError(
            user, library or module.partition(".")[0], extra
        ) from error
