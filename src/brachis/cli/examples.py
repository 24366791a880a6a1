"""Examples of every command, and the exit codes, as the help shows them.

Run in this order the examples work, given a sweep file ``lines.yaml`` (docs/sweeps.md).
"""

from __future__ import annotations

EXIT_CODES = (
    "0    done; of a plan: planned and verified",
    "1    no verified plan; a fault of brachis; output that cannot be written",
    "2    wrong input: a file, a key, an option",
    "3    planned and verified, but a figure could not be written",
    "130  interrupted (Ctrl-C) before there was a motion",
)

EXAMPLES: dict[str, tuple[str, ...]] = {
    "": (
        "brachis new scara3                # a task for a robot that comes along",
        "brachis plan task.yaml --out out  # plan, verify, draw",
    ),
    "robots": ("brachis robots", "brachis robots --json"),
    "new": ("brachis new scara3", "brachis new gantry2 --out gantry.yaml"),
    "plan": (
        "brachis plan task.yaml --out out",
        "brachis plan task.yaml --set search.effort=single --set 'path.0.line.by=[0, 0.4]'",
    ),
    "bottleneck": ("brachis bottleneck task.yaml --set search.effort=single",),
    "verify": ("brachis verify out/result.npz",),
    "export": (
        "brachis export out/result.npz --out out/motion.csv --dt 0.004",
        "brachis export out/result.npz --out out/motion.gif --dt 0.1",
    ),
    "import": ("brachis import out/motion.csv --robot task.yaml --out out/today.npz",),
    "compare": ("brachis compare out/motion.csv --robot task.yaml",),
    "plot": ("brachis plot out/result.npz --kind torques --out out/torques.svg",),
    "report": ("brachis report out/result.npz", "brachis report out/result.npz --title 'cell 3' --out out/cell3.html"),
    "view": ("brachis view out", "brachis view out/result.npz --port 0 --no-browser"),
    "inspect": ("brachis inspect task.yaml", "brachis inspect tx90l_rail --task-space pose"),
    "compose": ("brachis compose iiwa14 --range -2 2 --velocity 2 --force 1500 --mass 50 --out cell.urdf",),
    "schema": ("brachis schema --out task.schema.json", "brachis schema --of trajectory"),
    "sweep": (
        "brachis sweep lines.yaml --jobs 2",
        "brachis sweep lines.yaml --retry  # goes on where it was ended",
    ),
}
"""By command; those of the whole program under no name."""
