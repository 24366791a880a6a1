"""``brachis inspect``: show the joints and closed forms of a robot, and the path and postures of a task."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

from typer import Argument

import brachis
from brachis.apps.cli.app import (
    Changes,
    Degrees,
    Json,
    Verbosity,
    get_verbosity,
    load_changed_task,
    read_changes,
    refuse_options,
    task_space_of,
    urdf_of,
)
from brachis.apps.cli.output import (
    print_fit,
    print_json,
    print_lines,
    print_segments,
    print_table,
    write_posture,
)
from brachis.common.files import is_task_file
from brachis.common.words import write_count
from brachis.errors import InputError, check_names

if TYPE_CHECKING:
    from brachis import ik
    from brachis.problem.problem import Problem
    from brachis.robot import Robot
    from brachis.task import Task

_NONE = "none"
"""Entry of a table for a missing limit or mass, and for a joint without friction."""
_LISTED = 12
"""Maximum number of choices of redundant joints that are printed without --verbose."""


def inspect(
    source: Annotated[Path, Argument(metavar="URDF|TASK")],
    task_space: str | None = None,
    tool_frame: str | None = None,
    base_frame: str | None = None,
    posture: str | None = None,
    frame: str | None = None,
    lock: list[str] | None = None,
    degrees: Degrees = False,
    changes: Changes = None,
    json: Json = False,
) -> None:
    """Show a robot's joints and its closed forms.

    The command prints the limits, mass and friction of every joint, and the choices of redundant joints that have a
    closed form. With --verbose, the command also prints the branches, the reasons why other choices have no closed
    form, and the pairs of bodies that may collide.

    Parameters
    ----------
    source : path
        URDF file, name of an included robot, or task file. A task file shows its robot with the limits and masses in
        use, and its path with the postures at both ends.
    task_space : str, optional
        What the path prescribes: rows such as x,y or x,y,z,yaw, or a word such as pose or axis. Default: the task space
        of the task, or the largest one that the robot allows.
    posture : str, optional
        Show where the tool is in this posture, given as joint positions such as '0, 0.3, 1.2' or by its name in the
        task.
    frame : str, optional
        Frame, named in the task, in which the place of the tool is shown. Default: the world.
    lock : list of str, optional
        Joint to hold at a position, given as name=value. The option can be repeated.

    Examples
    --------
    brachis inspect task.yaml
    brachis inspect tx90l_rail --task-space pose
    """
    from brachis.robot import bind
    from brachis.robot.from_task import robot_from_settings
    from brachis.task import PathPart, name_task_file

    remarks: list[str] = []
    task = problem = tolerances = None
    place: dict[str, Any] = {}
    collisions: dict[str, list[Any]] = {"solids": [], "pairs": [], "never_free": []}
    keys = read_changes(changes)
    space: str | Sequence[str] | None = task_space_of(task_space)
    if is_task_file(source):
        options = {
            "--tool-frame": tool_frame,
            "--base-frame": base_frame,
            "--lock": lock,
        }
        set_it = "robot.tool_frame, robot.base_frame, robot.locked_joints"
        refuse_options(options, "a task file", f"a URDF; in a task file, set {set_it}")
        task = load_changed_task(source, keys)
        first = next((p for p in task.program if isinstance(p, PathPart)), task)
        space = space or first.task_space
        tolerances = first.tolerances
        with name_task_file(source, keys):
            robot = robot_from_settings(task.robot)
    else:
        refuse_options({"--set": changes, "--frame": frame}, "a URDF", "a task file")
        source = urdf_of(source)
        robot = _robot_of_urdf(source, tool_frame, base_frame, lock or [], remarks)
    if posture is None:
        refuse_options({"--frame": frame}, "no posture", "--posture")
    else:
        place = _place_tool(robot, posture, frame, task, remarks)
    if task is not None:
        with name_task_file(source, keys):
            problem = _problem_of(robot, task, collisions, remarks, is_needed=not place)
    if space is None:
        space = brachis.ik.default_task_space(robot)
        words = space if isinstance(space, str) else ",".join(space)
        remarks.append(f"task space: {words}; --task-space chooses a different one")
    with name_task_file(None if task_space else source, keys):
        robot, task_map = bind(robot, space, tolerances)
        # A move has no task coordinates.
        candidates = brachis.ik.find_all(robot, task_map) if task_map.m else []
    with name_task_file(source, keys):
        remarks += _warnings(robot, problem)
    if candidates and not any(candidate.solver for candidate in candidates):
        remarks.append(brachis.ik.NO_CLOSED_FORM)
    if missing := brachis.ik.missing_eaik(candidates):
        remarks.append(missing)
    summary = {
        "robot": str(source),
        "tool": place,
        "task_space": list(task_map.rows),
        "degree_of_redundancy": robot.n - task_map.m,
        "remarks": remarks,
        "decompositions": [_decomposition(candidate) for candidate in candidates],
    }
    data = summary | _describe(robot, problem, collisions)
    if json:
        print_json(data)
    else:
        _print_robot(robot, problem, data, degrees=degrees)


def _problem_of(
    robot: Robot,
    task: Task,
    collisions: dict[str, list[Any]],
    remarks: list[str],
    *,
    is_needed: bool,
) -> Problem | None:
    """Return the problem of a task, or None if it cannot be planned; `remarks` and `collisions` get the reasons."""
    from brachis.problem.plausibility import check_within_reach, of_robot
    from brachis.problem.program import bind_task
    from brachis.problem.task_plausibility import of_task
    from brachis.robot.plausibility import report_issues
    from brachis.scene import MANY_POSTURES

    try:
        collisions |= _collisions(robot, task)
        remarks += [
            f"{' and '.join(pair)} are never clear of each other: they are too close in all "
            f"{MANY_POSTURES} random postures; if they may touch, add [{', '.join(pair)}] to collisions.disable"
            for pair in collisions["never_free"]
        ]
        problem = bind_task(robot, task)
        check_within_reach(problem)
    except InputError as error:
        report_issues(of_robot(robot) + of_task(task), strict=task.strict)
        if is_needed and not collisions["never_free"]:
            raise
        remarks.append(f"the task cannot be planned: {error}")
        return None
    return problem


def _describe(
    robot: Robot, problem: Problem | None, collisions: dict[str, list[Any]]
) -> dict[str, Any]:
    """Describe robot and task as plain data for JSON. Free ends, and the length of a joint path, are None."""
    from brachis.limits import describe_guarantees, joint_limits_of
    from brachis.robot.from_task import in_use
    from brachis.task import part_names
    from brachis.task.fields import plain

    limits = joint_limits_of(robot) if problem is None else problem.limits
    data = {
        "tool_frame": robot.tool_frame,
        "base_frame": robot.base_frame,
        "in_use": in_use(robot),
        "joints": _joint_rows(robot),
        "guarantees": describe_guarantees(limits),
        "collisions": collisions,
        "fits": [fit.to_dict() for fit in problem.task.fits] if problem else [],
    }
    if problem is None:
        return data
    return data | {
        "joint_names": list(problem.robot.joint_names),
        "position_units": list(problem.robot.position_units),
        "start_posture": plain(problem.start),
        "end_posture": plain(problem.end),
        "path": {
            "segments": [segment.kind for segment in problem.task.path],
            "length": problem.path.length if problem.task_map.axes else None,
        },
        "parts": part_names(problem.task.program),
    }


def _warnings(robot: Robot, problem: Problem | None) -> list[str]:
    """List implausible values, or raise PlausibilityError where planning the task would raise it."""
    from brachis.problem.plausibility import of_places, of_robot
    from brachis.problem.task_plausibility import of_task
    from brachis.robot.plausibility import refuse_issues

    issues = of_robot(robot)
    strict = None
    if problem is not None:
        issues += of_task(problem.task) + of_places(problem)
        strict = problem.task.strict
    return [f"warning: {issue}" for issue in refuse_issues(issues, strict=strict)]


def _place_tool(
    robot: Robot,
    posture: str,
    frame: str | None,
    task: Task | None,
    remarks: list[str],
) -> dict[str, Any]:
    """Describe the tool's place in a frame of the task or in the world, as keys of a task; add to `remarks`."""
    import numpy as np
    from scipy.spatial.transform import Rotation

    from brachis.common.arguments import numbers
    from brachis.common.arrays import clear_rounding
    from brachis.problem.plausibility import of_postures
    from brachis.robot.plausibility import refuse_issues
    from brachis.task.points.units import CONVENTIONS, values_of
    from brachis.task.settings import place_frame

    named = {} if task is None else task.postures
    if posture.isidentifier():
        check_names("posture", [posture], named, "--posture")
    joints: object = named.get(posture)
    if joints is None:
        words = posture.replace(",", " ").split()
        joints = numbers(words, "--posture", "rad or m")
    q = robot.posture(joints, "--posture")
    issues = refuse_issues(tuple(of_postures(robot, "--posture", q)), strict=False)
    remarks += [f"warning: {issue}" for issue in issues]
    placement = robot.tool_placement(q)
    if task is not None and frame is not None:
        check_names("frame", [frame], task.frames, "--frame")
        placement = place_frame(task.frames, frame).transform.actInv(placement)
    position = clear_rounding(placement.translation).tolist()
    place = {"frame": frame, "position": position}
    for name, convention in CONVENTIONS.items():
        values = values_of(name, Rotation.from_matrix(placement.rotation))
        values = np.degrees(values) if convention.euler else values
        key = f"{name}_deg" if convention.euler else name
        place[key] = clear_rounding(values).tolist()
    return place


def _print_robot(
    robot: Robot, problem: Problem | None, data: dict[str, Any], *, degrees: bool
) -> None:
    """Print the whole description for a person."""
    chain = f"{robot.base_frame} -> {robot.tool_frame}"
    joints = write_count(robot.n, "joint")
    print_lines(f"{data['robot']}: {chain}, {joints}")
    _print_place(data["tool"])
    print_lines(*data["remarks"])
    rows = _joint_rows(robot, degrees=degrees)
    shown = [key for key in rows[0] if any(row[key] != _NONE for row in rows)]
    cells = [[row[key] for key in shown] for row in rows]
    print_table("joints", shown, cells, numbers={*shown} - {"joint", "type"})
    print_lines(*(f"{name}: {text}" for name, text in data["in_use"].items()))
    guarantees = data["guarantees"]
    for text in dict.fromkeys(guarantees.values()):
        names = [name for name in guarantees if guarantees[name] == text]
        print_lines(f"limits on {', '.join(names)}: {text}")
    pairs = data["collisions"]["pairs"]
    if pairs:
        listed = (
            f":\n  {'; '.join(pairs)}"
            if get_verbosity() is Verbosity.VERBOSE
            else " (--verbose lists them)"
        )
        print_lines(f"{write_count(len(pairs), 'pair')} that may collide{listed}")
    if problem is not None:
        task = problem.task
        for end in ("start", "end"):
            posture = write_posture(data, f"{end}_posture", degrees=degrees)
            print_lines(f"{end} posture: {posture}")
        if task.program:
            print_lines(f"program: {', '.join(data['parts'])}")
        kinds = [segment.kind for segment in task.path]
        length = data["path"]["length"]
        long = "" if length is None else f", {length:.4g} m long"
        named = ", ".join(dict.fromkeys(kinds))
        if kinds:
            count = write_count(len(kinds), "segment")
            print_lines(f"path: {count} ({named}){long}")
        print_segments(problem.path)
        for fit in task.fits:
            print_fit(fit)
    redundancy = data["degree_of_redundancy"]
    space = ", ".join(data["task_space"])
    print_lines(f"task space [{space}]: degree of redundancy {redundancy}")
    if redundancy < 0:
        print_lines(
            "The robot has fewer joints than the task space has rows: prescribe fewer rows."
        )
    else:
        _print_decompositions(data["decompositions"])


def _collisions(robot: Robot, task: Task) -> dict[str, list[Any]]:
    """List the names of all solids of robot and scene, of pairs that may collide, and of pairs that always do."""
    from brachis.scene import find_never_free, scene_of

    scene = scene_of(robot, task)
    if scene is None:
        return {}
    stuck = find_never_free(scene, robot, task.collisions.clearance)
    # Pairs with bodies of the scene come first.
    pairs = (-scene.pairs.max(axis=1)).argsort(kind="stable").tolist()
    return {
        "solids": [solid.name for solid in scene.solids],
        "pairs": [scene.names(pair) for pair in pairs],
        "never_free": [
            [scene.solids[number].name for number in pair] for pair in stuck.pairs
        ],
    }


def _joint_rows(robot: Robot, *, degrees: bool = False) -> list[dict[str, str]]:
    """List the name, type, axis, limits, mass and friction of every joint, with units.

    The mass given for a joint is that of the links between this joint and the next one. For the last joint, the mass
    includes the payload.
    """
    from brachis.robot.joints import UNITS, shown_unit
    from brachis.robot.limits import MAGNITUDES

    chain = robot.chain
    limits = robot.limits
    columns = {"range": "position"}
    columns |= {kind.replace("_", " "): kind for kind in MAGNITUDES}
    rows = []
    for i, (name, unit) in enumerate(
        zip(robot.joint_names, robot.position_units, strict=True)
    ):
        axis = chain.axes[i].round(6) + 0.0
        row = {
            "joint": name,
            "type": "revolute" if chain.revolute[i] else "prismatic",
            "axis at zero": " ".join(f"{component:.4g}" for component in axis),
        }
        for key, kind in columns.items():
            shown, factor = shown_unit(UNITS[kind][unit], degrees=degrees)
            lower, upper = factor * limits.both_ways(kind)[:, i]
            text = f"{lower:.4g} to {upper:.4g} {shown}"
            if lower == -upper and key != "range":
                text = f"{upper:.4g} {shown}"
            if (lower, upper) == (-float("inf"), float("inf")):
                text = _NONE
            row[key] = text
        mass = robot.dynamic_chain.masses[i]
        row["mass"] = f"{mass:.4g} kg" if mass else _NONE
        for key in ("viscous", "coulomb", "armature"):
            value = getattr(robot.friction, key)[i]
            row[key] = f"{value:.4g} {UNITS[key][unit]}" if value else _NONE
        rows.append(row)
    return rows


def _robot_of_urdf(
    path: Path,
    tool_frame: str | None,
    base_frame: str | None,
    lock: Sequence[str],
    remarks: list[str],
) -> Robot:
    """Create the robot of a URDF with the limits that the file states; missing limits are not an error here.

    Without a tool frame, the chain is the first limb of the URDF. `remarks` then name the other choices.
    """
    import numpy as np

    from brachis.common.arguments import numbers
    from brachis.robot.urdf import default_chain, read_file

    if tool_frame is None:
        limb = default_chain(read_file(path), str(path))
        tool_frame = limb.tool
        if limb.base and base_frame is None:
            base_frame = limb.base
            remarks.append(
                f"base frame: {limb.base}, from which several limbs branch off; --base-frame chooses a different one"
            )
        if len(limb.leaves) > 1:
            remarks.append(
                f"tool frame: {limb.tool}, the last link before the chains to {', '.join(limb.leaves)} branch off; "
                "--tool-frame chooses a different one"
            )
    locked = {}
    for text in lock:
        name, equals, value = text.partition("=")
        if not equals:
            raise InputError(
                "not understood",
                where="--lock",
                found=text,
                allowed="name=value, in rad or m",
            )
        locked[name] = float(numbers(value, f"--lock {name}", "rad or m"))
    robot = brachis.Robot.from_urdf(
        path,
        tool_frame=tool_frame,
        base_frame=base_frame,
        locked_joints=locked,
        limits=brachis.LimitSpec(torque=None, velocity=None, acceleration=1.0),
    )
    magnitudes = {}
    for kind in ("acceleration", "velocity", *("torque",) * robot.has_masses):
        stated = [limit.of_kind(kind) for limit in robot.urdf_limits]
        magnitudes[kind] = np.array([np.inf if x is None else x for x in stated])
    return replace(robot, limits=robot.limits.with_magnitudes(**magnitudes))


def _decomposition(candidate: ik.TriedDecomposition) -> dict[str, Any]:
    """Describe one choice of redundant joints: its solver, or the reason why it has none."""
    row: dict[str, Any] = {
        "redundant joints": ", ".join(candidate.redundant_joints) or "none",
        "solver": "-",
        "branches": 0,
        "labels": "",
        "why not": "",
        "remark": candidate.remark,
    }
    solver = candidate.solver
    if solver is None:
        reasons = candidate.reasons.items()
        row["why not"] = "; ".join(f"{name}: {why}" for name, why in reasons)
        return row
    several = f" (up to {solver.alternatives})" if solver.alternatives > 1 else ""
    row["solver"] = candidate.family
    row["branches"] = len(solver.branches)
    row["labels"] = ", ".join(f"{label}{several}" for label in solver.branches)
    return row


def _print_decompositions(rows: Sequence[dict[str, Any]]) -> None:
    """Print a table of all choices, with the branches of choices that have a solver and the reasons for the others."""
    columns = ["redundant joints", "solver", "branches"]
    if any(row["remark"] for row in rows):
        columns.append("remark")
    rows = sorted(rows, key=lambda row: row["solver"] == "-")
    is_verbose = get_verbosity() is Verbosity.VERBOSE
    shown = rows if is_verbose else rows[:_LISTED]
    cells = [[row[name] for name in columns] for row in shown]
    print_table("choices of redundant joints (-: no closed form)", columns, cells)
    if not is_verbose:
        omission = f"... and {len(rows) - len(shown)} more; " if rows != shown else ""
        print_lines(
            f"{omission}--verbose lists the branches, and why other choices have no closed form"
        )
        return
    for labels in dict.fromkeys(row["labels"] for row in rows if row["labels"]):
        alike = [row["redundant joints"] for row in rows if row["labels"] == labels]
        print_lines(f"branches with {'; '.join(alike)} redundant: {labels}")
    for row in rows:
        if row["why not"]:
            print_lines(f"not {row['redundant joints']}: {row['why not']}")


def _print_place(place: dict[str, Any]) -> None:
    """Print the tool's position, and its orientation in every convention, in the form that a task file uses."""
    from brachis.task.points.units import CONVENTIONS

    for key, values in place.items():
        if key == "frame":
            print_lines(f"the tool in {values or 'the world'}:")
            continue
        convention = CONVENTIONS.get(key.removesuffix("_deg"))
        about = f"{convention.meaning}: {convention.makers}" if convention else "m"
        numbers = ", ".join(f"{value:.9g}" for value in values)
        print_lines(f"  {key}: [{numbers}]  # {about}")
