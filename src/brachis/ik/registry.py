"""Finding a closed form for a choice of redundant joints, by geometry.

The families are listed in `BUILTIN`; other packages add theirs through the entry-point group ``brachis.ik``, whose
entries are `Family` objects (see `ik_family`). No answer is believed: a solver is returned only after its answers have
been put into the chain's forward kinematics (`check`).

Where no family fits the chain as it is, the ideal one is tried that it almost is (`snap_axes`); answers are polished.

What is said of closed forms that a robot lacks.

The most that a robot can prescribe for its tool.
"""

from __future__ import annotations

import contextlib
import importlib.metadata
import itertools
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import cache

import numpy as np

from brachis.errors import DecompositionError, UnknownNameError, write_count
from brachis.ik.check import check_answers
from brachis.ik.eaik import NOT_INSTALLED, eaik
from brachis.ik.idealised import TOLERANCE, PolishedSolver, SnappedChain, snap_axes
from brachis.ik.parallel_axes import parallel_axes
from brachis.ik.planar import planar
from brachis.ik.positioning import positioning
from brachis.ik.prismatic import prismatic
from brachis.ik.protocol import Family, IKSolver, NotApplicableError
from brachis.ik.screws import ChainGeometry
from brachis.ik.spherical_wrist import spherical_wrist
from brachis.robot import Robot, TaskMap
from brachis.robot.task_map import JointSpace
from brachis.robot.task_map.protocol import AXES, POSE_ROWS

BUILTIN: tuple[Family, ...] = (
    prismatic,
    planar,
    positioning,
    spherical_wrist,
    parallel_axes,
    eaik,
)

_NEAR = 2e-3
"""Axes this near (rad, m) to those of an ideal arm may be meant to be there."""


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
    remark : str
        What else there is to know of the solver; empty where there is nothing.
    """

    redundant_joints: tuple[str, ...]
    family: str | None
    solver: IKSolver | None
    reasons: dict[str, str]
    remark: str = ""


@dataclass(frozen=True)
class Match(Candidate):
    """A choice of redundant joints that has a closed form."""

    family: str
    solver: IKSolver


@cache
def plugin_families() -> tuple[Family, ...]:
    """Families of other packages, from the entry-point group ``brachis.ik``; a broken one says so when it is tried."""
    return tuple(
        _loaded(entry) for entry in importlib.metadata.entry_points(group="brachis.ik")
    )


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
    robot: Robot,
    task_map: TaskMap,
    redundant_joints: Sequence[str],
    *,
    families: Sequence[Family] = (),
) -> Match:
    """Find the closed form for a choice of redundant joints.

    Parameters
    ----------
    robot : Robot
    task_map : TaskMap
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
            raise UnknownNameError(
                "joint", name, robot.joint_names, where="redundant_joints"
            )
    r = robot.n - task_map.m
    if len(set(names)) != len(names) or len(names) != r:
        joints = write_count(robot.n, "joint")
        rows = write_count(task_map.m, "row")
        raise DecompositionError(
            "wrong number of redundant joints"
            if r >= 0
            else "the robot has fewer joints than the task space has rows",
            redundant_joints=names,
            found=f"{len(names)} ({', '.join(names) or 'none'})"
            if r >= 0
            else f"{robot.n} for {task_map.m} rows",
            allowed=f"{r}: {joints} less {rows} ({', '.join(task_map.rows)})"
            if r >= 0
            else f"at most {robot.n} rows; or task_space: joints, with a path of the joints such as "
            f"line: {{by: [{', '.join(['0.5'] * robot.n)}]}}",
        )
    candidate = _try(robot, task_map, names, families, _ideals(robot, task_map))
    if not isinstance(candidate, Match):
        available = [
            c.redundant_joints
            for c in find_all(robot, task_map, families=families)
            if c.solver is not None
        ]
        raise DecompositionError(
            f"no closed form for redundant joints [{', '.join(names)}]",
            redundant_joints=names,
            reasons=candidate.reasons,
            available=available,
        )
    return candidate


def find_all(
    robot: Robot, task_map: TaskMap, *, families: Sequence[Family] = ()
) -> list[Candidate]:
    """Try every choice of redundant joints; see `find`. Paths of joints need no closed form."""
    r = robot.n - task_map.m
    if r < 0 or isinstance(task_map, JointSpace):
        return []
    ideals = _ideals(robot, task_map)
    return [
        _try(robot, task_map, names, families, ideals)
        for names in itertools.combinations(robot.joint_names, r)
    ]


def _ideals(robot: Robot, task_map: TaskMap) -> Callable[[float], SnappedChain | None]:
    """Return the ideal arm within a tolerance as a function of it; the redundant joints have no part in it."""
    geometry = ChainGeometry.of(robot)
    return cache(lambda tolerance: snap_axes(geometry, task_map, tolerance))


def _try(
    robot: Robot,
    task_map: TaskMap,
    names: tuple[str, ...],
    families: Sequence[Family],
    ideals: Callable[[float], SnappedChain | None],
) -> Candidate:
    """Let every family in turn look at one choice; where none fits, at the ideal arm that the robot almost is."""
    redundant = tuple(sorted(robot.joint_names.index(name) for name in names))
    reasons: dict[str, str] = {}
    tried = (*families, *BUILTIN, *plugin_families())
    match = _fitting(robot, task_map, redundant, tried, reasons, None)
    if match is None and (ideal := ideals(TOLERANCE)):
        match = _fitting(robot, task_map, redundant, tried, reasons, ideal)
    if match is None and (rough := ideals(_NEAR)):
        _name_rounding(task_map, redundant, tried, reasons, rough)
    return match or Candidate(
        tuple(robot.joint_names[i] for i in redundant), None, None, reasons
    )


def _fitting(
    robot: Robot,
    task_map: TaskMap,
    redundant: tuple[int, ...],
    families: Sequence[Family],
    reasons: dict[str, str],
    ideal: SnappedChain | None,
) -> Match | None:
    """Find the first family that fits the robot or the ideal arm; put down the others' reasons."""
    geometry = ChainGeometry.of(robot)
    for family in families:
        try:
            solver = family.build(
                ideal.geometry if ideal else geometry, task_map, redundant
            )
            if ideal:
                solver = PolishedSolver(solver, geometry, task_map, redundant)
            check_answers(robot, task_map, redundant, solver)
        except NotApplicableError as reason:
            reasons[family.name] = str(reason)
        except Exception as error:
            if family in BUILTIN:
                raise
            reasons[family.name] = (
                f"its code failed: {type(error).__name__}: {error}"  # another package's fault
            )
        else:
            reasons.pop(family.name, None)
            remark = (
                f"axes within {ideal.miss} of an ideal arm's: answers are polished"
                if ideal
                else ""
            )
            return Match(
                tuple(robot.joint_names[i] for i in redundant),
                family.name,
                solver,
                reasons,
                remark,
            )
    return None


def _name_rounding(
    task_map: TaskMap,
    redundant: tuple[int, ...],
    families: Sequence[Family],
    reasons: dict[str, str],
    ideal: SnappedChain,
) -> None:
    """Put down which families would fit if the axes were nearer to the ideal arm's."""
    if max(ideal.turned, ideal.shifted) < TOLERANCE:
        return
    for family in (family for family in families if family in BUILTIN):
        with contextlib.suppress(NotApplicableError):
            family.build(ideal.geometry, task_map, redundant)
            reasons[family.name] = (
                f"fits an ideal arm only, and its axes are up to {ideal.miss} from there; at most {TOLERANCE:.0e} is "
                "taken for rounding. If the URDF rounds angles, as in 1.57, write them with more digits"
            )


NO_CLOSED_FORM = (
    "no choice of redundant joints has a closed form: "
    "motions are planned from differential inverse kinematics"
)
"""Of a robot and a task space without any."""
_INSTALLING = "installing it takes a C++ compiler except on macOS and on Linux for x86_64 with Python 3.13 or older"
"""What installing EAIK may ask for; where it has wheels it comes with brachis."""


def missing_eaik(candidates: Sequence[Candidate]) -> str:
    """Say which choices of redundant joints EAIK might add, and how to get it.

    Parameters
    ----------
    candidates : sequence of Candidate
        All choices, as `find_all` returns them.

    Returns
    -------
    str
        A sentence without its full stop; empty where EAIK is installed or would add nothing.
    """
    further = [
        candidate.redundant_joints
        for candidate in candidates
        if candidate.solver is None
        and candidate.reasons.get(eaik.name) == NOT_INSTALLED
    ]
    if not further:
        return ""
    names = ", ".join("[" + ", ".join(joints) + "]" for joints in further)
    return f"{NOT_INSTALLED}; it might add the redundant joints {names}; {_INSTALLING}"


_PARALLEL = 1e-9


def default_task_space(robot: Robot) -> str | list[str]:
    """Return the task space of a whole pose, of three rows, or of those of the plane in which a robot moves."""
    geometry = ChainGeometry.of(robot)
    along = np.abs(
        np.where(
            geometry.revolute[:, None],
            1.0 - np.abs(geometry.axes),
            np.abs(geometry.axes),
        )
    )
    normals = np.flatnonzero(np.all(along < _PARALLEL, axis=0))
    if len(normals):
        return [row for i, row in enumerate(AXES) if i != normals[0]][: robot.n]
    return "pose" if robot.n >= len(POSE_ROWS) else list(AXES[: robot.n])
