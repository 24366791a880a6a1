"""`brachis inspect` on tasks: where the tool is in every convention, pairs that are never clear, and how long it is."""

import json

import numpy as np
import pinocchio as pin
import pytest
import yaml

import brachis
from brachis.task.orientation import Attitude

HOME = [-0.4, 0.7, 0.1, -1.2, 0.3, 1.0, 0.2]
USER = {"xyz": [0.3, 0.1, 0.2], "rpy_deg": [10.0, -90.0, 40.0]}
FLOOR = {"name": "floor", "half_space": {"normal": [0, 0, 1], "offset": 0.2}}


def written(tmp_path, **keys):
    content = yaml.safe_load("""
    brachis: 1
    robot: {urdf: iiwa14}
    start: home
    task_space: pose
    path: [{line: {by: [0.0, 0.1, 0.0]}}]
    """)
    content |= {"postures": {"home": HOME}, "frames": {"user1": USER}}
    file = tmp_path / "task.yaml"
    file.write_text(yaml.safe_dump(content | keys))
    return file


def place_of(run, *arguments):
    outcome = run("inspect", *arguments, "--json")
    return outcome.data["tool"]


@pytest.mark.parametrize(
    "options, frame", [((), pin.SE3.Identity()), (("--frame", "user1"), None)]
)
def test_every_convention_says_the_same_place(run, tmp_path, options, frame):
    if frame is None:
        turn = pin.rpy.rpyToMatrix(*np.radians(USER["rpy_deg"]))
        frame = pin.SE3(turn, np.array(USER["xyz"]))
    expected = frame.actInv(brachis.robots.iiwa14.tool_placement(HOME))
    file = written(tmp_path)
    text = ", ".join(map(str, HOME))
    for posture in ("home", text):
        place = place_of(run, file, "--posture", posture, *options)
        np.testing.assert_allclose(place["position"], expected.translation, atol=1e-12)
        keys = place.keys() - {"position", "frame"}
        assert keys == Attitude.model_fields.keys()
        for key in keys:
            turn = Attitude.model_validate({key: place[key]}).rotation.as_matrix()
            np.testing.assert_allclose(turn, expected.rotation, atol=1e-12)


@pytest.mark.parametrize(
    "end", [{"joints": [0.0] * 7}, {"joints": [0.0, 1.0]}, {"joints": [9.0] * 7}]
)
def test_the_place_is_told_while_the_end_is_wrong(run, tmp_path, end):
    file = written(tmp_path, end=end)
    run(f"inspect {file}", code=2)
    outcome = run(f"inspect {file} --posture home")
    second, third = outcome.out.splitlines()[1:3]
    assert (second, third[:12]) == ("the tool in the world:", "  position: ")
    assert "the task cannot be planned: end.joints" in outcome.out.replace("\n", " ")


def test_wrong_names_of_postures_and_frames(run, error_of, tmp_path):
    file = written(tmp_path)
    for options, message in (
        ("--posture hom", "no posture named 'hom'; allowed: home"),
        ("--posture home --frame user", "no frame named 'user'; allowed: user1"),
        ("--frame user1", "--frame: this option cannot be used with no posture"),
    ):
        assert message in error_of(f"inspect {file} {options}")
    outcome = run("inspect iiwa14 --posture '0 0 0 0 0 0 0' --frame a", code=2)
    assert "--frame: this option cannot be used with a URDF" in outcome.err


def test_pairs_that_are_never_free_are_named_with_the_entry_that_lets_them_touch(
    run, tmp_path
):
    """The start posture cannot keep clear of them, and the entries are enough to plan."""
    file = written(tmp_path, scene=[FLOOR])
    run(f"inspect {written(tmp_path, scene=[FLOOR])} --json")
    outcome = run(f"inspect {file}")
    text = outcome.out.replace("\n", " ")
    assert "add [link_1 0, floor] to collisions.disable" in text
    assert "the task cannot be planned: postures.home" in text
    pairs = run(f"inspect {file} --json").data["collisions"]["never_free"]
    free = run("inspect", file, "--set", f"collisions.disable={json.dumps(pairs)}")
    assert "never clear" not in free.out
    assert "cannot be planned" not in free.out
    low = {**FLOOR, "half_space": {"normal": [0, 0, 1], "offset": -0.05}}
    assert "never clear" not in run(f"inspect {written(tmp_path, scene=[low])}").out


def test_it_fits_a_screen_and_has_the_reasons_with_verbose(run):
    short = run("inspect tx90l_rail").out
    assert len(short.splitlines()) < 40
    assert "do not meet in a point" not in short
    for joint in ("rail", *(f"joint_{number}" for number in range(1, 7))):
        rows = [row for row in short.splitlines()[1:] if joint in row]
        assert len(rows) == 2, "one in the table of joints, one in that of choices"
    long = run("--verbose inspect tx90l_rail").out
    assert "not joint_4: " in long
    assert "do not meet in a point" in long
    assert "branches with rail" in long
    many = run("inspect gen3_rails").out
    assert len(many.splitlines()) < 50
    assert "and 72 more" in many


def test_what_is_left_out_of_an_mjcf_file_is_said_once(run, tmp_path):
    pytest.importorskip("mujoco")
    file = tmp_path / "arm.xml"
    file.write_text(
        """<mujoco><worldbody><body name="b"><joint name="k" axis="1 0 0" range="-90 90"/>
        <geom size="0.1" pos="0 0 1"/></body></worldbody></mujoco>"""
    )
    for _ in range(2):
        assert (
            run(f"inspect {file}").err.count("no counterpart: collision shapes (1)")
            == 1
        )
