"""An arm on a linear axis. The arm's URDF is handled as XML, so that elements unknown to brachis do not change."""

from __future__ import annotations

import math
import os
import re
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from html import escape
from pathlib import Path
from typing import Any

import numpy as np
import pinocchio as pin
from lxml import etree

from brachis.common.files import (
    BEGINNINGS,
    COMPOSED,
    atomic_write,
    is_file,
    mesh_file,
    ros_files,
)
from brachis.errors import InputError
from brachis.robot.urdf import check_inertias, read_file
from brachis.robot.urdf_bodies import read_dynamics
from brachis.robot.urdf_elements import Element, UrdfTree, read_tree
from brachis.robot.urdf_writer import write_numbers, write_origin

_NAME = re.compile(r"[A-Za-z_][\w.-]*", re.ASCII)


def _is_positive(value: np.ndarray) -> np.ndarray:
    """Return which values are positive."""
    return value > 0.0


_FIGURES: dict[str, tuple[str, tuple[int, ...], Callable[[np.ndarray], Any]]] = {
    "range": ("[low, high] in m, low < high", (2,), lambda ends: ends[0] < ends[1]),
    "velocity": ("a finite number > 0 m/s", (), _is_positive),
    "force": ("a finite number > 0 N", (), _is_positive),
    "mass": ("a finite number > 0 kg", (), _is_positive),
    "axis": ("a direction [x, y, z], not all zero", (3,), np.any),
    "mount_xyz": ("a position [x, y, z] in m", (3,), np.isfinite),
    "mount_rpy": ("[roll, pitch, yaw] in rad", (3,), np.isfinite),
    "carriage_size": ("three lengths > 0 m", (3,), _is_positive),
}
"""For every figure of a rail: the allowed values in words, the shape, and a test of the values. All must be finite."""


def relocate_meshes(robot: Element, source: Path, target: Path | None) -> None:
    """Rewrite names of mesh and texture files: from relative to the folder of `source` to relative to that of `target`.

    Without `target`, the names become absolute. Names that are already absolute do not change; nor do names in packages
    that ROS finds, or that cannot be found.
    """
    old = source.parent.resolve()
    for element in robot.iter("mesh", "texture"):
        name = element.get("filename")
        if not name or Path(name).is_absolute():
            continue
        scheme, _, within = name.partition("://")
        path: Path | None = old / name
        if within:
            by_ros = any(map(is_file, ros_files(within)))
            path = None if by_ros or scheme != "package" else mesh_file(name, old)
        if path is None:
            continue
        placed = os.path.normpath(path)
        if target is not None:
            placed = os.path.relpath(path, target.parent.resolve())
        element.set("filename", placed)


@dataclass(frozen=True, kw_only=True)
class Rail:
    """A linear axis with its carriage. All data of the axis are given; none are guessed.

    Attributes
    ----------
    range : (2,) sequence of float
        Minimum and maximum position on the rail, m.
    velocity : float
        Velocity limit of the rail, m/s.
    force : float
        Limit of the rail's drive force, N. The drive force accelerates the carriage and the arm, and holds them on a
        rail that is not horizontal.
    mass : float
        Mass of the carriage, kg. The carriage is a solid box.
    axis : (3,) sequence of float
        Direction of the rail in the world frame, as a vector of any length except zero. The rail may be horizontal,
        vertical or tilted.
    mount_xyz, mount_rpy : (3,) sequence of float
        Placement of the arm's root link on the carriage, m and rad (roll, pitch and yaw about the fixed axes x, y, z
        of the world frame). ``(pi, 0, 0)`` hangs the arm upside down, ``(0, pi / 2, 0)`` mounts it on a wall.
    carriage_size : (3,) sequence of float
        Lengths of the carriage, m, along the axes of the mounted arm's root link, whose origin is the centre of the
        box's top. The lengths are used only for drawing: the carriage never turns, so its moments of inertia do not
        matter.
    name : str
        Name of the rail's joint, and prefix of the names of the other new elements.
    root : str
        Name of the new root link, which is the world frame.

    Raises
    ------
    InputError
        A value is out of range.
    """

    range: Sequence[float]
    velocity: float
    force: float
    mass: float
    axis: Sequence[float] = (0.0, 1.0, 0.0)
    mount_xyz: Sequence[float] = (0.0, 0.0, 0.0)
    mount_rpy: Sequence[float] = (0.0, 0.0, 0.0)
    carriage_size: Sequence[float] = (0.4, 0.4, 0.1)
    name: str = "rail"
    root: str = "world"

    def __post_init__(self) -> None:
        """Check the data."""
        for figure, (allowed, shape, test) in _FIGURES.items():
            raw = getattr(self, figure)
            try:
                value = np.array(raw, dtype=float)
            except (TypeError, ValueError):
                value = np.array(np.nan)
            is_finite = value.shape == shape and np.isfinite(value).all()
            if not is_finite or not np.all(test(value)):
                raise InputError(
                    "this value is not valid",
                    where=figure,
                    found=str(raw),
                    allowed=allowed,
                )
            if figure == "axis":
                value /= np.abs(value).max()  # squares of large values may overflow
                value /= np.linalg.norm(value)
            plain = tuple(value.tolist()) if shape else float(value)
            object.__setattr__(self, figure, plain)
        for figure in ("name", "root"):
            raw = getattr(self, figure)
            if not (isinstance(raw, str) and _NAME.fullmatch(raw)):
                raise InputError(
                    "this is not a valid name",
                    where=figure,
                    found=repr(raw),
                    allowed="a letter or underscore, then letters, digits, underscores, dots and hyphens",
                )

    def mount(
        self, arm: UrdfTree, source: Path, target: Path | None, *, meshes: bool
    ) -> str:
        """Mount the arm on the carriage by changing the arm's XML, and return the text of the URDF."""
        root = f"{self.name}_base" if arm.root == self.root else arm.root
        self._check_names(arm, source, root)
        for mention in arm.robot.xpath("//link/@name | //@link | //@reference"):
            if mention == arm.root:
                mention.getparent().set(mention.attrname, root)
        if not meshes:
            drawn = "link/*[self::visual or self::collision]"
            for element in arm.robot.xpath(f"{drawn}[geometry/mesh]"):
                element.getparent().remove(element)
        relocate_meshes(arm.robot, source, target)
        arm.robot.set("name", f"{arm.robot.get('name') or source.stem}_{self.name}")
        arm.robot[:0] = self._elements(root)
        declaration, _, body = robot_text(arm.robot).partition("\n")
        return "\n".join((declaration, COMPOSED, body.removeprefix(f"{COMPOSED}\n")))

    def _check_names(self, arm: UrdfTree, source: Path, arm_root: str) -> None:
        """Raise an error for new names that the arm's links or joints already have; frames are looked up by name."""
        taken = dict.fromkeys(arm.joints, "joint") | dict.fromkeys(arm.links, "link")
        taken.pop(arm.root)
        new = {
            self.root: "root",
            arm_root: "name" if arm_root != arm.root else "root",
            self.name: "name",
            f"{self.name}_carriage": "name",
            f"{self.name}_mount": "name",
        }
        for candidate, parameter in new.items():
            if candidate in taken:
                raise InputError(
                    f"the name {candidate!r} is taken",
                    where=parameter,
                    found=f"{taken[candidate]} {candidate!r} in {source}",
                    hint=f"Choose another {parameter}",
                )
        if len(new) < 5:
            raise InputError(
                "the new joints and links need different names",
                where="name",
                found=f"name {self.name!r}, root {self.root!r}, the arm's root link {arm_root!r}",
                hint="Choose another name or root",
            )

    def _elements(self, arm_root: str) -> list[Element]:
        """Return the XML elements of world, rail, carriage and mount."""
        carriage = f"{self.name}_carriage"
        low, high = self.range
        speed = self.velocity
        x, y, z = self.axis
        width, depth, height = self.carriage_size
        turn = pin.rpy.rpyToMatrix(*self.mount_rpy)
        down = (turn @ np.array([0.0, 0.0, -1.0])).round(
            15
        )  # in floating point cos(pi / 2) is not 0
        middle = np.array(self.mount_xyz) + 0.5 * height * down
        beam = middle + height * down + 0.5 * (low + high) * np.array(self.axis)
        beam_rpy = (0.0, -math.atan2(z, math.hypot(x, y)), math.atan2(y, x))
        beam_size = (high - low + max(width, depth), height, height)
        centre = write_origin(middle, self.mount_rpy)
        inertia = pin.Inertia.FromBox(self.mass, *self.carriage_size).inertia
        ixx, iyy, izz = inertia.diagonal()
        # The material needs a new name, because the arm may define a different grey.
        grey = f'<material name="{self.name}_grey"><color rgba="0.35 0.38 0.42 1"/></material>'
        new = etree.fromstring(f"""
<robot>
  <link name="{self.root}">
    <visual>
      {write_origin(beam.round(12), beam_rpy)}
      <geometry><box size="{write_numbers(*beam_size)}"/></geometry>
      {grey}
    </visual>
  </link>
  <joint name="{self.name}" type="prismatic">
    <parent link="{self.root}"/>
    <child link="{carriage}"/>
    <axis xyz="{write_numbers(*self.axis)}"/>
    <limit lower="{write_numbers(low)}" upper="{write_numbers(high)}"
           velocity="{write_numbers(speed)}" effort="{write_numbers(self.force)}"/>
  </joint>
  <link name="{carriage}">
    <inertial>
      {centre}
      <mass value="{write_numbers(self.mass)}"/>
      <inertia ixx="{write_numbers(ixx)}" ixy="0" ixz="0" iyy="{write_numbers(iyy)}" iyz="0"
               izz="{write_numbers(izz)}"/>
    </inertial>
    <visual>
      {centre}
      <geometry><box size="{write_numbers(*self.carriage_size)}"/></geometry>
      {grey}
    </visual>
  </link>
  <joint name="{self.name}_mount" type="fixed">
    <parent link="{carriage}"/>
    <child link="{escape(arm_root)}"/>
    {write_origin(self.mount_xyz, self.mount_rpy)}
  </joint>
</robot>""")
        return list(new)


def robot_text(robot: Element) -> str:
    """Return the indented text of a ``<robot>`` element with the comments around it."""
    etree.cleanup_namespaces(robot)
    etree.indent(robot, "  ")
    tree = robot.getroottree()
    text = etree.tostring(tree, encoding="unicode", pretty_print=True)
    return f'<?xml version="1.0"?>\n{text}'


def on_rail(
    arm_urdf: str | os.PathLike[str],
    rail: Rail,
    *,
    meshes: bool = True,
    output: str | os.PathLike[str] | None = None,
) -> str:
    """Mount an arm on a linear axis and return the URDF of both.

    The chain consists of the link `rail.root` (the world frame), the prismatic joint `rail.name`, the link
    ``<name>_carriage``, the fixed joint ``<name>_mount``, and the arm, which is unchanged from its root link on. If the
    arm's root link is itself called `rail.root`, it is renamed to ``<name>_base``. At rail position p, m, the arm's
    root link lies at ``p * axis + mount_xyz``, turned by `rail.mount_rpy`.

    Parameters
    ----------
    arm_urdf : path
        URDF of the arm, without xacro macros.
    rail : Rail
    meshes : bool, optional
        Whether to keep visuals and collisions of the arm that are meshes; False removes them.
    output : path, optional
        File to write. An older file is replaced if this function wrote it. Names of mesh files are relative to the
        folder of this file; without `output`, they are absolute. Names in packages that ROS finds, or that cannot be
        found, do not change.

    Returns
    -------
    str
        Text of the composed URDF.

    Raises
    ------
    InputError
        A name is already in use; or `output` cannot be written, or would overwrite the arm's URDF or another URDF that
        this function did not write.
    UrdfError
        The arm's URDF is missing, is broken, is not a single tree, or has bodies that are physically impossible.

    Examples
    --------
    >>> import brachis
    >>> rail = brachis.compose.Rail(axis=(0, 1, 0), range=(-2, 2), velocity=2, force=1500, mass=80)
    >>> text = brachis.compose.on_rail("robots/iiwa14/robot.urdf", rail)
    >>> brachis.Robot.from_urdf("iiwa14 on a rail", urdf_text=text).joint_names[:2]
    ('rail', 'joint_1')
    """
    source = Path(arm_urdf)
    target = None if output is None else Path(output)
    arm = read_tree(read_file(source), str(source))
    if target is not None and is_file(target) and target.samefile(source):
        raise InputError(
            "the output would overwrite the arm's URDF",
            where=f"output {target}",
            allowed="another file",
        )
    text = rail.mount(arm, source, target, meshes=meshes)
    # On a moving axis, the inertia of the arm's root link matters as well; before, no joint moved this link.
    composed = read_tree(text, str(source))
    carried = read_dynamics(composed, (rail.name,), {}, composed.root)
    check_inertias(composed, carried.bodies, str(source))
    if target is not None:
        with atomic_write(target, BEGINNINGS[".urdf"]) as stream:
            stream.write(text.encode())
    return text
