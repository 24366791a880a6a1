"""URScript: a program of servoj commands for Universal Robots' arms."""

from __future__ import annotations

import os
from collections.abc import Sequence

import numpy as np

from brachis.apps.export.rows import JointRows, rows_of
from brachis.common.files import atomic_write
from brachis.errors import InputError
from brachis.trajectory import Trajectory

_LOOKAHEAD = 0.03
_GAIN = 300
"""s, the shortest that servoj takes; proportional gain, the manual's default."""
_NEAR = 0.005
"""How far from the start posture the arm may be when the program begins, rad."""


def export_urscript(
    trajectory: Trajectory,
    path: str | os.PathLike[str],
    dt: float,
    *,
    last: str = "hold",
    joints: Sequence[str] | None = None,
) -> None:
    """Write a program with one ``servoj`` a period; see `brachis.export.write` for the parameters.

    The program halts with a message where the arm is not at the start posture, and moves nothing then.

    Raises
    ------
    InputError
        There are other joints than six revolute ones; an arm on a rail is written with its six as `joints`, and the
        rail, which its own controller moves at the same time, in another format.
    """
    rows = rows_of(trajectory, dt, last, joints)
    if rows.units != ("rad",) * 6:
        raise InputError(
            "servoj takes the angles of six joints",
            where="joints",
            found=", ".join(
                f"{name} ({unit})"
                for name, unit in zip(rows.joints, rows.units, strict=True)
            ),
            allowed="six revolute joints, from the base on",
            hint="Name the arm's six as joints, and write others, such as a rail, in another format",
        )
    with atomic_write(path) as stream:
        stream.write(("\n".join(_lines(rows, trajectory.t_end)) + "\n").encode())


def _lines(rows: JointRows, t_end: float) -> list[str]:
    """Return the program's lines; a command leads to its row's posture within the period before it."""
    first, *postures = (f"[{', '.join(map(repr, row))}]" for row in rows.q.tolist())
    periods = np.diff(rows.t).round(12).tolist()
    moves = [
        f"  servoj({posture}, 0, 0, {period!r}, {_LOOKAHEAD}, {_GAIN})"
        for posture, period in zip(postures, periods, strict=True)
    ]
    return [
        "def brachis_motion():",
        f"  # {len(postures)} periods, {t_end:.6g} s; joints {', '.join(rows.joints)}, rad",
        *(f"  # {sentence}" for sentence in rows.left_out),
        f"  start = {first}",
        "  now = get_actual_joint_positions()",
        "  i = 0",
        "  while i < 6:",
        f"    if norm(now[i] - start[i]) > {_NEAR}:",
        '      popup("The arm is not at the start posture of the motion", error=True, blocking=True)',
        "      halt",
        "    end",
        "    i = i + 1",
        "  end",
        *moves,
        "  stopj(10)",
        "end",
        "brachis_motion()",
    ]
