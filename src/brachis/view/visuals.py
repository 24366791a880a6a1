"""What a URDF says its links look like: primitives and meshes, with their colours."""

from __future__ import annotations

import io
import zipfile
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from lxml import etree

from brachis.errors import InputError
from brachis.files import mesh_file
from brachis.robot.urdf_tree import Element, read_tree

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


def link_shapes(urdf: str, folder: Path) -> tuple[dict[str, list[trimesh.Trimesh]], list[str]]:
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
    tree, shapes, unread = read_tree(urdf, "URDF"), {}, []
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
        where = "; ROS_PACKAGE_PATH may name the folder of its package" if absent[0].startswith("package://") else ""
        unread.insert(0, f"{count} missing: {absent[0]}{', ...' if len(absent) > 1 else ''}{where}"[:_LONGEST])
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
            raise InputError("packed meshes are not read", where=path.name, hint="Unpack it")
        size += _size(path)
        if size > room:
            found, allowed = f"{size / 1e6:.0f} MB", f"{_LARGEST / 1e6:.0f} MB for all meshes of the robot"
            raise InputError("the mesh is too large to be shown", where=path.name, found=found, allowed=allowed)
    return size


def _size(path: Path) -> int:
    """Size of a file, of an archive that of what is in it, bytes."""
    if not zipfile.is_zipfile(path):
        return path.stat().st_size
    with zipfile.ZipFile(path) as archive:
        return sum(each.file_size for each in archive.infolist())


def _meshes(name: str, visual: Element, materials: list[Element]) -> list[trimesh.Trimesh]:
    """Have yourdfpy read one visual, as the only one of a robot of one link.

    Raises
    ------
    InputError
        There is nothing in it, or numbers that are not finite.
    """
    import trimesh  # noqa: PLC0415  (one second)
    import yourdfpy  # noqa: PLC0415

    robot = etree.Element("robot", name="robot")
    robot.extend([_copied(each) for each in materials])
    etree.SubElement(robot, "link", name=name).append(_copied(visual))
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
            found.append(_placed(trimesh.Trimesh(mesh.vertices, mesh.faces, visual=mesh.visual), placement))
    if not found or not all(np.isfinite(mesh.vertices).all() for mesh in found):
        file = next((mesh.get("filename") for mesh in visual.iter("mesh")), None)
        raise InputError("the mesh has no faces, or corners that are not finite", where=file)
    return found


def _copied(element: Element) -> Element:
    return etree.fromstring(etree.tostring(element))


def _placed(mesh: trimesh.Trimesh, placement: Any) -> trimesh.Trimesh:  # noqa: ANN401  (a matrix)
    """Place a mesh, and see to its colour where it has no picture on it."""
    look = getattr(mesh.visual, "material", mesh.visual)  # a material, or colours of the faces
    if getattr(look, "baseColorTexture", None) is None and getattr(look, "image", None) is None:
        mesh = coloured(mesh, tuple(map(int, look.main_color)) if mesh.visual.defined else _STEEL)
    mesh.apply_transform(placement)
    return mesh


def coloured(mesh: trimesh.Trimesh, colour: tuple[int, ...]) -> trimesh.Trimesh:
    """Give a mesh one material that is no metal, RGBA from 0 to 255, and sharp edges unless it has too many faces."""
    import trimesh  # noqa: PLC0415

    if len(mesh.faces) <= _PRIMITIVE:
        mesh = trimesh.graph.smooth_shade(mesh, angle=_SHARP)
    material = trimesh.visual.material.PBRMaterial(baseColorFactor=colour, metallicFactor=0.1, roughnessFactor=0.65)
    mesh.visual = trimesh.visual.TextureVisuals(material=material)
    return mesh
