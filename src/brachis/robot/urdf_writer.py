"""Conversion of a Pinocchio model to the text of a URDF, from which brachis reads, saves and verifies robots."""

from __future__ import annotations

from collections.abc import Sequence
from xml.sax.saxutils import quoteattr

import numpy as np
import pinocchio as pin

from brachis.common.files import is_file
from brachis.errors import UrdfError
from brachis.task.fields import LARGEST


def write_urdf(model: pin.Model, geometry: pin.GeometryModel | None = None) -> str:
    """Write a model as a URDF.

    Parameters
    ----------
    model : pinocchio.Model
        Joints that neither turn about nor slide along one axis become ``floating`` joints, which can be held but not
        moved. Infinite limits, and limits as large as the largest number, are left out. ``model.armature`` becomes the
        attribute ``armature`` of ``<dynamics>``, which only brachis reads.
    geometry : pinocchio.GeometryModel, optional
        Solids, which become ``<collision>`` elements: boxes, balls, cylinders, capsules (read only by brachis) and mesh
        files.

    Returns
    -------
    str
        The text of the URDF. Every body is a link, and so is every frame except the frames of joints. The link that a
        joint moves has the name of the body at the joint's frame, or the name of the joint if there is no such body. A
        name that is already taken gets an underscore.

    Raises
    ------
    UrdfError
        A solid has a shape that cannot be written.
    """
    bodies = {
        frame.parentJoint: number
        for number, frame in reversed([*enumerate(model.frames)])
        if frame.type == pin.FrameType.BODY and frame.placement.isIdentity()
    }
    origins = [
        (model.frames[bodies[i]].name if i in bodies else name, pin.SE3.Identity())
        for i, name in enumerate(model.names)
    ]
    solids: list[str] = [""] * model.njoints
    for solid in geometry.geometryObjects if geometry else ():
        solids[solid.parentJoint] += _write_solid(solid)
    texts = [
        f"<link name={quoteattr(name)}>{_write_inertial(inertia)}{solid}</link>"
        for (name, _), inertia, solid in zip(
            origins, model.inertias, solids, strict=True
        )
    ]
    names = {name for name, _ in origins}
    parents = [origins[parent] for parent in model.parents]
    carriers = [origins[0]]
    """For every frame, the closest link above it, with the placement of this link in the frame of the joint that moves
    both."""
    for number, frame in enumerate(model.frames[1:], 1):
        joint = frame.parentJoint
        above = model.frames[frame.parentFrame].parentJoint
        carrier = carriers[frame.parentFrame] if above == joint else origins[joint]
        if frame.type == pin.FrameType.JOINT and above == model.parents[joint]:
            parents[joint] = carriers[frame.parentFrame]
        elif frame.type in _LINKS and bodies.get(joint) != number:
            name = frame.name
            while name in names:
                name += "_"
            names.add(name)
            ends = _write_ends(carrier, name, frame.placement)
            fixed = quoteattr(f"fixed:{name}")
            texts.append(f"<link name={quoteattr(name)}/>")
            texts.append(f"<joint name={fixed} type='fixed'>{ends}</joint>")
            carrier = (name, frame.placement)
        carriers.append(carrier)
    for i in range(1, model.njoints):
        ends = _write_ends(parents[i], origins[i][0], model.jointPlacements[i])
        texts.append(_write_joint(model, i, ends))
    content = "\n".join(texts)
    return f"<robot name={quoteattr(model.name)}>\n{content}\n</robot>\n"


_LINKS = (pin.FrameType.BODY, pin.FrameType.OP_FRAME, pin.FrameType.SENSOR)


def write_numbers(*numbers: float) -> str:
    """Write numbers as the shortest text that reproduces them exactly."""
    return " ".join(repr(float(number) + 0.0).removesuffix(".0") for number in numbers)


def write_origin(xyz: Sequence[float] | np.ndarray, rpy: Sequence[float]) -> str:
    """Write an ``<origin>``, or nothing for the identity."""
    turn = f' rpy="{write_numbers(*rpy)}"' if any(rpy) else ""
    return f'<origin xyz="{write_numbers(*xyz)}"{turn}/>' if turn or any(xyz) else ""


def _write_placement(placement: pin.SE3) -> str:
    return write_origin(placement.translation, pin.rpy.matrixToRpy(placement.rotation))


def _write_ends(parent: tuple[str, pin.SE3], child: str, placement: pin.SE3) -> str:
    """Write the ends and the origin of a joint between a parent link and a child link, both placed in one frame."""
    name, placed = parent
    origin = _write_placement(placed.actInv(placement))
    return f"<parent link={quoteattr(name)}/><child link={quoteattr(child)}/>{origin}"


def _write_inertial(inertia: pin.Inertia) -> str:
    """Write a mass and its inertia about the centre of mass; empty for a body without a mass."""
    matrix = inertia.inertia
    if not inertia.mass and not matrix.any():
        return ""
    moments = " ".join(
        f"i{'xyz'[row]}{'xyz'[column]}='{write_numbers(matrix[row, column])}'"
        for row, column in zip(*np.triu_indices(3), strict=True)
    )
    origin = _write_placement(pin.SE3(np.eye(3), inertia.lever))
    mass = write_numbers(inertia.mass)
    return f"<inertial>{origin}<mass value='{mass}'/><inertia {moments}/></inertial>"


def _write_joint(model: pin.Model, i: int, ends: str) -> str:
    """Write joint number `i` of a model: its type, axis, limits and friction."""
    joint = model.joints[i]
    name = quoteattr(model.names[i])
    data = joint.createData()
    joint.calc(data, pin.neutral(model))
    slide, turn = np.reshape(data.S, (2, 3, -1))
    if joint.nv != 1 or (slide.any() and turn.any()):
        return f"<joint name={name} type='floating'>{ends}</joint>"
    v = joint.idx_v
    figures = {"velocity": model.velocityLimit[v], "effort": model.effortLimit[v]}
    if joint.nq == 1:  # a joint without a range may have a sine and a cosine
        figures["lower"] = model.lowerPositionLimit[joint.idx_q]
        figures["upper"] = model.upperPositionLimit[joint.idx_q]
    stated = [key for key, value in figures.items() if abs(value) < LARGEST]
    limits = " ".join(f"{key}='{write_numbers(figures[key])}'" for key in stated)
    kind = "revolute" if {"lower", "upper"} & set(stated) else "continuous"
    kind = "prismatic" if slide.any() else kind
    axis = write_numbers(*(slide + turn).ravel())
    damping, friction, armature = (
        write_numbers(values[v])
        for values in (model.damping, model.friction, model.armature)
    )
    return (
        f"<joint name={name} type='{kind}'>{ends}<axis xyz='{axis}'/><limit {limits}/>"
        f"<dynamics damping='{damping}' friction='{friction}' armature='{armature}'/></joint>"
    )


def _write_solid(solid: pin.GeometryObject) -> str:
    """Write a solid as a ``<collision>``."""
    shape = solid.geometry
    kind = type(shape).__name__.lower()
    if kind == "box":
        figures = f"size='{write_numbers(*(2.0 * shape.halfSide))}'"
    elif kind == "sphere":
        figures = f"radius='{write_numbers(shape.radius)}'"
    elif kind in ("cylinder", "capsule"):
        length = write_numbers(2.0 * shape.halfLength)
        figures = f"radius='{write_numbers(shape.radius)}' length='{length}'"
    elif is_file(solid.meshPath):
        kind = "mesh"
        file = quoteattr(solid.meshPath)
        figures = f"filename={file} scale='{write_numbers(*solid.meshScale)}'"
    else:
        raise UrdfError(
            "this solid cannot be written into a URDF",
            where=f"geometry: {solid.name}",
            found=kind,
            allowed="a box, a ball, a cylinder, a capsule, or a mesh with its file",
        )
    origin = _write_placement(solid.placement)
    return f"<collision>{origin}<geometry><{kind} {figures}/></geometry></collision>"
