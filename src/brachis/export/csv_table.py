"""CSV: one row per sample, SI units, the shortest digits that read back exactly."""

from __future__ import annotations

import csv
import io
import os
from collections.abc import Sequence

import numpy as np

from brachis.export.rows import rows_of
from brachis.files import atomic_write
from brachis.trajectory import Trajectory


def export_csv(
    trajectory: Trajectory,
    path: str | os.PathLike[str],
    dt: float,
    *,
    last: str = "exact",
    joints: Sequence[str] | None = None,
) -> None:
    """Write time, joint positions, velocities, accelerations and torques.

    The header is ``t``, then ``q_<joint>`` of all joints, ``qd_<joint>``, ``qdd_<joint>`` and ``tau_<joint>``, in
    s, rad (m), rad/s (m/s), rad/s^2 (m/s^2) and Nm (N). Where `joints` leaves out a joint that moves, a line that
    begins with ``#`` stands before the header. See `brachis.export.write` for the parameters.

    Examples
    --------
    >>> from brachis import plan
    >>> from brachis.export import export_csv
    >>> trajectory = plan("examples/01_scara_line.yaml").trajectory
    >>> export_csv(trajectory, "motion.csv", dt=0.004)  # doctest: +SKIP
    """
    rows = rows_of(trajectory, dt, last, joints)
    names, values = zip(*rows.columns(), strict=True)
    with atomic_write(path) as stream:
        text = io.TextIOWrapper(stream, encoding="utf-8", newline="")
        text.writelines(f"# brachis: {sentence}\n" for sentence in rows.left_out)
        writer = csv.writer(text, lineterminator="\n")
        writer.writerow(names)
        writer.writerows(np.column_stack(values).tolist())  # floats as repr: the shortest text that reads back the same
        text.flush()
        text.detach()  # the stream is atomic_write's to close
