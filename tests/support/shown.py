"""Robots that the viewer shows."""

from __future__ import annotations

from pathlib import Path

from support.published import FOLDER

ROOT = Path(__file__).parents[2]
ROBOTS = sorted((ROOT / "robots").glob("*/robot.urdf"))
PANDA = FOLDER / "robots/panda_description/urdf/panda.urdf"
"""Its links are meshes; the file exists where example-robot-data is installed."""
_INERTIAL = '<inertial><mass value="1"/><inertia ixx="1" iyy="1" izz="1" ixy="0" ixz="0" iyz="0"/></inertial>'
NO_VISUALS = f"""<robot name="bare"><link name="world"/><link name="tool"/>
<link name="slide">{_INERTIAL}</link><link name="arm">{_INERTIAL}</link>
<joint name="rail" type="prismatic"><parent link="world"/><child link="slide"/><origin xyz="0 0 0.5"/>
<axis xyz="0 1 0"/><limit lower="-1" upper="2" velocity="1" effort="10"/></joint>
<joint name="turn" type="revolute"><parent link="slide"/><child link="arm"/><origin xyz="0.2 0 0"/>
<axis xyz="0 0 1"/><limit lower="-2" upper="2" velocity="1" effort="10"/></joint>
<joint name="flange" type="fixed"><parent link="arm"/><child link="tool"/><origin xyz="0.7 0 0"/></joint></robot>"""
"""A rail and an arm of one joint, without anything to see."""
