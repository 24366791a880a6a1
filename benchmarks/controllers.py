"""Seeded plans exported with every profile, read back, and checked as they run by formulas of their own.

Usage: python benchmarks/controllers.py [--seed 0] [--count 200] [--save]

Every file is read by a parser of this script, and its numbers are turned into joint positions by hand-written units,
signs and couplings. They have to be those of the plan to the file's last digit. Samples of positions are checked by
their differences, and by torques (Pinocchio's RNEA) at the samples; polynomials densely. A run that breaks a limit and
is reported to pass counts as a fault, and so does one that keeps all limits and is reported to break a limit.
"""

from __future__ import annotations

import argparse
import csv
import tempfile
import warnings
from collections import Counter, defaultdict
from pathlib import Path

import numpy as np
import pinocchio as pin
import yaml
from scipy.interpolate import BPoly

import brachis
from brachis.errors import BrachisError, BrachisWarning, InputError
from committed import save

ROBOTS = ("scara3", "tx90l_rail", "ur10_rail", "iiwa14", "gen3")
ALLOWED = 1.0 + 1e-4
UNSURE = 5e-5
"""Ratios that are so near to what is allowed decide nothing: the two verdicts may differ by rounding."""
DECIMALS = {"kuka_rsi_4ms": 8, "fanuc_stream_8ms": 5}
DEGREES = ("kuka_rsi_4ms", "abb_egm_4ms", "fanuc_stream_8ms", "staubli_val3")
KINDS = (
    "position",
    "velocity",
    "acceleration",
    "jerk",
    "torque",
    "torque_rate",
    "power",
    "rms_torque",
)
FRANKA = {
    "velocity": [2.175] * 4 + [2.61] * 3,
    "acceleration": [15.0, 7.5, 10.0, 12.5, 15.0, 20.0, 20.0],
    "jerk": [7500.0, 3750.0, 5000.0, 6250.0, 7500.0, 10000.0, 10000.0],
    "torque_rate": [1000.0] * 7,
}


def with_more_limits(
    robot: brachis.Robot, name: str, seed: int
) -> tuple[brachis.Robot, dict[str, object]]:
    """Add limits on heat and power, different limits in the two directions, and a tool speed to every other draw."""
    rng = np.random.default_rng([56, seed])
    if rng.random() < 0.5:
        return robot, {}
    torque = robot.limits.torque
    speed = np.where(np.isfinite(robot.limits.velocity), robot.limits.velocity, 5.0)
    pairs = np.column_stack([-rng.uniform(0.5, 1.0, robot.n) * speed, speed])
    limits = {"velocity": pairs.tolist()}
    if name != "scara3":
        limits["power"] = (rng.uniform(0.1, 0.5) * torque * speed).tolist()
        limits["rms_torque"] = (rng.uniform(0.6, 1.0) * torque).tolist()
    tool_limits = {"speed": float(rng.uniform(0.1, 1.0))}
    return robot.with_limits(**limits), {"tool_limits": tool_limits}


def plan_of(seed: int) -> brachis.Trajectory | None:
    """Plan a random line of the joints or of the tool; None where the draw has no plan."""
    rng = np.random.default_rng([55, seed])
    name = ROBOTS[seed % len(ROBOTS)]
    robot = getattr(brachis.robots, name)
    ends = robot.limits.both_ways("position")
    low, high = np.where(np.isfinite(ends), ends, [[-2.0], [2.0]])
    start = low + (0.3 + 0.4 * rng.random(robot.n)) * (high - low)
    by = rng.uniform(-0.2, 0.2, robot.n) * (high - low)
    options = {
        "intervals": int(rng.integers(8, 20)),
        "rest": ("velocity", "full")[int(rng.integers(2))],
        "effort": "single",
        "time_limit": 20.0,
    }
    if rng.random() < 0.5:
        options |= {"path": brachis.Line(by=by.tolist()), "task_space": "joints"}
    else:
        space = ["x", "y"] if name == "scara3" else "position"
        along = rng.uniform(-0.2, 0.2, len(space) if name == "scara3" else 3)
        options |= {"path": brachis.Line(by=along.tolist()), "task_space": space}
    robot, more_options = with_more_limits(robot, name, seed)
    try:
        result = brachis.plan(
            robot, start=start.tolist(), check_advice=False, **options, **more_options
        )
    except BrachisError:
        return None
    return result.trajectory if result.verified else None


def read(path: Path) -> tuple[list[str], np.ndarray, np.ndarray, np.ndarray | None]:
    """Read names of axes, times, positions, and velocities and accelerations if there are any."""
    if path.suffix == ".yaml":
        message = yaml.safe_load(path.read_text())
        points = message["points"]
        seconds = [point["time_from_start"] for point in points]
        t = [time["sec"] + 1e-9 * time["nanosec"] for time in seconds]
        rates = [[point["velocities"], point["accelerations"]] for point in points]
        q = [point["positions"] for point in points]
        return message["joint_names"], np.array(t), np.array(q), np.array(rates)
    header, *rows = csv.reader(path.read_text().splitlines())
    table = np.array(rows, dtype=float)
    names = [name.removeprefix("q_").partition(" ")[0] for name in header[1:]]
    return names, table[:, 0], table[:, 1:], None


def by_hand(motion: brachis.Trajectory, profile: str, q: np.ndarray) -> np.ndarray:
    """Positions of the axes: the arm first, then slides before it; degrees and mm; FANUC's coupled third axis."""
    units = motion.robot.position_units
    slides = [i for i in range(len(units)) if "rad" not in units[: i + 1]]
    arm = [i for i in range(len(units)) if i not in slides]
    in_degrees = profile in DEGREES
    values = q[:, arm] * np.where(
        [units[i] == "rad" for i in arm],
        180.0 / np.pi if in_degrees else 1.0,
        1e3 if in_degrees else 1.0,
    )
    if profile == "fanuc_stream_8ms":
        values[:, 2] -= values[:, 1]
    return np.hstack([values, q[:, slides] * (1e3 if in_degrees else 1.0)])


def joints_of(
    motion: brachis.Trajectory, profile: str, values: np.ndarray
) -> np.ndarray:
    """Undo `by_hand`."""
    n = motion.robot.n
    columns = [by_hand(motion, profile, row[None])[0] for row in np.eye(n)]
    return np.linalg.solve(np.array(columns).T, values.T).T


def torques(motion: brachis.Trajectory, *states: np.ndarray) -> np.ndarray:
    """Torques by RNEA, and the friction of the robot."""
    robot = motion.robot
    data = robot.model.createData()
    tau = [pin.rnea(robot.model, data, *row) for row in zip(*states, strict=True)]
    friction = robot.friction
    _, qdot, qddot = states
    coulomb = friction.coulomb * np.tanh(qdot / friction.v_eps)
    return np.array(tau) + friction.armature * qddot + friction.viscous * qdot + coulomb


def worst_ratio(motion: brachis.Trajectory, profile: str, t, q, rates) -> float:
    """Largest ratio to the limits of the robot, of the tool and of the profile."""
    limits = {kind: motion.robot.limits.both_ways(kind) for kind in KINDS}
    if profile == "franka_1khz":
        for kind, largest in FRANKA.items():
            lower, upper = limits[kind]
            limits[kind] = (
                np.maximum(lower, np.negative(largest)),
                np.minimum(upper, largest),
            )

    def ratio(values: np.ndarray, kind: str) -> float:
        """Largest ratio of values, (K, n), to limits in both directions."""
        lower, upper = limits[kind]
        return np.maximum(values / lower, values / upper).max()

    h = t[1]
    if rates is not None:
        pieces = BPoly.from_derivatives(t, np.concatenate([q[:, None], rates], axis=1))
        t = np.union1d(np.linspace(0.0, t[-1], 4001), t)
        q, qdot, qddot = (pieces(t, nu=order) for order in range(3))
        ratios = [ratio(qdot, "velocity"), ratio(qddot, "acceleration")]
    else:
        ratios = []
        for order, kind in enumerate(("velocity", "acceleration", "jerk"), start=1):
            held = np.pad(q, ((order - 1, order - 1), (0, 0)), mode="edge")
            ratios.append(ratio(np.diff(held, order, axis=0) / h**order, kind))
        qdot = np.zeros_like(q)
        qdot[1:-1] = (q[2:] - q[:-2]) / (2.0 * h)
        qddot = np.zeros_like(q)
        qddot[1:-1] = (q[2:] - 2.0 * q[1:-1] + q[:-2]) / h**2
        qddot[0] = 2.0 * (q[1] - q[0]) / h**2
        qddot[-1] = 2.0 * (q[-2] - q[-1]) / h**2
    tau = torques(motion, q, qdot, qddot)
    if rates is None:
        ratios.append(ratio(np.diff(tau, axis=0) / h, "torque_rate"))
        heat = np.mean(tau**2, axis=0)
    else:
        heat = np.trapezoid(tau**2, t, axis=0) / t[-1]
    lowest, highest = np.clip(limits["position"], -1e6, 1e6)
    middle = 0.5 * (lowest + highest)
    half = 0.5 * (highest - lowest)
    turned = np.abs(q - middle) / half
    places, _ = motion.robot.tool_placements(q)
    speeds = np.linalg.norm(np.diff(places, axis=0), axis=1) / np.diff(t)
    return float(
        max(
            *ratios,
            ratio(tau, "torque"),
            ratio(tau * qdot, "power"),
            ratio(np.sqrt(heat), "rms_torque"),
            turned.max(),
            speeds.max() / (motion.task.tool_limits.speed or np.inf),
        )
    )


def check(
    motion: brachis.Trajectory, profile: str, folder: Path, count: Counter[str]
) -> tuple[float, str]:
    """Export a motion, read it back and compare the verdicts.

    Returns
    -------
    float
        Largest deviation of the file's numbers, in halves of its last digit.
    str
        What is wrong; empty if nothing is.
    """
    path = folder / f"run{'.yaml' if profile == 'ros2_control' else '.csv'}"
    path.unlink(missing_ok=True)
    try:
        report = brachis.export.write_for_controller(motion, path, profile)
    except InputError:
        count["refused"] += 1
        return 0.0, ""
    count["written"] += 1
    count["passed"] += report.passed
    _, t, values, rates = read(path)
    last = "exact" if rates is not None else "hold"
    samples = motion.sample(report.period, last=last)
    off = np.abs(values - by_hand(motion, profile, samples.q)).max()
    digit = 0.5 * 10.0 ** -DECIMALS.get(profile, 12)
    q = joints_of(motion, profile, values)
    if rates is not None:
        back = by_hand(motion, profile, np.eye(motion.robot.n)).T
        rates = np.stack([rates[:, i] @ back for i in range(2)], axis=1)
    ratio = worst_ratio(motion, profile, t, q, rates)
    said = [
        check
        for check in report.checks
        if check.name not in ("path error", "acceleration at the ends")
    ]
    keeps_limits = all(check.passed for check in said)
    fault = ""
    if ratio > ALLOWED + UNSURE and keeps_limits:
        count["breaks, not said"] += 1
        fault = f"ratio {ratio:.6f} and not said"
    if ratio < ALLOWED - UNSURE and not keeps_limits:
        count["keeps, said to break"] += 1
        fault = f"ratio {ratio:.6f}, {report.failures}"
    return off / digit, fault


def main() -> None:
    """Export, read, check, count."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--count", type=int, default=200)
    parser.add_argument("--save", action="store_true")
    options = parser.parse_args()
    counts: dict[str, Counter[str]] = defaultdict(Counter)
    worst_digit: dict[str, float] = defaultdict(float)
    plans = 0
    seed = options.seed
    warnings.simplefilter("ignore", BrachisWarning)
    with tempfile.TemporaryDirectory() as folder:
        while plans < options.count:
            motion = plan_of(seed)
            plans += motion is not None
            for profile in brachis.profile_names() if motion else ():
                off, fault = check(motion, profile, Path(folder), counts[profile])
                worst_digit[profile] = max(worst_digit[profile], off)
                if fault:
                    print(f"seed {seed}, {profile}: {fault}")
            seed += 1
    columns = [
        "profile",
        "written",
        "rejected",
        "verified as run",
        "violations not reported",
        "false reports",
        "largest error, in half units of the last digit",
    ]
    kinds = ("written", "refused", "passed", "breaks, not said", "keeps, said to break")
    rows = [
        [profile, *(str(count[kind]) for kind in kinds), f"{worst_digit[profile]:.2f}"]
        for profile, count in counts.items()
    ]
    for row in (columns, *rows):
        print(" | ".join(row))
    about = f"{plans} random plans along joint or tool lines are exported with every profile and read back."
    save("Motions as controllers run them", columns, rows, about)


if __name__ == "__main__":
    main()
