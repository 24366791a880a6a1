"""The eight planar lines with limits on jerk and torque rate, and what differences of neighbouring points would miss.

For every line: end times without such limits, with the jerk limited, with the torque's rate limited (s; unverified ones
are marked); then by how much differences of accelerations of neighbouring collocation points, three an interval,
understate the larger jerk at their ends, as a part of the limit: on average, and at most.
"""

from __future__ import annotations

from pathlib import Path

import numpy as np

import brachis
from committed import processor_time, save

ROOT = Path(__file__).parents[1]
JERK, TORQUE_RATE = 12.0, 20.0
"""rad/s^3 and Nm/s, all joints."""


def planned(angle_deg: float, **limits: float) -> tuple[brachis.Result, float]:
    """Plan a line with everything left open; also the processor time that it took, s."""
    task = brachis.load_task(ROOT / "examples/01_scara_line.yaml").to_dict()
    task["path"], task["redundant_joints"] = (
        [{"line": {"length": 1.0, "angle_deg": angle_deg}}],
        "auto",
    )
    task["robot"]["limits"] |= limits
    began = processor_time()
    return brachis.plan(task), processor_time() - began


def understated(result: brachis.Result) -> np.ndarray:
    """By how much differences understate the jerk between neighbouring points, as parts of the limit."""
    refined = result.candidate.refined
    assert refined is not None
    (phase,) = refined.program.phases
    t_norm = np.linspace(0.0, 1.0, 3 * phase.intervals + 1)
    state = phase.with_points(t_norm).state(refined.x)
    differences = np.abs(np.diff(state.qddot, axis=0)).max(axis=1) / (
        np.diff(t_norm) * refined.t_end
    )
    jerk = np.abs(state.qdddot).max(axis=1)
    return np.asarray(np.maximum(jerk[1:], jerk[:-1]) - differences) / JERK


def main() -> None:
    """Print a line for each line."""
    rows = []
    print(
        f"angle    no limit   jerk {JERK:g} rad/s^3   torque rate {TORQUE_RATE:g} Nm/s   missed: mean, most"
    )
    for angle in range(0, 360, 45):
        entries = []
        for limits in ({}, {"jerk": JERK}, {"torque_rate": TORQUE_RATE}):
            result, seconds = planned(angle, **limits)
            entries.append(
                f"{result.t_end:.4f} s{' ' if result.verified else '!'} in {seconds:4.1f} s"
            )
            if "jerk" in limits:
                missed = understated(result)
        rows.append(
            (
                f"{angle} deg",
                *entries,
                f"{100 * missed.mean():.1f} %, {100 * missed.max():.0f} %",
            )
        )
        print("   ".join(rows[-1]), flush=True)
    columns = (
        "line",
        "no limit",
        f"jerk {JERK:g} rad/s^3",
        f"torque rate {TORQUE_RATE:g} Nm/s",
        "missed: mean, most",
    )
    about = "End times and processor times; by how much differences of neighbouring points would understate the jerk."
    save("Limits on jerk and torque rate", columns, rows, about)


if __name__ == "__main__":
    main()
