"""Search for a closed form for a choice of redundant joints, by geometry.

The built-in families are listed in `BUILTIN`. Other packages add families through the entry-point group ``brachis.ik``,
whose entries are `Family` objects (see `ik_family`). A solver is returned only after its solutions have been checked
with the forward kinematics of the chain (`check_answers`).

If no family fits the chain itself, the families are tried on the closest ideal chain (`snap_axes`). The solutions for
the ideal chain are then polished.
"""

from __future__ import annotations

import importlib.metadata
import itertools
import pickle
from collections.abc import Collection, Sequence
from dataclasses import dataclass, fields, replace
from functools import cache, cached_property

import numpy as np

from brachis.common import tolerances
from brachis.common.arguments import check_list
from brachis.common.words import write_count
from brachis.errors import DecompositionError, InputError, check_names
from brachis.ik.eaik import NOT_INSTALLED, eaik
from brachis.ik.parallel_axes import parallel_axes
from brachis.ik.planar import planar, prismatic
from brachis.ik.point_recipes import positioning
from brachis.ik.protocol import Family, IKSolver, NotApplicableError
from brachis.ik.screws import ChainGeometry
from brachis.ik.snapping import TOLERANCE, PolishedSolver, SnappedChain, snap_axes
from brachis.ik.solver_checks import check_answers, ranges_to_check
from brachis.ik.spherical_wrist import spherical_wrist
from brachis.robot import Robot, TaskMap
from brachis.robot.task_map import task_map_of
from brachis.robot.task_map.protocol import ANGLES, AXES, POSE_ROWS

BUILTIN: tuple[Family, ...] = (
    prismatic,
    planar,
    positioning,
    spherical_wrist,
    parallel_axes,
    eaik,
)
"""The built-in families, in the order in which they are tried."""
_FAILED = "its code failed"
NO_CLOSED_FORM = (
    "no choice of redundant joints has a closed form: "
    "motions are planned from differential inverse kinematics"
)
"""Message for a robot and a task space without any closed form."""


@dataclass(frozen=True)
class TriedDecomposition:
    """One choice of redundant joints, and the result of the search for its closed form.

    Attributes
    ----------
    redundant_joints : tuple of str
    family : str or None
        Name of the family that fits; None if no family fits.
    solver : IKSolver or None
    reasons : dict of str to str
        Reasons why the other families that were tried do not fit, by the names of these families.
    remark : str
        Remark about the solver; empty if there is none.
    """

    redundant_joints: tuple[str, ...]
    family: str | None
    solver: IKSolver | None
    reasons: dict[str, str]
    remark: str = ""


@dataclass(frozen=True)
class Match(TriedDecomposition):
    """A choice of redundant joints with a closed form."""

    family: str
    solver: IKSolver


def check_families(families: Sequence[Family]) -> None:
    """Reject anything except a list of families with unique names.

    Parameters
    ----------
    families : sequence of Family

    Raises
    ------
    InputError
    """
    check_list(families, "families", "closed forms")
    taken = {family.name for family in (*BUILTIN, *plugin_families())}
    for number, family in enumerate(families):
        where = f"families[{number}]"
        if not isinstance(family, Family):
            raise InputError(
                "this object is not a family of closed forms",
                where=where,
                found=repr(family),
                allowed="a function with the decorator @brachis.ik.ik_family(name, source=...), which returns "
                "an IKSolver (docs/own_closed_form.md)",
            )
        if family in BUILTIN:  # families to be tried first
            continue
        problem = _refuse_name(family.name, taken)
        if problem:
            raise InputError(problem, where=f"{where}.name", found=repr(family.name))
        taken.add(family.name)


def _refuse_name(name: object, taken: Collection[str]) -> str | None:
    """Return the reason why a family cannot have this name; None if it can."""
    if not isinstance(name, str) or not name.strip():
        return "a family needs a name"
    return "a family of this name exists already" if name in taken else None


@cache
def plugin_families() -> tuple[Family, ...]:
    """Return the families of the entry-point group ``brachis.ik``; a broken family is reported when it is tried."""
    return tuple(
        _load(entry) for entry in importlib.metadata.entry_points(group="brachis.ik")
    )


def _load(entry: importlib.metadata.EntryPoint) -> Family:
    try:
        family = entry.load()
    except Exception as error:  # noqa: BLE001  (whatever another package's import raises)
        reason = f"the plug-in cannot be loaded: {type(error).__name__}: {error}"
    else:
        if not isinstance(family, Family):
            reason = f"the plug-in's entry point must be a Family, not {type(family).__name__}"
        else:
            problem = _refuse_name(family.name, {builtin.name for builtin in BUILTIN})
            if problem is None:
                return family
            reason = problem

    def refuse(*_arguments: object) -> IKSolver:
        """Raise an error with the reason why the family cannot be used."""
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
        The redundant joints. There must be as many as the robot has joints, less the rows of the task space.
    families : sequence of Family, optional
        Families to try before the built-in and installed ones.

    Returns
    -------
    Match

    Raises
    ------
    UnknownNameError
        A redundant joint does not exist.
    DecompositionError
        The number of redundant joints is wrong, or no family fits. The error lists the reasons, and the choices that
        have a closed form.
    """
    names = tuple(redundant_joints)
    _check_names(robot, task_map, names)
    tried = _Matcher(robot, task_map, families).match(names)
    if isinstance(tried, Match):
        return tried
    raise DecompositionError(
        f"no closed form for redundant joints [{', '.join(names)}]",
        redundant_joints=names,
        reasons=tried.reasons,
        available=[
            choice.redundant_joints
            for choice in find_all(robot, task_map, families=families)
            if choice.solver is not None
        ],
    )


def _check_names(robot: Robot, task_map: TaskMap, names: tuple[str, ...]) -> None:
    """Reject redundant joints that do not exist, and a wrong number of redundant joints.

    Raises
    ------
    UnknownNameError, DecompositionError
    """
    check_names("joint", names, robot.joint_names, "redundant_joints")
    r = robot.n - task_map.m
    if r < 0:
        by = ", ".join(["0.5"] * robot.n)
        raise DecompositionError(
            "the robot has fewer joints than the task space has rows",
            redundant_joints=names,
            found=f"{robot.n} for {task_map.m} rows",
            allowed=f"at most {robot.n} rows, such as [{', '.join(default_task_space(robot))}]; or task_space: joints, "
            f"with a joint path such as line: {{by: [{by}]}}",
        )
    if len(set(names)) != len(names) or len(names) != r:
        joints = write_count(robot.n, "joint")
        rows = write_count(task_map.m, "row")
        raise DecompositionError(
            "wrong number of redundant joints",
            redundant_joints=names,
            found=f"{len(names)} ({', '.join(names) or 'none'})",
            allowed=f"{r}: {joints} less {rows} ({', '.join(task_map.rows)})",
        )


def find_all(
    robot: Robot, task_map: TaskMap, *, families: Sequence[Family] = ()
) -> list[TriedDecomposition]:
    """Try every choice of redundant joints; see `find`. Joint paths need no closed form.

    A virtual joint of the tool that has a range is always redundant, because closed forms do not respect ranges.
    """
    r = robot.n - task_map.m
    if r < 0 or not task_map.is_of_tool:
        return []
    matcher = _Matcher(robot, task_map, families)
    always = tuple(joint.name for joint in robot.tool_joints if joint.is_ranged)
    free_names = [name for name in robot.joint_names if name not in always]
    choices = itertools.combinations(free_names, r - len(always))
    return [matcher.match((*names, *always)) for names in choices]


class _Matcher:
    """The families to try on a robot, and the ideal arms close to it.

    Parameters
    ----------
    robot, task_map, families
        The arguments of `find`.
    """

    def __init__(
        self, robot: Robot, task_map: TaskMap, families: Sequence[Family]
    ) -> None:
        self._robot = robot
        self._task_map = task_map
        check_families(families)
        self._families = (*families, *BUILTIN, *plugin_families())
        self._geometry = ChainGeometry.of(robot)

    @cached_property
    def _ideal(self) -> SnappedChain | None:
        """The ideal arm within the tolerance of the robot; it does not depend on the redundant joints."""
        return snap_axes(self._geometry, self._task_map)

    @cached_property
    def _rough(self) -> SnappedChain | None:
        """The ideal arm within a larger tolerance (rad, m) of the robot; the URDF may be meant to describe it."""
        return snap_axes(self._geometry, self._task_map, 2e-3)

    @cached_property
    def _content(self) -> bytes:
        """Everything on which the result of a match depends, except the families."""
        geometry = self._geometry
        task_map = self._task_map
        content = (
            *(geometry.joint_names, geometry.revolute, geometry.axes, geometry.points),
            *(geometry.tool_position, geometry.tool_rotation),
            *ranges_to_check(self._robot),
            type(task_map),
            *(getattr(task_map, entry.name) for entry in fields(task_map)[1:]),
        )
        return pickle.dumps(content)

    def match(self, names: tuple[str, ...]) -> TriedDecomposition:
        """Try every family on one choice; if none fits, try them on the ideal arm close to the robot."""
        redundant = tuple(sorted(self._robot.joint_names.index(name) for name in names))
        key = (redundant, self._content, *map(id, self._families))
        if key in _KNOWN:
            _, tried = _KNOWN[key]
        else:
            tried = self._find(redundant)
            if len(_KNOWN) >= _MOST_KNOWN:
                _KNOWN.clear()
            reasons = tried.reasons.values()
            # The result is not cached if a library is missing or if code of another package failed, because that may
            # change.
            if not any(
                reason.startswith((NOT_INSTALLED, _FAILED)) for reason in reasons
            ):
                _KNOWN[key] = (self._families, tried)
        return replace(tried, reasons=dict(tried.reasons))

    def _find(self, redundant: tuple[int, ...]) -> TriedDecomposition:
        """Try the families on the robot, then on the ideal arm."""
        reasons: dict[str, str] = {}
        match = self._match(redundant, reasons, None)
        if match is None and self._ideal:
            match = self._match(redundant, reasons, self._ideal)
        if match is None:
            self._name_rounding(redundant, reasons)
            chosen = tuple(self._robot.joint_names[i] for i in redundant)
            return TriedDecomposition(chosen, None, None, reasons)
        return match

    def _match(
        self,
        redundant: tuple[int, ...],
        reasons: dict[str, str],
        ideal: SnappedChain | None,
    ) -> Match | None:
        """Find the first family that fits the robot or the ideal arm; record why the families before it do not fit."""
        geometry = ideal.geometry if ideal else self._geometry
        remark = ""
        for family in self._families:
            try:
                solver = family.build(geometry, self._task_map, redundant)
                if ideal:
                    solver = PolishedSolver(
                        solver, self._geometry, self._task_map, redundant
                    )
                    remark = f"the axes are within {ideal.miss} of an ideal arm's; solutions are refined numerically"
                check_answers(self._robot, self._task_map, redundant, solver)
            except NotApplicableError as reason:
                reasons[family.name] = str(reason)
            except Exception as error:
                if family in BUILTIN:
                    raise
                # The code of another package may fail in any way.
                reasons[family.name] = f"{_FAILED}: {type(error).__name__}: {error}"
            else:
                reasons.pop(family.name, None)
                chosen = tuple(self._robot.joint_names[i] for i in redundant)
                return Match(chosen, family.name, solver, reasons, remark)
        return None

    def _name_rounding(
        self, redundant: tuple[int, ...], reasons: dict[str, str]
    ) -> None:
        """Record which families would fit if the axes were closer to the axes of the ideal arm."""
        rough = self._rough
        if rough is None or max(rough.turned, rough.shifted) < TOLERANCE:
            return
        for family in BUILTIN:
            try:
                family.build(rough.geometry, self._task_map, redundant)
            except NotApplicableError:
                continue
            reasons[family.name] = (
                f"only for an ideal arm, and the axes are off by up to {rough.miss}; up to {TOLERANCE:.0e} is "
                "accepted as rounding. If the URDF rounds angles, as in 1.57, write them with more digits"
            )


_MOST_KNOWN = 256
"""Maximum number of choices of redundant joints whose closed forms are cached."""
_KNOWN: dict[tuple[object, ...], tuple[tuple[Family, ...], TriedDecomposition]] = {}
"""Cached closed forms, so that their formulas are recorded only once, and the families whose ids are in the keys."""


def missing_eaik(tried: Sequence[TriedDecomposition]) -> str:
    """Describe the choices of redundant joints that EAIK might add, and how to install it.

    Parameters
    ----------
    tried : sequence of TriedDecomposition
        All choices, as returned by `find_all`.

    Returns
    -------
    str
        A sentence without its full stop; empty if EAIK is installed or would add nothing.
    """
    further = [
        choice.redundant_joints
        for choice in tried
        if choice.solver is None and choice.reasons.get(eaik.name) == NOT_INSTALLED
    ]
    if not further:
        return ""
    names = ", ".join("[" + ", ".join(joints) + "]" for joints in further)
    return (
        f"{NOT_INSTALLED}; it might add the redundant joints {names}; "
        "installing it needs a C++ compiler, except on macOS and on Linux for x86_64 with Python 3.13 or older"
    )


def default_task_space(robot: Robot) -> str | list[str]:
    """Return the default task space: a whole pose, three rows, or the rows of the plane in which a robot moves.

    If all revolute joints are along one axis of the world, the angle about it is the fourth row.
    """
    geometry = ChainGeometry.of(robot)
    sizes = np.abs(geometry.axes)
    along = np.where(geometry.revolute[:, None], 1.0 - sizes, sizes)
    normals = np.flatnonzero(np.all(along < tolerances.LENGTH, axis=0))
    if len(normals):
        return [row for i, row in enumerate(AXES) if i != normals[0]][: robot.n]
    is_along = along < tolerances.LENGTH
    for axis in np.flatnonzero(is_along[geometry.revolute].all(axis=0)):
        rows = [*AXES, ANGLES[axis]]
        jacobians = task_map_of(robot, rows).sample_jacobians()
        if np.linalg.matrix_rank(jacobians, tol=tolerances.WRITTEN).max() == len(rows):
            return rows
    return "pose" if robot.n >= len(POSE_ROWS) else list(AXES[: robot.n])
