"""Predicted against re-solved changes of t_E for +1 % of every limit: ``python3 benchmarks/sensitivities.py``.

The paper's eight lines with every decomposition, the TX90L on its rail with every closed form, and two examples more.
Each limit that presses is raised by 1 % and, to tell curvature from wrong derivatives, by 0.1 %. The linearised problem
lets other limits take over within the step.
"""

from __future__ import annotations

import time
from collections.abc import Iterator
from pathlib import Path

from brachis import LimitSpec, Result, Robot, load_task, plan
from brachis.bottleneck import SensitivityCheck, check_sensitivities, sensitivities

ROOT = Path(__file__).parents[1]
STEP, SMALL_STEP = 0.01, 0.001
LARGE = 1e-4
REQUIRED = 0.05


def planar_lines() -> Iterator[tuple[str, Result]]:
    """Yield the lines of examples/02 with every joint as the redundant one."""
    limits = LimitSpec(torque=10.0, velocity=None)
    robot = Robot.from_urdf(ROOT / "robots/scara3/robot.urdf", gravity=[0, 0, 0], limits=limits)
    task = load_task(ROOT / "examples/01_scara_line.yaml").to_dict()
    for angle in range(0, 360, 45):
        for joint in ("j1", "j2", "j3"):
            line = [{"line": {"length": 1.0, "angle_deg": angle}}]
            yield f"{angle} deg, {joint}", plan(robot, {**task, "path": line, "redundant_joints": [joint]})


def rail_arm() -> Iterator[tuple[str, Result]]:
    """Yield the line of examples/03 with every joint that has a closed form as the redundant one."""
    task = load_task(ROOT / "examples/03_tx90l_rail_line.yaml").to_dict()
    for joint in ("rail", "joint_1", "joint_2", "joint_3"):
        yield f"TX90L, {joint}", plan({**task, "redundant_joints": [joint]})


def further() -> Iterator[tuple[str, Result]]:
    """Yield examples with many active limits and with a joint that none limits."""
    for name in ("04_ur10_rail_weld", "06_free_roll"):
        yield name, plan(ROOT / "examples" / f"{name}.yaml")


def print_case(name: str, result: Result) -> SensitivityCheck:
    """Print a line for every limit that costs time."""
    refined = result.attempt.refined
    assert refined is not None
    found = sensitivities(refined)
    check = check_sensitivities(refined, found, step=STEP)
    smaller = check_sensitivities(refined, found, step=SMALL_STEP)
    for entry, near in zip(check.entries, smaller.entries, strict=True):
        if not entry.predicted:
            continue
        limit = " ".join(filter(None, (str(entry.sensitivity.label), entry.sensitivity.bound.end)))
        mark = "" if abs(entry.re_solved) <= LARGE or entry.deviation <= REQUIRED else " > 5 %"
        mark += "" if entry.optimal else " not optimal"
        mark += f" other optimum {1e3 * entry.other_optimum:+.2f} ms" if entry.other_optimum else ""
        print(
            f"| {name} | {check.t_end:.4f} | {limit} | {1e3 * entry.predicted:.4f} | {1e3 * entry.re_solved:.4f} "
            f"| {100 * entry.deviation:.2f} %{mark} | {100 * near.deviation:.2f} % "
            f"| {100 * entry.linearised_deviation:.2f} % | {found.source} "
            f"| {found.residual:.0e} | {check.wall_time:.2f} s |",
            flush=True,
        )
    return check


def main() -> None:
    """Print the table and the worst deviations."""
    columns = "case", "t_E [s]", "limit", "predicted [ms]", "re-solved [ms]", "off at +1 %", "off at +0.1 %"
    columns += "linearised, off at +1 %", "multipliers", "residual", "check"
    print(f"| {' | '.join(columns)} |\n{'|---' * len(columns)}|")
    began = time.perf_counter()
    groups = {"planar lines": planar_lines(), "TX90L on a rail": rail_arm(), "further": further()}
    summary = []
    for group, cases in groups.items():
        checks = [print_case(*case) for case in cases]
        absolute = max(check.worst_deviation(LARGE) for check in checks)
        relative = max(check.worst_deviation(LARGE * check.t_end) for check in checks)
        large = [entry for check in checks for entry in check.larger(LARGE)]
        linearised = max(entry.linearised_deviation for entry in large)
        summary.append(
            f"{group}: {len(large)} changes larger than {LARGE:g} s, the worst off by {100 * absolute:.2f} % "
            f"(linearised {100 * linearised:.2f} %); of those larger than {LARGE:g} t_E the worst by "
            f"{100 * relative:.2f} %"
        )
    print("\n" + "\n".join(summary))
    print(f"{time.perf_counter() - began:.1f} s in all")


if __name__ == "__main__":
    main()
