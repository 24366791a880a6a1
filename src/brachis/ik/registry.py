"""Finding a closed form for a choice of redundant joints, by geometry.

The families are listed in `BUILTIN`; other packages add theirs through the entry-point group ``brachis.ik``, whose
entries are `Family` objects (see `ik_family`). No answer is believed: a solver is returned only after its answers have
been put into the chain's forward kinematics.
"""

from __future__ import annotations

import importlib.metadata
import itertools
from collections.abc import Sequence
from dataclasses import dataclass
from functools import cache

import numpy as np

from brachis.errors import DecompositionError, UnknownNameError
from brachis.ik.eaik import eaik
from brachis.ik.geometry import ChainGeometry
from brachis.ik.parallel_axes import parallel_axes
from brachis.ik.planar import planar
from brachis.ik.polynomial import polynomial
from brachis.ik.prismatic import prismatic
from brachis.ik.protocol import Family, IKSolver, NotApplicableError
from brachis.ik.spherical_wrist import spherical_wrist
from brachis.robot import Robot, TaskSpace

BUILTIN: tuple[Family, ...] = (prismatic, planar, spherical_wrist, parallel_axes, eaik, polynomial)

_CHECKED_POSTURES = 16
_POSE_TOLERANCE = 1e-8


@dataclass(frozen=True)
class Candidate:
    """One choice of redundant joints and what is known of its closed form.

    Attributes
    ----------
    redundant_joints : tuple of str
    family : str or None
        The family that fits, None where none does.
    solver : IKSolver or None
    reasons : dict of str to str
        Why the other families that were tried do not fit.
    """

    redundant_joints: tuple[str, ...]
    family: str | None
    solver: IKSolver | None
    reasons: dict[str, str]


@dataclass(frozen=True)
class Match(Candidate):
    """A choice of redundant joints that has a closed form."""

    family: str
    solver: IKSolver


@cache
def plugin_families() -> tuple[Family, ...]:
    """Families of other packages, from the entry-point group ``brachis.ik``; a broken one says so when it is tried."""
    return tuple(_loaded(entry) for entry in importlib.metadata.entry_points(group="brachis.ik"))


def _loaded(entry: importlib.metadata.EntryPoint) -> Family:
    try:
        family = entry.load()
    except Exception as error:  # noqa: BLE001  (whatever another package's import raises)
        reason = f"the plug-in cannot be loaded: {type(error).__name__}: {error}"
    else:
        if isinstance(family, Family):
            return family
        reason = f"the plug-in's entry point is no Family but {type(family).__name__}"

    def refuse(*_arguments: object) -> IKSolver:
        raise NotApplicableError(reason)

    return Family(entry.name, refuse, entry.value)


def find(
    robot: Robot, task_space: TaskSpace, redundant_joints: Sequence[str], *, families: Sequence[Family] = ()
) -> Match:
    """Find the closed form for a choice of redundant joints.

    Parameters
    ----------
    robot : Robot
    task_space : TaskSpace
    redundant_joints : sequence of str
        As many as the robot has joints more than the task space has rows.
    families : sequence of Family, optional
        Tried before the built-in and installed ones.

    Returns
    -------
    Match

    Raises
    ------
    UnknownNameError
        A redundant joint does not exist.
    DecompositionError
        The number of redundant joints is wrong, or no family fits; lists the reasons and the choices that have one.
    """
    names = tuple(redundant_joints)
    for name in names:
        if name not in robot.joint_names:
            raise UnknownNameError("joint", name, robot.joint_names, where="redundant_joints")
    r = robot.n - task_space.m
    if len(set(names)) != len(names) or len(names) != r:
        raise DecompositionError(
            "wrong number of redundant joints" if r >= 0 else "the robot has fewer joints than the task space has rows",
            redundant_joints=names,
            found=f"{len(names)} ({', '.join(names) or 'none'})",
            allowed=f"{r}: {robot.n} joints less {task_space.m} rows ({', '.join(task_space.rows)})"
            if r >= 0
            else None,
        )
    candidate = _try(robot, task_space, names, families)
    if not isinstance(candidate, Match):
        available = [c.redundant_joints for c in find_all(robot, task_space, families=families) if c.solver is not None]
        raise DecompositionError(
            f"no closed form for redundant joints [{', '.join(names)}]",
            redundant_joints=names,
            reasons=candidate.reasons,
            available=available,
        )
    return candidate


def find_all(robot: Robot, task_space: TaskSpace, *, families: Sequence[Family] = ()) -> list[Candidate]:
    """Try every choice of redundant joints; see `find`."""
    r = robot.n - task_space.m
    if r < 0:
        return []
    return [_try(robot, task_space, names, families) for names in itertools.combinations(robot.joint_names, r)]


def _try(robot: Robot, task_space: TaskSpace, names: tuple[str, ...], families: Sequence[Family]) -> Candidate:
    """Let every family in turn look at one choice."""
    geometry = ChainGeometry.of(robot)
    redundant = tuple(sorted(robot.joint_names.index(name) for name in names))
    ordered = tuple(robot.joint_names[i] for i in redundant)
    reasons: dict[str, str] = {}
    for family in (*families, *BUILTIN, *plugin_families()):
        try:
            solver = family.build(geometry, task_space, redundant)
            check_answers(robot, task_space, redundant, solver)
        except NotApplicableError as reason:
            reasons[family.name] = str(reason)
        else:
            return Match(ordered, family.name, solver, reasons)
    return Candidate(ordered, None, None, reasons)


def check_answers(
    robot: Robot,
    task_space: TaskSpace,
    redundant: tuple[int, ...],
    solver: IKSolver,
    *,
    postures: int = _CHECKED_POSTURES,
) -> None:
    """Put a solver's answers for random postures into Pinocchio's forward kinematics.

    Parameters
    ----------
    robot, task_space : Robot, TaskSpace
    redundant : tuple of int
        Indices of the redundant joints.
    solver : IKSolver
    postures : int, optional
        How many.

    Raises
    ------
    NotApplicableError
        An answer misses its target by more than 1e-8 m or rad, or none of the answers is the posture itself.
    """
    low, high = _checked_ranges(robot)
    q = np.random.default_rng(1).uniform(low, high, (postures, robot.n))
    rest = [i for i in range(robot.n) if i not in redundant]
    targets = task_space.values(*robot.tool_placements(q))
    answers = solver.solve(targets, q[:, list(redundant)])
    turning = ChainGeometry.of(robot).revolute[rest]
    own = np.abs(_difference(answers, q[:, None, rest], turning)).max(axis=2)
    if not np.all(np.nanmin(np.where(np.isnan(own), np.inf, own), axis=1) < _POSE_TOLERANCE * 100):
        raise NotApplicableError("its answers leave out postures that reach the target")
    sample, branch = np.nonzero(np.all(np.isfinite(answers), axis=2))
    reached = q[sample]
    reached[:, rest] = answers[sample, branch]
    miss = np.abs(task_space.difference(task_space.values(*robot.tool_placements(reached)), targets[sample])).max()
    if not miss < _POSE_TOLERANCE:
        raise NotApplicableError(f"its answers miss the target by {miss:.1e}")


def _checked_ranges(robot: Robot) -> tuple[np.ndarray, np.ndarray]:
    """Whole turns of angles, and what prismatic joints can reach: a boom need not know what a negative length is."""
    lower, upper = robot.limits.position_lower, robot.limits.position_upper
    ranged = (np.array(robot.position_units) == "m") & np.isfinite(lower) & np.isfinite(upper)
    return np.where(ranged, lower, -np.pi), np.where(ranged, upper, np.pi)


def _difference(first: np.ndarray, second: np.ndarray, angles: np.ndarray) -> np.ndarray:
    """Difference of coordinates, modulo 2 pi where they are angles."""
    delta = first - second
    return np.where(angles, np.mod(delta + np.pi, 2.0 * np.pi) - np.pi, delta)
