"""The registry: what it refuses, what it says then, and that it believes no family."""

import numpy as np
import pytest

import brachis
from brachis.errors import DecompositionError, InputError, UnknownNameError
from brachis.ik import (
    IKSolver,
    NotApplicableError,
    check_answers,
    find,
    find_all,
    ik_family,
)
from brachis.robot import Robot, task_map_of
from brachis.robot.task_map import RowsAndAngle
from support.chains import Joint, chain_urdf, planar_robot


@pytest.fixture(scope="module")
def arm():
    return planar_robot("RRR")


@pytest.fixture(scope="module")
def plane(arm):
    return task_map_of(arm, ["x", "y"])


def spatial_robot():
    """Three joints whose axes are neither parallel nor do they meet or leave slides."""
    joints = [
        Joint("revolute", axis=(0.0, 0.0, 1.0)),
        Joint("revolute", axis=(0.0, 1.0, 0.0), xyz=(0.1, 0.0, 0.4)),
        Joint("revolute", axis=(0.0, 0.6, 0.8), xyz=(0.5, 0.1, 0.0)),
    ]
    return Robot.from_urdf(
        "spatial", urdf_text=chain_urdf(joints, tool=(0.4, 0.0, 0.0))
    )


@pytest.mark.parametrize("names", [[], ["j1", "j2"], ["j1", "j1"]], ids=str)
def test_wrong_number_of_redundant_joints(arm, plane, names):
    with pytest.raises(DecompositionError) as caught:
        find(arm, plane, names)
    assert caught.value.redundant_joints == tuple(names)
    assert "3 joints less 2 rows (x, y)" in str(caught.value)
    assert f"found {len(names)} (" in str(caught.value)


def test_more_rows_than_joints():
    robot = planar_robot("RR")
    space = task_map_of(robot, ["x", "y", "yaw"])
    words = "fewer joints than the task space has rows"
    with pytest.raises(DecompositionError, match=words):
        find(robot, space, [])
    assert find_all(robot, space) == []


def test_unknown_joint_with_suggestion(arm, plane):
    with pytest.raises(UnknownNameError) as caught:
        find(arm, plane, ["j33"])
    assert caught.value.name == "j33"
    assert caught.value.valid == ("j1", "j2", "j3")
    assert "Did you mean 'j3'?" in str(caught.value)
    assert caught.value.where == "redundant_joints"


def test_no_closed_form_names_every_reason():
    robot = spatial_robot()
    with pytest.raises(DecompositionError) as caught:
        find(robot, task_map_of(robot, ["x", "y", "z"]), [])
    reasons = caught.value.reasons
    assert (
        "all joints except the redundant ones must be prismatic; revolute: j1, j2, j3"
        in reasons["prismatic"]
    )
    assert "j2 moves out of the plane in which j1 turns" in reasons["planar"]
    assert (
        "no closed form moves the tool by j1, j2, j3: no two neighbours among them"
        in reasons["positioning"]
    )
    assert all(reason in str(caught.value) for reason in reasons.values())
    assert caught.value.available == ()


def test_no_closed_form_lists_the_choices_that_have_one():
    # Joint 1 slides along the normal: with joint 2 or 3 redundant, x and y hang on one turning joint alone.
    joints = [
        Joint("prismatic"),
        Joint("revolute"),
        Joint("revolute", xyz=(0.4, 0.0, 0.0)),
    ]
    robot = Robot.from_urdf("scara", urdf_text=chain_urdf(joints, tool=(0.3, 0.0, 0.0)))
    space = task_map_of(robot, ["x", "y"])
    with pytest.raises(DecompositionError) as caught:
        find(robot, space, ["j3"])
    assert (
        caught.value.reasons["planar"]
        == "J_nr is singular everywhere: there is always a motion of the tool that needs j3"
    )
    assert caught.value.available == (("j1",),)
    assert "Choices with a closed form: [j1]" in str(caught.value)


def test_yaw_in_another_plane_than_the_joints_is_an_error():
    robot = planar_robot("RRR", "tilted")
    with pytest.raises(
        DecompositionError, match="yaw turns in a different plane than the joints"
    ):
        find(robot, RowsAndAngle(robot, ("x", "y", "yaw"), tool_axis=0), [])


def test_rows_that_the_plane_cannot_tell_apart_are_errors():
    # In the xz-plane y stands still: rows x and y are of rank one.
    robot = planar_robot("RR", "xz")
    with pytest.raises(DecompositionError, match="do not fit the plane"):
        find(robot, task_map_of(robot, ["x", "y"]), [])


def test_order_of_the_redundant_joints_does_not_matter():
    robot = planar_robot("RRRR")
    candidate = find(robot, task_map_of(robot, ["x", "y"]), ["j3", "j1"])
    assert candidate.redundant_joints == ("j1", "j3")


class Wrapped(IKSolver):
    """A solver that changes another one's answers."""

    def __init__(self, inner, change):
        self.branches, self._inner, self._change = inner.branches, inner, change

    def solve(self, targets, q_r):
        return self._change(self._inner.solve(targets, q_r))

    def branch_margins(self, q, branch):
        return self._inner.branch_margins(q, branch)

    def margin_gradient(self, q, branch):
        return self._inner.margin_gradient(q, branch)


def wrap(arm, plane, change):
    return Wrapped(find(arm, plane, ["j3"]).solver, change)


def third_party(arm, plane, change):
    """A family of another package that answers for redundant joint j3 only."""
    solver = wrap(arm, plane, change)

    @ik_family("third_party", source="this test")
    def family(geometry, _task_space, redundant):
        if geometry.joint_names[redundant[0]] != "j3":
            raise NotApplicableError("only j3")
        return solver

    return family


def test_a_third_party_family_comes_first_where_it_fits(arm, plane):
    family = third_party(arm, plane, lambda answers: answers)
    assert family.source == "this test"
    candidate = find(arm, plane, ["j3"], families=[family])
    assert candidate.family == "third_party"
    assert isinstance(candidate.solver, Wrapped)
    other = find(arm, plane, ["j1"], families=[family])
    assert other.family == "planar"
    assert other.reasons["third_party"] == "only j3"


@pytest.mark.parametrize(
    "change, reason",
    [
        (lambda answers: answers + 1e-4, "do not contain all postures"),
        (
            lambda answers: answers[:, ::-1] * np.array([1.0, np.nan])[:, None, None],
            "do not contain all postures",
        ),
        (lambda answers: answers + 3e-7, "miss the target by"),
        (lambda answers: np.concatenate([answers, answers], axis=1), "have the shape"),
        (lambda answers: np.full_like(answers, np.nan), "do not contain all postures"),
    ],
    ids=[
        "off by 1e-4",
        "one branch lost",
        "near misses",
        "more answers than labels",
        "no answers",
    ],
)
def test_a_wrong_family_is_rejected_and_the_next_one_taken(arm, plane, change, reason):
    family = third_party(arm, plane, change)
    candidate = find(arm, plane, ["j3"], families=[family])
    assert candidate.family == "planar"
    assert reason in candidate.reasons["third_party"]
    with pytest.raises(NotApplicableError, match=reason):
        check_answers(arm, plane, (2,), wrap(arm, plane, change))


def test_lifted_angles_are_right_answers(arm, plane):
    family = third_party(arm, plane, lambda answers: answers + 2.0 * np.pi)
    assert find(arm, plane, ["j3"], families=[family]).family == "third_party"


def test_a_family_of_others_that_breaks_down_is_named_and_passed_over(arm, plane):
    @ik_family("broken", source="this test")
    def broken(*_arguments):
        return {}["nothing"]

    candidate = find(arm, plane, ["j3"], families=[broken])
    assert candidate.family == "planar"
    assert candidate.reasons["broken"] == "its code failed: KeyError: 'nothing'"


@pytest.mark.parametrize(
    "member, change, reason",
    [
        (
            "branches",
            lambda _labels: ("elbow", "elbow"),
            "the same label: elbow, elbow",
        ),
        ("branch_margins", lambda a: a[:, 0], r"shape \(100,\), not \(100, k"),
        ("margin_gradient", lambda a: a[:, 0], "margin_gradient has the shape"),
        ("margin_gradient", lambda _slopes: np.zeros((1, 1, 1)), "has the shape"),
        ("margin_gradient", lambda slopes: -slopes, "contradicts differences of its"),
        ("margin_gradient", lambda slopes: 1.01 * slopes, "contradicts differences"),
        ("margin_gradient", lambda slopes: slopes * np.nan, "contradicts differences"),
    ],
)
def test_wrong_members_of_a_solver_are_errors(arm, plane, member, change, reason):
    solver = wrap(arm, plane, lambda answers: answers)
    check_answers(arm, plane, (2,), solver)
    right = getattr(solver, member)
    wrong = (lambda *given: change(right(*given))) if callable(right) else change(right)
    setattr(solver, member, wrong)
    with pytest.raises(NotApplicableError, match=reason):
        check_answers(arm, plane, (2,), solver)


def test_a_family_that_returns_no_solver_says_so(arm, plane):
    @ik_family("forgetful", source="this test")
    def forgetful(_geometry, _task_map, _redundant):
        """Forget to return the solver."""

    reasons = find(arm, plane, ["j3"], families=[forgetful]).reasons
    assert reasons["forgetful"] == "it returned None, not an IKSolver"


def test_margins_that_are_not_analytic_are_errors(arm, plane):
    class Rough(Wrapped):
        margin_gradient = IKSolver.margin_gradient

        def branch_margins(self, q, branch):
            return np.abs(np.cos(q[:, :1]))

    inner = find(arm, plane, ["j3"]).solver
    with pytest.raises(NotApplicableError, match="must be analytic"):
        check_answers(arm, plane, (2,), Rough(inner, lambda answers: answers))


def forget_the_decorator(_geometry, _task_map, _redundant):
    raise NotApplicableError("never")


@pytest.mark.parametrize("wrong", [forget_the_decorator, 3, Wrapped])
def test_what_is_no_family_is_an_error(arm, plane, wrong):
    with pytest.raises(InputError, match="not a family") as caught:
        find(arm, plane, ["j3"], families=[wrong])
    assert caught.value.where == "families[0]"
    assert "@brachis.ik.ik_family" in str(caught.value)
    with pytest.raises(InputError, match="not a family"):
        brachis.plan(brachis.examples.scara_line, families=[wrong])


@pytest.mark.parametrize("name", ["", " ", 5, "planar", None])
def test_families_have_names_of_their_own(arm, plane, name):
    family = ik_family(name, source="this test")(forget_the_decorator)
    with pytest.raises(InputError, match=r"families\[0\]\.name: "):
        find(arm, plane, ["j3"], families=[family])


def test_two_families_have_two_names(arm, plane):
    family = third_party(arm, plane, lambda answers: answers)
    words = r"families\[1\].name: a family of this name exists"
    with pytest.raises(InputError, match=words):
        find(arm, plane, ["j3"], families=[family, family])
