"""Building a scene: the solids of a task and of its robot, and the pairs of solids that must not touch."""

from __future__ import annotations

import itertools
from pathlib import Path

import numpy as np
from lxml import etree

from brachis.common.arguments import check_most
from brachis.common.files import read_text
from brachis.errors import TaskError, check_names
from brachis.robot import Robot
from brachis.robot.urdf_bodies import placement_matrix
from brachis.robot.urdf_elements import UrdfTree, end_of, read_tree
from brachis.scene.chain import Chain
from brachis.scene.scene import Scene
from brachis.scene.solids import build_capsules, build_solids, read_solids
from brachis.task import Task
from brachis.task.settings import place_frame

_MOST_PAIRS = 4000
"""Maximum number of pairs of bodies in a plan: this number takes 0.9 GB of memory and half a minute."""
_POSTURES = 100
"""Number of random postures used to find links that always touch."""


def scene_of(robot: Robot, task: Task) -> Scene | None:
    """Build the scene from the bodies of the task and of the robot; None if collisions are switched off.

    Raises
    ------
    TaskError
        A name is unknown; the robot has no collision geometry; or a mesh or a URDF of the scene cannot be read.
    UrdfError
        The collision geometry of a URDF cannot be read.
    """
    settings = task.collisions
    if task.collision_mode == "off":
        return None
    folder = Path(robot.source).absolute().parent
    tree = read_tree(robot.urdf, robot.source)
    check_names("link", settings.padding, tree.links, "collisions.padding")
    robot_solids = list(read_solids(tree, folder, settings.padding))
    if not robot_solids and settings.capsules == "auto":
        robot_solids = list(build_capsules(tree, settings.padding))
    if not robot_solids:
        raise TaskError(
            "the robot has no collision geometry",
            where="scene",
            found=f"no <collision> in {robot.source}",
            allowed="a URDF with <collision> elements",
            hint="Add them, or set collisions.capsules: auto, or collisions.mode: off",
        )
    solids = list(robot_solids)
    for body in task.scene:
        frame = placement_matrix(place_frame(task.frames, body.frame))
        solids += build_solids(body, frame)
    base = placement_matrix(robot.settings.base_placement)
    hint = (
        "Leave out bodies that the robot cannot reach, or join small bodies in one mesh"
    )
    problem = "the scene has too many bodies"
    check_most(len(solids), _MOST_PAIRS, "bodies", problem, "scene", hint)
    joints = np.zeros(len(solids), dtype=int)
    placements = np.array([solid.placement for solid in solids])
    for number, solid in enumerate(solids):
        if solid.link is None:
            joints[number], world = robot.world
            placements[number] = world @ placements[number]
            continue
        check_names("link", [solid.link], tree.links, f"scene: {solid.name}.link")
        joints[number], placed = robot.urdf_dynamics.links[solid.link]
        placements[number] = placed @ solid.placement
        if not joints[number]:  # it is placed in the first link
            placements[number] = base @ placements[number]
    listed = itertools.chain(*settings.disable)
    known = sorted({*tree.links, *(solid.name for solid in solids)})
    check_names("link or body", listed, known, "collisions.disable")
    disabled = {*map(frozenset, [*settings.disable, *_read_srdf(settings.srdf)])}
    # A solid of the robot can also be given by the name of its link; a body of the scene only by its own name.
    names = [{solid.name, solid.link} for solid in robot_solids]
    names += [{solid.name} for solid in solids[len(robot_solids) :]]
    pairs = [
        (first, second)
        for first, second in itertools.combinations(range(len(solids)), 2)
        if joints[first] != joints[second]
        and not any(
            frozenset(pair) in disabled
            for pair in itertools.product(names[first], names[second])
        )
    ]
    check_most(len(pairs), _MOST_PAIRS, "pairs to keep apart", problem, "scene", hint)
    numbers = np.reshape(pairs, (-1, 2)).astype(int)
    scene = Scene(tuple(solids), joints, placements, numbers, len(robot_solids))
    return scene.with_pairs(_find_hazards(scene, robot, tree, task))


def _find_hazards(scene: Scene, robot: Robot, tree: UrdfTree, task: Task) -> np.ndarray:
    """Select the pairs to check, (P,) bool; within the robot, leave out pairs of links that may touch.

    Links that are connected by a joint may touch, as may links that overlap in all of many random postures.
    """
    is_within = scene.pairs[:, 1] < scene.robot_count  # the robot's solids come first
    is_hazard = ~is_within
    if not task.collisions.self_collision:
        return is_hazard
    joined = [
        {end_of(joint, "parent"), end_of(joint, "child")}
        for joint in tree.joints.values()
    ]
    inner = scene.with_pairs(is_within)
    is_stuck = _always_closer(inner, robot, 0.0, _POSTURES)
    is_hazard[is_within] = [
        not stuck and {scene.solids[i].link for i in pair} not in joined
        for pair, stuck in zip(inner.pairs, is_stuck, strict=True)
    ]
    return is_hazard


def _always_closer(
    scene: Scene, robot: Robot, distance: float, count: int
) -> np.ndarray:
    """Tell which pairs, (P,) bool, are closer than a distance, m, in all `count` random postures."""
    ends = robot.limits.both_ways("position")
    half = np.where(robot.revolute, np.pi, 1.0)  # rad or m, for joints without an end
    low, high = np.where(np.isfinite(ends), ends, [-half, half])
    q = np.random.default_rng(0).uniform(low, high, (count, robot.n))
    close = scene.find_close(Chain.of(robot.model).place(q), distance)
    return np.bincount(close.pair, minlength=len(scene.pairs)) == count


MANY_POSTURES = 2000
"""Number of random postures used to find pairs that are never clear: a pair clear in 1 % of postures is recognised."""


def find_never_free(scene: Scene, robot: Robot, clearance: float) -> Scene:
    """Return the scene with only those pairs that violate the clearance, m, in all `MANY_POSTURES` random postures."""
    suspects = scene.with_pairs(_always_closer(scene, robot, clearance, _POSTURES))
    return suspects.with_pairs(
        _always_closer(suspects, robot, clearance, MANY_POSTURES)
    )


def _read_srdf(srdf: str | None) -> list[tuple[str, str]]:
    """Return the pairs of links that an SRDF file disables."""
    if srdf is None:
        return []
    where = f"collisions.srdf: {srdf}"
    text = read_text(Path(srdf), where=where, folder=Path.cwd())
    try:
        root = etree.fromstring(text.encode())
    except etree.XMLSyntaxError as error:
        raise TaskError(
            "the SRDF file is not XML", where=where, found=str(error)
        ) from error
    elements = root.iter("disable_collisions")
    return [(element.get("link1"), element.get("link2")) for element in elements]
