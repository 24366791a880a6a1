"""What on_rail refuses, in which words, and that nothing is written then."""

import math
from pathlib import Path

import pytest

from brachis.apps.compose import Rail, on_rail
from brachis.errors import InputError, UrdfError

from .conftest import RAIL, arm_text

FIGURES = {
    "zero axis": (
        {"axis": (0, 0, 0)},
        "axis: this value is not valid; found (0, 0, 0)",
    ),
    "short axis": (
        {"axis": (0, 1)},
        "axis: this value is not valid; found (0, 1); allowed: a direction [x, y, z], not all zero",
    ),
    "axis of words": ({"axis": "abc"}, "axis: this value is not valid; found abc"),
    "axis not a number": ({"axis": (0, math.nan, 0)}, "axis: this value is not valid"),
    "range upside down": (
        {"range": (2, -2)},
        "range: this value is not valid; found (2, -2); allowed: [low, high] in m, low < high",
    ),
    "empty range": ({"range": (1, 1)}, "range: this value is not valid"),
    "endless range": (
        {"range": (-math.inf, 1)},
        "range: this value is not valid; found (-inf, 1); allowed: [low, high] in m",
    ),
    "one number as range": (
        {"range": 2.0},
        "range: this value is not valid; found 2.0",
    ),
    "no velocity": (
        {"velocity": 0.0},
        "velocity: this value is not valid; found 0.0; allowed: a finite number > 0 m/s",
    ),
    "negative force": ({"force": -5}, "force: this value is not valid; found -5"),
    "infinite force": (
        {"force": math.inf},
        "force: this value is not valid; found inf",
    ),
    "no mass": ({"mass": 0}, "mass: this value is not valid; found 0"),
    "mass not stated": ({"mass": None}, "mass: this value is not valid; found None"),
    "mass not a number": (
        {"mass": math.nan},
        "mass: this value is not valid; found nan",
    ),
    "mount": (
        {"mount_xyz": (0, 0)},
        "mount_xyz: this value is not valid; found (0, 0); allowed: a position [x, y, z] in m",
    ),
    "turned mount": (
        {"mount_rpy": (0, 0, math.inf)},
        "mount_rpy: this value is not valid",
    ),
    "flat carriage": (
        {"carriage_size": (1, 1, 0)},
        "carriage_size: this value is not valid; found (1, 1, 0); allowed: three lengths",
    ),
    "empty name": ({"name": ""}, "name: this is not a valid name; found ''"),
    "name with a space": (
        {"name": "my rail"},
        "name: this is not a valid name; found 'my rail'",
    ),
    "name with a null": ({"name": "rail\0"}, "name: this is not a valid name"),
    "name that is none": ({"root": 7}, "root: this is not a valid name; found 7"),
}


@pytest.mark.parametrize("case", FIGURES)
def test_wrong_figure(arm, tmp_path, case):
    options, words = FIGURES[case]
    output = tmp_path / "new.urdf"
    with pytest.raises(InputError) as caught:
        on_rail(arm, Rail(**(RAIL | options)), output=output)
    assert str(caught.value).startswith(words)
    assert not output.exists()


BASE = "<robot name='x'><link name='base'><inertial><mass value='1'/>{}</inertial></link></robot>"
URDFS = {
    "not XML": ("<robot name='x'><link", ["not well-formed XML"]),
    "two roots": (
        "<robot name='x'><link name='a'/><link name='b'/></robot>",
        ["one tree", "root links: a, b"],
    ),
    "a loop": (
        arm_text()
        .replace("<link name='world'/>", "")
        .replace("link='world'", "link='tool'"),
        ["none"],
    ),
    "a loop beside a tree": (
        arm_text(
            more="<link name='p'/><link name='q'/>"
            "<joint name='pq' type='fixed'><parent link='p'/><child link='q'/></joint>"
            "<joint name='qp' type='fixed'><parent link='q'/><child link='p'/></joint>"
        ),
        ["do not form one tree", "a loop of links: p, q"],
    ),
    "an xacro macro": (
        arm_text(more="<xacro:arm xmlns:xacro='http://www.ros.org/wiki/xacro'/>"),
        ["xacro macros", "<xacro:arm>", "Expand the file with xacro first"],
    ),
    "a word in the place of a figure": (
        arm_text().replace('mass value="2.0"', "mass value='heavy'"),
        ["link 'link1': <mass value> is wrong", 'value="heavy"'],
    ),
    "a base without an inertia": (
        BASE.format(""),
        ["link 'base' has a mass but no <inertia>"],
    ),
}


@pytest.mark.parametrize("case", URDFS)
def test_wrong_urdf(arm, tmp_path, case):
    text, words = URDFS[case]
    arm.write_text(text)
    with pytest.raises(UrdfError) as caught:
        on_rail(arm, Rail(**RAIL), output=tmp_path / "new.urdf")
    for word in (str(arm), *words):
        assert word in str(caught.value)
    assert not (tmp_path / "new.urdf").exists()


def test_missing_arm(tmp_path):
    with pytest.raises(UrdfError, match=r"nowhere\.urdf: the file does not exist"):
        on_rail(tmp_path / "nowhere.urdf", Rail(**RAIL), output=tmp_path / "new.urdf")


def test_arm_is_never_overwritten(arm, tmp_path, monkeypatch):
    before = arm.read_text()
    alias = tmp_path / "alias.urdf"
    alias.symlink_to(arm)
    monkeypatch.chdir(arm.parent)
    for output in (arm, alias, Path("arm.urdf"), Path("../arm/arm.urdf")):
        with pytest.raises(
            InputError,
            match=r"output .*: the output would overwrite the arm's URDF; allowed: another file",
        ):
            on_rail(arm, Rail(**RAIL), output=output)
    assert arm.read_text() == before


def test_output_that_cannot_be_written(arm, tmp_path):
    (tmp_path / "folder.urdf").mkdir()
    for output in (tmp_path / "missing/new.urdf", tmp_path / "folder.urdf"):
        with pytest.raises(InputError) as caught:
            on_rail(arm, Rail(**RAIL), output=output)
        assert str(caught.value).startswith(
            f"{output}: the file cannot be written; found "
        )
    assert sorted(path.name for path in tmp_path.iterdir()) == ["arm", "folder.urdf"]
