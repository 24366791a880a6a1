"""What limits cost, on problems whose answer is known by hand and against least squares."""

from dataclasses import replace

import numpy as np
import pytest

import brachis
from brachis.explain import ActiveSet, Multipliers, multipliers_of, sensitivities_at
from support.effort import QUICK
from support.slides import X, Z
from support.solvers import solve

from .conftest import FORCE, LENGTH, MASS

CARRIED = 2.0 * MASS


@pytest.mark.parametrize("rest", ["full", "velocity"])
@pytest.mark.parametrize("degree", [3, 4])
def test_time_falls_with_the_root_of_the_force(slide, rest, degree):
    # t = 2 sqrt(m L / F) times a factor of the spline alone: d t / d ln F = -t / 2 exactly.
    result = slide(rest=rest, degree=degree)
    force, *idle = result.sensitivities.limits
    assert str(force.label) == "j1 force"
    change = pytest.approx(-0.5 * result.solver_report.objective, rel=1e-5)
    assert force.change(1.0) == change
    assert force.derivative * FORCE == change
    assert [entry.change(1.0) for entry in idle] == [0.0] * 7
    assert result.sensitivities.reliable
    report = result.bottleneck()
    assert "no other limit costs time" in str(report)
    rough = replace(report, sensitivities=replace(report.sensitivities, residual=0.87))
    assert "the cost of other limits is unknown" in str(rough)
    assert "no other limit" not in str(rough)
    assert "residual 87 % of the gradient: reliable up to 0.1 %" in str(rough)


def test_trapezoid(slide):
    limit = 2.0
    result = slide(intervals=40, robot={"limits": {"velocity": limit}})
    costs = result.sensitivities
    ramp = (
        limit * CARRIED / FORCE
    )  # t = L / v + v m / F, but for the corners that a spline rounds
    force, speed = (costs.of("j1", kind).change(1.0) for kind in ("force", "velocity"))
    assert force == pytest.approx(-ramp, rel=0.1)
    assert speed == pytest.approx(ramp - LENGTH / limit, rel=0.1)
    # The same motion k times as fast needs k times the velocity and k^2 times the force.
    assert 2.0 * force + speed == pytest.approx(
        -result.solver_report.objective, rel=1e-4
    )
    assert costs.of("j1", "velocity").label.unit == "m/s"


def test_lifting_against_gravity(slide):
    # From rest to rest t^2 = 2 L (a + b) / (a b) with a = F / m - g, b = F / m + g: no mere scaling of time.
    force, g = 30.0, 9.81
    robot = {"gravity": [0, 0, -g], "limits": {"torque": {"j1": 200.0, "j2": force}}}
    found = slide(
        (X, Z), ("x", "z"), (0.0, LENGTH), intervals=40, robot=robot
    ).sensitivities

    def best(force):
        up, down = force / MASS - g, force / MASS + g
        return np.sqrt(2.0 * LENGTH * (up + down) / (up * down))

    exact = (best(force + 1e-4) - best(force - 1e-4)) / 2e-4
    assert found.of("j2", "force").derivative == pytest.approx(exact, rel=0.02)
    assert found.of("j2", "force").label.unit == "N"


def slide_in_range(slide, lower, upper):
    """A motion of two slides along one line, of which the first has a range."""
    limits = {"torque": {"j1": 30.0}, "position": {"j1": [lower, upper]}}
    robot = {"limits": limits}
    return slide((X, X), ("x",), (LENGTH,), redundant=["j1"], robot=robot)


def test_ends_of_a_range(slide):
    """Two slides along one line; the lower one recoils within a narrow range, which costs time."""
    half = 0.02
    result = slide_in_range(slide, -half, half)
    lower, upper = (
        result.sensitivities.of("j1", "position", end) for end in ("lower", "upper")
    )
    assert lower.derivative >= 0.0 >= upper.derivative
    assert min(lower.change(1.0), upper.change(1.0)) < -1e-3, "a wider range saves time"
    assert lower.full_scale == pytest.approx(2.0 * half)
    assert lower.label.unit == "m"


@pytest.mark.parametrize("joint", ["j1", "j2", "j3"])
def test_no_limit_costs_less_than_nothing(scara, joint):
    found = scara(joint).sensitivities
    assert all(entry.change(1.0) <= 0.0 for entry in found.limits)
    # Torque limits and nothing else: were all torques f times as large, the time would fall with the root of f.
    expected = -0.5 * scara(joint).solver_report.objective
    together = sum(entry.change(1.0) for entry in found.limits)
    assert together == pytest.approx(expected, rel=2e-3)


def test_of_a_timed_motion_the_solver_s_multipliers_count(scara):
    task = scara("j1").task.to_dict()
    task["spline"]["intervals"] = "auto"
    result = brachis.plan(scara("j1").trajectory.robot, task)
    refined = result.candidate.refined
    assert refined.reports[-1].solver == "phase plane", "else this tests nothing"
    found = brachis.bottleneck.report(result).sensitivities
    # The arm is planar: with all torques four times as large motions take half the time.
    assert sum(entry.change(1.0) for entry in found.limits) == pytest.approx(
        -0.5 * result.t_end, rel=5e-3
    )


def test_limits_along_a_given_joint_path_cost_what_planning_again_saves():
    rng = np.random.default_rng(1)
    points = np.cumsum(rng.normal(0.0, 0.4, (6, 3)), axis=0)

    def plan_with(j1):
        return brachis.plan(
            brachis.examples.scara_line,
            start=points[0].tolist(),
            task_space="joints",
            redundant_joints="auto",
            path=[{"spline": {"through": points[1:].tolist()}}],
            intervals="auto",
            limits={"torque": {"j1": j1}},
            **QUICK,
        )

    result = plan_with(10.0)
    # Least times go with a power of the torque.
    power = np.log(plan_with(11.0).t_end / result.t_end) / np.log(1.1)
    for motion in (result, result.trajectory):
        found = brachis.bottleneck.report(motion).sensitivities
        change = found.of("j1", "torque").change(1.0)
        assert change == pytest.approx(power * result.t_end, rel=0.02)
        assert found.of("j2", "torque").change(0.1) == pytest.approx(0.0, abs=1e-3)


@pytest.mark.parametrize("end", [1, -1])
def test_rows_that_nothing_can_change_do_not_press(slide, end):
    # The first slide begins at an end of its range, which holds whatever x.
    refined = slide_in_range(slide, *sorted((0.0, end * 0.5))).candidate.refined
    program, x = refined.program, refined.reports[-1].x
    active_set = ActiveSet.at(program, x, 1e-5)
    assert np.abs(active_set.slopes).max(axis=1).min() > 0.0
    rows = program.rows(x)
    room = np.minimum(rows - program.lower, program.upper - rows)
    at_start = np.flatnonzero(room == 0.0)
    assert set(at_start) - set(active_set.rows), "some row should hold without pressing"


@pytest.mark.parametrize("joint", ["j1", "j2", "j3"])
def test_least_squares_agree_with_the_solver(scara, joint):
    refined = scara(joint).candidate.refined
    program, report = refined.program, refined.reports[-1]
    exact = multipliers_of(program, report.x, report.multipliers)
    fitted = multipliers_of(program, report.x)
    assert (exact.source, fitted.source) == ("solver", "least squares")
    assert max(exact.residual, fitted.residual) < 1e-5
    changes, expected = (
        [entry.change(1.0) for entry in sensitivities_at(program, multipliers).limits]
        for multipliers in (fitted, exact)
    )
    assert changes == pytest.approx(expected, rel=1e-4, abs=1e-6)


def test_an_answer_that_is_no_optimum_is_not_reliable(scara):
    refined = scara("j3").candidate.refined
    report = refined.reports[-1]
    x = report.x.copy()
    x[0] *= 1.02  # slower: no torque is at its limit any more
    for answer, reliable in ((x, False), (report.x, True)):
        multipliers = multipliers_of(refined.program, answer, report.multipliers)
        assert sensitivities_at(refined.program, multipliers).reliable is reliable


def test_least_squares_replace_multipliers_of_wrong_sign(scara):
    refined = scara("j3").candidate.refined
    report = refined.reports[-1]
    wrong = multipliers_of(refined.program, report.x, -report.multipliers)
    assert wrong.source == "least squares"
    assert wrong.residual < 1e-5


def test_branch_boundary_is_told_apart(scara):
    refined = scara("j3").candidate.refined
    program, report = refined.program, refined.reports[-1]
    tight = program.with_margin(0.2)
    answer = solve(tight, report.x)
    assert answer.objective > report.objective + 1e-4
    costs = sensitivities_at(tight, multipliers_of(tight, answer.x, answer.multipliers))
    (boundary,) = costs.boundaries
    wider = solve(program.with_margin(0.198), answer.x)
    saved = answer.objective - wider.objective
    assert boundary.derivative * 0.002 == pytest.approx(saved, rel=0.1)
    kinds = {"torque", "velocity", "acceleration", "position"}
    assert {entry.label.kind for entry in costs.limits} <= kinds


@pytest.mark.parametrize("weights", [[1.0, 1e-4], [1.0, 3e-5, 7e-5]])
@pytest.mark.parametrize("residual, cost", [(1e-6, 1e-4), (1e-3, 0.0)])
def test_what_balances_less_than_the_residual_costs_nothing(weights, residual, cost):
    """Alone, or together with another row that holds alike."""
    count = len(weights)
    slopes = np.eye(2)[[0, *[1] * (count - 1)]]
    active_set = ActiveSet(slopes, np.arange(count), np.ones(count))
    assert active_set.dependent == (count > 2)
    multipliers = Multipliers(active_set, np.array(weights), "least squares", residual)
    first, *others = np.eye(count)
    assert multipliers.change(first) == pytest.approx(-1.0, rel=1e-6)
    together = multipliers.change(np.sum(others, axis=0))
    assert together == pytest.approx(-cost, rel=1e-2, abs=1e-12)
    if active_set.dependent:
        assert multipliers.change(others[0]) == pytest.approx(0.0, abs=1e-7)
