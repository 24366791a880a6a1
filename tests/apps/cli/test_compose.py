"""``brachis compose``: what it writes and what it refuses."""

import re
import shlex
from math import radians

import pytest

from brachis import Robot
from brachis.apps.cli.app import split_vectors
from brachis.apps.compose import Rail, on_rail

from .conftest import ROOT, SCARA

FIGURES = ("--range", "-2", "2", "--velocity", "2", "--force", "1500", "--mass", "80")
READMES = [
    ROOT / "robots" / name / "README.md"
    for name in ("tx90l_rail", "ur10_rail", "iiwa14")
]


def test_writes_what_the_library_makes(run, tmp_path):
    out = tmp_path / "on_rail.urdf"
    outcome = run(
        f"compose {SCARA} --range -2 2 --velocity 2 --force 1500 --mass 80 --axis 0 0 1 "
        "--mount-xyz 0.1 -0.2 0.3 --mount-rpy-deg 180 0 -90 --name lift --root floor "
        f"--out {out}"
    )
    assert (outcome.out, outcome.err) == (f"wrote {out}\n", "")
    rail = Rail(
        axis=(0, 0, 1),
        range=(-2, 2),
        velocity=2,
        force=1500,
        mass=80,
        mount_xyz=(0.1, -0.2, 0.3),
        mount_rpy=(radians(180), 0, radians(-90)),
        name="lift",
        root="floor",
    )
    assert out.read_text() == on_rail(SCARA, rail)
    assert Robot.from_urdf(out).joint_names == ("lift", "j1", "j2", "j3")


@pytest.mark.parametrize(
    "words",
    [
        ("--axis", "0", "3", "-4", "--range", "-2", "2"),
        ("--axis", "0,3,-4", "--range", "-2,2"),
        ("--axis=0,3,-4", "--range=-2,2"),
        ("--axis", "0, 3, -4", "--range", "-2 2"),
        ("--axis", "0,3,-4", "--range", "-2", "2"),
    ],
    ids=" ".join,
)
def test_vectors_are_read_in_every_usual_form(run, tmp_path, words):
    out = tmp_path / "on_rail.urdf"
    run("compose", SCARA, *words, *FIGURES[3:], "--out", out)
    assert '<axis xyz="0 0.6 -0.8"/>' in out.read_text()
    assert '<limit lower="-2" upper="2" velocity="2" effort="1500"/>' in out.read_text()


def test_only_vectors_are_split():
    words = ["arm,1.urdf", "--out", "a,b c.urdf", "--axis", "0,1,0", "--name=x,y"]
    assert split_vectors(words, {"--axis"}) == [*words[:4], "0", "1", "0", words[-1]]


def test_json(run, tmp_path):
    out = tmp_path / "on_rail.urdf"
    outcome = run("compose", SCARA, *FIGURES, "--out", out, "--json")
    expected = {"urdf": str(out), "arm": str(SCARA), "joint": "rail", "root": "world"}
    assert outcome.data == expected


@pytest.mark.parametrize(
    "missing", ["--range", "--velocity", "--force", "--mass", "--out"]
)
def test_every_figure_of_a_rail_is_required_by_the_command(run, tmp_path, missing):
    words = [*FIGURES, "--out", str(tmp_path / "on_rail.urdf")]
    place = words.index(missing)
    del words[place : place + (3 if missing == "--range" else 2)]
    outcome = run("compose", SCARA, *words, code=2)
    assert "missing option" in outcome.err
    assert missing in outcome.err
    assert not list(tmp_path.iterdir())


@pytest.mark.parametrize(
    "options, message",
    [
        ("--mass -1", "mass: this value is not valid; found -1.0"),
        ("--mount-rpy-deg nan 0 0", "mount_rpy: this value is not valid"),
        ("--axis 0,1", "'--axis'"),
        ("--axis up", "'--axis'"),
    ],
)
def test_wrong_figure(run, tmp_path, options, message):
    out = ("--out", tmp_path / "on_rail.urdf")
    outcome = run("compose", SCARA, *FIGURES, *out, *options.split(), code=2)
    assert outcome.out == ""
    assert message in outcome.err
    assert "Traceback" not in outcome.err
    assert not list(tmp_path.iterdir())


@pytest.mark.parametrize("readme", READMES, ids=lambda path: path.parent.name)
def test_command_of_the_readme(run, readme, tmp_path, monkeypatch):
    (line,) = re.findall(r"^brachis compose .*", readme.read_text(), flags=re.MULTILINE)
    (tmp_path / "robots").symlink_to(ROOT / "robots")
    (tmp_path / "ur10_robot.urdf").symlink_to(
        ROOT / "robots/tx90l_rail/arm.urdf"
    )  # stands for the UR10
    monkeypatch.chdir(tmp_path)
    words = shlex.split(line)
    run(*words[1:])
    assert Robot.from_urdf(tmp_path / words[-1]).joint_names[:2] == ("rail", "joint_1")
