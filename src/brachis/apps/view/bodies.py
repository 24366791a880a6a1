"""What is drawn of a robot: the shapes of its URDF or a skeleton, and where they are.

Shapes belong to the joint that moves them; joint 0 is the world, which stands still.
"""

from __future__ import annotations

import io
import zipfile
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
import pinocchio as pin
from lxml import etree

from brachis.common.files import mesh_file
from brachis.errors import InputError
from brachis.robot import Robot
from brachis.robot.urdf_elements import Element, read_tree
from brachis.trajectory import Trajectory

if TYPE_CHECKING:
    import trimesh

_STEEL = (150, 160, 172, 255)
"""Colour of a shape without one."""
_PRIMITIVE = 2000
"""Faces of a shape that is few enough to be given sharp edges."""
_SHARP = 0.6
"""Angle between faces from which on an edge is sharp, rad."""
_LARGEST = 200_000_000
"""Bytes of all mesh files of a robot together, unpacked; readers take several times as much memory."""
_PACKED = (".gz", ".bz2")
"""Suffixes of packed files, whose size nobody knows before they are unpacked."""
_LONGEST = 500
"""Letters of a reason."""


def link_shapes(
    urdf: str, folder: Path
) -> tuple[dict[str, list[trimesh.Trimesh]], list[str]]:
    """Read the shapes of the links that have any.

    Parameters
    ----------
    urdf : str
        Text of the URDF.
    folder : Path
        Where it is: names of mesh files are relative to it, and packages are looked for in the folders above it.

    Returns
    -------
    shapes : dict of str to list of Trimesh
        By link, in the link's frame, m.
    unread : list of str
        Of the shapes that cannot be shown, the link and the reason; of missing files one line.
    """
    tree = read_tree(urdf, "URDF")
    shapes = {}
    unread = []
    absent: list[str] = []
    room = _LARGEST
    materials = [each for each in tree.robot if each.tag == "material"]
    for name, link in tree.links.items():
        found: list[trimesh.Trimesh] = []
        for visual in link.findall("visual"):
            missing = _find_meshes(visual, folder)
            absent += missing
            if missing:
                continue
            try:
                room -= _check_size(visual, room)
                found += _meshes(name, visual, materials)
            except InputError as error:
                unread.append(f"{name}: {error}"[:_LONGEST])
            except Exception as error:  # noqa: BLE001  (a file may be anything, and so may what its reader raises)
                unread.append(f"{name}: {type(error).__name__}: {error}"[:_LONGEST])
        if found:
            shapes[name] = found
    if absent:
        count = f"{len(absent)} mesh files are" if len(absent) > 1 else "a mesh file is"
        where = (
            "; ROS_PACKAGE_PATH may name the folder of its package"
            if absent[0].startswith("package://")
            else ""
        )
        unread.insert(
            0,
            f"{count} missing: {absent[0]}{', ...' if len(absent) > 1 else ''}{where}"[
                :_LONGEST
            ],
        )
    return shapes, unread


def _find_meshes(visual: Element, folder: Path) -> list[str]:
    """Put the paths of a visual's mesh files in the place of their names; return those that are missing."""
    missing = []
    for mesh in visual.iter("mesh"):
        name = str(mesh.get("filename"))
        path = mesh_file(name, folder)
        if path is None:
            missing.append(name)
        mesh.set("filename", str(path))
    return missing


def _check_size(visual: Element, room: int) -> int:
    """Return the size of a visual's mesh files, bytes.

    Raises
    ------
    InputError
        They are packed, or larger than `room`, bytes.
    """
    size = 0
    for mesh in visual.iter("mesh"):
        path = Path(str(mesh.get("filename")))
        if path.suffix in _PACKED:
            raise InputError(
                "packed meshes are not read", where=path.name, hint="Unpack it"
            )
        size += _size(path)
        if size > room:
            found = f"{size / 1e6:.0f} MB"
            allowed = f"{_LARGEST / 1e6:.0f} MB for all meshes of the robot"
            raise InputError(
                "the mesh is too large to be shown",
                where=path.name,
                found=found,
                allowed=allowed,
            )
    return size


def _size(path: Path) -> int:
    """Size of a file, of an archive that of what is in it, bytes."""
    if not zipfile.is_zipfile(path):
        return path.stat().st_size
    with zipfile.ZipFile(path) as archive:
        return sum(each.file_size for each in archive.infolist())


def _meshes(
    name: str, visual: Element, materials: list[Element]
) -> list[trimesh.Trimesh]:
    """Have yourdfpy read one visual, as the only one of a robot of one link.

    Raises
    ------
    InputError
        There is nothing in it, or numbers that are not finite.
    """
    import trimesh
    import yourdfpy

    robot = etree.Element("robot", name="robot")
    robot.extend([_copy(each) for each in materials])
    etree.SubElement(robot, "link", name=name).append(_copy(visual))
    read = yourdfpy.URDF.load(
        io.BytesIO(etree.tostring(robot)),
        load_meshes=True,
        build_scene_graph=True,
        filename_handler=yourdfpy.filename_handler_null,
    )
    found = []
    for node in read.scene.graph.nodes_geometry:
        placement, geometry = read.scene.graph.get(node)
        mesh = read.scene.geometry[geometry]
        if isinstance(mesh, trimesh.Trimesh) and len(mesh.faces):
            found.append(
                _place(
                    trimesh.Trimesh(mesh.vertices, mesh.faces, visual=mesh.visual),
                    placement,
                )
            )
    if not found or not all(np.isfinite(mesh.vertices).all() for mesh in found):
        file = next((mesh.get("filename") for mesh in visual.iter("mesh")), None)
        raise InputError(
            "the mesh has no faces, or corners that are not finite", where=file
        )
    return found


def _copy(element: Element) -> Element:
    return etree.fromstring(etree.tostring(element))


def _place(mesh: trimesh.Trimesh, placement: Any) -> trimesh.Trimesh:
    """Place a mesh, and see to its colour where it has no picture on it."""
    look = getattr(
        mesh.visual, "material", mesh.visual
    )  # a material, or colours of the faces
    if (
        getattr(look, "baseColorTexture", None) is None
        and getattr(look, "image", None) is None
    ):
        mesh = with_colour(
            mesh, tuple(map(int, look.main_color)) if mesh.visual.defined else _STEEL
        )
    mesh.apply_transform(placement)
    return mesh


def with_colour(mesh: trimesh.Trimesh, colour: tuple[int, ...]) -> trimesh.Trimesh:
    """Give a mesh a matt material, RGBA from 0 to 255, and sharp edges if it has few faces."""
    import trimesh

    if len(mesh.faces) <= _PRIMITIVE:
        mesh = trimesh.graph.smooth_shade(mesh, angle=_SHARP)
    material = trimesh.visual.material.PBRMaterial(
        baseColorFactor=colour, metallicFactor=0.1, roughnessFactor=0.65
    )
    mesh.visual = trimesh.visual.TextureVisuals(material=material)
    return mesh


@dataclass(frozen=True, eq=False)
class Placements:
    """Frames of a robot in the world frame at K postures.

    Attributes
    ----------
    positions : (K, n + 2, 3) ndarray
        Of the world, of what every joint moves, and of the tool, m.
    quaternions : (K, n + 2, 4) ndarray
        w, x, y, z.
    """

    positions: np.ndarray
    quaternions: np.ndarray

    @property
    def tool(self) -> np.ndarray:
        """Positions of the tool, (K, 3), m."""
        return np.asarray(self.positions[:, -1])


def placements(robot: Robot, q: np.ndarray) -> Placements:
    """Forward kinematics of postures `q`, (K, n)."""
    found = Placements(
        np.empty((len(q), robot.n + 2, 3)), np.empty((len(q), robot.n + 2, 4))
    )
    tool = robot.frame_id
    for k, data in enumerate(robot.place_joints(q)):
        for row, placement in enumerate((*data.oMi, data.oMf[tool])):
            found.positions[k, row] = placement.translation
            found.quaternions[k, row] = np.roll(
                pin.Quaternion(placement.rotation).coeffs(), 1
            )
    return found


_BONE = (72, 101, 129, 255)
_JOINT = (230, 159, 0, 255)
_AXIS = (120, 130, 140, 255)


@dataclass(frozen=True, eq=False)
class Bodies:
    """Shapes by the joint that moves them, in the joint's frame, m.

    Attributes
    ----------
    links : dict of int to list of Trimesh
        What the URDF says the links look like; joint 0 is the world.
    skeleton : dict of int to list of Trimesh
        Joints and the straight lines between them.
    unread : tuple of str
        Shapes of the URDF that cannot be shown, and why.
    lower, upper : (3,) ndarray
        Corners of the box that the whole robot keeps within, m.
    moving_lower, moving_upper : (3,) ndarray
        Of the box that its joints, what they move, and the tool keep within, m.
    """

    links: Mapping[int, Sequence[trimesh.Trimesh]]
    skeleton: Mapping[int, Sequence[trimesh.Trimesh]]
    unread: tuple[str, ...]
    lower: np.ndarray
    upper: np.ndarray
    moving_lower: np.ndarray
    moving_upper: np.ndarray

    @property
    def shows_links(self) -> bool:
        """Whether the links can be seen; otherwise the skeleton has to do."""
        return bool(self.links) and not self.unread


def bodies_of(trajectory: Trajectory) -> Bodies:
    """Read a robot's shapes, and draw its skeleton as large as the robot is."""
    robot = trajectory.robot
    shapes, unread = link_shapes(robot.urdf, Path(robot.source).absolute().parent)
    links: dict[int, list[trimesh.Trimesh]] = {}
    for name, meshes in shapes.items():
        frame = robot.model.frames[robot.model.getFrameId(name, pin.FrameType.BODY)]
        for mesh in meshes:
            mesh.apply_transform(frame.placement.homogeneous)
        links.setdefault(int(frame.parentJoint), []).extend(meshes)
    q = trajectory.position(np.linspace(0.0, trajectory.t_end, 33))
    found = placements(robot, q)
    size = float(np.ptp(found.positions.reshape(-1, 3), axis=0).max())
    skeleton = _skeleton(trajectory, max(size, 1e-3) * 0.012)
    drawn = links or skeleton
    moving = {joint: meshes for joint, meshes in drawn.items() if joint}
    return Bodies(
        links, skeleton, tuple(unread), *_box(drawn, found), *_box(moving, found)
    )


def _box(
    bodies: Mapping[int, Sequence[trimesh.Trimesh]], found: Placements
) -> tuple[np.ndarray, np.ndarray]:
    """Corners of a box around joints, tool and bodies in all postures."""
    from scipy.spatial.transform import Rotation

    points = [found.positions[:, 1:].reshape(-1, 3)]
    for joint, meshes in bodies.items():
        corners = np.concatenate([_corners(mesh.bounds) for mesh in meshes])
        turned = (
            Rotation.from_quat(
                found.quaternions[:, joint], scalar_first=True
            ).as_matrix()
            @ corners.T
        )
        points.append(
            (found.positions[:, joint, :, None] + turned)
            .transpose(0, 2, 1)
            .reshape(-1, 3)
        )
    every = np.concatenate(points)
    return every.min(axis=0), every.max(axis=0)


def _corners(bounds: np.ndarray) -> np.ndarray:
    return np.array(np.meshgrid(*bounds.T)).reshape(3, -1).T


def _skeleton(
    trajectory: Trajectory, radius: float
) -> dict[int, list[trimesh.Trimesh]]:
    """Draw every joint, and the link from it to the next one; along the axis of a prismatic joint where it slides."""
    robot = trajectory.robot
    model = robot.model
    tool = robot.model.frames[robot.frame_id]
    base = model.frames[
        model.getFrameId(robot.base_frame, pin.FrameType.BODY)
    ].placement.translation
    begins = [base, *np.zeros((robot.n, 3))]
    drawn: dict[int, list[trimesh.Trimesh]] = {
        joint: [] for joint in range(robot.n + 1)
    }
    for joint in range(robot.n):
        placement = model.jointPlacements[joint + 1]
        axis = _axis(model.joints[joint + 1])
        drawn[joint] += _rod(begins[joint], placement.translation, radius, _BONE)
        if robot.position_units[joint] == "m":
            low, high = (
                placement.act(axis * reach) for reach in _range(trajectory, joint)
            )
            drawn[joint] += _rod(low, high, 0.5 * radius, _AXIS)
            drawn[joint + 1] += _block(3.0 * radius, _JOINT)
        else:
            half = 2.0 * radius * axis
            drawn[joint + 1] += _rod(-half, half, 1.7 * radius, _JOINT)
    drawn[tool.parentJoint] += _rod(
        begins[-1], tool.placement.translation, radius, _BONE
    )
    return {joint: meshes for joint, meshes in drawn.items() if meshes}


def _axis(joint: Any) -> np.ndarray:
    """Axis of a joint in its own frame, (3,)."""
    subspace = np.asarray(joint.createData().S).reshape(6, -1)[:, 0]
    return subspace[:3] if np.any(subspace[:3]) else subspace[3:]


def _range(trajectory: Trajectory, joint: int) -> tuple[float, float]:
    """Positions between which a prismatic joint can move, m; where it has no ends, those of the motion."""
    limits = trajectory.robot.limits
    q = trajectory.q[:, joint]
    low = float(limits.position_lower[joint])
    high = float(limits.position_upper[joint])
    return (
        low if np.isfinite(low) else float(q.min()),
        high if np.isfinite(high) else float(q.max()),
    )


def _rod(
    begin: np.ndarray, end: np.ndarray, radius: float, colour: tuple[int, ...]
) -> list[trimesh.Trimesh]:
    """Cylinder between two points; nothing where they are one."""
    import trimesh

    if np.linalg.norm(end - begin) < 1e-9:
        return []
    return [
        with_colour(
            trimesh.creation.cylinder(radius, segment=[begin, end], sections=24), colour
        )
    ]


def _block(size: float, colour: tuple[int, ...]) -> list[trimesh.Trimesh]:
    import trimesh

    return [with_colour(trimesh.creation.box((size, size, size)), colour)]
