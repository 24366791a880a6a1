"""Every format is read back by a reader of its own, and equals the motion."""

import json
import re
import shutil
import subprocess
from dataclasses import replace

import jsonschema
import numpy as np
import pyarrow.parquet
import pytest
import yaml
from mcap.reader import make_reader
from numpy.testing import assert_allclose, assert_array_equal
from PIL import Image
from rosbags.rosbag2.storage_mcap import McapReader
from rosbags.typesys import Stores, get_types_from_msg, get_typestore

import brachis
from brachis import export
from brachis.apps.export.animation import frames
from brachis.errors import BrachisWarning, InputError, UnknownNameError
from support.motions import motion_between

DT = 0.02
NAMES = ("j1", "j2", "j3")
MESSAGE = "trajectory_msgs/msg/JointTrajectory"
STORE = get_typestore(Stores.ROS2_JAZZY)


@pytest.fixture(scope="module")
def written(line_trajectory, tmp_path_factory):
    """Write a format and return the file."""
    folder = tmp_path_factory.mktemp("formats")

    def write(suffix, **parameters):
        path = folder / f"motion{suffix}"
        export.write(line_trajectory, path, **parameters)
        return path

    return write


def equals_the_motion(trajectory, t, q, qdot, qddot):
    motion = trajectory.sample(DT)
    expected = (motion.t, motion.q, motion.qdot, motion.qddot)
    for values, known in zip((t, q, qdot, qddot), expected, strict=True):
        assert_allclose(values, known, rtol=0.0, atol=1e-9)
    assert len(t) > 100


def test_parquet(line_trajectory, written):
    table = pyarrow.parquet.read_table(written(".parquet", dt=DT))
    samples = (
        np.column_stack([table[f"{kind}_{name}"] for name in NAMES])
        for kind in ("q", "qd", "qdd")
    )
    equals_the_motion(line_trajectory, table["t"], *samples)
    about = json.loads(table.schema.metadata[b"brachis"])
    assert about == {
        "joints": dict.fromkeys(NAMES, "rad"),
        "t_end_s": line_trajectory.t_end,
        "left_out": [],
    }


def test_json_names_its_schema_and_fulfils_it(line_trajectory, written):
    content = json.loads(written(".json", dt=DT).read_text())
    schema = export.samples_schema()
    assert content["$schema"] == schema["$id"]
    jsonschema.Draft202012Validator.check_schema(schema)
    jsonschema.validate(content, schema)
    samples = content["samples"]
    curves = (samples[name] for name in ("t", "q", "qdot", "qddot"))
    equals_the_motion(line_trajectory, *curves)
    assert content["joint_names"] == list(NAMES)
    del samples["q"]
    with pytest.raises(jsonschema.ValidationError, match="'q' is a required property"):
        jsonschema.validate(content, schema)


def ros_duration(duration):
    return duration.sec + 1e-9 * duration.nanosec


def equals_the_message(trajectory, message):
    assert message.joint_names == list(NAMES)
    points = message.points
    t = [ros_duration(point.time_from_start) for point in points]
    parts = (
        [getattr(point, name) for point in points]
        for name in ("positions", "velocities", "accelerations")
    )
    equals_the_motion(trajectory, t, *parts)


def test_mcap_bag_with_the_definitions_of_ros(line_trajectory, written):
    reader = McapReader(written(".mcap", dt=DT))
    reader.open()
    ((connection, stamp, data),) = reader.messages(reader.connections, 0, 1)
    (schema,) = reader.schemas.values()
    reader.close()
    assert (connection.topic, connection.msgtype, stamp) == (export.TOPIC, MESSAGE, 0)
    equals_the_message(line_trajectory, STORE.deserialize_cdr(data, MESSAGE))
    types = get_types_from_msg(schema.data, schema.name)
    assert MESSAGE in types
    for name, definition in types.items():
        assert definition[1] == STORE.fielddefs[name][1], name


def as_message(value, name):
    """A message of ROS 2 out of plain data."""
    kind = STORE.types[name]
    fields = {}
    for key, (form, detail) in STORE.fielddefs[name][1]:
        field = value[key]
        if form.name == "NAME":
            field = as_message(field, detail)
        elif form.name == "SEQUENCE" and detail[0][0].name == "NAME":
            field = [as_message(item, detail[0][1]) for item in field]
        elif form.name == "SEQUENCE" and detail[0][1][0] == "float64":
            field = np.array(field, dtype=np.float64)
        fields[key] = field
    assert set(value) == set(fields)
    return kind(**fields)


def test_ros2_yaml(line_trajectory, written):
    content = yaml.safe_load(written(".yaml", dt=DT).read_text())
    data = STORE.serialize_cdr(as_message(content, MESSAGE), MESSAGE)
    equals_the_message(line_trajectory, STORE.deserialize_cdr(data, MESSAGE))


@pytest.fixture(scope="module")
def ur10(line_trajectory):
    """A motion of an arm of six joints on a rail."""
    q = np.array([np.zeros(7), np.linspace(0.6, 0.7, 7)])
    return motion_between(line_trajectory, brachis.robots.ur10_rail, q, branch="")


def test_urscript(ur10, tmp_path):
    path, joints = tmp_path / "motion.script", ur10.joint_names[1:]
    told = r"six joints; found rail \(m\), .*List only the six joints of the arm"
    with pytest.raises(InputError, match=told):
        export.write(ur10, path)
    with pytest.warns(BrachisWarning, match="rail"):
        export.write(ur10, path, joints=joints, dt=0.01)
    text = path.read_text()
    calls = re.findall(r"servoj\((\[.*?\]), 0, 0, ([0-9.e-]+),", text)
    postures = [json.loads(posture) for posture, _ in calls]
    times = [float(time) for _, time in calls]
    assert times == [0.01] * 110
    t = np.minimum(np.cumsum(times), ur10.t_end)
    assert_allclose(postures, ur10.position(t)[:, 1:], atol=1e-9)
    (start,) = re.findall(r"start = (\[.*\])", text)
    assert_array_equal(json.loads(start), ur10.q[0, 1:])
    assert len(re.findall(r"^ *end\b", text, re.MULTILINE)) == 3, "of def, while and if"


SENTENCE = "joint rail moves by 0.6 m (0 to 0.6 m) and is not in this file"


def remark_in(path):
    """What a file says of joints that are left out."""
    match path.suffix:
        case ".json":
            content = json.loads(path.read_text())
            jsonschema.validate(content, export.samples_schema())
            return content["warnings"]
        case ".parquet":
            metadata = pyarrow.parquet.read_table(path).schema.metadata
            return json.loads(metadata[b"brachis"])["left_out"]
        case ".mcap":
            with path.open("rb") as stream:
                (record,) = make_reader(stream).iter_metadata()
            assert record.name == "brachis"
            return [record.metadata["left_out"]]
        case _:
            lines = (line.split("# ") for line in path.read_text().splitlines())
            return [
                line[1].removeprefix("brachis: ")
                for line in lines
                if SENTENCE in line[-1]
            ]


@pytest.mark.parametrize(
    "suffix", [".csv", ".json", ".yaml", ".script", ".parquet", ".mcap"]
)
def test_a_rail_that_moves_and_is_left_out_is_warned_of_and_named_in_the_file(
    ur10, tmp_path, suffix
):
    path = tmp_path / f"motion{suffix}"
    with pytest.warns(BrachisWarning) as caught:
        export.write(ur10, path, joints=ur10.joint_names[1:], dt=0.1)
    (warning,) = caught
    hint = "Move the missing joints with their own controller"
    assert str(warning.message).startswith(f"{SENTENCE}. {hint}")
    assert remark_in(path) == [SENTENCE]


def test_a_joint_that_stands_still_may_be_left_out_without_a_word(ur10, tmp_path):
    still = replace(ur10, q=np.where(np.arange(7) == 0, 0.3, ur10.q))
    export.write(still, tmp_path / "motion.csv", joints=still.joint_names[1:], dt=0.1)
    assert (tmp_path / "motion.csv").read_text().startswith("t,q_shoulder_pan_joint")


def test_gif(line_trajectory, written):
    path = written(".gif", dt=1.2)
    times = line_trajectory.sample(1.2).t
    assert times[-1] == line_trajectory.t_end
    durations, pictures = [], []
    with Image.open(path) as film:
        for k in range(film.n_frames):
            film.seek(k)
            durations.append(film.info["duration"])
            pictures.append(np.asarray(film.convert("RGB"), dtype=int))
    assert durations == [1200, 1200, 1200, 1000]
    tool, _ = line_trajectory.robot.tool_placements(line_trajectory.position(times))
    figures = (figure for figure, _ in frames(line_trajectory, times))
    for figure, t, place, picture in zip(figures, times, tool, pictures, strict=True):
        ax, torques = figure.axes
        x, y = ax.transData.transform(place[:2])
        black = picture[picture.shape[0] - round(y), round(x)]
        assert black.max() < 80, "the tool"
        assert "tau" in torques.get_ylabel()
        (now,) = (line for line in torques.lines if line.get_gid() == "now")
        assert list(now.get_xdata()) == [t, t]


def test_an_animation_may_be_slower(line_trajectory, tmp_path):
    path = tmp_path / "slow.gif"
    export.write(line_trajectory, path, dt=1.2, slower=3.0)
    with Image.open(path) as film:
        assert film.n_frames == len(line_trajectory.sample(0.4).t)
    (figure, _), *_ = frames(line_trajectory, np.zeros(1), 3.0)
    assert figure._suptitle.get_text().endswith("3 times slower")


@pytest.mark.skipif(shutil.which("ffprobe") is None, reason="ffmpeg is not installed")
def test_mp4(line_trajectory, written):
    path = written(".mp4", dt=0.5)
    options = "-v error -count_frames -select_streams v -of json -show_entries"
    entries = "stream=nb_read_frames,r_frame_rate"
    command = [shutil.which("ffprobe"), *options.split(), entries, path]
    (stream,) = json.loads(subprocess.check_output(command))["streams"]
    assert stream["nb_read_frames"] == str(len(line_trajectory.sample(0.5).t))
    assert stream["r_frame_rate"] == "2/1"


def test_without_ffmpeg_a_film_is_an_error(line_trajectory, tmp_path, monkeypatch):
    monkeypatch.setenv("PATH", str(tmp_path))
    told = r"needs ffmpeg, which is not installed\. Install ffmpeg, or write a GIF"
    with pytest.raises(InputError, match=told):
        export.write(line_trajectory, tmp_path / "motion.mp4", dt=0.5)


def test_the_error_says_what_ffmpeg_says(line_trajectory, tmp_path, monkeypatch):
    folder = tmp_path / "bin"
    folder.mkdir()
    program = folder / "ffmpeg"
    program.write_text("#!/bin/sh\necho no encoder >&2\nexit 1\n")
    program.chmod(0o755)
    monkeypatch.setenv("PATH", f"{folder}:/usr/bin:/bin")
    with pytest.raises(
        InputError, match="ffmpeg failed to write the film; found no enco"
    ):
        export.write(line_trajectory, tmp_path / "motion.mp4", dt=0.5)
    assert list(tmp_path.iterdir()) == [folder]


def test_without_its_library_a_format_is_an_error(
    line_trajectory, tmp_path, monkeypatch
):
    for module, suffix in (("pyarrow", ".parquet"), ("mcap_ros2.writer", ".mcap")):
        monkeypatch.setitem(__import__("sys").modules, module, None)
        with pytest.raises(InputError, match=r'pip install "\.\[export\]"'):
            export.write(line_trajectory, tmp_path / f"motion{suffix}")
    assert list(tmp_path.iterdir()) == []


def test_some_joints_in_an_order_of_ones_own(line_trajectory, tmp_path):
    with pytest.warns(BrachisWarning, match="joint j2 moves by"):
        export.write(
            line_trajectory, tmp_path / "motion.csv", joints=["j3", "j1"], dt=0.5
        )
    _, header, first, *_ = (tmp_path / "motion.csv").read_text().splitlines()
    assert header == "t,q_j3,q_j1,qd_j3,qd_j1,qdd_j3,qdd_j1,tau_j3,tau_j1"
    q = [float(cell) for cell in first.split(",")[1:3]]
    assert q == line_trajectory.q[0, [2, 0]].tolist()
    with pytest.raises(UnknownNameError, match="there is no joint named 'j4'"):
        export.write(line_trajectory, tmp_path / "motion.csv", joints=["j4"])


@pytest.mark.parametrize(
    "name, parameters, told",
    [
        (
            "motion.txt",
            {},
            r"the suffix of the file is not that of a known format; found suffix .txt; allowed: .csv, .parquet, .json",
        ),
        ("motion", {"form": "parkuet"}, "Did you mean 'parquet'"),
        (
            "motion.gif",
            {"dt": 0.005},
            r"an animation cannot have this period; found 0.005 s; allowed: a multiple of 0.01 s",
        ),
        (
            "motion.gif",
            {"joints": ["j1"]},
            "an animation cannot leave out joints; found j1",
        ),
        (
            "motion.csv",
            {"slower": 2.0},
            r"only animations can be slowed down; found 2.0; allowed: 1, or .gif, .mp4",
        ),
        (
            "motion.gif",
            {"slower": 0.0},
            "slower: out of range; found 0.0; allowed: > 0",
        ),
        (
            "motion.gif",
            {"slower": 1e9},
            r"slower: the animation would have too many pictures; .*Lower slower",
        ),
        ("motion.csv", {"joints": ["j1", "j2", "j1"]}, "'j1' is given twice"),
        ("motion.json", {"last": "held"}, "Did you mean 'hold'"),
    ],
)
def test_what_cannot_be_written(line_trajectory, tmp_path, name, parameters, told):
    with pytest.raises(InputError, match=told):
        export.write(line_trajectory, tmp_path / name, **parameters)
    assert list(tmp_path.iterdir()) == []


def test_every_format_has_a_suffix_of_its_own():
    assert len({form.suffix for form in export.FORMATS.values()}) == len(export.FORMATS)
