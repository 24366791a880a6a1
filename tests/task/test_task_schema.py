"""The JSON Schema agrees with the loader on what a task looks like."""

import pytest
import yaml

from brachis.errors import TaskError
from brachis.task import json_schema, load_task
from brachis.task.units import unit_of

jsonschema = pytest.importorskip("jsonschema")


def task(**changes):
    content = """
    brachis: 1
    robot:
      urdf: robot.urdf
      limits: {torque: {j1: 10, j2: null}, velocity: null, acceleration: 2, position: [[-1, 1]]}
      friction: {viscous: [0, 1]}
    start: {joints: {j1: 0.5}}
    end: free
    task_space: [x, y]
    path:
    - {line: {to: [1, 2]}, blend: 0.1}
    - line: {length: 1.0, angle_deg: 90}
    - arc: {center: [1, 2], angle_deg: 90, yaw: tangent}
    - arc: {via: [1, 2], to: [3, 4]}
    - circle: {center: [1, 2], turns: -2}
    - spline: {through: [[1, 2], [3, 4]]}
    """
    return yaml.safe_load(content) | changes


@pytest.fixture(scope="module")
def validator():
    schema = json_schema()
    cls = jsonschema.validators.validator_for(schema)
    cls.check_schema(schema)
    return cls(schema)


@pytest.mark.parametrize(
    "change",
    [
        "",
        "task_space: position",
        "end: {joints: [1]}",
        "path: {line: {by: [1]}}",
        "path: [[0], [1], [2]]",
        "solver: ipopt",
        "search: {slower: 1 %}",
        "spline: {tolerance: 1 %}",
        (
            "robot: {urdf: robot.urdf, payload: {mass: 2, inertia: {ixx: 1, iyy: 1, izz: 1}}, tool_offset: {xyz: "
            "[0, 0, 0.1]}, mounting: wall, speed_override: 50 %, friction: {viscous: null, coulomb: urdf, "
            "rotor_inertia: 0.0001, gear_ratio: {j1: 100}}}"
        ),
        "robot: {urdf: robot.urdf, limits: {torque: {j1: [-5, 7], j2: 3}, velocity: [[-1, 2], 3]}}",
        "robot: {urdf: robot.urdf, mounting: {xyz: [1, 2, 3], rpy_deg: [0, 30, 0]}}",
    ],
)
def test_the_schema_accepts_what_the_loader_accepts(validator, change):
    content = task(**(yaml.safe_load(change) or {}))
    load_task(content)
    assert validator.is_valid(content)


def test_the_schema_accepts_a_saved_task(validator):
    assert validator.is_valid(load_task(task()).to_dict())


@pytest.mark.parametrize(
    "change",
    [
        "pth: []",
        "brachis: 2",
        "robot: {mounting: roof}",
        "robot: {limits: {torque: {j1: [-5]}}}",
        "robot: {payload: {com: [0, 0, 0]}}",
        "path: []",
        "path: [{lien: {to: [1]}}]",
        "path: [{line: {to: [1], by: [1]}}]",
        "path: [{line: {to: '1'}}]",
        "robot: {limits: {torque: -1}}",
        "task_space: posse",
        "spline: {degree: 8}",
        "search: {slower: 150 %}",
    ],
)
def test_the_schema_refuses_what_the_loader_refuses(validator, change):
    content = task(**yaml.safe_load(change))
    assert not validator.is_valid(content)
    with pytest.raises(TaskError):
        load_task(content)


def test_the_schema_tells_an_editor_what_keys_mean():
    schema = json_schema()
    assert schema["$schema"].startswith("https://json-schema.org/")
    assert schema["title"]
    described = [
        key for key, value in schema["properties"].items() if value.get("description")
    ]
    assert described == list(schema["properties"])


@pytest.mark.parametrize(
    "key, unit",
    [
        ("robot.payload.mass", "kg"),
        ("robot.payload.com.2", "m"),
        ("robot.limits.velocity", "rad/s (m/s)"),
        ("robot.limits.acceleration.j1", "rad/s^2 (m/s^2)"),
        ("tool_limits.speed", "m/s"),
        ("tool_limits.acceleration", "m/s^2"),
        ("tool_limits.angular_speed", "rad/s"),
        ("path.0.line.length", "m"),
        ("path.1.arc.angle_deg", "deg"),
        ("robot.mounting.xyz.0", "m"),
        ("boundary.start_speed", "m/s"),
        ("path.2.dwell", "s"),
        ("robot.gravity.2", "m/s^2"),
        ("search.time_limit", "s"),
        ("spline.intervals", ""),
        ("robot.limits.scale.torque", ""),
        ("no.such.key", ""),
    ],
)
def test_units_of_keys_are_those_of_their_descriptions(key, unit):
    assert unit_of(key) == unit
