"""The decomposition's motion against differences in time, and its derivatives against central differences."""

import copy

import numpy as np
import pytest
from numpy.testing import assert_allclose, assert_array_equal

from brachis.errors import UnreachableError
from brachis.ik.planar import PlanarSolver
from brachis.kinematics.closed_form import ClosedFormMap
from brachis.limits.safeguards import build_branch_margins
from brachis.optimise.evaluator import Evaluator
from support.chains import planar_robot
from support.motions import (
    PLANAR,
    THREE_CIRCLES,
    TOO_FAR,
    Sway,
    arc_path,
    check_derivatives,
    check_time_derivatives,
    joint_map,
)
from support.scara import scara


@pytest.fixture(params=PLANAR, ids=str, scope="module")
def motion(request):
    pattern, plane, rows, start, redundant = PLANAR[request.param]
    robot = planar_robot(pattern, plane)
    arc = arc_path(robot, rows, start)
    return Sway(joint_map(robot, rows, arc, start, redundant), amplitude=0.1)


T = np.linspace(0.02, 0.98, 25)


def test_path_is_met_exactly(motion):
    y, *_ = motion(T)
    chain = motion.joint_map
    targets = chain.path.sample(y[:, 0]).target
    assert_allclose(chain.task_map.values(chain.postures(y)), targets, atol=1e-12)


def test_motion_is_the_time_derivative_of_the_postures(motion):
    check_time_derivatives(motion, T, exact=1e-14)


def test_derivatives(motion):
    exact = check_derivatives(motion, T)
    for part in (exact.qdot_y, exact.qddot_y, exact.qddot_ydot):
        assert np.abs(part).max() > 0.1


@pytest.mark.parametrize("turns", [-3, 0, 2])
def test_angles_are_lifted_from_the_start_posture_on_and_stay_continuous_over_many_turns(
    turns,
):
    # Joint 1 follows a circle about the base three times: it must reach 6 pi, not jump back.
    start = np.array([0.2 + 2.0 * np.pi * turns, 1.0, 0.6])
    chain = joint_map(scara(), ["x", "y"], THREE_CIRCLES, start, ["j3"])
    s = np.linspace(0.0, 1.0, 400)
    q = chain.postures(np.stack([s, np.full(400, 0.6)], axis=1))
    assert_allclose(q[0], start, atol=1e-12)
    assert_allclose(q[:, 0], start[0] + 6.0 * np.pi * s, atol=1e-9)
    assert_allclose(q[:, 1:], np.broadcast_to(start[1:], (400, 2)), atol=1e-9)


def test_slides_never_wrap():
    robot = planar_robot("PPR")
    start = [20.0, -30.0, 0.4]
    chain = joint_map(robot, ["x", "y"], [{"line": {"by": [40.0, 0.0]}}], start, ["j3"])
    s = np.linspace(0.0, 1.0, 4)  # steps far beyond 2 pi
    q = chain.postures(np.stack([s, np.full(4, 0.4)], axis=1))
    assert_allclose(q[0], start, atol=1e-9)
    assert_allclose(chain.task_map.values(q), chain.path.sample(s).target, atol=1e-9)


def test_target_out_of_reach():
    chain = joint_map(scara(), ["x", "y"], TOO_FAR, [0.2, 1.0, 0.6], ["j3"])
    y = np.array([[0.0, 0.6], [1.0, 0.6]])
    postures = chain.postures(y)
    assert np.isfinite(postures[0]).all()
    assert np.isnan(postures[1, :2]).all()
    with pytest.raises(UnreachableError, match="out of the branch's reach"):
        chain.state(y, 0.0 * y, 0.0 * y, 0.0 * y)


class Slower(PlanarSolver):
    """A family whose subclass has answers and margins of its own."""

    calls = 0

    def solve_branch(self, targets, q_r, branch):
        self.calls += 1
        return super().solve_branch(targets, q_r, branch)

    def branch_margins(self, q, branch):
        return 0.1 * super().branch_margins(q, branch)

    def margin_gradient(self, q, branch):
        return 0.1 * super().margin_gradient(q, branch)


def test_what_a_subclass_computes_itself_is_asked_for():
    robot = planar_robot("RRR", "xy")
    start = [0.4, 1.0, 0.5]
    rows = ["x", "y"]
    known = joint_map(robot, rows, arc_path(robot, rows, start), start, ["j2"])
    assert isinstance(known.solver, PlanarSolver)
    solver = copy.copy(known.solver)
    solver.__class__ = Slower
    chain = known.task_map, known.path, solver, (1,), known.branch, known.start
    own = ClosedFormMap(*chain)
    y, *rates = Sway(known, amplitude=0.1)(T)
    (margin,) = build_branch_margins(own)
    state = own.state(y, *rates)
    assert solver.calls == 1
    assert_array_equal(state.q, known.state(y, *rates).q)
    assert margin.kernel_quantity(robot.chain) is None
    evaluation = Evaluator(own, [margin]).evaluate(y, *rates)
    expected = 0.1 * known.branch_margins(state.q)
    assert_allclose(evaluation.values, expected, atol=1e-14)
    solver.solve_branch = lambda *_given: np.zeros((len(T), 2))
    with pytest.raises(ValueError, match=r"Slower\.solve_branch returned"):
        own.postures(y)


def test_turns_follow_postures_that_are_known_to_be_near(motion):
    y, *rates = motion(T)
    chain = motion.joint_map
    q = chain.postures(y)
    far = q + 4.0 * np.pi * chain.branch_of.turns
    assert_allclose(chain.state(y, *rates, near=far).q, far, atol=1e-12)


def test_a_part_of_a_path_begins_in_the_turns_of_its_own_start(motion):
    y, *_ = motion(T)
    chain = motion.joint_map
    start = chain.start + 2.0 * np.pi * chain.branch_of.turns
    part = chain.along(chain.path, start)
    turned = chain.postures(y) + 2.0 * np.pi * chain.branch_of.turns
    assert_allclose(part.postures(y), turned, atol=1e-12)
