"""EAIK where it has wheels, and all else without it."""

import sys
import tomllib
from pathlib import Path

import pytest

import brachis
from brachis import ik
from support.effort import QUICK
from support.pose_arms import gen3, iiwa, panda_lengths

ROOT = Path(__file__).parents[2]
PROJECT = tomllib.loads((ROOT / "pyproject.toml").read_text())["project"]


def candidates(robot):
    return ik.find_all(robot, brachis.task_map_of(robot, "pose"))


def test_all_commands_have_it():
    assert "eaik" in str(PROJECT["optional-dependencies"]["all"])
    assert "EAIK" not in str(PROJECT["dependencies"])


def test_what_is_missing_and_how_to_get_it(monkeypatch):
    monkeypatch.setitem(sys.modules, "eaik.pybindings.EAIK", None)
    missing = ik.missing_eaik(candidates(gen3()))
    assert missing.startswith(
        "EAIK is not installed (pip install EAIK); it might add the redundant joints [j1], [j2], "
    )
    assert missing.endswith(
        "[j7]; installing it needs a C++ compiler, except on macOS and on Linux for x86_64 with Python 3.13 or older"
    )


def test_nothing_is_promised_where_no_closed_form_can_be(monkeypatch):
    """Joint 4 of this arm fixes the distance of shoulder and wrist; the others do without EAIK."""
    monkeypatch.setitem(sys.modules, "eaik.pybindings.EAIK", None)
    found = candidates(iiwa())
    assert [candidate.solver is None for candidate in found] == [
        i == 3 for i in range(7)
    ]
    assert ik.missing_eaik(found) == ""


def test_nothing_is_missing_beside_an_installation():
    pytest.importorskip("eaik.pybindings.EAIK")
    assert ik.missing_eaik(candidates(panda_lengths())) == ""


@pytest.mark.parametrize("example", ["01_scara_line", "03_tx90l_rail_line"])
def test_planning_without_it(example, monkeypatch):
    monkeypatch.setitem(sys.modules, "eaik.pybindings.EAIK", None)
    assert brachis.plan(ROOT / f"examples/{example}.yaml", **QUICK).verification.passed
