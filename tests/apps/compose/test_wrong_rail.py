"""What on_rail refuses, in which words, and that nothing is written then."""

import math
from pathlib import Path

import pytest

from brachis.apps.compose import Rail, on_rail
from brachis.errors import InputError, UrdfError

from .conftest import RAIL, arm_text

FIGURES = {
    "axis": (
        "a direction [x, y, z], not all zero",
        [(0, 0, 0), (0, 1), "abc", (0, math.nan, 0)],
    ),
    "range": (
        "[low, high] in m, low < high",
        [(2, -2), (1, 1), (-math.inf, 1), 2.0],
    ),
    "velocity": ("a finite number > 0 m/s", [0.0]),
    "force": ("a finite number > 0", [-5, math.inf]),
    "mass": ("a finite number > 0 kg", [0, None, math.nan]),
    "mount_xyz": ("a position [x, y, z] in m", [(0, 0)]),
    "mount_rpy": ("", [(0, 0, math.inf)]),
    "carriage_size": ("three lengths", [(1, 1, 0)]),
}


@pytest.mark.parametrize("name", FIGURES)
def test_wrong_figure(arm, tmp_path, name):
    allowed, values = FIGURES[name]
    for value in values:
        with pytest.raises(InputError) as caught:
            on_rail(arm, Rail(**(RAIL | {name: value})), output=tmp_path / "new.urdf")
        words = f"{name}: this value is not valid; found {value}; allowed: {allowed}"
        assert str(caught.value).startswith(words)
    assert not (tmp_path / "new.urdf").exists()


@pytest.mark.parametrize("name", ["", "my rail", "rail\0", 7], ids=repr)
def test_wrong_name(arm, tmp_path, name):
    with pytest.raises(InputError, match="name: this is not a valid name; found"):
        on_rail(arm, Rail(**RAIL, name=name), output=tmp_path / "new.urdf")
    assert not (tmp_path / "new.urdf").exists()


BASE = "<robot name='x'><link name='base'><inertial><mass value='1'/>{}</inertial></link></robot>"
URDFS = {
    "not XML": ("<robot name='x'><link", ["not well-formed XML"]),
    "a loop": (
        arm_text()
        .replace("<link name='world'/>", "")
        .replace("link='world'", "link='tool'"),
        ["none"],
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
