"""`brachis inspect` on every robot of this repository and on five of example-robot-data: it explains, never crashes."""

import json
import sys

import pytest

from brachis import ik
from brachis.ik import registry
from support.published import published_urdf

from .conftest import ROOT

WITHOUT_CLOSED_FORM = {"gen3": 7, "arm8": 28, "gen3_rails": 84}
OWN = sorted((ROOT / "robots").glob("*/*.urdf"))
PUBLISHED = {
    "UR5": "ur_description/urdf/ur5_robot.urdf",
    "UR10": "ur_description/urdf/ur10_robot.urdf",
    "Panda": "panda_description/urdf/panda.urdf",
    "xArm7": "xarm_description/urdf/xarm7.urdf",
    "Baxter": "baxter_description/urdf/baxter.urdf",
    "Kinova": "kinova_description/robots/kinova.urdf",
}


def published_robot(name):
    return published_urdf(PUBLISHED[name])


def inspect_robot(run, urdf, *options):
    """Solver of every choice of redundant joints, and remarks, after a check of the rest."""
    outcome = run("inspect", urdf, *options, "--json")
    data = outcome.data
    assert len(data["joints"]) >= 2
    for row in data["decompositions"]:
        assert (row["solver"] == "-") == bool(row["why not"]), row
        assert (row["solver"] == "-") == (row["branches"] == 0)
    return (
        {row["redundant joints"]: row["solver"] for row in data["decompositions"]},
        data["remarks"],
    )


def decompositions(run, urdf, *options):
    return inspect_robot(run, urdf, *options)[0]


@pytest.mark.parametrize(
    "urdf", OWN, ids=lambda path: f"{path.parent.name}/{path.name}"
)
def test_every_robot_of_the_repository(run, urdf):
    choices = WITHOUT_CLOSED_FORM.get(urdf.parent.name)
    solvers, remarks = inspect_robot(run, urdf)
    text = run(f"inspect {urdf}")
    assert (set(solvers.values()) == {"-"}) == (choices is not None)
    is_said = [ik.NO_CLOSED_FORM in words for words in (remarks, text.out)]
    assert is_said == [choices is not None] * 2
    if choices is not None:
        assert len(solvers) == choices


def test_no_closed_form_is_missed_where_there_is_nothing_to_choose(run):
    outcome = run(f"inspect {ROOT / 'robots/scara3/robot.urdf'} --task-space pose")
    assert "fewer joints than the task space has rows" in outcome.out
    assert ik.NO_CLOSED_FORM not in outcome.out


@pytest.mark.parametrize(
    "robot, joints",
    [
        ("tx90l_rail", ["rail", "joint_1", "joint_2", "joint_3"]),
        (
            "ur10_rail",
            ["rail", "shoulder_pan_joint", "wrist_2_joint", "wrist_3_joint"],
        ),
        ("Panda", [f"panda_joint{i}" for i in (4, 5, 6, 7)]),
        ("UR5", ["none"]),
        ("UR10", ["none"]),
        ("xArm7", None),
        ("Kinova", None),
    ],
)
def test_redundant_joints_with_a_closed_form(run, robot, joints):
    pytest.importorskip("eaik.pybindings.EAIK")  # which comes along where it has wheels
    known = ROOT / "robots" / robot / "robot.urdf"
    solvers = decompositions(run, known if known.exists() else published_robot(robot))
    closed = [joint for joint, solver in solvers.items() if solver != "-"]
    assert closed == (closed if joints is None else joints)


def test_iiwa_has_none_for_its_elbow(run):
    solvers = decompositions(run, "iiwa14")
    assert [joint for joint, solver in solvers.items() if solver == "-"] == ["joint_4"]
    data = run("inspect iiwa14 --json").data
    assert "J_nr is singular everywhere" in data["decompositions"][3]["why not"]


def test_without_eaik_it_is_said_what_is_missing(run, monkeypatch):
    monkeypatch.setitem(sys.modules, "eaik.pybindings.EAIK", None)
    monkeypatch.setattr(registry, "_KNOWN", {})
    panda = published_robot("Panda")
    solvers, (*_, remark) = inspect_robot(run, panda)
    closed = [joint for joint, solver in solvers.items() if solver != "-"]
    assert closed == ["panda_joint4", "panda_joint7"]
    assert remark.startswith("EAIK is not installed (pip install EAIK); it might add")
    assert "[panda_joint5], [panda_joint6]; installing it needs a C++ comp" in remark
    assert remark in run(f"inspect {panda}").out.replace("\n", " ")


def test_inspect_names_its_choice_of_a_tool_frame(run):
    panda = published_robot("Panda")
    _, (tool, space) = inspect_robot(run, panda)
    words = "tool frame: panda_hand, the last link before the chains to panda_leftf"
    assert tool.startswith(words)
    assert space.startswith("task space: pose")
    assert inspect_robot(run, panda, "--tool-frame", "panda_link8")[1] == [space]


def test_inspect_shows_the_first_of_several_arms(run):
    baxter = published_robot("Baxter")
    data = run(f"inspect {baxter} --json").data
    names = [joint["joint"] for joint in data["joints"]]
    assert names == [
        f"left_{joint}" for joint in ("s0", "s1", "e0", "e1", "w0", "w1", "w2")
    ]
    assert data["remarks"][0].endswith(
        "from which several limbs branch off; --base-frame chooses a different one"
    )
    assert "--tool-frame chooses a different one" in data["remarks"][1]
    solvers = decompositions(run, baxter, "--tool-frame", "left_gripper")
    assert set(solvers.values()) == {"-"}  # offsets at the shoulder and the wrist


def test_free_roll(run):
    arm = ROOT / "robots/tx90l_rail/arm.urdf"
    solvers = decompositions(run, arm, "--task-space", "pose_free_roll")
    assert solvers["tool_roll"] != "-"


def test_where_the_tool_is(run, error_of):
    urdf = ROOT / "robots/tx90l_rail/robot.urdf"
    out = run(f"inspect {urdf} --posture '0, 0, 0, 0, 0, 0, 0' --json").out
    place = json.loads(out)["tool"]
    assert place["position"] == pytest.approx([0.05, 0.05, 1.628])
    assert place["quaternion_wxyz"] == [1, 0, 0, 0]
    assert place["fanuc_wpr_deg"] == [0, 0, 0]
    iiwa = run("inspect iiwa14 --posture '0 0.3 0 0 0 0 0'").out
    assert "position: [0.279562116, 0, 1.26374832]" in iiwa, "no rounding error"
    degrees = run("inspect scara3 --posture '90 0.1 0.1'").out
    assert "90 degrees are 1.5708 rad" in degrees
    assert "!degrees" not in degrees, "this is for task files alone"
    run(f"inspect {urdf} --posture '0 0'", code=2)
    assert "--posture" in error_of(f"inspect {urdf} --posture a")


def test_rails_leave_the_arm_s_tool_frame_alone(run, tmp_path):
    """Frames half way up the arm, which a rail moves as well, are no tools."""
    out = tmp_path / "ur5.urdf"
    options = "--axis 0 1 0 --range -2 2 --velocity 2 --force 2000 --mass 60"
    run(f"compose {published_robot('UR5')} {options} --out {out}")
    assert decompositions(run, out)["rail"] == "parallel_axes"
