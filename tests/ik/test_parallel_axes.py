"""Three parallel axes: UR arms alone and on rails, from both ends, with every joint redundant that allows it."""

import itertools

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from brachis.errors import DecompositionError
from brachis.ik import ChainGeometry, NotApplicableError, find
from brachis.ik.parallel_axes import parallel_axes
from brachis.robot import task_map_of
from support.arms import (
    MOUNT,
    SKEW,
    TOOL,
    UR10_D,
    Arm,
    X,
    Y,
    Z,
    example_robot,
    generic,
    on_random_rail,
    placement,
    rolling,
    tx90l,
    ur10,
)
from support.factored_bench import Bench

WRIST = ("noflip", "flip")
ELBOW = ("up", "down")
SHOULDER = ("front", "back")
RAIL = ("left", "right")
SIX = (SHOULDER, ELBOW, WRIST)
TURNED = (ELBOW, WRIST, RAIL)
SLID = (ELBOW, WRIST)


def through_wrist():
    """A tool whose z axis goes through the point where the last two axes of the UR10 meet."""
    turn = Rotation.from_rotvec((0.5, 0.2, 0.0))
    return placement((0.0, 0.0, -UR10_D[5]), turn) @ placement((0.0, 0.0, 0.3))


UR = ur10().with_tool(TOOL)
ON_RAIL = UR.with_slide(0, Y)
ON_SKEW = UR.with_slide(0, SKEW)
CARRIED = UR.with_slide(1, SKEW)
JOINTS = {"slide": SIX, "pan": TURNED, "wrist 2": TURNED, "wrist 3": TURNED}


def on_rails(name, robot, places):
    """A redundant joint each, by the places of the slide, the pan joint and the last two."""
    return {
        f"{name}, {joint}": (robot, (place,), words)
        for place, (joint, words) in zip(places, JOINTS.items(), strict=True)
    }


CASES = {
    "UR10": (UR.robot(), (), SIX),
    "UR10 from its tool": (UR.mirrored.robot(MOUNT), (), SIX),
    **on_rails("rail", ON_RAIL.robot(), (0, 1, 5, 6)),
    **on_rails("skew rail", ON_SKEW.robot(MOUNT), (0, 1, 5, 6)),
    **on_rails("rail at the tool", ON_SKEW.mirrored.robot(MOUNT), (6, 5, 1, 0)),
    "slide after pan": (CARRIED.robot(MOUNT), (1,), SIX),
    "slide after pan, pan": (CARRIED.robot(MOUNT), (0,), SLID),
    "slide after pan, wrist 2": (CARRIED.robot(MOUNT), (5,), SLID),
    "slide after pan, wrist 3": (CARRIED.mirrored.robot(MOUNT), (0,), SLID),
    "roll": (rolling(UR), (6,), SIX),
    "rail, roll": (rolling(ON_RAIL), (0, 7), SIX),
    "pan, roll": (rolling(ON_RAIL), (1, 7), TURNED),
    "wrist 2, wrist 3 of a rolling tool": (rolling(ON_SKEW), (5, 6), TURNED),
    "rail, wrist 2 of a tool that rolls about the wrist": (
        rolling(ON_RAIL.with_tool(np.linalg.inv(TOOL)).with_tool(through_wrist())),
        (0, 5),
        SIX,
    ),
    "rail, wrist 3 of a tool that rolls about the wrist": (
        rolling(ON_RAIL.with_tool(np.linalg.inv(TOOL)).with_tool(through_wrist())),
        (0, 6),
        SIX,
    ),
    "generic": (generic().robot(MOUNT), (), SIX),
    "generic with a slide": (generic("PRRRRR").robot(MOUNT), (), SLID),
    "generic with a slide and a turn": (generic("PRRRRR", 2).robot(MOUNT), (), SLID),
    "generic with a turn and a slide": (
        generic("RPRRRR", 2).mirrored.robot(MOUNT),
        (),
        SLID,
    ),
    **{
        f"random senses and zeros {seed}": (
            on_random_rail(UR, seed),
            (j,),
            SIX if j == 0 else TURNED,
        )
        for seed, j in enumerate((0, 1, 5, 6))
    },
}


def bench_of(name):
    robot, redundant, _ = CASES[name]
    return Bench(robot, redundant, 800, family=parallel_axes)


@pytest.mark.parametrize("name", CASES)
def test_every_branch_is_right(name):
    bench = bench_of(name)
    words = CASES[name][2]
    assert bench.solver.branches == tuple(
        "_".join(label) for label in itertools.product(*words)
    )
    bench.check()


def test_rail_answers_change_sides_where_the_rail_stops_helping():
    # The pan joint turns the parallel axes to -y cos + ..., and the rail runs along y: one side or the other.
    bench = bench_of("rail, pan")
    sides = (
        np.isfinite(bench.answers(bench.q)).all(axis=2).reshape(-1, 4, 2).any(axis=1)
    )
    right = np.cos(bench.q[:, 1]) > 0.0
    np.testing.assert_array_equal(sides, np.stack([~right, right], axis=1))


@pytest.mark.parametrize("name", ["ur3", "ur5", "ur10"])
def test_arms_as_their_urdf_states_them(name):
    robot = example_robot(name)
    Bench(robot, (), 800, family=parallel_axes).check()
    match = find(robot, task_map_of(robot, "pose"), [], families=[parallel_axes])
    assert match.family == "parallel_axes"


@pytest.mark.parametrize(
    "arm, redundant",
    [
        (UR.with_slide(0, Z), "j2"),
        (UR.with_slide(0, Z), "j6"),
        (UR.with_slide(0, Z), "j7"),
        (UR.with_slide(1, X), "j1"),
    ],
    ids=["pan", "wrist 2", "wrist 3", "pan below the slide"],
)
def test_a_slide_that_never_helps_is_an_error(arm, redundant):
    # Along the pan axis, or radially after it, it moves the arm within the plane of the parallel joints.
    robot = arm.robot(MOUNT)
    with pytest.raises(DecompositionError) as caught:
        find(robot, task_map_of(robot, "pose"), [redundant], families=[parallel_axes])
    slide = f"j{arm.letters.index('P') + 1}"
    reason = f"J_nr is singular everywhere: there is always a motion of the tool that needs {redundant}"
    assert caught.value.reasons["parallel_axes"] == reason
    assert (slide,) in caught.value.available


def refusal(robot, redundant, rows="pose"):
    with pytest.raises(NotApplicableError) as caught:
        parallel_axes.build(
            ChainGeometry.of(robot), task_map_of(robot, rows), redundant
        )
    return str(caught.value)


def test_reasons():
    assert (
        refusal(ON_RAIL.robot(), (2,))
        == "no three successive joints with parallel axes have one joint before and two after them whose axes "
        "meet, or a slide and a revolute joint before and one after them, in this or the reverse order"
    )
    assert "no three successive joints" in refusal(tx90l().robot(), ())
    assert refusal(ON_RAIL.robot(), ()) == "7 joints left to solve for, not 6"
    assert (
        refusal(UR.robot(), (0, 1, 2), ["x", "y", "z"])
        == "this family solves only for poses"
    )
    steps = list(UR.steps)
    steps[5] = steps[5] @ placement((0.1, 0.0, 0.0))
    assert "one joint before and two after them whose axes meet" in refusal(
        Arm(UR.letters, UR.axes, tuple(steps)).robot(), ()
    )
    four = Arm(
        "RRRRRR",
        (Z, Y, Y, Y, Y, X),
        tuple(placement((0.1 * i, 0.0, 0.2)) for i in range(7)),
    )
    assert (
        refusal(four.robot(), ())
        == "J_nr is singular everywhere: the joints cannot make all motions of the task space"
    )
    axes, steps = (Z, Y, Y, Y, Y, X), [placement((0.3, 0.1 * i, 0.2)) for i in range(7)]
    steps[5] = placement((0.2, 0.0, 0.0))
    assert (
        refusal(Arm("RRRRRR", axes, tuple(steps)).robot(), ())
        == "J_nr is singular everywhere: the joints cannot make all motions of the task space"
    )
