"""A table of samples as comma-separated values."""

from __future__ import annotations

import csv
import io
import os

import numpy as np

from brachis.files import atomic_write
from brachis.trajectory import Trajectory

QUANTITIES = {"q": "q", "qd": "qdot", "qdd": "qddot", "tau": "tau"}
"""Prefix of the columns and the attribute of `Samples`, in the order of the columns."""


def export_csv(trajectory: Trajectory, path: str | os.PathLike[str], dt: float, *, last: str = "exact") -> None:
    r"""Write time, joint positions, velocities, accelerations and torques at a controller's rate.

    The first line names the columns: ``t``, then ``q_<joint>`` for all joints in chain order, then ``qd_<joint>``,
    ``qdd_<joint>`` and ``tau_<joint>``. Units are SI: s; rad or m and their time derivatives; Nm or N. Every number
    reads back as the very same float. UTF-8, comma, one ``\n`` per line.

    Parameters
    ----------
    trajectory : Trajectory
    path : path
        File to write; an older one is replaced, and kept if writing fails.
    dt : float
        Period, s. Rows are at 0, dt, 2 dt, ...
    last : {"exact", "hold"}, optional
        The last row: at t_end exactly, so that the last period may be shorter; or at the first multiple of `dt` that
        is not before t_end, with the end posture held at rest there. See `Trajectory.sample`.

    Raises
    ------
    InputError
        `dt` is not a usable period, `last` is unknown, or the file cannot be written.

    Examples
    --------
    >>> from brachis import plan
    >>> from brachis.export import export_csv
    >>> trajectory = plan("examples/01_scara_line.yaml").trajectory
    >>> export_csv(trajectory, "motion.csv", dt=0.004)  # doctest: +SKIP
    """
    samples = trajectory.sample(dt, last=last)
    header = ["t", *(f"{prefix}_{joint}" for prefix in QUANTITIES for joint in trajectory.joint_names)]
    table = np.column_stack([samples.t, *(getattr(samples, name) for name in QUANTITIES.values())])
    with atomic_write(path) as stream:
        text = io.TextIOWrapper(stream, encoding="utf-8", newline="")
        writer = csv.writer(text, lineterminator="\n")
        writer.writerow(header)
        writer.writerows(row.tolist() for row in table)  # floats as repr: the shortest text that reads back the same
        text.flush()
        text.detach()  # the stream is atomic_write's to close
