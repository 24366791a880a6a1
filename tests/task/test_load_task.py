"""Loading tasks: what is accepted, what comes back, and what every mistake is told."""

import copy
import json
from pathlib import Path

import numpy as np
import pytest
import yaml
from hypothesis import given
from hypothesis import strategies as st
from pydantic import ValidationError

from brachis import Program, examples, robots
from brachis.errors import TaskError
from brachis.task import FROM_URDF, LineBy, load_task

COMPLETE = """
brachis: 1
robot:
  urdf: ../robots/scara3/robot.urdf
  tool_frame: tool
  base_frame: null
  gravity: [0, 0, -9.81]
  locked_joints: {finger: 0.02}
  limits:
    torque: {j1: 10, j2: null}
    velocity: null
    acceleration: 2.0
    position: {j1: [-1, 1], j2: null}
    scale: {torque: 0.9, velocity: 1.0, acceleration: 1.0}
  friction: {armature: 0, viscous: [0.1, 0.2, 0], coulomb: {j1: 2}, coulomb_velocity: 0.01}
start: {joints: [0.1, 0.2, 0.3]}
end: {joints: {j1: 1, j2: 2, j3: 3}}
task_space: [x, y]
path:
  - line: {to: [1, 2]}
    blend: 0.1
  - line: {by: [1, 2]}
  - line: {length: 1.0, angle_deg: 90}
  - arc: {center: [1, 2], angle_deg: 90}
  - arc: {via: [1, 2], to: [3, 4]}
  - circle: {center: [1, 2]}
  - spline: {through: [[1, 2], [3, 4]], relative: true}
redundant_joints: [j3]
branch: elbow up
spline: {degree: 4, intervals: 30, rest: full, points_per_interval: 3}
solver: {name: uno, max_iterations: 100, time_limit: 20, tolerance: 1e-6}
refinement: {tolerance: 1.0e-4, density: 10, max_rounds: 10}
"""


def minimal(**changes):
    task = """
    brachis: 1
    start: {joints: [0.1, 0.2, 0.3]}
    task_space: [x, y]
    path: [{line: {length: 1.0, angle_deg: 90}}]
    redundant_joints: [j3]
    """
    return yaml.safe_load(task) | changes


def written(folder, text):
    file = folder / "task.yaml"
    file.write_text(text, encoding="utf-8")
    return file


def test_a_task_may_have_the_name_of_a_robot(tmp_path):
    named = COMPLETE.replace("../robots/scara3/robot.urdf", "iiwa14")
    file = written(tmp_path, named)
    assert load_task(file).robot.urdf == str(robots.path_of("iiwa14"))
    beside = tmp_path / "iiwa14"
    beside.write_text("<robot/>", encoding="utf-8")
    assert load_task(file).robot.urdf == str(beside)


@pytest.fixture
def complete(tmp_path):
    return load_task(written(tmp_path, COMPLETE))


def test_a_complete_file_is_read(complete, tmp_path):
    robot, path = complete.robot, complete.path
    assert robot.urdf == str(tmp_path.parent / "robots/scara3/robot.urdf")
    assert robot.limits.torque == {"j1": 10.0, "j2": None}
    assert robot.limits.position == {"j1": (-1.0, 1.0), "j2": None}
    assert robot.friction.viscous == (0.1, 0.2, 0.0)
    assert path[0].blend == 0.1
    assert path[1].shape == LineBy(by=(1.0, 2.0))
    kinds = "line line line arc arc circle spline"
    assert [segment.kind for segment in path] == kinds.split()
    assert complete.solver.tolerance == 1e-6  # YAML 1.1 would read the string '1e-6'


@pytest.mark.parametrize("text", [COMPLETE, COMPLETE.replace("velocity: null\n", "\n")])
def test_round_trip_through_json(tmp_path, text):
    task = load_task(written(tmp_path, text))
    assert load_task(json.loads(json.dumps(task.to_dict(), allow_nan=False))) == task


@given(
    st.one_of(
        st.just(FROM_URDF),
        st.none(),
        st.floats(1e-6, 1e6),
        st.lists(st.floats(1e-6, 1e6), min_size=1, max_size=7),
        st.dictionaries(
            st.text(min_size=1, max_size=5),
            st.none() | st.floats(1e-6, 1e6),
            max_size=7,
        ),
    )
)
def test_every_form_of_limit_survives_the_round_trip(limit):
    task = load_task(minimal(robot={"limits": {"torque": limit}}))
    assert load_task(task.to_dict()) == task


def test_position_is_the_three_rows():
    assert load_task(minimal(task_space="position")) == load_task(
        minimal(task_space=["x", "y", "z"])
    )
    assert (
        load_task(minimal(task_space="pose_free_roll")).task_space == "pose_free_roll"
    )


def test_arrays_and_paths_are_accepted_in_mappings():
    task = load_task(
        minimal(start={"joints": np.array([1.0, 2.0])}, robot={"urdf": Path("a.urdf")})
    )
    assert task.start.joints == (1.0, 2.0)
    assert task.robot.urdf == str(Path.cwd() / "a.urdf")


def test_a_row_of_a_table_keeps_the_names_of_its_numbers():
    pandas = pytest.importorskip("pandas")
    row = pandas.DataFrame({"b": [2.0], "a": [1.0]}).iloc[0]
    task = load_task(minimal(start={"joints": row}))
    assert task.start.joints == {"b": 2.0, "a": 1.0}
    column = pandas.Series([1.0, 2.0])
    assert load_task(minimal(start={"joints": column})).start.joints == (1.0, 2.0)


def test_a_table_in_place_of_numbers_is_named_by_its_type():
    pandas = pytest.importorskip("pandas")
    table = pandas.DataFrame({"a": [1.0], "b": [2.0]})
    with pytest.raises(TaskError, match="wrong form; found DataFrame; allowed"):
        load_task(minimal(start={"joints": table}))


@pytest.mark.parametrize(
    "value, share",
    [("1 %", 0.01), ("0.5%", 0.005), ("100 %", 1.0), (0.02, 0.02), (0, 0.0)],
)
def test_a_share_is_a_fraction_or_a_percentage(value, share):
    task = load_task(minimal(search={"slower": value}))
    assert task.search.slower == pytest.approx(share, rel=1e-15)
    assert load_task(task.to_dict()) == task


@pytest.mark.parametrize(
    "part, key, value, share",
    [
        ("spline", "tolerance", "1 %", 0.01),
        ("spline", "shortest_interval", "5 %", 0.05),
        ("refinement", "tolerance", "0.02 %", 2e-4),
    ],
)
def test_all_shares_may_be_percentages(part, key, value, share):
    task = load_task(minimal(**{part: {key: value}}))
    assert getattr(getattr(task, part), key) == pytest.approx(share, rel=1e-15)
    with pytest.raises(TaskError, match=rf"{part}.{key}: out of range"):
        load_task(minimal(**{part: {key: "100 %"}}))


def test_a_task_is_frozen(complete):
    with pytest.raises(ValidationError, match="frozen"):
        complete.branch = "auto"


def error_of(source):
    with pytest.raises(TaskError) as caught:
        load_task(source)
    assert caught.value.__cause__ is None
    assert "pydantic" not in str(caught.value)
    return caught.value


MISTAKES = [
    ("brachis: 2", "brachis: .*found 2.*allowed: 1"),
    ("brachis: true", r"brachis: .*found true \(a boolean\)"),
    (
        "strat: 1",
        r"strat: unknown key.*allowed: brachis, robot, start.*Did you mean 'start'\?",
    ),
    (
        "robot: {urdff: a}",
        r"robot.urdff: unknown key.*allowed: urdf, tool_frame.*Did you mean 'urdf'\?",
    ),
    ("robot: {limits: 10}", "robot.limits: wrong type; found 10; allowed: a mapping"),
    (
        "robot: {limits: {torqe: 1}}",
        r"robot.limits.torqe: unknown key.*allowed: torque, velocity.*position, power.*Did you mean 'torque'\?",
    ),
    (
        "robot: {limits: {scale: {torqe: 1}}}",
        (
            r"robot.limits.scale.torqe: unknown key.*allowed: torque, velocity, acceleration.*Did you mean "
            r"'torque'\?"
        ),
    ),
    (
        "robot: {limits: {torque: '10'}}",
        r"robot.limits.torque: .*found '10' \(a string\).*a number > 0",
    ),
    (
        "robot: {limits: {torque: 0}}",
        "robot.limits.torque: out of range; found 0; allowed: > 0",
    ),
    (
        "robot: {limits: {velocity: {j1: -1}}}",
        "robot.limits.velocity.j1: out of range; found -1",
    ),
    (
        "robot: {limits: {velocity: {1: 1}}}",
        r"robot.limits.velocity\[1\]: a name must be a string",
    ),
    (
        "robot: {limits: {acceleration: [.nan]}}",
        r"limits.acceleration\[0\]: not a finite number",
    ),
    (
        "robot: {limits: {acceleration: urdf}}",
        "robot.limits.acceleration: .*found 'urdf'",
    ),
    (
        "robot: {limits: {position: [[1, -1]]}}",
        r"limits.position\[0\]: .*found \[1.0, -1.0\].*low < high",
    ),
    (
        "robot: {limits: {position: [[1]]}}",
        r"limits.position\[0\]\[1\]: the list is too short",
    ),
    (
        "robot: {limits: {position: {j: [1, 2, 3]}}}",
        "limits.position.j: too many items.*at most 2",
    ),
    (
        "robot: {limits: {scale: {torque: 0}}}",
        "robot.limits.scale.torque: out of range.*> 0",
    ),
    (
        "robot: {gravity: [0, 0, .inf]}",
        r"robot.gravity\[2\]: not a finite number; found inf",
    ),
    ("search: {slower: 150 %}", "search.slower: out of range; found 1.5.*<= 1"),
    (
        "search: {slower: 0.1, least_motion: false}",
        "search.slower: a slower motion is possible only with least_motion: true.*least_motion: true",
    ),
    (
        "refinement: {tolerance: 1.0e-06}",
        "refinement.tolerance: out of range; found 1e-06; allowed: >= 1e-05",
    ),
    (
        "robot: {friction: {viscous: -1}}",
        "robot.friction.viscous: out of range; found -1; allowed: >= 0",
    ),
    ("robot: 3", "robot: wrong type; found 3; allowed: a mapping"),
    ("start: {joints: []}", "start.joints: too few items.*at least 1"),
    (
        "start: {joints: [1, '2']}",
        r"start.joints\[1\]: wrong type; found '2' \(a string\); allowed: a number",
    ),
    ("start: {}", "start.joints: this required key is missing"),
    ("end: fre", "end: .*not defined in postures; found 'fre'.*allowed: free"),
    (
        "task_space: [x, yaw, roll]",
        r"task_space: only one row of rotation.*for example \[x, y, z, yaw\]",
    ),
    ("task_space: [axis, x, y]", "task_space: only one.*it must be the last"),
    ("task_space: [x, x]", r"task_space: a name occurs twice.*found \['x', 'x'\]"),
    (
        "task_space: [x, w]",
        r"task_space\[1\]: not one of the allowed values; found 'w'.*'yaw'",
    ),
    ("task_space: poze", r"found 'poze'.*Did you mean 'pose'\?"),
    ("search: {effort: fas}", r"found 'fas'.*Did you mean 'fast'\?"),
    ("task_space: poses", "task_space: .*found 'poses'.*pose_free_roll"),
    ("path: []", "path: there is no segment"),
    (
        "path: [{lien: {to: [1, 0]}}]",
        r"path\[0\]: a segment needs exactly one kind.*Did you mean 'line'\?",
    ),
    (
        "path: [{line: {to: [1, 0]}, arc: {}}]",
        r"path\[0\]: a segment needs exactly one kind.*keys line, arc",
    ),
    (
        "path: [{line: {to: [1], by: [1]}}]",
        r"path\[0\].line: a line needs exactly one.*\{length, angle_deg\}",
    ),
    (
        "path: [{arc: {via: [1], center: [1]}}]",
        r"path\[0\].arc: an arc needs exactly one of its forms",
    ),
    (
        "path: [{line: {length: 1}}]",
        r"path\[0\].line.angle_deg: this required key is missing",
    ),
    (
        "path: [{line: {length: -1, angle_deg: 0}}]",
        r"path\[0\].line.length: out of range; found -1",
    ),
    (
        "path: [{line: {length: 1, angle: 2, angle_deg: 2}}]",
        (
            r"path\[0\].line.angle: unknown key; found angle; allowed: length, angle_deg. Did you mean "
            r"'angle_deg'\?"
        ),
    ),
    (
        "path: [{circle: {center: [1, 0, 0], normal: [0, 0, 0]}}]",
        r"path\[0\].circle.normal: a direction cannot have zero length",
    ),
    (
        "path: [{circle: {center: [0, 0], turns: 0}}]",
        r"path\[0\].circle.turns: .*zero length",
    ),
    (
        "path: [{circle: {center: [0, 0], yaw: 'on'}}]",
        r"path\[0\].circle.yaw: .*'fixed' or 'tangent'",
    ),
    ("path: [{spline: {through: []}}]", r"path\[0\].spline.through: too few items"),
    (
        "path: [{spline: {through: [[1, 2]], relative: 1}}]",
        "spline.relative: .*true or false",
    ),
    (
        "path: [{line: {to: [1, 0]}, blend: -0.1}, {line: {to: [1, 0]}}]",
        r"path\[0\].blend: out of range; found -0.1; allowed: > 0",
    ),
    (
        "path: [{line: {to: [1, 0]}}, {line: {to: [1, 0]}, blend: 0.1}]",
        r"path\[1\].blend: the last segment.*found 0.1",
    ),
    ("redundant_joints: [a, a]", "redundant_joints: a name occurs twice"),
    (
        "redundant_joints: j3",
        r"redundant_joints: wrong form; found 'j3' \(a string\); allowed: auto, or a list of joint names",
    ),
    (
        "spline: {degree: 2}",
        "spline.degree: rest: full.*found 2.*allowed: >= 3, or rest: velocity",
    ),
    (
        "spline: {degree: 8}",
        "spline.degree: out of range; found 8; allowed: a whole number, 3 to 7",
    ),
    (
        "spline: {intervals: 20.5}",
        "spline.intervals: wrong type; found 20.5; allowed: auto, or a whole number from 4 to 10000",
    ),
    (
        "spline: {knots: free}",
        "spline.intervals: knots: free needs a number of intervals.*12, or knots: uniform",
    ),
    (
        "spline: {intervals: 3}",
        "spline.intervals: out of range; found 3; allowed: auto, or a whole number from 4",
    ),
    (
        "spline: {rest: none}",
        "spline.rest: not one of the allowed values.*'full' or 'jerk'",
    ),
    (
        "spline: {rest: jerk}",
        (
            "spline.degree: rest: jerk.*needs 3 continuous derivatives.*found 3.*allowed: >= 4, or rest: "
            "velocity or full"
        ),
    ),
    (
        "spline: {rest: jerk, degree: 4, intervals: 4}",
        "spline.intervals: rest: jerk leaves no freedom for splines of degree 4 .*found 4; allowed: >= 5, or auto",
    ),
    ("robot: {urdf: a.urdf, limits: {jerk: -1}}", "robot.limits.jerk.*found -1"),
    (
        "robot: {urdf: a.urdf, limits: {torque_rate: urdf}}",
        "robot.limits.torque_rate.*'urdf'",
    ),
    ("solver: {name: ''}", "solver.name: the string is empty"),
    (
        "refinement: {density: 9}",
        "refinement.density: out of range; found 9; allowed: >= 10",
    ),
]


@pytest.mark.parametrize("change, message", MISTAKES)
def test_the_error_names_the_key_the_value_and_the_alternatives(change, message):
    with pytest.raises(TaskError, match=message) as caught:
        load_task(minimal(**yaml.safe_load(change)))
    assert "mistakes" not in str(caught.value), "one mistake, one complaint"


def test_degree_two_is_accepted_where_only_the_velocity_vanishes():
    assert (
        load_task(minimal(spline={"degree": 2, "rest": "velocity"})).spline.degree == 2
    )


@pytest.mark.parametrize("key", ["brachis", "start", "task_space", "path"])
def test_required_keys(key):
    task = minimal()
    del task[key]
    assert f"task: {key}: this required key is missing" in str(error_of(task))


def test_an_array_of_mistakes_does_not_fill_the_screen():
    points = np.full((1000, 2), np.nan)
    with pytest.raises(TaskError) as caught:
        load_task(minimal(path=points))
    assert "through[0][0] and 1997 more: not a finite number" in str(caught.value)
    with pytest.raises(TaskError) as caught:
        load_task(minimal(path=[[f"{row}", 0.0] for row in range(1000)]))
    lines = str(caught.value).splitlines()
    assert lines[0] == "task: 1000 mistakes"
    assert len(lines) == 22
    assert lines[-1] == "  and 980 more"


def test_all_mistakes_are_in_one_message(tmp_path):
    text = COMPLETE.replace("0.9", ".nan").replace("to: [1, 2]", "to: [1, x]")
    file = written(tmp_path, text.replace("uno", "3"))
    first, *lines = str(error_of(file)).splitlines()
    assert first == f"{file}: 3 mistakes"
    keys = ["robot.limits.scale.torque", "path[0].line.to[1]", "solver.name"]
    for line, key in zip(lines, keys, strict=True):
        assert line.startswith(f"  {file}: {key}: ")


LAUGHS = "a0: &a0 [1]\n" + "".join(
    f"a{i}: &a{i} [{', '.join([f'*a{i - 1}'] * 10)}]\n" for i in range(1, 10)
)


@pytest.mark.parametrize(
    "text, expected",
    [
        ("brachis: 1\nstart: [1, 2", ["line 2, column ", "not valid YAML"]),
        (
            "brachis: 1\nstart: 1\nbrachis: 1",
            ["line 3, column 1", "'brachis' occurs twice"],
        ),
        (
            "robot: {limits: {torque: 1, torque: 2}}",
            ["line 1, column 29", "'torque' occurs twice"],
        ),
        (
            "[1, 2]",
            [
                "wrong type; found [1, 2] (a list); allowed: a mapping with keys among brachis"
            ],
        ),
        ("", ["wrong type; found null; allowed: a mapping with keys"]),
        ("a: 1\n---\nb: 2", ["not valid YAML"]),
        ("a: !!python/object:os.system {}", ["not valid YAML"]),
        ("when: 2024-13-45", ["not valid YAML"]),
        ("\x07", ["not valid YAML"]),
        ("a: &a [*a]", ["contains itself"]),
        ("a: &a {<<: *a}", ["contains itself"]),
        (
            LAUGHS,
            [
                "not valid YAML",
                "2.35e+09 values with all aliases expanded, more than the 1000000 allowed",
            ],
        ),
        ("a: " + "[" * 5000, ["not valid YAML"]),
        ('a: !!int ""', ["not valid YAML"]),
        ("a: !!bool x", ["not valid YAML"]),
        ("a: !!timestamp x", ["not valid YAML"]),
        ("a: " + "1" * 5000, ["not valid YAML"]),
        (
            "#" * 1_000_001,
            [
                "it is longer than 1 MB, the maximum size that brachis reads",
                "waypoints belong in a CSV file",
            ],
        ),
    ],
)
def test_broken_files(tmp_path, text, expected):
    file = written(tmp_path, text)
    message = str(error_of(file))
    assert message.startswith(str(file))
    for part in expected:
        assert part in message


def test_merge_keys_may_be_overridden(tmp_path):
    text = COMPLETE.replace("j1: 10, j2: null", "<<: &limits {j1: 1, j2: 2}, j2: 3")
    assert load_task(written(tmp_path, text)).robot.limits.torque == {
        "j1": 1.0,
        "j2": 3.0,
    }


def test_a_missing_file_and_a_folder(tmp_path):
    assert "nothing.yaml: the file does not exist" in str(
        error_of(tmp_path / "nothing.yaml")
    )
    assert "the file cannot be read" in str(error_of(str(tmp_path)))


def test_a_binary_file(tmp_path):
    file = tmp_path / "task.yaml"
    file.write_bytes(b"\xff\xfe\x00")
    assert "not a text file" in str(error_of(file))


def test_what_is_no_source():
    assert "found int; allowed: a file name, a mapping, or a Task" in str(error_of(3))


def test_a_file_needs_a_urdf(tmp_path):
    file = written(
        tmp_path, COMPLETE.replace("  urdf: ../robots/scara3/robot.urdf\n", "")
    )
    assert f"{file}: robot.urdf: this key is missing" in str(error_of(file))


def test_the_loader_leaves_the_mapping_as_it_is():
    given_task = minimal(robot={"urdf": "a.urdf"})
    before = copy.deepcopy(given_task)
    load_task(given_task)
    assert given_task == before


@pytest.mark.parametrize(
    "key, word",
    [("start.joints", "home"), ("search.effort", "for"), ("path_start", "home")],
)
def test_suggestions_are_no_words_of_a_sentence(key, word):
    with pytest.raises(TaskError) as caught:
        load_task(examples.scara_line, changes={key: word})
    assert "Did you mean" not in str(caught.value)


def test_found_values_are_written_as_in_a_file():
    change = {"payload": None, "events": [{"name": "x"}]}
    with pytest.raises(TaskError, match=r"found \[\{name: 'x'\}\] \(a list\)"):
        load_task(
            {
                "brachis": 1,
                "start": {"joints": [0.0]},
                "program": [{"move": {"joints": [1.0]}}, change],
            }
        )


def test_a_move_leads_to_an_array():
    (move,) = Program([{"move": np.array([0.1, 0.2])}])
    assert move.move.joints == (0.1, 0.2)
