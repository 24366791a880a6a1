"""Cartesian gantries and macro-mini arms: slides that carry, or are carried by, other joints."""

import numpy as np
import pytest

from brachis.ik import find
from brachis.robot import Robot, task_map_of
from support.chains import Joint, chain_urdf, gantry_robot
from support.closed_forms import Bench

X, Y, Z = (1.0, 0.0, 0.0), (0.0, 1.0, 0.0), (0.0, 0.0, 1.0)
SKEW = (0.6, 0.0, 0.8)
SLIDE = {"lower": -1.0, "upper": 1.0, "velocity": 1.0, "effort": 50.0}


def macro_mini(first, second, turn, plane_rows):
    """Two slides that carry a two-link arm turning about `turn`."""
    joints = [
        Joint("prismatic", axis=first, limit=SLIDE),
        Joint("prismatic", axis=second, xyz=(0.1, 0.2, 0.3), limit=SLIDE),
        Joint("revolute", axis=turn, xyz=(0.05, 0.0, 0.1)),
        Joint("revolute", axis=turn, xyz=(0.4, 0.03, 0.02)),
    ]
    robot = Robot.from_urdf(
        "macro-mini", urdf_text=chain_urdf(joints, tool=(0.3, 0.02, 0.05))
    )
    return Bench(robot, plane_rows, 500)


@pytest.mark.parametrize(
    "axes, rows",
    [
        ([X, Y], ["x", "y"]),
        ([Y, X], ["x", "y"]),
        ([X, SKEW], ["x", "z"]),
        ([X, Y, Z], ["x", "y", "z"]),
        ([Z, SKEW, Y], ["x", "y", "z"]),
        ([Z, X, Y], ["z", "x", "y"]),
        ([X, Y, Z, SKEW], ["x", "y", "z"]),
        ([X, SKEW, Y], ["x", "y"]),
        ([X], ["x"]),
    ],
    ids=str,
)
def test_gantries(axes, rows):
    bench = Bench(gantry_robot(axes), rows, 500)
    found = 0
    for redundant, exists in bench.decompositions():
        if exists:
            candidate = bench.check(redundant, distinct_roots=1)
            assert candidate.family == "prismatic"
            bench.check_margin_gradient(candidate)
            found += 1
    assert found


@pytest.mark.parametrize(
    "rows, singular",
    [
        (["x", "y"], []),
        (["x", "y", "yaw"], []),
        (["y"], [(1, 2, 3)]),  # the slide along x alone does not change y
    ],
    ids=str,
)
def test_macro_mini_in_its_plane(rows, singular):
    bench = macro_mini(X, Y, Z, rows)
    for redundant, exists in bench.decompositions():
        assert exists == (redundant not in singular)
        if exists:
            # Circles are met where a turning joint is left, after yaw has taken one.
            turning = sum(joint not in redundant for joint in (2, 3)) - ("yaw" in rows)
            bench.check(redundant, distinct_roots=2 if turning > 0 else 1)


def test_slides_carried_by_turning_joints_have_branches_by_the_sign_of_their_determinant():
    # The second slide's direction turns with the joint before it: parallel to the first one twice a turn.
    joints = [
        Joint("prismatic", axis=X, limit=SLIDE),
        Joint("revolute", axis=Z, xyz=(0.1, 0.0, 0.0)),
        Joint("prismatic", axis=X, xyz=(0.2, 0.0, 0.0), limit=SLIDE),
    ]
    robot = Robot.from_urdf("crane", urdf_text=chain_urdf(joints, tool=(0.3, 0.1, 0.0)))
    candidate = find(robot, task_map_of(robot, ["x", "y"]), ["j2"])
    assert candidate.solver.branches == ("slides_positive", "slides_negative")
    angles = np.linspace(0.1, 6.2, 50)[:, None]
    answers = candidate.solver.solve(np.full((50, 2), 0.4), angles)
    turned_up = np.sin(angles[:, 0]) > 0.0
    np.testing.assert_array_equal(np.isfinite(answers[:, 0, 0, 0]), turned_up)
    np.testing.assert_array_equal(np.isfinite(answers[:, 1, 0, 0]), ~turned_up)
