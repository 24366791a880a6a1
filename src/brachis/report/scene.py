"""The motion as an animation: stick figures, the tool's trace and the figures of every joint at some times."""

from __future__ import annotations

from typing import Any

import numpy as np

from brachis.bottleneck import THRESHOLD
from brachis.plots.postures import plane_of
from brachis.plots.quantities import kinds_of, quantities
from brachis.plots.skeleton import skeleton
from brachis.report.figures import encoded
from brachis.report.motion import ReportedMotion
from brachis.report.tables import NEAR

_FRAMES = 240


def scene(motion: ReportedMotion) -> dict[str, Any]:
    """Write what the page's animation shows.

    Returns
    -------
    dict
        ``t``, ``s``, ``speed`` (of the tool) at K times; ``bones``, (K, p, 3), m; ``plane``, the two world axes that a
        planar robot moves in, or None; ``joints``, with ``name``, ``redundant`` and, for every quantity, the values
        with their unit and parts of their limits; ``levels``, the parts of a limit from which on values are marked.
    """
    trajectory = motion.trajectory
    samples = trajectory.at(np.linspace(0.0, trajectory.t_end, _FRAMES))
    robot = trajectory.robot
    joints: list[dict[str, Any]] = [
        {"name": name, "redundant": name in trajectory.redundant_joints, "prismatic": unit == "m", "quantities": []}
        for name, unit in zip(robot.joint_names, robot.position_units, strict=True)
    ]
    kinds = kinds_of(trajectory)
    for kind in kinds:
        for part in quantities(trajectory, samples, kind, degrees=motion.degrees):
            for column, joint in enumerate(part.joints.tolist()):
                entry = {"unit": part.unit, "values": encoded(part.values[:, column])}
                if part.is_limited[column]:
                    entry["ratios"] = encoded(np.abs(part.ratios[:, column]))
                joints[joint]["quantities"].append(entry)
    return {
        "t": encoded(samples.t),
        "s": encoded(samples.s),
        "speed": encoded(samples.tool_speed),
        "bones": encoded(skeleton(robot, samples.q).bones),
        "plane": plane_of(trajectory),
        "joints": joints,
        "kinds": kinds,
        "levels": {"near": NEAR, "at": THRESHOLD, "beyond": 1.0 + trajectory.task.refinement.tolerance},
    }
