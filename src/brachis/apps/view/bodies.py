"""Shapes for drawing a robot and its scene: those of the URDF or a skeleton, and their placements.

Every shape belongs to the joint that moves it. Joint 0 is the world, which stands still.
"""

from __future__ import annotations

import io
import zipfile
from collections import defaultdict
from collections.abc import Sequence
from copy import deepcopy
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

import coal
import numpy as np
import pinocchio as pin
from lxml import etree

from brachis.common.files import mesh_file
from brachis.common.words import name_first
from brachis.errors import InputError
from brachis.path import path_of
from brachis.robot import Robot, task_map_of
from brachis.robot.chain import path_frame_in_world
from brachis.robot.urdf_elements import Element, read_tree
from brachis.scene import Solid, scene_of
from brachis.scene.chain import Chain
from brachis.task.scene import SceneBody
from brachis.trajectory import Samples, Trajectory

if TYPE_CHECKING:
    import trimesh

    Meshes = dict[int, list[trimesh.Trimesh]]

_COLOURS = {
    "shape": (150, 160, 172, 255),  # colour of a shape without a colour of its own
    "bone": (72, 101, 129, 255),
    "joint": (230, 159, 0, 255),
    "axis": (120, 130, 140, 255),
    "scene": (190, 120, 90, 255),
}
"""Colours of shapes as RGBA from 0 to 255."""
_LARGEST = 200_000_000
"""Maximum total size of a robot's unpacked mesh files, bytes. Reading them takes several times as much memory."""

_FLOOR = 4.0
"""Length and width of the plate that represents a half-space, m."""
_THIN = 0.002
"""Thickness of this plate, m."""


def link_shapes(
    urdf: str, folder: Path
) -> tuple[dict[str, list[trimesh.Trimesh]], list[str]]:
    """Read the visual shapes of the links.

    Parameters
    ----------
    urdf : str
        Text of the URDF.
    folder : Path
        Folder of the URDF. Names of mesh files are relative to this folder, and packages are searched for in the
        folders above it.

    Returns
    -------
    shapes : dict of str to list of Trimesh
        Shapes by link, in the link's frame, m.
    unread : list of str
        Link and reason for each shape that cannot be shown. All missing files share one entry.
    """
    tree = read_tree(urdf, "URDF")
    shapes: dict[str, list[trimesh.Trimesh]] = {}
    unread = []
    absent = []
    room = _LARGEST
    materials = tree.robot.findall("material")
    for visual in tree.robot.iterfind("link/visual"):
        name = visual.getparent().get("name")
        mesh = visual.find("geometry/mesh")
        try:
            if mesh is not None:
                file = str(mesh.get("filename"))
                path = mesh_file(file, folder)
                if path is None:
                    absent.append(file)
                    continue
                room -= _check_size(path, room)
                mesh.set("filename", str(path))
            meshes = _meshes(name, visual, materials)
            shapes.setdefault(name, []).extend(meshes)
        except InputError as error:
            unread.append(f"{name}: {error}")
        except Exception as error:  # noqa: BLE001  (a file may contain anything, and its reader may raise any error)
            unread.append(f"{name}: {type(error).__name__}: {error}")
    if absent:
        hint = "ROS_PACKAGE_PATH can name the folder of a package"
        names = name_first(absent, ", ")
        unread.insert(0, f"missing mesh files: {names}; {hint}")
    return shapes, [reason[:500] for reason in unread]


def _check_size(path: Path, room: int) -> int:
    """Return the size of a mesh file, or of the unpacked content of an archive, bytes.

    Raises
    ------
    InputError
        The file is compressed, so that its size is unknown, or it is larger than `room` bytes.
    """
    if path.suffix in {".gz", ".bz2"}:
        raise InputError(
            "compressed meshes cannot be read",
            where=path.name,
            hint="Decompress the file",
        )
    size = path.stat().st_size
    if zipfile.is_zipfile(path):
        with zipfile.ZipFile(path) as archive:
            size = sum(member.file_size for member in archive.infolist())
    if size > room:
        raise InputError(
            "the mesh is too large to be shown",
            where=path.name,
            found=f"{size / 1e6:.0f} MB",
            allowed=f"{_LARGEST / 1e6:.0f} MB for all meshes of the robot",
        )
    return size


def _meshes(
    name: str, visual: Element, materials: list[Element]
) -> list[trimesh.Trimesh]:
    """Read one visual with yourdfpy, as the only visual of a robot with a single link.

    Raises
    ------
    InputError
        The visual has no faces, or numbers that are not finite.
    """
    import trimesh
    import yourdfpy

    robot = etree.Element("robot", name="robot")
    robot.extend(deepcopy(materials))
    etree.SubElement(robot, "link", name=name).append(deepcopy(visual))
    read = yourdfpy.URDF.load(
        io.BytesIO(etree.tostring(robot)),
        load_meshes=True,
        build_scene_graph=True,
        filename_handler=yourdfpy.filename_handler_null,
    )
    meshes = []
    for mesh in read.scene.dump():
        if isinstance(mesh, trimesh.Trimesh) and len(mesh.faces):
            bare = trimesh.Trimesh(mesh.vertices, mesh.faces, visual=mesh.visual)
            meshes.append(_paint(bare))
    if not meshes or not all(np.isfinite(mesh.vertices).all() for mesh in meshes):
        raise InputError(
            "the mesh has no faces, or has corners that are not finite",
            where=visual.xpath("string(geometry/mesh/@filename)"),
        )
    return meshes


def _paint(mesh: trimesh.Trimesh) -> trimesh.Trimesh:
    """Colour a mesh unless it has a texture."""
    # The appearance of a mesh is a material, or the colours of its faces.
    look = getattr(mesh.visual, "material", mesh.visual)
    pictures = [getattr(look, name, None) for name in ("baseColorTexture", "image")]
    if pictures != [None, None]:
        return mesh
    colour = tuple(map(int, look.main_color)) if mesh.visual.defined else None
    return with_colour(mesh, colour or _COLOURS["shape"])


def with_colour(mesh: trimesh.Trimesh, colour: tuple[int, ...]) -> trimesh.Trimesh:
    """Give a mesh a matt material with an RGBA colour, 0 to 255, and sharp edges if the mesh has few faces."""
    import trimesh

    if len(mesh.faces) <= 2000:
        mesh = trimesh.graph.smooth_shade(mesh, angle=0.6)  # rad
    material = trimesh.visual.material.PBRMaterial(
        baseColorFactor=colour, metallicFactor=0.1, roughnessFactor=0.65
    )
    mesh.visual = trimesh.visual.TextureVisuals(material=material)
    return mesh


def placements(robot: Robot, q: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Compute forward kinematics of postures `q`, (K, n).

    Returns
    -------
    positions : (K, n + 2, 3) ndarray
        Positions of the frame of the paths, of the frame that each joint moves, and of the tool, in the world frame, m.
    quaternions : (K, n + 2, 4) ndarray
        Orientations of these frames: w, x, y, z.
    """
    tool = robot.frame_id
    rows = []
    for data in robot.place_joints(q):
        seen = path_frame_in_world(data, robot.world)
        placed = (*data.oMi, data.oMf[tool])
        rows.append([pin.SE3ToXYZQUAT(seen * frame) for frame in placed])
    frames = np.array(rows)
    return frames[..., :3], frames[..., [6, 3, 4, 5]]


@dataclass(frozen=True, eq=False)
class Bodies:
    """Shapes for drawing, by the joint that moves them, in the joint's frame, m.

    Attributes
    ----------
    links : dict of int to list of Trimesh
        Visual shapes of the URDF and bodies of the scene; joint 0 is the frame of the paths.
    passing : dict of str to dict of int to list of Trimesh
        Bodies of the scene, by name, that are there only during some parts of a program.
    skeleton : dict of int to list of Trimesh
        Shapes for the joints and for the straight lines between them.
    unread : tuple of str
        Shapes of the URDF that cannot be shown, with reasons.
    box : (2, 3) ndarray
        Lower and upper corners of a box that contains the whole robot at all times, m.
    moving_box : (2, 3) ndarray
        Lower and upper corners of a box that contains only the joints, the bodies they move, and the tool, m.
    """

    links: Meshes
    passing: dict[str | None, Meshes]
    skeleton: Meshes
    unread: tuple[str, ...]
    box: np.ndarray
    moving_box: np.ndarray

    @property
    def shows_links(self) -> bool:
        """Whether all links can be shown; if not, the skeleton is shown."""
        return bool(self.links) and not self.unread


def bodies_of(trajectory: Trajectory) -> Bodies:
    """Read a robot's shapes, and make a skeleton that fits its size."""
    import trimesh
    from scipy.spatial.transform import Rotation

    robot = trajectory.robot
    shapes, unread = link_shapes(robot.urdf, Path(robot.source).absolute().parent)
    links: Meshes = defaultdict(list)
    for name, meshes in shapes.items():
        frame = robot.model.frames[robot.model.getFrameId(name, pin.FrameType.BODY)]
        for mesh in meshes:
            mesh.apply_transform(frame.placement.homogeneous)
        links[int(frame.parentJoint)] += meshes
    lasting = []
    passing = {}
    for body in trajectory.task.scene:
        if body.since == body.until:
            lasting.append(body)
        else:
            passing[body.name] = scene_meshes(trajectory, [body])
    for joint, meshes in scene_meshes(trajectory, lasting).items():
        links[joint] += meshes
    q = trajectory.position(np.linspace(0.0, trajectory.t_end, 33))
    positions, quaternions = placements(robot, q)
    size = np.ptp(positions, axis=(0, 1)).max()
    skeleton = _skeleton(trajectory, max(size, 1e-3) * 0.012)
    world = robot.world[0]
    moving = [np.delete(positions, world, axis=1).reshape(-1, 3)]
    still: list[np.ndarray] = []
    for joint, meshes in (links or skeleton).items():
        corners_of_link = np.concatenate(
            [trimesh.bounds.corners(mesh.bounds) for mesh in meshes]
        )
        turns = Rotation.from_quat(quaternions[:, joint], scalar_first=True).as_matrix()
        corners = positions[:, joint, None] + corners_of_link @ turns.transpose(0, 2, 1)
        (still if joint == world else moving).append(corners.reshape(-1, 3))
    box, moving_box = (
        np.array([points.min(axis=0), points.max(axis=0)])
        for points in map(np.concatenate, (still + moving, moving))
    )
    return Bodies(links, passing, skeleton, tuple(unread), box, moving_box)


def _skeleton(trajectory: Trajectory, radius: float) -> Meshes:
    """Make rods for each joint along its axis, for the links between joints, and for the rails of prismatic joints."""
    import trimesh

    robot = trajectory.robot
    model = robot.model
    base = model.getFrameId(robot.base_frame, pin.FrameType.BODY)
    begin = model.frames[base].placement.translation
    ranges = robot.limits.both_ways("position")
    used = trajectory.q.min(axis=0), trajectory.q.max(axis=0)
    ranges = np.where(np.isfinite(ranges), ranges, used)
    chain = Chain.of(model)
    rods = []  # moving joint, two ends, thickness as a multiple of the radius, colour
    for joint, axis in enumerate(chain.axes):
        origin = chain.placements[joint, :3, 3]
        half = 2.0 * radius * axis
        rods.append((joint, begin, origin, 1.0, "bone"))
        rods.append((joint + 1, -half, half, 1.7, "joint"))
        if not chain.revolute[joint]:
            direction = chain.placements[joint, :3, :3] @ axis
            low, high = origin + np.outer(ranges[:, joint], direction)
            rods.append((joint, low, high, 0.5, "axis"))
        begin = np.zeros(3)
    tool = model.frames[robot.frame_id]
    rods.append((tool.parentJoint, begin, tool.placement.translation, 1.0, "bone"))
    drawn: Meshes = defaultdict(list)
    for joint, first, last, thickness, kind in rods:
        if np.linalg.norm(last - first) >= 1e-9:
            ends = [first, last]
            rod = trimesh.creation.cylinder(
                thickness * radius, segment=ends, sections=24
            )
            drawn[joint].append(with_colour(rod, _COLOURS[kind]))
    return drawn


def prescribed_path(trajectory: Trajectory, samples: Samples) -> np.ndarray:
    """Return the path at the motion's own s, (K, 3), m. Coordinates that the path leaves free are those of the tool."""
    points = samples.tool_position.copy()
    for component, rows, t in trajectory.split_times(samples.t):
        task_map = task_map_of(component.robot, component.task.task_space)
        axes = list(task_map.axes)
        if axes:
            path = path_of(task_map, component.task)
            s = np.clip(component.path_coordinate(t), 0.0, 1.0)
            points[rows[:, None], axes] = path.sample(s).target[:, : len(axes)]
    return points


def scene_meshes(trajectory: Trajectory, bodies: Sequence[SceneBody]) -> Meshes:
    """Make meshes of bodies in a task's scene, without those of the robot, in the frames of their joints, m."""
    scene = scene_of(trajectory.robot, trajectory.task.with_scene(bodies))
    meshes: Meshes = defaultdict(list)
    if scene is None:
        return meshes
    for number, solid in enumerate(
        scene.solids[scene.robot_count :], scene.robot_count
    ):
        mesh = _mesh_of(solid)
        mesh.apply_transform(scene.placements[number])
        meshes[int(scene.joints[number])].append(with_colour(mesh, _COLOURS["scene"]))
    return meshes


def _mesh_of(solid: Solid) -> trimesh.Trimesh:
    """Make a mesh of a solid, in the axes of the solid."""
    import trimesh

    shape = solid.geometry
    make = trimesh.creation
    if isinstance(shape, coal.Box):
        return make.box(2.0 * shape.halfSide)
    if isinstance(shape, coal.Sphere):
        return make.icosphere(radius=shape.radius)
    if isinstance(shape, coal.Cylinder):
        return make.cylinder(shape.radius, height=2.0 * shape.halfLength)
    if isinstance(shape, coal.Capsule):
        mesh = make.capsule(2.0 * shape.halfLength, shape.radius)
        mesh.apply_translation(-mesh.bounds.mean(axis=0))
        return mesh
    if isinstance(shape, coal.Halfspace):
        placed = trimesh.geometry.align_vectors([0.0, 0.0, 1.0], shape.n)
        placed[:3, 3] = shape.n * (shape.d - 0.5 * _THIN)
        return make.box([_FLOOR, _FLOOR, _THIN], placed)
    return trimesh.Trimesh(np.array(shape.points())).convex_hull
