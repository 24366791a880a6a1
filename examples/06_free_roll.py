"""The same arc with three tool orientations: turning with the path, fixed, and with free roll."""

from __future__ import annotations

from pathlib import Path

import brachis

TASK = Path(__file__).with_suffix(".yaml")
ORIENTATIONS = {
    "turning with the path": ("pose", "tangent"),
    "fixed": ("pose", "fixed"),
    "free roll": ("pose_free_roll", "fixed"),
}


def main() -> dict[str, brachis.Result]:
    """Plan the three motions, and print their end times."""
    results = {}
    for name, (space, orientation) in ORIENTATIONS.items():
        task = brachis.load_task(TASK).to_dict()
        task["task_space"] = space
        task["path"][0]["orientation"] = orientation
        result = results[name] = brachis.plan(task)
        joints = ", ".join(result.trajectory.redundant_joints)
        print(
            f"{name}: {result.t_end:.3f} s, verified: {result.verified}, redundant joints {joints}"
        )
    return results


if __name__ == "__main__":
    main()
