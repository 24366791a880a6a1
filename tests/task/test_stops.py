"""Stops and dwells at the ends of segments, as a task writes them."""

import pytest
import yaml

from brachis.errors import TaskError
from brachis.task import load_task, task_with

UP = {"line": {"by": [0.0, 0.1]}}


def task(last=None, **keys):
    right = {"line": {"by": [0.1, 0.0]}, **keys}
    path = [right, UP | (last or {})]
    return task_with(start=[0], task_space=["x", "y"], path=path)


def test_a_dwell_is_a_stop():
    for keys, stop, dwell in (
        ({}, False, 0.0),
        ({"stop": True}, True, 0.0),
        ({"dwell": 0.5}, True, 0.5),
        ({"stop": True, "dwell": 0.5}, True, 0.5),
        ({"dwell": 0}, False, 0.0),
        ({"stop": True, "dwell": 0.001}, True, 0.001),
    ):
        made = task(**keys)
        assert (made.path[0].stop, made.path[0].dwell) == (stop, dwell)
        assert load_task(made.to_dict()) == made


@pytest.mark.parametrize(
    "keys, where, said",
    [
        ("{stop: true, blend: 0.01}", "blend", "so the corner there is not rounded"),
        ("{dwell: 0.5, blend: 0.01}", "blend", "so the corner there is not rounded"),
        ("{stop: false, dwell: 0.5}", "stop", "a dwell needs a stop"),
        ("dwell: 0.0005", "dwell", "0.001 s"),
        ("dwell: -0.5", "dwell", ">= 0"),
        ("dwell: long", "dwell", "number"),
        ("stop: 1", "stop", "true or false"),
    ],
)
def test_what_is_no_stop_is_refused_with_its_key(keys, where, said):
    with pytest.raises(TaskError) as caught:
        task(**yaml.safe_load(keys))
    assert f"path[0].{where}: " in str(caught.value)
    assert said in str(caught.value)


@pytest.mark.parametrize("keys", [{"stop": True}, {"dwell": 1.0}], ids=str)
def test_the_last_segment_ends_the_motion_anyway(keys):
    (key,) = keys
    message = rf"path\[1\].{key}: the last .*boundary.end_speed"
    with pytest.raises(TaskError, match=message):
        task(last=keys)
