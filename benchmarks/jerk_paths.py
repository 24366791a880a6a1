"""Seeded paths of a seven-joint arm with jerk limits, timed by brachis and by copp-py's third-order solver.

Usage: python benchmarks/jerk_paths.py [--count 20] [--first 0] [--intervals 100] [--stations 1601] [--save]

The paths, and the limits on velocity, acceleration and torque, are those of `joint_paths`; the jerk of every joint is
limited as well, and the acceleration is zero at both ends. brachis plans cubic splines s(t), refined and verified.
copp-py takes the very same path with its derivatives at even stations, and its convex programs, each about the last
one's answer, are solved until the end time settles. What comes out is looked at between its stations, by the same
limits.
"""

from __future__ import annotations

import argparse

import copp_py as copp
import numpy as np
import pinocchio as pin

import brachis
import joint_paths
from brachis.path import Path, path_of
from brachis.robot import Robot, bind
from committed import processor_time, save

SETTLED, MOST_ROUNDS = 1e-5, 20
WITHIN = 1.002
"""Largest ratio to a limit between stations with which a motion passes the dense check."""
BETWEEN = 5


def case(seed: int, intervals: int) -> brachis.Task:
    """Return a task of `joint_paths` with jerk limits, and acceleration zero at both ends."""
    content = joint_paths.case(seed, intervals).to_dict()
    rng = np.random.default_rng(seed + 10_000)
    acceleration = np.array(content["robot"]["limits"]["acceleration"])
    content["robot"]["limits"]["jerk"] = (
        (acceleration * rng.uniform(10.0, 30.0, len(acceleration))).round(1).tolist()
    )
    content["spline"]["rest"] = "full"
    return brachis.load_task(content)


def derivatives(path: Path, s: np.ndarray) -> tuple[np.ndarray, ...]:
    """Postures and their first three derivatives by s, each (S, n)."""
    sample = path.sample(s)
    return sample.target, sample.xi, sample.xi_ds, sample.xi_dds


def by_copp(robot: Robot, path: Path, stations: int) -> tuple[float, float]:
    """Time a path with copp-py; return the end time, s, and the largest ratio to a limit between its stations."""
    s = np.linspace(0.0, 1.0, stations)
    limits, data = robot.limits, robot.model.createData()
    theirs = copp.Robot(robot.n, capacity=stations)
    theirs.append_s(s)
    q, q_ds, q_dds, q_ddds = derivatives(path, s)
    theirs.set_q(q, q_ds, q_dds, 0, dddq=q_ddds)
    theirs.add_velocity_limits(
        limits.velocity, -limits.velocity, start_idx_s=0, length=stations
    )
    theirs.add_acceleration_limits(
        limits.acceleration, -limits.acceleration, start_idx_s=0, length=stations
    )
    theirs.set_inverse_dynamics(
        lambda *state: np.asarray(pin.rnea(robot.model, data, *state))
    )
    theirs.add_torque_limits(
        limits.torque, -limits.torque, start_idx_s=0, length=stations
    )
    second = copp.solver.topp2_ra
    speed_squared = second.solve(
        second.Problem(theirs.constraints, (0, stations - 1)), second.Options()
    )
    theirs.constraints.amax_substitute(speed_squared, 0)
    theirs.add_jerk_limits(limits.jerk, -limits.jerk, start_idx_s=0, length=stations)
    third, times, acceleration = copp.solver.topp3_socp, [np.inf], None
    for _ in range(MOST_ROUNDS):
        problem = third.Problem(
            theirs.constraints, speed_squared, b_linearization=acceleration
        )
        profile = third.solve(problem, third.Options())
        speed_squared, acceleration = np.array(profile.a), np.array(profile.b)
        times.append(float(copp.interpolation.s_to_t_topp3(s, profile, 0.0)[0]))
        if abs(times[-1] / times[-2] - 1.0) < SETTLED:
            break
    return times[-1], worst_between(robot, path, s, speed_squared, acceleration)


def worst_between(
    robot: Robot, path: Path, s: np.ndarray, a: np.ndarray, b: np.ndarray
) -> float:
    """Largest ratio to a limit where b = d2s/dt2 is linear in s between stations and a = (ds/dt)^2 its integral."""
    part = (np.arange(BETWEEN) + 0.5) / BETWEEN
    step, slope = s[1] - s[0], np.diff(b) / (s[1] - s[0])
    inner = slice(1, -1)  # at rest the profile is of another form
    at = (s[:-1, None] + part * step)[inner].ravel()
    second = (b[:-1, None] + slope[:, None] * part * step)[inner].ravel()
    first = (
        a[:-1, None]
        + 2.0 * (b[:-1, None] * part * step + 0.5 * slope[:, None] * (part * step) ** 2)
    )[inner]
    speed = np.sqrt(np.maximum(first.ravel(), 0.0))[:, None]
    third = np.repeat(slope[inner], BETWEEN)[:, None] * speed
    q, q_ds, q_dds, q_ddds = derivatives(path, at)
    second = second[:, None]
    qdot, qddot = q_ds * speed, q_ds * second + q_dds * speed**2
    qdddot = q_ds * third + 3.0 * q_dds * speed * second + q_ddds * speed**3
    data = robot.model.createData()
    tau = np.array(
        [
            pin.rnea(robot.model, data, *state)
            for state in zip(q, qdot, qddot, strict=True)
        ]
    )
    limits = robot.limits
    pairs = (
        (qdot, limits.velocity),
        (qddot, limits.acceleration),
        (qdddot, limits.jerk),
        (tau, limits.torque),
    )
    return max(float((np.abs(values) / limit).max()) for values, limit in pairs)


def main() -> None:
    """Print a line a case, then a summary."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--count", type=int, default=20)
    parser.add_argument("--first", type=int, default=0)
    parser.add_argument("--intervals", type=int, default=100)
    parser.add_argument("--stations", type=int, default=1601)
    parser.add_argument("--save", action="store_true", help="into benchmarks/results")
    given = parser.parse_args()
    rows = []
    print(
        "case   brachis t_E   copp t_E   difference   copp's worst ratio   brachis     copp (processor time)"
    )
    for seed in range(given.first, given.first + given.count):
        task = case(seed, given.intervals)
        robot, task_map = bind(
            brachis.Robot.from_urdf(joint_paths.URDF, limits=task.robot.limits),
            task.task_space,
        )
        began = processor_time()
        least, worst = by_copp(robot, path_of(task_map, task), given.stations)
        theirs, began = processor_time() - began, processor_time()
        try:
            result = brachis.plan(task)
            t_end = result.t_end if result.verified else np.inf
        except brachis.BrachisError as error:
            print(error)
            t_end = np.inf
        ours = processor_time() - began
        gap = t_end / least - 1.0
        rows.append((gap, worst, ours, theirs))
        print(
            f"{seed:4d} {t_end:11.4f} s {least:8.4f} s {100.0 * gap:10.3f} % {worst:18.4f} "
            f"{ours:10.2f} s {theirs:6.2f} s"
        )
    summarise(np.array(rows))


def summarise(rows: np.ndarray) -> None:
    """Print, and keep if asked, what came of all cases: difference, copp's worst ratio, both processor times, s."""
    gaps, worst_ratios, ours_all, theirs_all = rows.T
    both = np.isfinite(gaps) & (worst_ratios <= WITHIN)
    span = f"{100.0 * gaps[both].min(initial=np.inf):+.2f} % to {100.0 * gaps[both].max(initial=-np.inf):+.2f} %"
    cells = [
        ("failed", f"{int(np.isinf(gaps).sum())}", "0"),
        (
            "limit exceeded by more than 0.2 % between stations",
            "0, verified",
            f"{int((worst_ratios > WITHIN).sum())}",
        ),
        ("end time compared with copp-py's, if both meet the limits", span, ""),
        (
            "processor time, median",
            f"{np.median(ours_all):.2f} s",
            f"{np.median(theirs_all):.2f} s",
        ),
    ]
    columns = (f"{len(rows)} paths", "brachis", "copp-py")
    for cell in (columns, *cells):
        print(" | ".join(cell))
    save("Paths of joints with limited jerk, beside copp-py", columns, cells)


if __name__ == "__main__":
    main()
