"""MJCF files with the figures of URDFs."""

from __future__ import annotations

from lxml import etree

LEAST_INERTIA = "1e-12"
"""Moment, kg m^2, in place of the zero ones of slender rods, which MuJoCo refuses."""


def mjcf_of(urdf: str) -> str:
    """The chain of a URDF, from its root, without shapes; MJCF has no limits of velocity."""
    robot = etree.fromstring(urdf.encode())
    root = etree.Element("mujoco", model=robot.get("name"))
    etree.SubElement(root, "compiler", angle="radian", eulerseq="XYZ")
    world = etree.SubElement(root, "worldbody")
    joints = {
        joint.find("child").get("link"): joint
        for joint in robot.iter("joint")
        if joint.find("child") is not None
    }

    def add(parent, link):
        name = link.get("name")
        joint = joints.get(name)
        body = etree.SubElement(parent, "body", name=name)
        if joint is not None:
            origin = joint.find("origin")
            if origin is not None:
                body.set("pos", origin.get("xyz", "0 0 0"))
                body.set("euler", origin.get("rpy", "0 0 0"))
            _add_joint(body, joint)
        _add_inertial(body, link)
        for child in robot.iter("link"):
            above = joints.get(child.get("name"))
            if above is not None and above.find("parent").get("link") == name:
                add(body, child)

    for link in robot.iter("link"):
        if link.get("name") not in joints:
            if link.get("name") == "world":
                link.set("name", "root")
                for joint in robot.iter("parent"):
                    joint.set("link", joint.get("link").replace("world", "root"))
            add(world, link)
    return etree.tostring(root, encoding="unicode", pretty_print=True)


def _add_joint(body, joint):
    if joint.get("type") == "fixed":
        return
    kinds = {"prismatic": "slide", "revolute": "hinge", "continuous": "hinge"}
    axis = joint.find("axis")
    limit = joint.find("limit")
    effort = limit.get("effort")
    element = etree.SubElement(
        body,
        "joint",
        name=joint.get("name"),
        type=kinds[joint.get("type")],
        axis="1 0 0" if axis is None else axis.get("xyz"),
        actuatorfrcrange=f"-{effort} {effort}",
    )
    if limit.get("lower"):
        element.set("range", f"{limit.get('lower')} {limit.get('upper')}")


def _add_inertial(body, link):
    inertial = link.find("inertial")
    if inertial is None:
        return
    inertia = inertial.find("inertia")
    moments = [
        inertia.get(key, "0") for key in ("ixx", "iyy", "izz", "ixy", "ixz", "iyz")
    ]
    moments[:3] = [moment if float(moment) else LEAST_INERTIA for moment in moments[:3]]
    origin = inertial.find("origin")
    assert origin.get("rpy") in (None, "0 0 0")
    etree.SubElement(
        body,
        "inertial",
        pos=origin.get("xyz"),
        mass=inertial.find("mass").get("value"),
        fullinertia=" ".join(moments),
    )
