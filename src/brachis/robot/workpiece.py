"""The URDF as seen from the workpiece: a tree whose root is the link that carries the workpiece.

A positioner carries the workpiece, in whose frame the paths are given. Seen from the workpiece, positioner and arm are
one serial chain: through the joints of the positioner in reverse, then through those of the arm. A joint with its
origin O and its axis a moves its child by ``O exp(a q)``. In reverse, it moves its parent by ``exp(-a q) O^-1``, which
is a joint about -a and a fixed link.
"""

from __future__ import annotations

import copy

import numpy as np
import pinocchio as pin
from lxml import etree

from brachis.robot.urdf_bodies import origin_of
from brachis.robot.urdf_elements import Element, UrdfTree, connect, end_of, numbers_of
from brachis.robot.urdf_writer import write_numbers

_MOVED = "/moved by "
"""Separates the parent of a reversed joint from the joint's name, in the name of the link between both."""


def carrying_joints(tree: UrdfTree, link: str) -> list[str]:
    """List the joints from a link to the root of its tree, beginning at the link."""
    joints = []
    while link in tree.above:
        joints.append(tree.above[link])
        link = end_of(tree.joints[joints[-1]], "parent")
    return joints


def tree_seen_from(tree: UrdfTree, link: str, where: str) -> UrdfTree:
    """Return the tree with another link as its root. Joint positions keep their meaning.

    The links between reversed joints and their parents are only in `UrdfTree.above` and `UrdfTree.downward`.

    Parameters
    ----------
    tree : UrdfTree
    link : str
        The new root.
    where : str
        Name of the file, for messages.
    """
    links = list(tree.links)
    joints = dict(tree.joints)
    for name in carrying_joints(tree, link):
        joint = tree.joints[name]
        parent = end_of(joint, "parent")
        moved = f"{parent}{_MOVED}{name}"
        links.append(moved)
        joints[name] = _reverse(joint, moved)
        joints[moved] = _fix(moved, parent, np.linalg.inv(origin_of(joint, "origin")))
    return UrdfTree(tree.robot, tree.links, joints, *connect(links, joints, where))


def _reverse(joint: Element, moved: str) -> Element:
    """Return a joint from its child to a new link, without an origin and about the opposite axis."""
    reverse = copy.deepcopy(joint)
    reverse.find("parent").set("link", end_of(joint, "child"))
    reverse.find("child").set("link", moved)
    for element in [*reverse.findall("origin"), *reverse.findall("axis")]:
        reverse.remove(element)
    axis = -np.array(numbers_of(joint, "axis", "xyz", "1 0 0"))
    etree.SubElement(reverse, "axis", xyz=write_numbers(*axis))
    return reverse


def _fix(name: str, child: str, placement: np.ndarray) -> Element:
    """Return a fixed joint that places a link relative to the link that has the joint's name."""
    joint = etree.Element("joint", name=name, type="fixed")
    etree.SubElement(joint, "parent", link=name)
    etree.SubElement(joint, "child", link=child)
    rpy = pin.rpy.matrixToRpy(placement[:3, :3])
    numbers = {"xyz": placement[:3, 3], "rpy": rpy}
    texts = {key: write_numbers(*value) for key, value in numbers.items()}
    etree.SubElement(joint, "origin", texts)
    return joint
