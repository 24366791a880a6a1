"""Three joints that place the tool: every recipe, built arms with all their choices of redundant joints, and plans."""

import itertools
from pathlib import Path

import numpy as np
import pytest

import brachis
from brachis.ik import ChainGeometry, NotApplicableError
from brachis.ik.point_recipes import RECIPES, positioning
from brachis.robot import Robot, task_map_of
from brachis.robot.task_map import RowsAndAngle
from support.chains import Joint, chain_urdf
from support.effort import QUICK
from support.factored_bench import Bench
from support.pose_arms import panda as panda_urdf
from support.screw_arms import (
    BASES,
    SLIDE,
    extra,
    panda,
    screw_robot,
    seven_joints,
)
from support.spatial import rail_arm, rail_arm_joints

ROBOTS = Path(__file__).parents[2] / "robots"


def bench(robot, redundant, postures=300, rows="position"):
    return Bench(robot, redundant, postures, family=positioning, rows=rows)


def built(name):
    return Robot.from_urdf(ROBOTS / name / "robot.urdf")


def three_joints():
    """An industrial arm without its wrist."""
    return Robot.from_urdf(
        "arm", urdf_text=chain_urdf(rail_arm_joints()[1:4], tool=(0.3, 0.1, 0.4))
    )


def scara(tool=(0.1, 0.05, 0.0)):
    """Three parallel axes and a quill."""
    joints = [
        Joint("revolute", xyz=xyz)
        for xyz in ((0.0, 0.0, 0.5), (0.4, 0.0, 0.1), (0.3, 0.0, 0.0))
    ]
    return Robot.from_urdf(
        "scara",
        urdf_text=chain_urdf(
            [*joints, Joint("prismatic", axis=(0.0, 0.0, -1.0), limit=SLIDE)], tool=tool
        ),
    )


@pytest.mark.parametrize("name", BASES)
@pytest.mark.parametrize("arrangement", ["alone", "carried", "carried backwards"])
def test_every_recipe(name, arrangement):
    rng = np.random.default_rng(len(name))
    axes, redundant = [*BASES[name]], ()
    if "backwards" in arrangement:
        axes.reverse()
    if "carried" in arrangement:  # redundant joints before and behind the three
        axes, redundant = (
            [extra(rng, "R"), *axes, extra(rng, "P"), extra(rng, "R")],
            (0, 4, 5),
        )
    checked = bench(screw_robot(axes), redundant).check()
    assert len(set(checked.solver.branches)) == len(checked.solver.branches)


def test_the_cases_use_every_recipe():
    used = {
        RECIPES.index(bench(screw_robot(base), (), 1).solver.recipe)
        for base in BASES.values()
    }
    assert used == set(range(len(RECIPES)))
    backwards = bench(screw_robot(BASES["cylinder"][::-1]), (), 1).solver
    assert backwards._joints.mirrored


ARMS = {
    "three joints": (three_joints, 1),
    "scara": (scara, 3),
    "tx90l_rail": (lambda: built("tx90l_rail"), 14),
    "ur10_rail": (lambda: built("ur10_rail"), 16),
    "iiwa14": (lambda: built("iiwa14"), 16),
    "panda": (panda_urdf, 13),
    "panda, tool off the last axis": (panda, 17),
    "seven joints, tool off the last axis": (seven_joints, 28),
}


@pytest.mark.parametrize("name", ARMS)
def test_built_arms_with_all_choices_of_redundant_joints(name):
    make, expected = ARMS[name]
    robot = make()
    space, served = task_map_of(robot, "position"), 0
    q = np.random.default_rng(2).uniform(-np.pi, np.pi, (200, robot.n))
    jacobian = space.jacobian(space.twists(q))
    for redundant in itertools.combinations(range(robot.n), robot.n - 3):
        rest = [i for i in range(robot.n) if i not in redundant]
        singular = np.abs(np.linalg.det(jacobian[:, :, rest])).max() < 1e-9
        try:
            bench(robot, redundant, 200).check(with_gradient=False)
        except NotApplicableError as reason:
            named = all(robot.joint_names[i] in str(reason) for i in rest)
            says_so = str(reason).startswith("J_nr is singular everywhere")
            assert says_so if singular else named
        else:
            assert not singular
            served += 1
    assert served == expected


@pytest.mark.parametrize("rows", [*itertools.permutations("xyz")], ids="".join)
def test_rows_in_any_order(rows):
    bench(built("tx90l_rail"), (0, 4, 5, 6), 300, rows).check()
    bench(screw_robot(BASES["cylinder"][::-1]), (), 300, rows).check()


def test_labels_say_where_the_arm_is():
    checked = bench(rail_arm(), (0, 4, 5, 6), 1)
    bend_forwards = np.array([[0.2, 0.3, 0.4, 1.2, 0.5, 0.8, -0.3]])
    labels = checked.solver.branches
    assert (
        labels[np.argmax((checked.margins(bend_forwards) > 0.0).all(axis=2))]
        == "front_up"
    )
    other = bend_forwards * np.array([1.0, 1.0, -4.0, -1.0, 1.0, 1.0, 1.0])
    assert labels[np.argmax((checked.margins(other) > 0.0).all(axis=2))] == "back_down"
    # The rail moves the tool across the plane of the links to one side or, turned round, to the other.
    assert bench(rail_arm(), (1, 4, 5, 6), 1).solver.branches == (
        "left_up",
        "left_down",
        "right_up",
        "right_down",
    )
    # A quill has one answer, and so have three slides.
    assert bench(scara(), (0,), 1).solver.branches == ("front", "back")
    assert bench(screw_robot(BASES["P|PP"]), (), 1).solver.branches == ("slides",)


def test_refusals():
    robot = built("tx90l_rail")
    geometry, position = ChainGeometry.of(robot), task_map_of(robot, "position")
    for space in (
        task_map_of(robot, "pose"),
        task_map_of(robot, ["x", "y"]),
        RowsAndAngle(robot, ("x", "y", "yaw"), 0),
    ):
        with pytest.raises(
            NotApplicableError,
            match="this family solves only for the position: x, y and z",
        ):
            positioning.build(geometry, space, (0, 4, 5, 6))
    with pytest.raises(NotApplicableError, match="4 joints left to solve for, not 3"):
        positioning.build(geometry, position, (0, 4, 5))
    with pytest.raises(NotApplicableError) as caught:
        positioning.build(geometry, position, (0, 1, 2, 3))
    assert str(caught.value) == (
        "J_nr is singular everywhere: there is always a motion of the tool that needs rail, joint_1, joint_2, joint_3"
    )


PLANS = {
    "tx90l_rail": (
        (0.0, 0.3, 0.2, 1.5, 0.2, 1.2, 0.1),
        ("rail", "joint_4", "joint_5", "joint_6"),
        "front_up",
    ),
    "iiwa14": (
        (0.3, 0.6, 0.2, -1.4, 0.3, 0.9, 0.1),
        ("joint_3", "joint_5", "joint_6", "joint_7"),
        "back_down",
    ),
}


@pytest.mark.parametrize("name", PLANS)
def test_four_redundant_joints_are_faster_than_one(name):
    start, redundant, branch = PLANS[name]
    urdf, by = ROBOTS / name / "robot.urdf", [0.0, 0.2, -0.1]
    task = {
        "brachis": 1,
        "start": {"joints": start},
        "path": [{"line": {"by": by}}],
        "spline": {"intervals": 8},
        "solver": {"max_iterations": 600},
        "search": QUICK,
    }
    result = brachis.plan(
        urdf, {**task, "task_space": "position", "redundant_joints": redundant}
    )
    assert (result.family, result.trajectory.branch) == ("positioning", branch)
    assert result.verified
    ends = result.trajectory.robot.tool_placements(result.trajectory.q[[0, -1]])[0]
    np.testing.assert_allclose(ends[1] - ends[0], by, atol=1e-8)
    # The motion that keeps the orientation as well is one of those that keep the position.
    pose = brachis.plan(
        urdf, {**task, "task_space": "pose", "redundant_joints": redundant[:1]}
    )
    assert pose.verified
    assert result.t_end < 0.97 * pose.t_end
