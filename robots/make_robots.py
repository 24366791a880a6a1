"""Write the URDFs of the robots that have a ``figures.yaml`` with ``python robots/make_robots.py``.

ur10_rail needs the arm of example-robot-data (``pip install ".[robots]"``) and is left as it is without.
"""
# ruff: noqa: INP001 (a script)

from __future__ import annotations

import copy
import math
import sys
import sysconfig
from collections.abc import Callable, Mapping, Sequence
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
import yaml
from lxml import etree

from brachis.apps.compose import Rail, on_rail
from brachis.apps.compose.rail import robot_text
from brachis.robot.urdf_elements import Element

ROBOTS = Path(__file__).parent
ZERO = (0.0, 0.0, 0.0)
COLOURS = {
    "grey": (0.35, 0.38, 0.42, 1.0),
    "yellow": (0.93, 0.78, 0.25, 1.0),
    "blue": (0.16, 0.42, 0.68, 1.0),
    "orange": (0.90, 0.55, 0.15, 1.0),
}
SIZES = {"box": ("size",), "cylinder": ("radius", "length"), "sphere": ("radius",)}
COMMENT = " Made by robots/make_robots.py; every figure's origin is in README.md beside this file. "


def main() -> None:
    """Write every URDF that can be made here."""
    for path, make in MAKERS.items():
        if make is ur10_rail and example_robot_data() is None:
            sys.stdout.write(
                f"{path}: left as it is, example-robot-data is not installed\n"
            )
            continue
        (ROBOTS / path).write_text(make(), encoding="utf-8")
        sys.stdout.write(f"{path}: written\n")


def tx90l_rail() -> str:
    """Staubli TX90L whose base is the carriage of a rail."""
    figures = read_figures("tx90l_rail")
    return robot(figures, figures["robot"], [figures["rail"], *figures["joints"]])


def tx90l() -> str:
    """Build the same arm without the rail."""
    figures = read_figures("tx90l_rail")
    del figures["links"]["world"]
    return robot(figures, "tx90l", figures["joints"])


def tx90l_positioner() -> str:
    """Staubli TX90L beside a positioner."""
    cell, arm = read_figures("tx90l_positioner"), read_figures("tx90l_rail")
    del arm["links"]["world"], arm["visuals"]["world"]
    both = {part: {**cell[part], **arm[part]} for part in ("links", "visuals")}
    return robot(both, cell["robot"], [*cell["joints"], *arm["joints"]])


def alone(name: str) -> str:
    """Build a robot of which everything stands in its own figures."""
    figures = read_figures(name)
    return robot(figures, figures["robot"], figures["joints"])


def gen3_rails() -> str:
    """Kinova Gen3 hanging from two rails."""
    rails, arm = read_figures("gen3_rails"), read_figures("gen3")
    both = {part: {**rails[part], **arm[part]} for part in ("links", "visuals")}
    return robot(both, rails["robot"], [*rails["joints"], *arm["joints"]])


def ur10_rail() -> str:
    """Universal Robots UR10 of example-robot-data on a rail, without meshes and simulator settings."""
    figures, folder = read_figures("ur10_rail"), example_robot_data()
    if folder is None:
        message = "example-robot-data is not installed"
        raise FileNotFoundError(message)
    given = figures["rail"]
    rail = Rail(
        axis=given["axis"],
        range=given["range_m"],
        velocity=given["max_speed_m_s"],
        force=given["max_force_n"],
        mass=given["carriage_mass"],
    )
    text = on_rail(folder / figures["arm"], rail, meshes=False)
    element = etree.fromstring(
        text, etree.XMLParser(remove_blank_text=True, remove_comments=True)
    )
    element.set("name", figures["robot"])
    for tag in ("gazebo", "transmission"):
        for each in element.findall(tag):
            element.remove(each)
    for name in figures["drop"]:
        joint = next(
            each
            for each in element.findall("joint")
            if each.find("child").get("link") == name
        )
        element.remove(joint)
        element.remove(element.find(f"link[@name='{name}']"))
    for name, visuals in figures["visuals"].items():
        element.find(f"link[@name='{name}']").extend(shapes_of(visuals))
    return commented(element)


MAKERS: dict[str, Callable[[], str]] = {
    "tx90l_rail/robot.urdf": tx90l_rail,
    "tx90l_rail/arm.urdf": tx90l,
    "tx90l_positioner/robot.urdf": tx90l_positioner,
    **{
        f"{name}/robot.urdf": partial(alone, name)
        for name in ("iiwa14", "gen3", "arm8")
    },
    "gen3_rails/robot.urdf": gen3_rails,
    "ur10_rail/robot.urdf": ur10_rail,
}


def example_robot_data() -> Path | None:
    """Folder of the robots of example-robot-data, or None where it is not installed."""
    places = (Path(sysconfig.get_path("purelib")) / "cmeel.prefix", Path(sys.prefix))
    folders = (place / "share/example-robot-data/robots" for place in places)
    return next((folder for folder in folders if folder.is_dir()), None)


def read_figures(name: str) -> dict[str, Any]:
    """Figures of one robot."""
    content: dict[str, Any] = yaml.safe_load(
        (ROBOTS / name / "figures.yaml").read_text(encoding="utf-8")
    )
    return content


def robot(
    figures: Mapping[str, Any], name: str, joints: Sequence[Mapping[str, Any]]
) -> str:
    """Text of the URDF with the links and visuals of `figures` and the given joints."""
    element = etree.Element("robot", name=name)
    for name_of_link, body in figures["links"].items():
        parts = shapes_of(figures["visuals"].get(name_of_link, []))
        if body:
            parts.insert(0, inertial_of(body))
        element.append(make("link", *parts, name=name_of_link))
    element.extend(joint_of(each) for each in joints)
    return commented(element)


def inertial_of(figures: Mapping[str, Any]) -> Element:
    """Inertia from its figures: mass, centre of mass, and the inertia about it."""
    keys = ("ixx", "ixy", "ixz", "iyy", "iyz", "izz")
    return make(
        "inertial",
        *origin(figures["com"], ZERO),
        make("mass", value=figures["mass"]),
        make("inertia", **dict(zip(keys, figures["inertia"], strict=True))),
    )


def commented(element: Element) -> str:
    """Text of the URDF below a comment that says where it comes from."""
    element.addprevious(etree.Comment(COMMENT))
    return robot_text(element)


def joint_of(figures: Mapping[str, Any]) -> Element:
    """Joint from its figures; degrees become radians in full precision."""
    kind = figures["type"]
    limit = None
    if kind in ("revolute", "continuous"):
        limit = {
            "velocity": math.radians(figures["max_speed_deg_s"]),
            "effort": figures["torque_nm"],
        }
        if kind == "revolute":
            low, high = (math.radians(angle) for angle in figures["range_deg"])
            limit = {"lower": low, "upper": high, **limit}
    elif kind == "prismatic":
        low, high = figures["range_m"]
        limit = {
            "lower": low,
            "upper": high,
            "velocity": figures["max_speed_m_s"],
            "effort": figures["max_force_n"],
        }
    element = make(
        "joint",
        make("parent", link=figures["parent"]),
        make("child", link=figures["child"]),
        *origin(figures.get("origin", ZERO), radians(figures.get("rpy_deg", ZERO))),
        name=figures["name"],
        type=kind,
    )
    if "axis" in figures:
        element.append(make("axis", xyz=figures["axis"]))
    if limit is not None:
        element.append(make("limit", **limit))
    return element


def shapes_of(figures: Sequence[Mapping[str, Any]]) -> list[Element]:
    """Primitives that are drawn, and then, without the balls that mark tools, those that must not touch anything."""
    drawn = [visual_of(each) for each in figures]
    solid = [collision_of(each) for each in drawn if each.find(".//sphere") is None]
    return [*drawn, *solid]


def collision_of(drawn: Element) -> Element:
    """Collision geometry that is what a visual shows."""
    return make(
        "collision", *(copy.deepcopy(part) for part in drawn if part.tag != "material")
    )


def visual_of(figures: Mapping[str, Any]) -> Element:
    """Primitive from its figures: ``box``, ``cylinder`` (radius, length) or ``sphere`` (radius)."""
    shape = next(kind for kind in SIZES if kind in figures)
    size = (
        {"size": figures[shape]}
        if shape == "box"
        else dict(zip(SIZES[shape], figures[shape], strict=True))
    )
    colour = figures["colour"]
    return make(
        "visual",
        *origin(figures.get("xyz", ZERO), radians(figures.get("rpy_deg", ZERO))),
        make("geometry", make(shape, **size)),
        make("material", make("color", rgba=COLOURS[colour]), name=colour),
    )


def make(
    tag: str, *children: Element, **attributes: str | float | Sequence[float]
) -> Element:
    """Make an element; numbers are written as the shortest text from which the same numbers are read again."""
    element = etree.Element(tag)
    for name, value in attributes.items():
        text = value
        if not isinstance(text, str):
            figures = np.array(value, dtype=float, ndmin=1) + 0.0
            text = " ".join(repr(float(each)).removesuffix(".0") for each in figures)
        element.set(name, text)
    element.extend(children)
    return element


def origin(xyz: Sequence[float], rpy: Sequence[float]) -> list[Element]:
    """Make an ``<origin>``, or nothing for the identity."""
    if any(rpy):
        return [make("origin", xyz=xyz, rpy=rpy)]
    return [make("origin", xyz=xyz)] if any(xyz) else []


def radians(angles: Sequence[float]) -> list[float]:
    """Turn degrees into radians."""
    return [math.radians(angle) for angle in angles]


if __name__ == "__main__":
    main()
