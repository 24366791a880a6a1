"""Limits on the tool, as a task writes them: what is refused, with its key; tables as arrays."""

import numpy as np
import pytest
import yaml

import brachis
from brachis.errors import TaskError

TASK = yaml.safe_load("""
brachis: 1
start: {joints: [-0.6, 0.0]}
task_space: [x, y]
path: [{line: {by: [1.2, 0.0]}}]
""")


@pytest.mark.parametrize(
    "tool, where, said",
    [
        (
            "process_speed: {speed: 0.1, s: [0.6, 0.3]}",
            "process_speed[0].s",
            "begin < end",
        ),
        (
            "process_speed: {speed: 0.1, s: [-0.1, 0.3]}",
            "process_speed[0].s[0]",
            ">= 0",
        ),
        (
            "process_speed: {speed: 0.1, s: [0.1, 0.3], tolerance: 0.01}",
            "process_speed[0].tolerance",
            "unknown key",
        ),
        (
            "{process_speed: {speed: 0.503, s: [0.1, 0.3]}, speed: 0.5}",
            "process_speed[0].speed",
            "at most 0.5 m/s",
        ),
        (
            "process_speed: [{speed: 1.0, s: [0.25, 0.75]}, {speed: 0.1, s: [0.6, 0.9]}]",
            "process_speed[1].s",
            "begin above 0.75",
        ),
        (
            "{process_speed: {speed: 1.0, s: [0.25, 0.75]}, speed: 0.5}",
            "process_speed[0].speed",
            "at most 0.5 m/s",
        ),
        (
            "{process_speed: {speed: 1.0, s: [0.25, 0.75]}, speed: {s: [0.2, 0.4, 0.5], speed: [2.0, 1.0, 0.2]}}",
            "process_speed[0].speed",
            "at most 0.2 m/s",
        ),
        ("speed: {s: [0.0, 0.5], speed: [1.0]}", "tool_limits.speed.speed", "2"),
        (
            "speed: {s: [0.5, 0.2], speed: [1.0, 1.0]}",
            "tool_limits.speed.s[1]",
            ">= 0.5",
        ),
        (
            "speed: {s: [0.5, 0.5, 0.5], speed: [1.0, 2.0, 1.0]}",
            "tool_limits.speed.s",
            "a step",
        ),
        ("speed: {s: [0.5, 1.5], speed: [1.0, 1.0]}", "tool_limits.speed.s[1]", "1"),
        ("acceleration: 0.0", "tool_limits.acceleration", "1e-06"),
        ("angular_speed: fast", "tool_limits.angular_speed", "number"),
    ],
)
def test_the_error_names_the_key_of_what_makes_no_limit(tool, where, said):
    with pytest.raises(TaskError) as caught:
        brachis.load_task({**TASK, "tool_limits": yaml.safe_load(tool)})
    assert where in str(caught.value)
    assert said in str(caught.value)


def test_a_table_of_arrays_comes_back():
    given = {"s": np.linspace(0.0, 1.0, 3), "speed": np.array([1.0, 0.5, 1.0])}
    loaded = brachis.load_task({**TASK, "tool_limits": {"speed": given}})
    assert loaded.tool_limits.speed.speed == (1.0, 0.5, 1.0)
    assert brachis.load_task(loaded.to_dict()) == loaded
