"""Building a scene: the solids of a task and of its robot, and the pairs of them that must not touch."""

from __future__ import annotations

import itertools
from collections.abc import Iterable, Sequence
from pathlib import Path

import numpy as np
from lxml import etree

from brachis.common.files import read_text
from brachis.errors import TaskError, UnknownNameError
from brachis.robot import Robot
from brachis.robot.urdf_bodies import placement_matrix
from brachis.robot.urdf_elements import UrdfTree, end_of, read_tree
from brachis.scene.chain import Chain
from brachis.scene.scene import Scene
from brachis.scene.solids import Solid, build_capsules, build_solids, read_solids
from brachis.task import Task

_POSTURES = 100
"""Random postures in which links that always touch are found."""


def scene_of(robot: Robot, task: Task) -> Scene | None:
    """Put the bodies of a task's scene and of the robot together; None where the task looks at none.

    Raises
    ------
    TaskError
        A name is unknown; the robot has no collision geometry; a mesh, or a URDF of the scene, cannot be read.
    UrdfError
        The collision geometry of a URDF cannot be read.
    """
    settings = task.collisions
    if task.collision_mode == "off":
        return None
    folder = Path(robot.source).absolute().parent
    tree = read_tree(robot.urdf, robot.source)
    _check_names("collisions.padding", settings.padding, tree.links)
    own = list(read_solids(tree, folder, settings.padding))
    if not own and settings.capsules == "auto":
        own = list(build_capsules(tree, settings.padding))
    if not own:
        raise TaskError(
            "the robot has no collision geometry",
            where="scene",
            found=f"no <collision> in {robot.source}",
            allowed="a URDF with <collision> elements",
            hint="Add them, or set collisions.capsules: auto, or collisions.mode: off",
        )
    solids = (*own, *itertools.chain(*map(build_solids, task.scene)))
    joints = np.zeros(len(solids), dtype=int)
    placements = np.array([solid.placement for solid in solids])
    for number, solid in enumerate(solids):
        if solid.link is None:
            continue
        _check_names(f"scene: {solid.name}.link", [solid.link], tree.links)
        joints[number], placed = find_carrier(robot, solid.link)
        placements[number] = placed @ solid.placement
    names = {*tree.links, *(solid.name for solid in solids)}
    listed = itertools.chain(*settings.disable)
    _check_names("collisions.disable", listed, sorted(names), "link or body")
    disabled = [*settings.disable, *_read_srdf(settings.srdf)]
    links = {solid.name: solid.link for solid in own}
    pairs = [
        (first, second)
        for first, second in itertools.combinations(range(len(solids)), 2)
        if joints[first] != joints[second]
        and not _may_touch(solids[first], solids[second], links, disabled)
    ]
    numbers = np.reshape(pairs, (-1, 2)).astype(int)
    scene = Scene(solids, joints, placements, numbers, len(own))
    return scene.with_pairs(_find_hazards(scene, robot, tree, task))


def find_carrier(robot: Robot, link: str) -> tuple[int, np.ndarray]:
    """Find the joint that moves a link, 0 for none, and where the link is in its frame, or in the world, (4, 4)."""
    joint, placed = robot.urdf_dynamics.links[link]
    if not joint:
        placed = placement_matrix(robot.settings.mounting) @ placed
    return joint, placed


def _check_names(
    where: str, names: Iterable[str], known: Iterable[str], kind: str = "link"
) -> None:
    """Refuse names that are not known."""
    known = tuple(known)
    for name in names:
        if name not in known:
            raise UnknownNameError(kind, name, known, where=where)


def _find_hazards(scene: Scene, robot: Robot, tree: UrdfTree, task: Task) -> np.ndarray:
    """Choose the pairs to look at: of those within the robot the ones that do not belong together.

    Links that a joint joins may touch, and so may those that overlap in every one of many random postures.
    """
    within = scene.pairs[:, 1] < scene.own  # the robot's solids come first
    own = np.flatnonzero(within)
    others = np.flatnonzero(~within)
    if not task.collisions.self_collision:
        return others
    joined = {
        frozenset((end_of(joint, "parent"), end_of(joint, "child")))
        for joint in tree.joints.values()
    }
    links = [
        frozenset(scene.solids[i].link or "" for i in pair) for pair in scene.pairs[own]
    ]
    are_joined = np.array([pair in joined for pair in links], dtype=bool)
    ends = robot.limits.both_ways("position")
    half = np.where(robot.revolute, np.pi, 1.0)  # rad or m, for joints without an end
    low, high = np.where(np.isfinite(ends), ends, [-half, half])
    q = np.random.default_rng(0).uniform(low, high, (_POSTURES, robot.n))
    close = scene.with_pairs(own).find_close(Chain.of(robot.model).place(q), 0.0)
    counts = np.bincount(close.pair, minlength=len(own))
    kept = own[~are_joined & (counts < _POSTURES)]
    return np.sort(np.concatenate([kept, others]))


def _read_srdf(srdf: str | None) -> list[tuple[str, str]]:
    """List the pairs of links that an SRDF file disables."""
    if srdf is None:
        return []
    where = f"collisions.srdf: {srdf}"
    text = read_text(Path(srdf), where=where, folder=Path.cwd())
    try:
        root = etree.fromstring(text.encode())
    except etree.XMLSyntaxError as error:
        problem = "the SRDF file is not XML"
        raise TaskError(problem, where=where, found=str(error)) from error
    found = root.iter("disable_collisions")
    return [(str(each.get("link1")), str(each.get("link2"))) for each in found]


def _may_touch(
    first: Solid,
    second: Solid,
    links: dict[str, str | None],
    disabled: Sequence[tuple[str, str]],
) -> bool:
    """Tell whether two solids are disabled: the robot's own by name or link, bodies of the scene by name alone."""
    names = [{each.name, links.get(each.name, each.name)} for each in (first, second)]
    return any(
        (a in names[0] and b in names[1]) or (a in names[1] and b in names[0])
        for a, b in disabled
    )
