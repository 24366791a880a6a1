"""The lattice of all postures: its joint paths are motions of the arm, and it goes wherever the arm can."""

import dataclasses
import math

import numpy as np
import pytest
from numpy.testing import assert_allclose, assert_array_equal

from brachis.common.deadline import Deadline
from brachis.problem.problem import decompositions_of
from brachis.robot import dynamics
from brachis.search.closed_form_lattice import ClosedFormLattice
from brachis.search.joint_path import NO_TIME, DeadEnd
from brachis.search.posture_lattice import PostureLattice
from brachis.task import task_with
from support.chains import planar_robot
from support.joint_paths import check_joint_path
from support.scara import RANGES, START, problem, scara
from support.screw_arms import seven_joints
from support.spatial import START as RAIL_START
from support.spatial import rail_arm

SEVEN = [0.3, -0.7, 0.4, 1.3, 0.5, -0.9, 0.2]
TURN = 2.0 * math.pi


def line(robot, start, by, rows=("x", "y"), **task):
    path = [{"line": {"by": by}}]
    return problem(robot, rows, start={"joints": start}, path=path, **task)


def joint_paths_of(line_problem, **options):
    return PostureLattice(line_problem, [], **options).joint_paths(4)


def shortest_of(decompositions):
    """The least length of a joint path of a closed form."""
    lattices = map(ClosedFormLattice, decompositions)
    return min(lattice.joint_paths(1)[0].length for lattice in lattices)


CASES = {
    "r = 0, 2R": lambda: line(scara(locked_joints={"j3": 0.4}), START[:2], [0.1, 0.4]),
    "r = 1, 3R": lambda: line(scara(), START, [0.0, 1.0]),
    "r = 1, ranges": lambda: line(scara(RANGES), START, [0.0, 1.0]),
    "r = 1, gravity": lambda: line(
        scara({"torque": [330.0, 200.0, 70.0]}, gravity=[0.0, -9.81, 0.0]),
        START,
        [0.3, 0.9],
    ),
    "r = 1, 7R, pose": lambda: line(seven_joints(), SEVEN, [0.1, 0.2, 0.1], "pose"),
    "r = 1, rail, pose": lambda: line(
        rail_arm(), list(RAIL_START), [0.1, 0.9, 0.1], "pose"
    ),
    "r = 2, 4R": lambda: line(planar_robot("RRRR"), [0.4, 0.8, 0.7, 0.5], [-0.6, 0.3]),
    "r = 4, 7R, position": lambda: line(
        seven_joints(), SEVEN, [0.1, 0.2, 0.1], "position"
    ),
}


@pytest.mark.parametrize("case", CASES)
def test_joint_paths_are_motions_of_the_robot(case):
    line_problem = CASES[case]()
    joint_paths = joint_paths_of(line_problem, nodes=40)
    assert not isinstance(joint_paths, DeadEnd), str(joint_paths)
    assert joint_paths
    for joint_path in joint_paths:
        assert_array_equal(joint_path.s[[0, -1]], [0.0, 1.0])
        check_joint_path(line_problem, joint_path, miss=1e-10, step=0.8 + 1e-12)
        assert_array_equal(joint_path.q[0], line_problem.start)


def test_gravity_and_ranges_turn_joint_paths_away():
    """Without these limits the shortest joint paths go where the limits of the cases above forbid it."""
    held = CASES["r = 1, gravity"]().robot.limits
    strong = scara({"torque": 1e4}, gravity=[0.0, -9.81, 0.0])
    (shortest, *_) = joint_paths_of(line(strong, START, [0.3, 0.9]))
    still = np.zeros_like(shortest.q)
    load = dynamics.torque(strong, shortest.q, still, still)
    assert np.any(np.abs(load) > held.torque)
    bounded = CASES["r = 1, ranges"]().robot.limits
    q = joint_paths_of(line(scara(), START, [0.0, 1.0]))[0].q
    assert np.any((q < bounded.position_lower) | (q > bounded.position_upper))


def test_it_goes_on_where_the_branch_of_a_closed_form_ends():
    """With joint 3 redundant the elbow of joints 1 and 2 would have to stretch: the branch ends, the arm goes on."""
    start = [-0.919, -1.53, 2.225]
    robot = scara({"position": {"j1": [start[0] - 0.6, start[0] + 0.6]}})
    path = [{"line": {"length": 1.652, "angle_deg": 58.5}}]
    keys = {"start": {"joints": start}, "path": path}
    (by_j3,) = decompositions_of(problem(robot, **keys, redundant_joints=["j3"]))
    for finer in (1, 3):
        lattice = ClosedFormLattice(by_j3, cells_per_turn=72 * finer, density=finer)
        end = lattice.joint_paths(4)
        assert isinstance(end, DeadEnd)
        assert 0.5 < end.s < 1.0
    (first, *_) = joint_paths_of(problem(robot, **keys))
    assert first.q[0, 1] < 0.0 < first.q[-1, 1], "the elbow has changed its side"


@pytest.mark.parametrize("angle", range(0, 360, 90))
def test_the_shortest_joint_path_is_about_as_short_as_the_best_of_all_closed_forms(
    angle,
):
    line_problem = problem(
        scara(),
        start={"joints": START},
        path=[{"line": {"length": 1.0, "angle_deg": angle}}],
    )
    best = shortest_of(decompositions_of(line_problem))
    assert joint_paths_of(line_problem)[0].length < 1.15 * best


def component(q):
    """Of the self-motion of three links of 1 m: nearer than 1 m to the base, joint 2 never stretches nor folds."""
    return int(np.sign(np.sin(q[1])))


@pytest.mark.parametrize(
    "known", [True, False], ids=["closed forms", "random postures"]
)
def test_a_free_start_finds_both_components_of_the_self_motion(known):
    line_problem = problem(
        scara(),
        start="free",
        path_start=[0.5, 0.2],
        path=[{"line": {"by": [-0.3, 0.1]}}],
    )
    decompositions = decompositions_of(line_problem)
    expected = {
        component(joint_path.q[0])
        for one in decompositions
        for joint_path in ClosedFormLattice(one, cells_per_turn=36).joint_paths(6)
    }
    assert expected == {-1, 1}
    joint_paths = PostureLattice(
        line_problem, decompositions if known else [], cells_per_turn=36
    ).joint_paths(6)
    for joint_path in joint_paths:
        assert len({component(q) for q in joint_path.q}) == 1
    assert {component(joint_path.q[0]) for joint_path in joint_paths} == expected
    assert joint_paths[0].length < 1.15 * shortest_of(decompositions)


CIRCLE = [{"circle": {"center": [0.0, 0.0], "turns": 1}}]
COARSE = {"cells_per_turn": 24, "density": 0.2}


RANGE = {"position": {"j1": [START[0] - 7.0, START[0] + 13.0]}}


@pytest.mark.parametrize("turns, reached", [(1, True), (0, False), (2, False)])
def test_the_end_is_reached_in_its_own_turn(turns, reached):
    """Once round the base, so far from it that no other joint can turn in place of the first."""
    end = START + TURN * turns * np.eye(3)[0]
    line_problem = problem(
        scara(RANGE), path=CIRCLE, start={"joints": START}, end={"joints": end.tolist()}
    )
    joint_paths = joint_paths_of(line_problem, **COARSE)
    assert isinstance(joint_paths, list) is reached
    for joint_path in joint_paths if reached else []:
        assert_allclose(joint_path.q[-1], end, atol=1e-3)
        assert_array_equal(joint_path.q[0], START)


@pytest.mark.parametrize("turns, reached", [(0, True), (2, True), (-1, False)])
def test_a_given_end_is_reached_from_the_turn_before(turns, reached):
    """Back from the end: the free start is a turn before it, where that is within the range."""
    robot = scara(RANGE)
    end = START + TURN * turns * np.eye(3)[0]
    path_start = robot.tool_placement(end).translation[:2].tolist()
    line_problem = problem(
        robot,
        path=CIRCLE,
        start="free",
        path_start=path_start,
        end={"joints": end.tolist()},
    )
    joint_paths = joint_paths_of(line_problem, **COARSE)
    assert isinstance(joint_paths, list) is reached
    for joint_path in joint_paths if reached else []:
        assert_array_equal(joint_path.q[-1], end)
        assert joint_path.q[-1, 0] - joint_path.q[0, 0] == pytest.approx(TURN, abs=1.6)


LATTICES = {
    "of all postures": lambda line_problem: PostureLattice(
        line_problem, decompositions_of(line_problem), density=0.2
    ),
    "of a closed form": lambda line_problem: ClosedFormLattice(
        *decompositions_of(line_problem)
    ),
}


@pytest.mark.parametrize("lattice", LATTICES.values(), ids=LATTICES)
@pytest.mark.parametrize("way", [1.0, -1.0])
def test_a_free_start_may_be_in_any_turn_of_a_range(way, lattice):
    """A circle and a half about the base fits into the range only from one of its ends on."""
    robot = scara({"position": {"j1": [-TURN, TURN]}}, locked_joints={"j3": 0.4})
    start = np.array([way * (-TURN + 0.2), 0.9])
    here = robot.tool_placement(start).translation[:2].tolist()

    def end_of(turns):
        circle = [{"circle": {"center": [0.0, 0.0], "turns": turns * way}}]
        line_problem = problem(robot, start="free", path_start=here, path=circle)
        return lattice(line_problem).joint_paths(4)

    joint_paths = end_of(1.5)
    assert all(
        -TURN <= q <= TURN for joint_path in joint_paths for q in joint_path.q[:, 0]
    )
    assert min(abs(joint_path.q[0, 0] - start[0]) for joint_path in joint_paths) < 1e-6
    dead = end_of(2.1)
    assert isinstance(dead, DeadEnd)
    assert 1.8 / 2.1 < dead.s < 1.0
    assert "the range of joint 'j1' ends" in dead.cause


def test_the_same_seed_gives_the_same_joint_paths():
    line_problem = CASES["r = 2, 4R"]()
    tasks = [task_with(line_problem.task, seed=seed) for seed in (3, 3, 4)]
    first, again, changed = (
        joint_paths_of(dataclasses.replace(line_problem, task=task), nodes=60)
        for task in tasks
    )
    gaps = [np.abs(a.q - b.q).max() for a, b in zip(first, again, strict=True)]
    assert max(gaps) <= 1e-9
    assert np.abs(first[0].q - changed[0].q).max() > 1e-6


def test_no_layer_is_begun_after_the_deadline():
    found = joint_paths_of(CASES["r = 1, 3R"](), deadline=Deadline.after(0.0))
    assert found.cause == NO_TIME


@pytest.mark.parametrize(
    "start, end",
    [
        ([-0.45, 0.77, -1.3, -1.0], [-0.24, 0.14, -0.77, 0.43]),
        ([1.02, 0.68, -0.4, -0.15, -0.4], [0.22, -0.32, 0.07, -0.83, -0.8]),
    ],
    ids=["four joints", "five joints"],
)
def test_a_given_end_is_reached_with_several_redundant_joints(start, end):
    """To wait, and to leap to the end at last, is no longer: but the leap would be too large."""
    robot = planar_robot("CCCCC"[: len(start)])
    tool = [robot.tool_placement(np.array(q)).translation[:2] for q in (start, end)]
    by = (tool[1] - tool[0]).tolist()
    line_problem = line(robot, start, by, end={"joints": end})
    joint_paths = joint_paths_of(line_problem, nodes=60)
    assert isinstance(joint_paths, list)
    assert joint_paths
    assert_allclose(joint_paths[0].q[-1], end, atol=1e-3)
    assert np.abs(np.diff(joint_paths[0].q, axis=0)).max() <= 0.8
