"""Dotted keys."""

import re

import numpy as np
import pytest
import yaml

from brachis.errors import TaskError
from brachis.task import read_assignment, with_keys
from brachis.task.load import set_key

TASK = yaml.safe_load("""
brachis: 1
start: {joints: [0.1, 0.2, 0.3]}
task_space: [x, y]
path:
- line: {by: [1.0, 0.0]}
- line: {by: [0.0, 1.0]}
""")


@pytest.mark.parametrize("key", ["path.1.line.by", "path[1].line.by"])
def test_keys_have_indices_of_lists(key):
    changed = with_keys(TASK, {key: [2.0, 2.0]})
    first, second = TASK["path"]
    assert changed["path"] == [first, {"line": {"by": [2.0, 2.0]}}]
    assert second == {"line": {"by": [0.0, 1.0]}}


def test_keys_fill_absent_and_null_mappings():
    task = {"robot": {"limits": None}}
    set_key(task, "robot.limits.torque", 5)
    set_key(task, "spline.degree", 4)
    assert task == {"robot": {"limits": {"torque": 5}}, "spline": {"degree": 4}}


@pytest.mark.parametrize(
    "key, expected",
    [
        ("path.2.line", ["path is a list of 2", "allowed: 0 to 1"]),
        ("path.last", ["path.last", "allowed: 0 to 1"]),
        (
            "brachis.version",
            ["brachis is a value without keys", "found 1", "Set brachis itself"],
        ),
        ("spline..degree", ["spline..degree", "joined by dots"]),
        ("", ["joined by dots"]),
    ],
)
def test_ways_that_lead_nowhere(key, expected):
    with pytest.raises(TaskError) as caught:
        with_keys(TASK, {key: 1})
    assert all(part in str(caught.value) for part in expected)


@pytest.mark.parametrize(
    "text, expected",
    [
        ("spline.intervals=40", ("spline.intervals", 40)),
        ("robot.limits.velocity = null", ("robot.limits.velocity", None)),
        ("tool_limits={speed: 1e-1}", ("tool_limits", {"speed": 0.1})),
        ("a=b=c", ("a", "b=c")),
        ("a=[!degrees 180, 0.12]", ("a", [np.pi, 0.12])),
        ("a={j1: !degrees 180, j2: 1}", ("a", {"j1": np.pi, "j2": 1})),
    ],
)
def test_values_are_yaml(text, expected):
    assert read_assignment(text) == expected


@pytest.mark.parametrize(
    "value, found",
    [
        ("[30, 0.12]", "a list: put the tag before each number that has this unit"),
        ("{j1: 30}", "a mapping: put the tag before each number that has this unit"),
        ("a", "'a'"),
        ("'30'", "'30'"),
        ("1e400", "'1e400'"),
        ("nan", "'nan'"),
    ],
)
def test_a_unit_is_for_numbers_without_one(value, found):
    needs = "!degrees needs a number, not"
    with pytest.raises(TaskError, match=f"{needs} {re.escape(found)}$"):
        read_assignment(f"start.joints=!degrees {value}")


@pytest.mark.parametrize("value", ["30", "[30, 2]", "{j1: 30}"])
def test_an_unknown_tag_is_refused_with_those_that_exist(value):
    with pytest.raises(TaskError) as caught:
        read_assignment(f"start.joints=!deg {value}")
    assert str(caught.value) == (
        "value of start.joints: line 1, column 1: not valid YAML: there is no tag named '!deg'; allowed: "
        "!radians, !degrees, !meters, !millimeters, !foot, !inches. Did you mean '!degrees'?"
    )


@pytest.mark.parametrize("text", ["spline.intervals", "start.joints=[1, 2"])
def test_what_is_no_assignment(text):
    with pytest.raises(
        TaskError, match=r"key=value|value of start.joints: line 1.*not valid YAML"
    ):
        read_assignment(text)
