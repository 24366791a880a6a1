"""Arms whose URDF rounds angles, as in 1.5708: closed forms of the ideal arm, polished on the arm as it is."""

import functools
import itertools
import json
import re
import sysconfig
from pathlib import Path

import numpy as np
import pytest

from brachis.apps.cli.inspection import inspect
from brachis.errors import DecompositionError
from brachis.ik import Family, find, find_all
from brachis.ik.snapping import PolishedSolver
from brachis.robot import task_map_of
from support.closed_forms import wrap
from support.factored_bench import Bench
from support.rounded import ANY_DIGITS, ARMS, by_angles

ROUNDED, EXACT = 4, ANY_DIGITS
XARM = "cmeel.prefix/share/example-robot-data/robots/xarm_description/urdf/xarm7.urdf"


@functools.cache
def candidates(name, digits, seed=0):
    robot = by_angles(ARMS[name], digits, seed=seed)
    return robot, find_all(robot, task_map_of(robot, "pose"))


def polished_of(name):
    """Redundant joints with a closed form, and its solver for the rounded arm."""
    _, found = candidates(name, ROUNDED)
    return {c.redundant_joints: c.solver for c in found if c.solver}


CASES = [(name, joints) for name in ARMS for joints in polished_of(name)]


def bench_of(name, joints, postures=2000):
    robot, _ = candidates(name, ROUNDED)
    solver = polished_of(name)[joints]
    redundant = [robot.joint_names.index(joint) for joint in joints]
    family = Family("ready", lambda *_: solver, "")
    return Bench(robot, redundant, postures, family=family)


@pytest.mark.parametrize("seed", [0, 5])
@pytest.mark.parametrize("name", ARMS)
def test_the_same_decompositions_are_found_as_for_the_exact_arm(name, seed):
    _, exact = candidates(name, EXACT, seed)
    _, rounded = candidates(name, ROUNDED, seed)
    assert [c.family for c in rounded] == [c.family for c in exact]
    counts = {"UR10": 1, "iiwa": 6}
    assert sum(c.solver is not None for c in exact) == counts.get(name, 4)
    for candidate in exact:
        assert candidate.remark == ""
        assert not isinstance(candidate.solver, PolishedSolver)
    for candidate, ideal in zip(rounded, exact, strict=True):
        if candidate.solver is not None:
            assert isinstance(candidate.solver, PolishedSolver)
            assert candidate.solver.branches == ideal.solver.branches
            assert re.fullmatch(
                r"the axes are within \de-0[56] rad and \de-0[67] m of an ideal arm's; solutions are refined "
                r"numerically",
                re.sub(r"\.\d", "", candidate.remark),
            )
        else:
            assert candidate.reasons == ideal.reasons


@pytest.mark.parametrize("name, joints", CASES, ids=str)
def test_all_answers_are_right_and_one_is_the_posture(name, joints):
    bench = bench_of(name, joints)
    solved = bench.solve(bench.q)
    _, branch, postures = bench.check_answers(solved)

    branch //= bench.solver.alternatives
    for b in range(len(bench.solver.branches)):
        assert (
            bench.solver.branch_margins(postures[branch == b], b).min(initial=1.0)
            > -1e-3
        )
    margins = bench.margins(bench.q)
    # Alternatives are told apart by continuity alone.
    inside = (margins > 0.0).all(axis=2).repeat(bench.solver.alternatives, axis=1)
    gap = np.where(inside, bench.distance(solved, bench.q), np.inf).min(axis=1)
    product = np.abs(margins[:, 0]).prod(axis=1)
    regular = (np.abs(margins[:, 0]).min(axis=1) > 5e-3) & (product > 1e-2)
    assert np.mean(regular) > 0.5
    assert (gap * product)[regular].max() < 1e-8
    assert np.mean(gap > 1e-6) < 0.01, (
        "answers are missing but beside the branches' boundaries"
    )


@pytest.mark.parametrize("name, joints", CASES, ids=str)
def test_no_answer_is_given_twice(name, joints):
    bench = bench_of(name, joints, 500)
    solved = bench.solve(bench.q)
    for first, second in itertools.combinations(range(solved.shape[1]), 2):
        gap = np.abs(wrap(solved[:, first] - solved[:, second], bench.turning)).max(
            axis=1
        )
        assert np.nanmin(gap, initial=1.0) > 1e-6


@pytest.mark.parametrize(
    "name, joint",
    [
        ("iiwa", 6),
        ("UR10", 2),
        ("UR10", 3),
        ("UR10 on a rail", 3),
        ("TX90L on a rail", 6),
    ],
)
def test_what_is_farther_off_is_an_error_with_the_reason(name, joint):
    near, far = (
        by_angles(ARMS[name], EXACT, bent=bent, bent_joint=joint)
        for bent in (5e-5, 1e-3)
    )
    redundant = ["j1"] * (near.n - 6)
    match = find(near, task_map_of(near, "pose"), redundant)
    assert re.search(r"axes are within [57]\.\de-05 rad", match.remark)
    with pytest.raises(DecompositionError) as caught:
        find(far, task_map_of(far, "pose"), redundant)
    reasons = [
        reason
        for reason in caught.value.reasons.values()
        if "only for an ideal arm" in reason
    ]
    assert re.search(r"the axes are off by up to 1\.\de-03 rad", reasons[0])
    assert (
        "up to 1e-04 is accepted as rounding. If the URDF rounds angles" in reasons[0]
    )


def test_offsets_that_are_meant_are_no_rounding():
    arm = ARMS["iiwa"]
    steps = list(arm.steps)
    steps[5] = steps[5] + 0.005 * np.outer([0.0, 1.0, 0.0, 0.0], [0.0, 0.0, 0.0, 1.0])
    robot = by_angles(type(arm)(arm.letters, arm.axes, tuple(steps)), ROUNDED)
    with pytest.raises(DecompositionError) as caught:
        find(robot, task_map_of(robot, "pose"), ["j3"])
    assert "miss a common point by 0.005 m" in caught.value.reasons["spherical_wrist"]
    assert "rounds" not in str(caught.value)


def xarm():
    """The URDF, where example-robot-data is installed."""
    path = Path(sysconfig.get_path("purelib")) / XARM
    if not path.exists():
        pytest.skip("example-robot-data is not installed")
    return path


def test_inspect_names_the_families_and_the_solvers_that_refine(capsys, monkeypatch):
    monkeypatch.setenv("COLUMNS", "240")
    inspect(xarm(), task_space="pose", json=True)
    data = json.loads(capsys.readouterr().out)
    assert data["tool_frame"] == "link_eef"
    rows = data["decompositions"]
    assert {row["redundant joints"]: row["solver"] for row in rows} == {
        **dict.fromkeys(("joint1", "joint2", "joint3"), "-"),
        **dict.fromkeys(("joint4", "joint7"), "spherical_wrist"),
        **dict.fromkeys(("joint5", "joint6"), "eaik"),
    }
    remarks = {row["redundant joints"]: row["remark"] for row in rows}
    assert (
        remarks["joint4"]
        == "the axes are within 3.7e-06 rad and 1.1e-06 m of an ideal arm's; solutions are refined numerically"
    )
    assert remarks["joint1"] == ""
    inspect(xarm(), task_space="pose")
    assert capsys.readouterr().out.count("solutions are refined numerically") == 4
