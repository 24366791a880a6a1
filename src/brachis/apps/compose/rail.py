"""An arm on a linear axis.

Reading the URDF of an arm that is to be mounted elsewhere, and what changes in it there.
"""

from __future__ import annotations

import math
import os
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import pinocchio as pin
from lxml import etree

from brachis.apps.compose import checks, elements
from brachis.apps.compose.elements import Element
from brachis.common import files
from brachis.common.files import atomic_write, status_of, writing_errors
from brachis.errors import InputError
from brachis.robot.urdf import check_inertias, read_file
from brachis.robot.urdf_bodies import read_dynamics
from brachis.robot.urdf_elements import read_tree


@dataclass(frozen=True)
class Arm:
    """A URDF as XML, so that whatever yourdfpy does not know is kept as written.

    Attributes
    ----------
    robot : lxml element
        The ``<robot>`` element.
    root_link : str
        The only link that no joint moves or holds.
    link_names, joint_names : tuple of str
        All links and joints, in the order of the file.
    source : Path
        The file.
    """

    robot: Element
    root_link: str
    link_names: tuple[str, ...]
    joint_names: tuple[str, ...]
    source: Path


def read_arm(source: Path) -> Arm:
    """Read a URDF whose links form one tree.

    Raises
    ------
    UrdfError
        See `read_file` and `read_tree`.
    """
    tree = read_tree(read_file(source), str(source))
    return Arm(tree.robot, tree.root, tuple(tree.links), tuple(tree.joints), source)


def rename_link(robot: Element, old: str, new: str) -> None:
    """Give a link another name wherever the URDF mentions it."""
    for element in robot.iter(etree.Element):
        if element.tag == "link" and element.get("name") == old:
            element.set("name", new)
        for attribute in ("link", "reference"):
            if element.get(attribute) == old:
                element.set(attribute, new)


def drop_meshes(robot: Element) -> None:
    """Remove every visual and collision whose geometry is a mesh; primitives stay."""
    for link in robot.findall("link"):
        for element in (*link.findall("visual"), *link.findall("collision")):
            if element.find("geometry/mesh") is not None:
                link.remove(element)


def relocate_meshes(robot: Element, source: Path, target: Path | None) -> None:
    """Name mesh and texture files, which are found from the folder of `source`, relative to the folder of `target`.

    Without `target` they become absolute. Absolute names stay as they are, and so do packages that ROS finds, or that
    are nowhere.
    """
    old = source.parent.resolve()
    new = None if target is None else target.parent.resolve()
    for element in robot.iter("mesh", "texture"):
        name = element.get("filename")
        if not name or Path(name).is_absolute():
            continue
        scheme, _, within = name.partition("://")
        path: Path | None = old / name
        if within:
            by_ros = any(files.is_file(place) for place in files.ros_files(within))
            path = None if by_ros or scheme != "package" else files.mesh_file(name, old)
        if path is None:
            continue
        element.set(
            "filename",
            os.path.normpath(path) if new is None else os.path.relpath(path, new),
        )


def check_composed(text: str, joint: str, where: str) -> None:
    """Refuse numbers that are none, and bodies below `joint` that cannot be.

    On a moving axis even the inertia of the arm's root link counts, which no joint moved before.

    Raises
    ------
    UrdfError
    """
    tree = read_tree(text, where)
    carried = read_dynamics(tree, (joint,), {}, tree.root)
    check_inertias(tree, carried.bodies, where)


@dataclass(frozen=True, kw_only=True)
class Rail:
    """A linear axis with its carriage. Its figures are never guessed.

    Attributes
    ----------
    range : (2,) sequence of float
        Lowest and highest position on the rail, m.
    velocity : float
        Limit of the rail's speed, m/s.
    force : float
        Limit of the rail's drive force, N. It accelerates carriage and arm, and carries them on a rail that is not
        horizontal.
    mass : float
        Mass of the carriage, kg: a solid box.
    axis : (3,) sequence of float
        Direction of the rail in the world frame, any length but zero; horizontal, vertical or tilted.
    mount_xyz, mount_rpy : (3,) sequence of float
        Placement of the arm's root link on the carriage, m and rad (roll, pitch and yaw about the fixed axes x, y, z
        of the world frame). ``(pi, 0, 0)`` hangs the arm upside down, ``(0, pi / 2, 0)`` mounts it on a wall.
    carriage_size : (3,) sequence of float
        Sides of the carriage, m, along the axes of the mounted arm's root link, whose origin is the middle of the
        box's top. For the drawing; the carriage only shifts, so that its inertia never enters the motion.
    name : str
        Name of the joint, and the beginning of the other new names.
    root : str
        Name of the root link.

    Raises
    ------
    InputError
        A figure cannot be.
    """

    range: Sequence[float]
    velocity: float
    force: float
    mass: float
    axis: Sequence[float] = (0.0, 1.0, 0.0)
    mount_xyz: Sequence[float] = elements.ZERO
    mount_rpy: Sequence[float] = elements.ZERO
    carriage_size: Sequence[float] = (0.4, 0.4, 0.1)
    name: str = "rail"
    root: str = "world"

    def __post_init__(self) -> None:
        """Check the figures."""
        checked = {
            "range": checks.interval(self.range, "range", "m"),
            "name": checks.identifier(self.name, "name"),
            "root": checks.identifier(self.root, "root"),
            "axis": checks.direction(self.axis, "axis"),
            "velocity": checks.positive(self.velocity, "velocity", "m/s"),
            "force": checks.positive(self.force, "force", "N"),
            "mass": checks.positive(self.mass, "mass", "kg"),
            "mount_xyz": checks.vector(self.mount_xyz, "mount_xyz", "[x, y, z] in m"),
            "mount_rpy": checks.vector(
                self.mount_rpy, "mount_rpy", "[roll, pitch, yaw] in rad"
            ),
            "carriage_size": checks.vector(
                self.carriage_size, "carriage_size", "three lengths > 0 m", above=0.0
            ),
        }
        for figure, value in checked.items():
            object.__setattr__(self, figure, value)

    def mount(self, arm: Arm, target: Path | None, *, meshes: bool) -> str:
        """Put the arm, whose XML is changed, on the carriage, and return the URDF's text."""
        arm_root = f"{self.name}_base" if arm.root_link == self.root else arm.root_link
        self._check_names(arm, arm_root)
        rename_link(arm.robot, arm.root_link, arm_root)
        if not meshes:
            drop_meshes(arm.robot)
        relocate_meshes(arm.robot, arm.source, target)
        arm.robot.set("name", f"{arm.robot.get('name') or arm.source.stem}_{self.name}")
        for place, element in enumerate(self._elements(arm_root)):
            arm.robot.insert(place, element)
        return elements.robot_text(arm.robot)

    def _check_names(self, arm: Arm, arm_root: str) -> None:
        """Refuse new names that the arm has already, be it for links or joints: frames are looked up by name."""
        taken = dict.fromkeys(arm.joint_names, "joint") | dict.fromkeys(
            arm.link_names, "link"
        )
        taken.pop(arm.root_link)
        new = {
            self.root: "root",
            arm_root: "name" if arm_root != arm.root_link else "root",
        }
        new |= dict.fromkeys(
            (self.name, f"{self.name}_carriage", f"{self.name}_mount"), "name"
        )
        for candidate, parameter in new.items():
            if candidate in taken:
                raise InputError(
                    f"the name {candidate!r} is taken",
                    where=parameter,
                    found=f"{taken[candidate]} {candidate!r} in {arm.source}",
                    hint=f"Choose another {parameter}",
                )
        if len(new) < 5:
            raise InputError(
                "two of the new names are the same",
                where="name",
                found=f"name {self.name!r}, root {self.root!r}, the arm's root link {arm_root!r}",
                hint="Choose another name or root",
            )

    def _elements(self, arm_root: str) -> list[Element]:
        """World, rail, carriage and mount."""
        carriage = f"{self.name}_carriage"
        low, high = self.range
        height = self.carriage_size[2]
        down = (
            pin.rpy.rpyToMatrix(*self.mount_rpy) @ np.array([0.0, 0.0, -1.0])
        ).round(15)  # cos(pi / 2) is not 0
        centre = np.array(self.mount_xyz) + 0.5 * height * down
        beam = (
            centre + height * down + 0.5 * (low + high) * np.array(self.axis)
        ).round(12)
        length = high - low + max(self.carriage_size[:2])
        heading = (
            0.0,
            -math.atan2(self.axis[2], math.hypot(*self.axis[:2])),
            math.atan2(self.axis[1], self.axis[0]),
        )
        limit = {
            "lower": low,
            "upper": high,
            "velocity": self.velocity,
            "effort": self.force,
        }
        colour = (
            f"{self.name}_grey",
            elements.GREY,
        )  # a name of its own: the arm may have another grey
        inertia = elements.box_inertia(self.mass, self.carriage_size)
        return [
            elements.link(
                self.root,
                elements.visual(
                    "box",
                    {"size": (length, height, height)},
                    colour,
                    xyz=beam,
                    rpy=heading,
                ),
            ),
            elements.joint(
                self.name, "prismatic", self.root, carriage, axis=self.axis, limit=limit
            ),
            elements.link(
                carriage,
                elements.inertial(self.mass, centre, inertia, self.mount_rpy),
                elements.visual(
                    "box",
                    {"size": self.carriage_size},
                    colour,
                    xyz=centre,
                    rpy=self.mount_rpy,
                ),
            ),
            elements.joint(
                f"{self.name}_mount",
                "fixed",
                carriage,
                arm_root,
                xyz=self.mount_xyz,
                rpy=self.mount_rpy,
            ),
        ]


def on_rail(
    arm_urdf: str | os.PathLike[str],
    rail: Rail,
    *,
    meshes: bool = True,
    output: str | os.PathLike[str] | None = None,
) -> str:
    """Mount an arm on a linear axis and return the URDF of both.

    The chain is: link `rail.root` (the world frame), prismatic joint `rail.name`, link ``<name>_carriage``, fixed joint
    ``<name>_mount``, and the arm's own root link, below which nothing of the arm changes. An arm's root link that is
    itself called `rail.root` becomes ``<name>_base``. At rail position p, m, the arm's root link lies at
    ``p * axis + mount_xyz``, turned by `rail.mount_rpy`.

    Parameters
    ----------
    arm_urdf : path
        URDF of the arm, without xacro macros.
    rail : Rail
    meshes : bool, optional
        False drops all visuals and collisions of the arm that are meshes.
    output : path, optional
        File to write. Mesh files are then named relative to its folder; without `output` by absolute names. Those in
        packages that ROS finds, or that are nowhere, stay as they are.

    Returns
    -------
    str
        The URDF.

    Raises
    ------
    InputError
        A name is taken, or `output` cannot be written or is the arm's own file.
    UrdfError
        The arm's URDF is missing, broken, not one tree, or has bodies that cannot be.

    Examples
    --------
    >>> import brachis
    >>> rail = brachis.compose.Rail(axis=(0, 1, 0), range=(-2, 2), velocity=2, force=1500, mass=80)
    >>> text = brachis.compose.on_rail("robots/iiwa14/robot.urdf", rail)
    >>> brachis.Robot.from_urdf("iiwa14 on a rail", urdf_text=text).joint_names[:2]
    ('rail', 'joint_1')
    """
    source, target = Path(arm_urdf), None if output is None else Path(output)
    arm = read_arm(source)
    with writing_errors(target or ""):
        known = None if target is None else status_of(target)
    if known is not None and os.path.samestat(known, source.stat()):
        raise InputError(
            "is the arm's own file", where=f"output {target}", allowed="another file"
        )
    text = rail.mount(arm, target, meshes=meshes)
    check_composed(text, rail.name, str(source))
    if target is not None:
        with atomic_write(target) as stream:
            stream.write(text.encode())
    return text
