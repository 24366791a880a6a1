"""The planar arm repeats a circle without a stop, and draws it once from rest to rest.

Usage: python examples/10_periodic_circle.py
"""

from __future__ import annotations

from pathlib import Path

import numpy as np

import brachis

TASK = Path(__file__).with_suffix(".yaml")


def plan_both() -> dict[str, brachis.Result]:
    """Plan the periodic motion, and the motion from rest to rest, whose end posture is free."""
    task = brachis.load_task(TASK).to_dict()
    return {
        "periodic": brachis.plan(task),
        "rest to rest": brachis.plan({**task, "boundary": {}}),
    }


def turns(
    trajectory: brachis.Trajectory, count: int, dt: float
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Sample a periodic motion over several turns: times (K,), joint positions (K, n) and torques (K, n)."""
    t = np.arange(0.0, count * trajectory.t_end, dt)
    once = np.mod(t, trajectory.t_end)
    return t, trajectory.position(once), trajectory.torque(once)


def main() -> dict[str, brachis.Result]:
    """Plan both motions and print how long a turn takes."""
    results = plan_both()
    for name, result in results.items():
        print(f"{name}: {result.t_end:.3f} s a turn, verified: {result.verified}")
    t, q, tau = turns(results["periodic"].trajectory, count=3, dt=1e-4)
    steps = np.abs(np.diff(q, axis=0)).max(), np.abs(np.diff(tau, axis=0)).max()
    print(
        f"three turns, {t[-1]:.2f} s, in steps of 0.1 ms: {steps[0]:.1e} rad and {steps[1]:.3f} Nm at most"
    )
    return results


if __name__ == "__main__":
    main()
