"""Arms with a spherical wrist or shoulder: which decompositions have a closed form, and why the others have none."""

import itertools

import numpy as np
import pytest

from brachis.errors import DecompositionError
from brachis.ik import ChainGeometry, NotApplicableError, find
from brachis.ik.spherical_wrist import spherical_wrist
from brachis.robot import Robot, bind, task_map_of
from brachis.robot.task_map import Pose
from support.chains import Joint, chain_urdf
from support.factored_bench import Bench
from support.screw_arms import (
    Axis,
    extra,
    panda,
    screw_robot,
    seven_joints,
    unit,
    wrist,
)
from support.spatial import rail_arm, rail_arm_joints

X, Y, Z = np.eye(3)


RAILS = {
    "across": (0.8, -0.6, 0.0),
    "along": (0.0, 0.0, 1.0),
    "at an angle to": (0.6, 0.0, 0.8),
}


@pytest.mark.parametrize(
    "rail, exist",
    [("across", {0, 1, 2, 3}), ("along", {0, 2, 3}), ("at an angle to", {0, 1})],
    ids=str,
)
def test_which_joints_may_be_redundant_on_which_rail(rail, exist):
    robot = rail_arm(RAILS[rail])
    for redundant in range(7):
        if redundant in exist:
            Bench(robot, (redundant,)).check()
            continue
        with pytest.raises(NotApplicableError) as caught:
            Bench(robot, (redundant,), postures=1)
        reason = str(caught.value)
        if redundant == 1:  # the rail and the links all move in one plane
            assert reason.startswith("J_nr is singular everywhere: ")
            assert reason.endswith("a motion of the tool that needs j2")
        elif redundant < 4:
            assert "no two neighbours among them move in one plane" in reason
        else:
            assert "do not meet in a point: they miss a common point by 0." in reason
            assert (
                "the axes of j3, j2, j1 do not meet in a point: one of the joints is prismatic"
                in reason
            )


@pytest.mark.parametrize("turntable", [1, 2])
def test_gantry_of_three_slides_of_which_a_turntable_turns_the_last(turntable):
    axes = [Axis("P", axis, np.zeros(3)) for axis in (X, Y, Z)]
    axes.insert(turntable, Axis("R", unit(X + Y if turntable == 2 else Z), np.zeros(3)))
    bench = Bench(
        screw_robot([*axes, *wrist(np.random.default_rng(3))]), (turntable,)
    ).check()
    assert bench.solver.branches == (
        "left_noflip",
        "left_flip",
        "right_noflip",
        "right_flip",
    )


@pytest.mark.parametrize("redundant", [0, 1, 2, 4, 5, 6])
def test_spherical_shoulder_and_wrist(redundant):
    bench = Bench(seven_joints(), (redundant,)).check()
    assert len(bench.solver.branches) == 8
    # Shoulder, wrist and elbow turn in right angles: whatever has one answer has all eight.
    assert np.isfinite(bench.answers(bench.q)).all()


def test_spherical_shoulder_and_wrist_on_a_rail():
    robot, found = seven_joints(rail=Y), []
    for redundant in itertools.combinations(range(8), 2):
        try:
            Bench(robot, redundant, postures=200).check()
        except NotApplicableError:
            continue
        found.append(redundant)
    elbow = 4
    assert [pair for pair in found if 0 in pair] == [
        (0, j) for j in range(1, 8) if j != elbow
    ]
    # The rail changes the distance of the wrist from the shoulder; it has to move it across the axes that are left.
    assert [pair for pair in found if 0 not in pair] == [
        (1, 2),
        (1, 4),
        (2, 3),
        (2, 4),
        (3, 4),
        (6, 7),
    ]


def test_panda():
    robot = panda()
    for redundant in range(7):
        if redundant in {3, 6}:
            Bench(robot, (redundant,)).check()
            continue
        with pytest.raises(NotApplicableError, match="do not meet in a point"):
            Bench(robot, (redundant,), postures=1)


@pytest.mark.parametrize("redundant", [(0, 7), (1, 7), (2, 7), (3, 7)], ids=str)
def test_free_roll_is_one_more_redundant_joint(redundant):
    robot, _ = bind(rail_arm(), "pose_free_roll")
    assert len(Bench(robot, redundant).check().solver.branches) == 8


def test_free_roll_takes_the_place_of_a_wrist_joint():
    # The tool's z axis passes through the wrist's centre at an angle to the last joint's.
    joints = rail_arm_joints()[1:]
    arm = Robot.from_urdf(
        "arm",
        urdf_text=chain_urdf(
            [
                *joints,
                Joint("fixed", xyz=(0.0, 0.0, -0.1), rpy=(0.5, 0.0, 0.0), limit=None),
            ]
        ),
    )
    robot, space = bind(arm, "pose_free_roll")
    assert isinstance(space, Pose)
    for name in ("j4", "j5", "j6", "tool_roll"):
        Bench(robot, (robot.joint_names.index(name),)).check()


def test_a_slide_that_moves_the_centre_along_one_axis_of_the_wrist():
    arm = rail_arm_joints()
    telescope = Joint("prismatic", axis=(0.0, 0.0, 1.0), limit=arm[0].limit)
    robot = Robot.from_urdf(
        "telescope",
        urdf_text=chain_urdf([*arm[:5], telescope, *arm[5:]], tool=(0.1, 0.0, 0.2)),
    )
    Bench(robot, (0, 5)).check()
    askew = Joint("prismatic", axis=(1.0, 0.0, 0.0), limit=arm[0].limit)
    robot = Robot.from_urdf(
        "askew", urdf_text=chain_urdf([*arm[:5], askew, *arm[5:]], tool=(0.1, 0.0, 0.2))
    )
    with pytest.raises(NotApplicableError, match="j5, j7, j8 do not meet in a point"):
        Bench(robot, (0, 5), postures=1)


def test_refusals():
    with pytest.raises(NotApplicableError, match="this family solves only for poses"):
        spherical_wrist.build(
            ChainGeometry.of(rail_arm()),
            task_map_of(rail_arm(), ["x", "y", "z"]),
            (0, 1, 2, 3),
        )
    rng = np.random.default_rng(8)
    general = [extra(rng, "R") for _ in range(3)]
    with pytest.raises(NotApplicableError) as caught:
        Bench(screw_robot([*general, *wrist(rng)]), (), postures=1)
    assert (
        "no closed form moves the point where the axes of j4, j5, j6 meet by j1, j2, j3"
        in str(caught.value)
    )
    assert "no two neighbours among them move in one plane" in str(caught.value)
    skew = [
        Axis("P", Z, np.zeros(3)),
        Axis("R", Z, np.zeros(3)),
        Axis("R", unit(Y + Z), X),
    ]
    with pytest.raises(
        NotApplicableError,
        match="no closed form moves the point",
    ):
        Bench(screw_robot([*skew, *wrist(rng)]), (), postures=1)
    coaxial = [Axis("R", Z, np.zeros(3)), Axis("R", Z, Z), Axis("R", X, Y)]
    with pytest.raises(NotApplicableError, match=r"^J_nr is singular everywhere"):
        Bench(screw_robot([*coaxial, *wrist(rng)]), (), postures=1)


def test_a_refusal_lists_the_choices_that_have_a_closed_form():
    robot = rail_arm()
    with pytest.raises(
        DecompositionError, match="no two neighbours among them move in one plane"
    ) as caught:
        find(
            rail_arm(RAILS["at an angle to"]),
            task_map_of(robot, "pose"),
            ["j3"],
            families=[spherical_wrist],
        )
    assert ("j1",) in caught.value.available


ALONG = (0.0, 0.0, 1.0)
SMOOTH = {
    "rail": (rail_arm, 0),
    "joint 1": (rail_arm, 1),
    "joint 3, rail along": (lambda: rail_arm(ALONG), 3),
    "seven joints": (seven_joints, 2),
    "backwards": (panda, 6),
    "meeting of the last": (panda, 3),
}


@pytest.mark.parametrize("name", SMOOTH)
def test_labels_follow_the_branch_along_smooth_curves(name):
    make, redundant = SMOOTH[name]
    Bench(make(), (redundant,), postures=1).check_labels_along_curves()
