"""A new kind of joint limit is a row of the table with its keyword, a class and a formula: three files change."""

import os
import shutil
import subprocess
import sys
from pathlib import Path

import brachis

PACKAGE = Path(brachis.__file__).parent
LEAST = 0.9

# By file: where something is added in front of a text, and what.
ADDED = {
    "task/limit_kinds.py": {
        '    LimitKind(\n        "jerk",': """\
    LimitKind(
        "mean_speed",
        {"rad": "rad/s", "m": "m/s"},
        "Largest root mean square of the velocity over the whole motion.",
        scale="limits of mean speeds",
    ),
""",
        "    jerk: StatedLimit\n": "    mean_speed: StatedLimit\n",
    },
    "limits/joint.py": {
        "JOINT_LIMITS = {": """\
class MeanSpeedLimit(RmsTorqueLimit):
    kind = "mean_speed"

    def quantity(self, motion):
        return motion.qdot

    def quantity_partials(self, motion):
        every = np.broadcast_to(np.eye(self._robot.n), (len(motion.q), self._robot.n, self._robot.n))
        return Partials(0.0 * every, every, 0.0 * every)


""",
        "        JerkLimit,\n": "        MeanSpeedLimit,\n",
    },
    "verify/limits/joint.py": {
        "JOINT_CHECKS: ": """\
def _worst_mean_speed(given):
    limit = given.robot.limits.mean_speed
    states = given.states
    if not np.isfinite(limit).any():
        return None
    mean = np.trapezoid(states.qdot**2, states.t, axis=0) / states.t[-1]
    ratios = np.sqrt(mean) / limit
    joint = int(np.argmax(ratios))
    return Worst(float(ratios[joint]), given.robot.joint_names[joint], float(states.t[-1]))


""",
        '    "jerk": ': '    "mean_speed": _worst_mean_speed,\n',
    },
}
LINE = Path(__file__).parents[2] / "examples/01_scara_line.yaml"
PLAN = f"""
import brachis
import numpy as np

LINE = {str(LINE)!r}
quick = dict(redundant_joints=["j1"], effort="single", intervals=8, least_motion=False)
free = brachis.plan(LINE, **quick)
checks = free.verification.checks
assert "mean speed ratio" not in [check.name for check in checks]
moments = np.linspace(0.0, free.t_end, 500)
speed = float((free.trajectory.at(moments).qdot ** 2).mean(axis=0).max() ** 0.5)
limits = {{"mean_speed": {LEAST} * speed / 0.5, "scale": {{"mean_speed": 0.5}}}}
result = brachis.plan(LINE, limits=limits, **quick)
(check,) = [each for each in result.verification.checks if each.name == "mean speed ratio"]
assert result.verified and 0.999 < check.value <= check.allowed, check
assert result.t_end > free.t_end
saved = result.task.robot.limits.mean_speed
report = brachis.bottleneck.report(result)
assert "mean speed" in {{entry.label.kind for entry in report.sensitivities.limits}}
print(sorted(result.trajectory.robot.limits.mean_speed))
"""


def test_three_files_add_a_kind_of_joint_limit(tmp_path):
    ignored = shutil.ignore_patterns("__pycache__")
    shutil.copytree(PACKAGE, tmp_path / "brachis", ignore=ignored)
    for name, additions in ADDED.items():
        file = tmp_path / "brachis" / name
        text = file.read_text()
        for place, addition in additions.items():
            assert text.count(place) == 1, (name, place)
            text = text.replace(place, addition + place)
        file.write_text(text)
    done = subprocess.run(
        [sys.executable, "-c", PLAN],
        env={**os.environ, "PYTHONPATH": str(tmp_path)},
        capture_output=True,
        text=True,
        check=False,
    )
    assert done.returncode == 0, done.stderr
    assert done.stdout.startswith("[")
