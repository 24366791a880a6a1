"""Random plans of every robot, and a second opinion on each: is what is called verified within its limits?

Usage: python benchmarks/random_plans.py [--count 300] [--seed 0] [--robot NAME] [--jobs 1]

Tasks come from random smooth joint motions, so that most have a solution: lines, arcs, splines, blended corners and CSV
files near the tool's path, with armature, viscous and Coulomb friction (widths from 1e-5 to 0.1 rad/s), tilted gravity,
one-sided, far and narrow position ranges, limits of torque, velocity and acceleration, degrees 2 to 5, both kinds of
rest, given and free starts, and free knots now and then.

The second opinion, `recheck`, knows the result file alone. It uses nothing of brachis: numpy reads the arrays,
Pinocchio the URDF, and the limits come from the task in the file. It looks at 80 places within every polynomial piece
(the verification at 4 or so), at places ever closer to every zero of a joint velocity, and ever closer around the
largest ratios found. Exits with 1 where a motion that was called verified exceeds a limit by more than 1.1e-4.
"""

from __future__ import annotations

import argparse
import functools
import json
import sys
import tempfile
import time
import warnings
import xml.etree.ElementTree as ET
from collections.abc import Iterator, Mapping
from concurrent.futures import ProcessPoolExecutor
from pathlib import Path

import numpy as np
import pinocchio as pin

import random_poses
from brachis import Robot, ik, plan
from brachis.errors import BrachisError, BrachisWarning
from brachis.robot import task_map_of

ROOT = Path(__file__).parents[1]
ROBOTS = ("scara3", "gantry2", "tx90l_rail", "ur10_rail", "iiwa14", "panda")
TOOLS = {"panda": "panda_hand_tcp"}
SPACES: dict[str, object] = {"scara3": ["x", "y"], "gantry2": ["x", "y"]}
"""Task spaces of those that do not follow poses."""
ALLOWED = 1.1e-4
"""Largest excess of a verified motion: of a ratio, and of a position beyond its range in rad or m."""
KINDS = ("torque", "velocity", "acceleration", "position")

# ---------------------------------------------------------------- the second opinion: nothing of brachis from here on

_PLACES = np.linspace(0.0, 1.0, 81)
_BESIDE = np.concatenate([-np.logspace(0, -9, 190), [0.0], np.logspace(-9, 0, 190)])
"""Places beside a zero of a velocity, in pieces: a step is 12 % of the distance from it."""
_PEAKS, _ZOOMS = 40, 3


class SavedMotion:
    """A result file: its arrays, its robot and its limits.

    Parameters
    ----------
    path : path
        An npz file that brachis wrote.
    """

    def __init__(self, path: Path) -> None:
        with np.load(path) as archive:
            arrays = {name: archive[name] for name in archive.files}
        self.meta = json.loads(str(arrays["meta"]))
        settings, names = self.meta["task"]["robot"], self.meta["joint_names"]
        self.n = len(names)
        self.model = _model(self.meta["urdf"], names, settings)
        self.data = self.model.createData()
        self.limits = _limits(self.meta["urdf"], names, settings["limits"])
        self.friction = _friction(self.meta["urdf"], names, settings["friction"])
        self.nodes, self.h = arrays["q"], np.diff(arrays["times"])[:, None]
        self.powers = _powers(arrays, self.h)
        self.pieces = len(self.h)

    def states(
        self, piece: np.ndarray, u: np.ndarray
    ) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Positions, velocities, accelerations at places u in pieces, (K, n) each."""
        a, h, u = self.powers[:, piece], self.h[piece], u[:, None]
        q = self.nodes[piece] + u * (
            a[1] + u * (a[2] + u * (a[3] + u * (a[4] + u * a[5])))
        )
        qdot = (
            a[1] + u * (2 * a[2] + u * (3 * a[3] + u * (4 * a[4] + u * 5 * a[5])))
        ) / h
        qddot = (2 * a[2] + u * (6 * a[3] + u * (12 * a[4] + u * 20 * a[5]))) / h**2
        return q, qdot, qddot

    def excesses(self, piece: np.ndarray, u: np.ndarray) -> np.ndarray:
        """Torque, velocity, acceleration beyond their limits as parts of them, positions in rad or m, (K, 4)."""
        q, qdot, qddot = self.states(piece, u)
        tau = np.array(
            [
                pin.rnea(self.model, self.data, *state)
                for state in zip(q, qdot, qddot, strict=True)
            ]
        )
        f, lim = self.friction, self.limits
        tau += (
            f["armature"] * qddot
            + f["viscous"] * qdot
            + f["coulomb"] * np.tanh(qdot / f["coulomb_velocity"])
        )
        beyond = np.maximum(lim["lower"] - q, q - lim["upper"])
        rates = {"torque": tau, "velocity": qdot, "acceleration": qddot}
        ratios = [
            (np.abs(value) / lim[kind]).max(axis=1) - 1.0
            for kind, value in rates.items()
        ]
        return np.column_stack([*ratios, beyond.max(axis=1)])


def recheck(path: Path) -> dict[str, float]:
    """Largest excess over every kind of limit of a result file."""
    motion = SavedMotion(path)
    piece, u = (
        part.ravel()
        for part in np.broadcast_arrays(np.arange(motion.pieces)[:, None], _PLACES)
    )
    close, at = _near_zeros(motion, piece, u)
    piece, u = np.concatenate([piece, close]), np.concatenate([u, at])
    excess = motion.excesses(piece, u)
    worst, reach = excess.max(axis=0), 1.5 / (len(_PLACES) - 1)
    for _ in range(_ZOOMS):
        best = np.unique(
            np.argpartition(-excess, min(_PEAKS, len(excess) - 1), axis=0)[:_PEAKS]
        )
        piece, u = (
            np.repeat(piece[best], 41),
            (u[best, None] + reach * np.linspace(-1.0, 1.0, 41)).ravel(),
        )
        excess = motion.excesses(piece, np.clip(u, 0.0, 1.0))
        worst, reach = np.maximum(worst, excess.max(axis=0)), reach / 15.0
    return dict(zip(KINDS, worst.tolist(), strict=True))


def _near_zeros(
    motion: SavedMotion, piece: np.ndarray, u: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """Places ever closer to where a velocity is zero or least, of joints with Coulomb friction."""
    places = len(_PLACES)
    speed = motion.states(piece, u)[1].reshape(motion.pieces, places, motion.n)
    found = [(np.empty(0, dtype=int), np.empty(0))]
    for joint in np.flatnonzero(motion.friction["coulomb"] > 0.0):
        v, width = speed[:, :, joint], motion.friction["coulomb_velocity"][joint]
        least = np.abs(v) <= np.minimum(
            np.abs(np.roll(v, 1, axis=1)), np.abs(np.roll(v, -1, axis=1))
        )
        crossing = np.pad(v[:, 1:] * v[:, :-1] <= 0.0, ((0, 0), (0, 1)))
        least[:, [0, -1]] = True
        moving = np.abs(v).max(axis=1, keepdims=True) > 0.1 * width
        slow = np.abs(v) < 20.0 * width
        which, place = np.nonzero(moving & (crossing | (least & slow)))
        low, high = _PLACES[place], _PLACES[np.minimum(place + 1, places - 1)]
        before = v[which, place]
        for _ in range(50):
            middle = 0.5 * (low + high)
            same = motion.states(which, middle)[1][:, joint] * before > 0.0
            low, high = np.where(same, middle, low), np.where(same, high, middle)
        zeros = np.where(crossing[which, place], 0.5 * (low + high), _PLACES[place])
        beside = (zeros[:, None] + _BESIDE).ravel()
        inside = (beside >= 0.0) & (beside <= 1.0)
        found.append((np.repeat(which, len(_BESIDE))[inside], beside[inside]))
    piece, at = (np.concatenate(parts) for parts in zip(*found, strict=True))
    return piece, at


def _powers(arrays: Mapping[str, np.ndarray], h: np.ndarray) -> np.ndarray:
    """Coefficients (6, L, n) of powers of u, of quintic pieces relative to their first nodes."""
    way, v, a, b = (
        np.diff(arrays["q"], axis=0),
        h * arrays["qdot"][:-1],
        arrays["qddot"][:-1],
        arrays["qddot_before"][1:],
    )
    w, a, b = h * arrays["qdot"][1:], 0.5 * h**2 * a, 0.5 * h**2 * b
    cubic = 10.0 * way - 6.0 * v - 4.0 * w - 3.0 * a + b
    quartic = -15.0 * way + 8.0 * v + 7.0 * w + 3.0 * a - 2.0 * b
    quintic = 6.0 * way - 3.0 * v - 3.0 * w - a + b
    return np.array([np.zeros_like(way), v, a, cubic, quartic, quintic])


def _model(urdf: str, names: list[str], settings: Mapping[str, object]) -> pin.Model:
    """Pinocchio's model of the chain, all other joints held at zero."""
    root = ET.fromstring(urdf)
    for joint in root.iter("joint"):
        if joint.get("name") in names:
            joint.set(
                "type",
                {"continuous": "revolute"}.get(
                    joint.get("type", ""), joint.get("type", "")
                ),
            )
            if joint.find("limit") is None:
                ET.SubElement(joint, "limit", effort="0", velocity="0")
            joint.find("limit").attrib.update(lower="-1e9", upper="1e9")
        elif joint.get("type"):
            joint.set("type", "fixed")
        for mimic in joint.findall("mimic"):
            joint.remove(mimic)
    model = pin.buildModelFromXML(ET.tostring(root, encoding="unicode"))
    if list(model.names)[1:] != names or model.nq != len(names):
        raise SystemExit(f"the joints differ: {list(model.names)[1:]}, {names}")
    model.gravity.linear = np.array(settings["gravity"], dtype=float)
    model.armature = np.zeros(model.nv)
    return model


def _limits(
    urdf: str, names: list[str], settings: Mapping[str, object]
) -> dict[str, np.ndarray]:
    """Limits of every joint; infinite where there is none."""
    stated = {
        joint.get("name"): joint
        for joint in ET.fromstring(urdf).iter("joint")
        if joint.get("type")
    }

    def of_urdf(key: str) -> list[float]:
        found = [stated[name].find("limit") for name in names]
        return [
            np.inf if limit is None else float(limit.get(key, "inf")) for limit in found
        ]

    scale = settings["scale"]
    limits = {}
    for kind, key in (
        ("torque", "effort"),
        ("velocity", "velocity"),
        ("acceleration", ""),
    ):
        own = settings[kind]
        values = of_urdf(key) if key else [np.inf] * len(names)
        limits[kind] = (
            np.array(values) if own == "urdf" else _spread(own, names, values)
        ) * scale[kind]
    turning = [stated[name].get("type") == "continuous" for name in names]
    lower = np.where(
        turning,
        -np.inf,
        [-value if value == np.inf else value for value in of_urdf("lower")],
    )
    upper = np.where(turning, np.inf, of_urdf("upper"))
    own = settings["position"]
    if own is None:
        own = [[None, None]] * len(names)
    elif own == "urdf":
        own = {}
    listed = own if isinstance(own, list) else [own.get(name, "urdf") for name in names]
    for i, ends in enumerate(listed):
        if ends != "urdf":
            low, high = ends or (None, None)
            lower[i] = -np.inf if low is None else low
            upper[i] = np.inf if high is None else high
    return {**limits, "lower": lower, "upper": upper}


def _friction(
    urdf: str, names: list[str], settings: Mapping[str, object]
) -> dict[str, np.ndarray]:
    """Friction of every joint; the URDF's where the task does not say."""
    stated = {
        joint.get("name"): joint.find("dynamics")
        for joint in ET.fromstring(urdf).iter("joint")
    }
    terms = {
        key: _spread(settings[key], names, value)
        for key, value in (("armature", 0.0), ("coulomb_velocity", 0.01))
    }
    for key, word in (("viscous", "damping"), ("coulomb", "friction")):
        rubbing = [
            0.0 if stated[name] is None else float(stated[name].get(word, "0"))
            for name in names
        ]
        own = settings[key]
        terms[key] = _spread(
            rubbing if own == "urdf" else 0.0 if own is None else own, names, rubbing
        )
    return terms


def _spread(value: object, names: list[str], missing: object) -> np.ndarray:
    """One value for every joint: of a number, a list or a mapping; infinite for null."""
    default = list(missing) if isinstance(missing, list) else [missing] * len(names)
    if isinstance(value, Mapping):
        listed = [
            value.get(name, other) for name, other in zip(names, default, strict=True)
        ]
    else:
        listed = (
            list(value) if isinstance(value, (list, tuple)) else [value] * len(names)
        )
    return np.array([np.inf if one is None else one for one in listed], dtype=float)


# ---------------------------------------------------------------------------------------------- the plans


def urdf_of(name: str) -> Path:
    """URDF of a robot."""
    return (
        random_poses.stored_urdf(random_poses.PANDA)
        if name == "panda"
        else ROOT / f"robots/{name}/robot.urdf"
    )


def random_task(
    name: str, seed: int, number: int, folder: Path, time_limit: float = 15.0
) -> dict[str, object]:
    """Make a task mapping; the same for the same arguments. A CSV file that it needs goes into `folder`."""
    rng = np.random.default_rng([seed, ROBOTS.index(name), number])
    tool, space = TOOLS.get(name), SPACES.get(name, "pose")
    gravity = _tilted(
        rng,
        np.zeros(3) if name in ("scara3", "gantry2") else np.array([0.0, 0.0, -9.81]),
    )
    robot = Robot.from_urdf(urdf_of(name), tool_frame=tool, gravity=gravity)
    while True:
        joint_path = _joint_motion(rng, robot)
        tau = np.abs(
            [
                pin.rnea(robot.model, robot.model.createData(), q, 0.0 * q, 0.0 * q)
                for q in joint_path
            ]
        ).max(axis=0)
        if np.all(tau < 0.6 * robot.limits.torque) or name == "scara3":
            break
    limits, friction = _random_limits(rng, robot, joint_path, tau)
    free_knots = rng.random() < 0.1
    degree = int(rng.integers(2, 6))
    task: dict[str, object] = {
        "brachis": 1,
        "robot": {
            "urdf": str(urdf_of(name)),
            "gravity": [float(g) for g in gravity],
            "limits": limits,
            "friction": friction,
            **({"tool_frame": tool} if tool else {}),
        },
        "start": {"joints": joint_path[0].tolist()},
        "task_space": space,
        "path": _random_path(
            rng, robot, joint_path, space, folder / f"{name}_{number}.csv"
        ),
        "search": {"effort": "single", "time_limit": time_limit},
        "solver": {"time_limit": 0.2 * time_limit},
        "spline": {
            "degree": degree,
            "intervals": 8 if free_knots else int(rng.integers(8, 21)),
            "knots": "free" if free_knots else "uniform",
            "rest": "velocity" if degree == 2 or rng.random() < 0.3 else "full",
        },
    }
    task["redundant_joints"] = _redundant(rng, name, joint_path, space)
    if rng.random() < 0.15:
        task |= {
            "start": "free",
            "path_start": _coordinates(robot, joint_path[0], space),
        }
    return task


def _tilted(rng: np.random.Generator, gravity: np.ndarray) -> np.ndarray:
    """Tilt gravity by some degrees; of an arm in the plane, up to 1 m/s^2 of it."""
    return gravity + rng.uniform(-1.0, 1.0, 3) * (rng.random() < 0.7)


def _joint_motion(rng: np.random.Generator, robot: Robot) -> np.ndarray:
    """Random smooth joint motion (50, n) within the ranges."""
    limits = robot.limits
    lower, upper = (
        np.maximum(limits.position_lower, -np.pi),
        np.minimum(limits.position_upper, np.pi),
    )
    middle, half = 0.5 * (lower + upper), 0.4 * (upper - lower)
    s = np.linspace(0.0, 1.0, 50)[:, None]
    first = middle + half * rng.uniform(-0.8, 0.8, robot.n)
    way, bow = rng.uniform(-0.4, 0.4, robot.n), rng.uniform(-0.1, 0.1, robot.n)
    return np.clip(
        first + way * s + bow * np.sin(np.pi * s), middle - half, middle + half
    )


def _random_limits(
    rng: np.random.Generator, robot: Robot, joint_path: np.ndarray, held: np.ndarray
) -> tuple[dict[str, object], dict[str, object]]:
    """Limits and friction that leave the motion possible."""
    names, n = robot.joint_names, robot.n
    torque = np.maximum(rng.uniform(0.4, 1.0, n) * robot.limits.torque, 1.6 * held)
    rubbing = rng.random(n) < 0.7
    friction = {
        "armature": dict(
            zip(names, (rng.uniform(0.0, 0.02, n) * torque).tolist(), strict=True)
        ),
        "viscous": dict(
            zip(names, (rng.uniform(0.0, 0.03, n) * torque).tolist(), strict=True)
        ),
        "coulomb": dict(
            zip(
                names,
                (rubbing * rng.uniform(0.0, 0.2, n) * torque).tolist(),
                strict=True,
            )
        ),
        "coulomb_velocity": dict(
            zip(names, (10.0 ** rng.uniform(-5.0, -1.0, n)).tolist(), strict=True)
        ),
    }
    ranges: dict[str, list[float | None]] = {}
    for name, low, high in zip(
        names, joint_path.min(axis=0), joint_path.max(axis=0), strict=True
    ):
        room = rng.uniform(0.05, 0.5, 2)
        ends = [float(low - room[0]), float(high + room[1])]
        kind = rng.integers(0, 8)
        forms = {
            0: [ends[0], None],
            1: [None, ends[1]],
            2: [ends[0], 1e4],
            3: [-1e4, ends[1]],
            4: ends,
        }
        if kind in forms:
            ranges[name] = forms[kind]
    limits: dict[str, object] = {
        "torque": dict(zip(names, torque.tolist(), strict=True)),
        "position": ranges,
    }
    if rng.random() < 0.3:
        limits["acceleration"] = dict(
            zip(names, rng.uniform(3.0, 30.0, n).tolist(), strict=True)
        )
    if rng.random() < 0.3:
        limits["scale"] = {"velocity": float(rng.uniform(0.4, 1.0))}
    return limits, friction


def _random_path(
    rng: np.random.Generator,
    robot: Robot,
    joint_path: np.ndarray,
    space: object,
    csv: Path,
) -> object:
    """Segments near the tool's path along the motion."""
    placements = [robot.tool_placement(q) for q in joint_path]
    rows = 3 if space == "pose" else 2
    points = np.array([placement.translation[:rows] for placement in placements])
    quaternions = np.array(
        [pin.Quaternion(placement.rotation).coeffs() for placement in placements]
    )[:, [3, 0, 1, 2]]
    turn = pin.log3(placements[-1].rotation @ placements[0].rotation.T)
    angle = float(np.linalg.norm(turn))
    turning = {
        "rotate": {
            "axis": (turn / max(angle, 1e-9)).tolist(),
            "angle_deg": float(np.rad2deg(angle)),
        }
    }
    extra = {"orientation": turning} if space == "pose" and angle > 1e-6 else {}
    kind = rng.choice(
        ["line", "arc", "spline", "blend", "csv"], p=[0.3, 0.15, 0.15, 0.2, 0.2]
    )
    if kind == "arc":
        return [
            {"arc": {"via": points[25].tolist(), "to": points[-1].tolist()}, **extra}
        ]
    if kind == "blend":
        corner = points[25] + 0.1 * (points[25] - points[0])
        sides = np.linalg.norm([corner - points[0], points[-1] - corner], axis=1)
        radius = float(rng.uniform(0.1, 0.4) * sides.min())
        last = {"line": {"to": points[-1].tolist()}}
        return [{"line": {"to": corner.tolist()}, "blend": radius}, last]
    if kind == "spline":
        chosen = [16, 33, 49]
        turns = [{"quaternion_wxyz": quaternions[k].tolist()} for k in chosen]
        turned = {"orientations": turns} if space == "pose" else {}
        return [{"spline": {"through": points[chosen].tolist(), **turned}}]
    if kind == "csv":
        table = np.hstack([points, quaternions]) if space == "pose" else points
        header = "x,y,z,qw,qx,qy,qz" if space == "pose" else "x,y"
        np.savetxt(
            csv, table[::7], fmt="%.9f", delimiter=",", header=header, comments=""
        )
        return [{"csv": {"file": str(csv), "relative": True}}]
    return [{"line": {"to": points[-1].tolist()}, **extra}]


@functools.cache
def _closed_forms(name: str) -> list[ik.TriedDecomposition]:
    """Choices of redundant joints of a robot that have a closed form, whatever its limits."""
    robot = Robot.from_urdf(urdf_of(name), tool_frame=TOOLS.get(name))
    found = ik.find_all(robot, task_map_of(robot, SPACES.get(name, "pose")))
    return [c for c in found if c.solver is not None]


def _redundant(
    rng: np.random.Generator, name: str, joint_path: np.ndarray, space: object
) -> list[str]:
    """Redundant joints: of those with a closed form one of the two with the most room along the motion."""
    forms = _closed_forms(name)
    if space == "pose":
        forms = sorted(forms, key=lambda c: -random_poses.room(joint_path, c))
    return list(forms[int(rng.integers(0, min(2, len(forms))))].redundant_joints)


def _coordinates(robot: Robot, q: np.ndarray, space: object) -> object:
    """Where the tool is, as a task writes it."""
    placement = robot.tool_placement(q)
    if space != "pose":
        return placement.translation[:2].tolist()
    turn = pin.Quaternion(placement.rotation).coeffs().tolist()
    return {"position": placement.translation.tolist(), "quaternion_xyzw": turn}


def planned(
    name: str, seed: int, number: int, folder: Path, time_limit: float = 15.0
) -> tuple[str, str, dict[str, float], float]:
    """Plan one task: robot, outcome in words (verified, unverified or the error), excesses and seconds."""
    began = time.perf_counter()
    try:
        with warnings.catch_warnings():
            warnings.simplefilter(
                "ignore", BrachisWarning
            )  # far ranges look like mm and degrees
            result = plan(
                random_task(name, seed, number, folder, time_limit), strict=False
            )
    except BrachisError as error:
        return name, f"{type(error).__name__}: {error}", {}, time.perf_counter() - began
    seconds = time.perf_counter() - began
    path = folder / f"{name}_{number}.npz"
    result.trajectory.save(path)
    failed = ", ".join(
        check.name for check in result.verification.checks if not check.passed
    )
    return (
        name,
        f"unverified: {failed}" if failed else "verified",
        recheck(path),
        seconds,
    )


def outcomes(
    names: tuple[str, ...], seed: int, count: int, jobs: int
) -> Iterator[tuple[str, int, tuple[str, str, dict[str, float], float]]]:
    """Plan `count` tasks, the robots in turn."""
    with tempfile.TemporaryDirectory() as folder, ProcessPoolExecutor(jobs) as pool:
        numbered = [(names[i % len(names)], i // len(names)) for i in range(count)]
        futures = [
            (name, k, pool.submit(planned, name, seed, k, Path(folder)))
            for name, k in numbered
        ]
        for name, k, future in futures:
            yield name, k, future.result()


def main() -> int:
    """Print what was not verified and why, then a line for every robot; 1 where a verified motion exceeds a limit."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--count", type=int, default=300)
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--robot", choices=ROBOTS)
    parser.add_argument("--jobs", type=int, default=1)
    chosen = parser.parse_args()
    names = (chosen.robot,) if chosen.robot else ROBOTS
    rows: dict[str, list[tuple[str, dict[str, float], float]]] = {
        name: [] for name in names
    }
    wrong = 0
    for name, number, (_, outcome, excess, seconds) in outcomes(
        names, chosen.seed, chosen.count, chosen.jobs
    ):
        rows[name].append((outcome, excess, seconds))
        lie = outcome == "verified" and max(excess.values()) > ALLOWED
        wrong += lie
        if lie or outcome != "verified":
            found = ", ".join(f"{kind} {value:+.2e}" for kind, value in excess.items())
            print(
                f"{name} {number}: {'WRONGLY ' if lie else ''}{outcome.splitlines()[0]} [{found}]",
                flush=True,
            )
    for name, entries in rows.items():
        good = [
            max(excess.values())
            for outcome, excess, _ in entries
            if outcome == "verified"
        ]
        made = sum(bool(excess) for _, excess, _ in entries)
        times = [seconds for *_, seconds in entries]
        print(
            f"{name}: {len(entries)} tasks, {made} planned, {len(good)} verified, worst excess of these "
            f"{max(good, default=float('nan')):.2e}; median {np.median(times):.2f} s, longest {max(times):.1f} s"
        )
    return 1 if wrong else 0


if __name__ == "__main__":
    sys.exit(main())
