"""What limits are predicted to cost, beside solving again: ``python benchmarks/sensitivities.py [--save]``.

The paper's eight lines with every decomposition, the TX90L on its rail with every closed form, two examples more, and
every kind of limit on three of the lines and on the TX90L. The derivative from the multipliers is compared with central
differences, every limit 0.03 % wider and narrower, and what it promises for +1 % with solving again at +1 %. The latter
differs by what is of second order, and by limits that take over within the step: the linearised problem knows these.
"""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from brachis import LimitSpec, Result, Robot, Trajectory, load_task, plan
from brachis.apps.bottleneck import CheckedSensitivity, check_sensitivities
from committed import processor_time, save

ROOT = Path(__file__).parents[1]
STEP, SMALLER_STEP, SMALL_STEP = 0.01, 0.001, 0.0003
LARGE = 1e-4
REQUIRED = 0.05
UNHURRIED = {"time_limit": 600.0}
"""No busy machine ends a search early."""
HELD = 0.7
"""Of what the motion without a limit reaches: what it may reach with it."""
CURVE = ((0.0, 1.0), (0.3, 1.0), (1.0, 0.3))
"""Torques over speeds, parts of what the free motion reaches."""


def planar_lines() -> Iterator[tuple[str, Result]]:
    """Yield the lines of examples/02 with every joint as the redundant one."""
    limits = LimitSpec(torque=10.0, velocity=None)
    robot = Robot.from_urdf(
        ROOT / "robots/scara3/robot.urdf", gravity=[0, 0, 0], limits=limits
    )
    task = load_task(ROOT / "examples/01_scara_line.yaml").to_dict()
    for angle in range(0, 360, 45):
        for joint in ("j1", "j2", "j3"):
            line = [{"line": {"length": 1.0, "angle_deg": angle}}]
            yield (
                f"{angle} deg, {joint}",
                plan(
                    robot,
                    {
                        **task,
                        "path": line,
                        "redundant_joints": [joint],
                        "search": UNHURRIED,
                    },
                ),
            )


def rail_arm() -> Iterator[tuple[str, Result]]:
    """Yield the line of examples/03 with every joint that has a closed form as the redundant one."""
    task = load_task(ROOT / "examples/03_tx90l_rail_line.yaml").to_dict()
    for joint in ("rail", "joint_1", "joint_2", "joint_3"):
        yield (
            f"TX90L, {joint}",
            plan({**task, "redundant_joints": [joint], "search": UNHURRIED}),
        )


def further() -> Iterator[tuple[str, Result]]:
    """Yield examples with many active limits and with a joint that none limits."""
    for name in ("04_ur10_rail_weld", "06_free_roll"):
        yield (
            name,
            plan(
                {
                    **load_task(ROOT / f"examples/{name}.yaml").to_dict(),
                    "search": UNHURRIED,
                }
            ),
        )


def kinds() -> Iterator[tuple[str, Result]]:
    """Yield motions held back by every kind of limit that the free motion exceeds."""
    scara = load_task(ROOT / "examples/01_scara_line.yaml").to_dict()
    lines = {
        f"{angle} deg": [{"line": {"length": 1.0, "angle_deg": angle}}]
        for angle in (0, 45, 90)
    }
    tasks = {name: {**scara, "path": line} for name, line in lines.items()}
    tasks["TX90L"] = load_task(ROOT / "examples/03_tx90l_rail_line.yaml").to_dict()
    for name, task in tasks.items():
        single = {
            **task,
            "search": {**UNHURRIED, "effort": "single", "least_motion": False},
        }
        for kind, (joints, tool) in held_back(plan(single).trajectory).items():
            limits = {**(task["robot"].get("limits") or {}), **joints}
            robot = {**task["robot"], "limits": limits}
            yield (
                f"{name}, {kind}",
                plan({**single, "robot": robot, "tool_limits": tool}),
            )


def held_back(free: Trajectory) -> dict[str, tuple[dict[str, Any], dict[str, Any]]]:
    """Limits of joints and of the tool, by name, that a motion exceeds."""
    t = np.linspace(0.0, free.t_end, 4001)
    motion, names = free.at(t), free.joint_names
    positions, _ = free.robot.tool_placements(motion.q)
    velocity = np.gradient(positions, t, axis=0)
    speed = np.linalg.norm(velocity, axis=1).max()
    power = np.abs(motion.tau * motion.qdot)
    fastest, strongest = np.abs(motion.qdot).max(axis=0), np.abs(motion.tau).max(axis=0)
    rms = np.sqrt(np.trapezoid(motion.tau**2, t, axis=0) / free.t_end)
    jerk = np.abs(free.jerk(t)).max(axis=0)
    rate = np.abs(np.gradient(motion.tau, t, axis=0)).max(axis=0)
    curves = {
        name: [[x * v, y * tau] for x, y in CURVE]
        for name, v, tau in zip(names, fastest, strongest, strict=True)
    }
    return {
        "acceleration": (
            {"acceleration": (HELD * np.abs(motion.qddot).max(axis=0)).tolist()},
            {},
        ),
        "jerk": ({"jerk": (HELD * jerk).tolist()}, {}),
        "torque rate": ({"torque_rate": (HELD * rate).tolist()}, {}),
        "power": ({"power": (HELD * power.max(axis=0)).tolist()}, {}),
        "total power": (
            {
                "total_power": HELD
                * np.abs(np.sum(motion.tau * motion.qdot, axis=1)).max()
            },
            {},
        ),
        "torque that falls with speed": ({"torque_speed": curves}, {}),
        "rms torque": ({"rms_torque": (0.95 * rms).tolist()}, {}),
        "tool speed": ({}, {"speed": HELD * speed}),
        "tool acceleration": (
            {},
            {
                "acceleration": HELD
                * np.linalg.norm(np.gradient(velocity, t, axis=0)[5:-5], axis=1).max()
            },
        ),
        "process speed": (
            {},
            {"process_speed": {"speed": 0.4 * speed, "s": [0.3, 0.7]}},
        ),
    }


@dataclass(frozen=True)
class Compared:
    """One limit of one motion: wider by 1 %, by 0.1 %, and both ways by 0.03 %."""

    at_step: CheckedSensitivity
    nearer: CheckedSensitivity
    wider: CheckedSensitivity
    narrower: CheckedSensitivity

    @property
    def kind(self) -> str:
        label = self.at_step.sensitivity.label
        tool = "tool " if label.subject.startswith("tool") else ""
        return tool + label.kind.replace("force", "torque")

    @property
    def large(self) -> bool:
        return max(abs(self.at_step.predicted), abs(self.at_step.re_solved)) > LARGE

    @property
    def optimal(self) -> bool:
        return self.at_step.optimal and self.wider.optimal and self.narrower.optimal

    @property
    def central(self) -> float:
        """Change for `STEP` by central differences, s."""
        return (
            0.5 * (self.wider.re_solved - self.narrower.re_solved) * STEP / SMALL_STEP
        )

    @property
    def off(self) -> float:
        """How far the prediction is off it, as a fraction."""
        return (
            abs(self.at_step.predicted - self.central) / abs(self.central)
            if self.central
            else np.inf
        )

    def __str__(self) -> str:
        """Return the cells of its line."""
        entry = self.at_step
        limit = " ".join(
            filter(None, (str(entry.sensitivity.label), entry.sensitivity.side))
        )
        marks = ["not optimal"] * (not self.optimal) + ["> 5 %"] * (
            self.large and self.off > REQUIRED
        )
        marks += [f"other optimum {1e3 * entry.other_optimum:+.2f} ms"] * bool(
            entry.other_optimum
        )
        return (
            f"{limit} | {1e3 * entry.predicted:.4f} | {1e3 * self.central:.4f} | {100 * self.off:.2f} % "
            f"| {100 * self.nearer.deviation:.2f} % "
            f"| {1e3 * entry.re_solved:.4f} | {100 * entry.deviation:.2f} % | {100 * entry.linearised_deviation:.2f} % "
            f"| {', '.join(marks)}"
        )


def compared(name: str, result: Result) -> list[Compared]:
    """Print a line for every limit that costs time."""
    refined = result.candidate.optimum
    found = result.sensitivities
    checks = [
        check_sensitivities(refined, found, step=step)
        for step in (STEP, SMALLER_STEP, SMALL_STEP, -SMALL_STEP)
    ]
    limits = [
        Compared(*entries)
        for entries in zip(*(check.entries for check in checks), strict=True)
    ]
    limits = [each for each in limits if each.at_step.predicted]
    for each in limits:
        print(
            f"| {name} | {checks[0].t_end:.4f} | {each} | {found.residual:.0e} |",
            flush=True,
        )
    return limits


def worst(title: str, limits: list[Compared]) -> tuple[str, ...]:
    """Line of the summary."""
    large = [each for each in limits if each.large]
    offs = [each.off for each in large]
    further = (
        ("nearer", "deviation"),
        ("at_step", "deviation"),
        ("at_step", "linearised_deviation"),
    )
    solved = [
        [getattr(getattr(each, check), figure) for each in large]
        for check, figure in further
    ]
    cells = [max(values, default=0.0) for values in (offs, *solved)]
    within = sum(off <= REQUIRED for off in offs)
    return (
        title,
        f"{within} of {len(large)}",
        *(f"{100 * cell:.1f} %" for cell in cells),
    )


def main() -> None:
    """Print the table and the worst deviations."""
    columns = (
        "case",
        "t_E [s]",
        "limit",
        "predicted [ms]",
        "central [ms]",
        "off",
        "off at +0.1 %",
        "at +1 % [ms]",
    )
    columns += "off at +1 %", "linearised, off at +1 %", "marks", "residual"
    print(f"| {' | '.join(columns)} |\n{'|---' * len(columns)}|")
    began, by_kind = processor_time(), defaultdict[str, list[Compared]](list)
    for case in (planar_lines, rail_arm, further, kinds):
        for name, result in case():
            for each in compared(name, result):
                by_kind[each.kind].append(each)
    everything = [each for limits in by_kind.values() for each in limits]
    rows = [worst(kind, limits) for kind, limits in by_kind.items()] + [
        worst("all", everything)
    ]
    columns = (
        "limit",
        "within 5 % of central differences",
        "worst",
        "worst at +0.1 %",
        "worst at +1 %",
        "worst linearised at +1 %",
    )
    print("\n" + "\n".join(" | ".join(row) for row in (columns, *rows)))
    print(
        f"solved again without an optimum: {sum(not each.optimal for each in everything)} of {len(everything)}"
    )
    print(f"{processor_time() - began:.1f} s of processor time in all")
    about = (
        "Changes of the end time by more than 0.1 ms for a limit that is 1 % wider: the derivative from the "
        "multipliers beside central differences over 0.03 % either way, then beside solving again with the limit 0.1 % "
        "and 1 % wider, and what the linearised problem says at 1 %."
    )
    save("What limits cost, beside solving again", columns, rows, about)


if __name__ == "__main__":
    main()
