"""The paper's example in Python: plan it, print its main figures, sample it for a controller."""

from __future__ import annotations

from pathlib import Path

import brachis

HERE = Path(__file__).parent


def main() -> brachis.Result:
    """Plan the task of ``01_scara_line.yaml`` and print the result."""
    result = brachis.plan(
        HERE.parent / "robots/scara3/robot.urdf", HERE / "01_scara_line.yaml"
    )
    print(
        f"end time {result.t_end:.4f} s with redundant joint {', '.join(result.trajectory.redundant_joints)}"
    )
    print(
        f"verified: {result.verified}, worst ratio to a limit {result.verification.worst_ratio:.6f}"
    )
    samples = result.trajectory.sample(dt=0.001)
    print(
        f"{len(samples.t)} samples at 1 kHz, largest torque {abs(samples.tau).max():.3f} Nm"
    )
    return result


if __name__ == "__main__":
    main()
