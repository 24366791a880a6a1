"""What all closed forms owe beside right answers: they are found, sent to other processes, and NaN says no."""

import pickle

import numpy as np
import pytest
from numpy.testing import assert_allclose, assert_array_equal

from brachis.ik import find
from brachis.ik.snapping import PolishedSolver
from brachis.robot import Robot, task_map_of
from support.arms import TOOL, Y, ur10
from support.chains import gantry_robot, planar_robot, planar_urdf
from support.pose_arms import panda_lengths
from support.rounded import ARMS, by_angles
from support.screw_arms import BASES, screw_robot
from support.spatial import rail_arm

COUNT = 30
AXES = [(1.0, 0.0, 0.0), (0.0, 1.0, 0.0), (0.6, 0.0, 0.8)]


def almost_upright():
    """A plane turned by 1.5708 rad."""
    text = planar_urdf("RRRR", "xz").replace(repr(np.pi / 2), "1.5708")
    return Robot.from_urdf("rounded", urdf_text=text)


CASES = {
    "planar, rounded": (almost_upright, ["x", "z", "pitch"], (1,)),
    "planar": (lambda: planar_robot("RRR"), ["x", "y"], (1,)),
    "prismatic": (lambda: gantry_robot(AXES), ["x", "y"], (2,)),
    "prismatic, position": (lambda: screw_robot(BASES["P|PP"]), "position", ()),
    "positioning": (rail_arm, "position", (0, 4, 5, 6)),
    "spherical_wrist": (rail_arm, "pose", (2,)),
    "parallel_axes": (ur10().with_slide(0, Y).with_tool(TOOL).robot, "pose", (0,)),
    "eaik": (panda_lengths, "pose", (5,)),
    "spherical_wrist, rounded": (
        lambda: by_angles(ARMS["TX90L on a rail"], 4),
        "pose",
        (0,),
    ),
}


@pytest.mark.parametrize("name", CASES)
def test_a_solver_is_found_and_sent_and_what_it_cannot_solve_disturbs_nothing(name):
    make, rows, redundant = CASES[name]
    family, _, kind = name.partition(", ")
    if family == "eaik":
        pytest.importorskip("eaik")
    robot = make()
    task_map = task_map_of(robot, rows)
    match = find(robot, task_map, [robot.joint_names[i] for i in redundant])
    solver = match.solver
    assert match.family == family
    assert isinstance(solver, PolishedSolver) == (kind == "rounded")

    q = np.random.default_rng(5).uniform(-1.5, 1.5, (COUNT, robot.n))
    targets = task_map.values(q)
    values = q[:, list(redundant)]
    clean = solver.solve(targets, values)
    shape = (len(solver.branches), solver.alternatives, task_map.m)
    assert clean.shape == (COUNT, *shape)
    assert np.isfinite(clean).any(axis=(1, 2, 3)).all()
    for branch in range(len(solver.branches)):
        in_branch = solver.solve_branch(targets, values, branch)
        assert_allclose(in_branch, clean[:, branch], atol=1e-12)

    again = pickle.loads(pickle.dumps(solver))  # noqa: S301  (our own)
    assert_allclose(again.solve(targets, values), clean, atol=1e-12)
    for branch in range(len(solver.branches)):
        margins = solver.branch_margins(q, branch)
        assert_array_equal(again.branch_margins(q, branch), margins)

    assert solver.solve(targets[:0], values[:0]).shape == (0, *shape)
    spoilt = [5, 7]
    targets[5, 0] = np.nan
    targets[7, -1] = np.inf
    if "prismatic" not in name:  # slides reach everything
        targets[3, :2] += 50.0
        spoilt.append(3)
    if redundant:
        values[9, 0] = np.nan
        spoilt.append(9)
    answers = solver.solve(targets, values)
    assert np.isnan(answers[spoilt]).all()
    assert np.isnan(solver.solve(targets[spoilt[-1:]], values[spoilt[-1:]])).all()
    others = np.setdiff1d(np.arange(COUNT), spoilt)
    assert_allclose(answers[others], clean[others], atol=1e-12)
