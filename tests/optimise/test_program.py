"""Programs of several phases: built from phases and links alone, against times known by hand and differences.

A slide of mass m pushed by at most F moves, stops and moves on: each move over d takes 2 sqrt(d m / F).
"""

import pickle

import numpy as np
import pytest
from numpy.testing import assert_array_equal

from brachis.common.arrays import spread
from brachis.common.deadline import NEVER
from brachis.explain import figures_of, multipliers_of, sensitivities_at
from brachis.limits.joint import PositionLimit, TorqueLimit
from brachis.optimise.backends import SolverOptions, SolveStatus, solvers_for
from brachis.optimise.boundary import Boundary
from brachis.optimise.bspline import clamped_knots
from brachis.optimise.grid import FixedGrid
from brachis.optimise.guess import starting_point
from brachis.optimise.improve import SolvedProgram
from brachis.optimise.links import CurveLink
from brachis.optimise.mesh import coarsest, optimise_knots, refine_mesh, solve_by_levels
from brachis.optimise.phase import Phase
from brachis.optimise.program import Program
from brachis.optimise.refine import RefinementOptions
from brachis.task import SplineSettings
from support.direct_map import DirectJointMap
from support.slides import X, slides
from support.solvers import INSTALLED, solve

MASS, FORCE, LENGTH = 2.0, 50.0, 1.2
FREE = np.nan
ALONE = (0,)


ROBOT = slides([X], [FORCE], MASS)
TORQUE = TorqueLimit(ROBOT, np.array(ALONE))


def move(start, end, *further, degree=2, intervals=8, points=3):
    """A free move of the slide from rest to rest."""
    breaks = np.linspace(0.0, 1.0, intervals + 1)
    grid = FixedGrid(clamped_knots(degree, breaks), degree, spread(breaks, points))
    boundary = Boundary.at_rest(np.array([start]), np.array([end]), 1)
    return Phase(DirectJointMap(ROBOT, np.zeros(1)), [TORQUE, *further], grid, boundary)


def within(lower, upper):
    robot = ROBOT.with_limits(position={"j1": [lower, upper]})
    return PositionLimit(robot, np.array(ALONE))


def two_moves(stop=0.5, **options):
    """Move from 0 to a stop and on to LENGTH."""
    return Program(
        [move(0.0, stop, **options), move(FREE, LENGTH, **options)],
        [CurveLink(0, 1, (0,), ALONE)],
    )


def first_point(program, stop=0.5):
    ways = [np.array([[0.0], [stop]]), np.array([[stop], [LENGTH]])]
    return starting_point(program, ways, [None, None])


def solve_first(program, **options):
    return SolvedProgram(program, (solve(program, first_point(program, **options)),))


def bang_bang(*distances):
    return sum(2.0 * np.sqrt(distance * MASS / FORCE) for distance in distances)


@pytest.mark.parametrize("solver", INSTALLED)
def test_a_given_stop(solver):
    program = two_moves()
    report = solvers_for(solver)[0].solve(
        program, first_point(program), SolverOptions(), None
    )
    assert report.status is SolveStatus.OPTIMAL
    assert report.objective == pytest.approx(bang_bang(0.5, 0.7), rel=1e-3)
    first, second = program.motions(report.x)
    assert [first.t_end, second.t_end] == pytest.approx(
        [bang_bang(0.5), bang_bang(0.7)], rel=1e-3
    )
    assert second.control_points[0, 0] == pytest.approx(0.5, abs=1e-6)


def test_a_stop_that_only_the_ranges_of_the_phases_bound():
    # Short and long moves together are faster than two alike: the stop goes to the far end of what is allowed.
    phases = [move(0.0, FREE, within(-1.0, 0.9)), move(FREE, LENGTH, within(0.65, 2.0))]
    linked, apart = (
        solve_first(Program(phases, links), stop=0.7)
        for links in ([CurveLink(0, 1, (0,), ALONE)], [])
    )
    assert linked.report.status is SolveStatus.OPTIMAL
    assert linked.t_end == pytest.approx(bang_bang(0.9, 0.3), rel=1e-3)
    first, second = linked.program.motions(linked.x)
    stops = [first.control_points[0, -1], second.control_points[0, 0]]
    assert stops == pytest.approx([0.9, 0.9], abs=1e-5)
    assert apart.t_end < 0.9 * linked.t_end, "the link should matter"


def test_refinement_reaches_meshes_of_every_phase():
    coarse = solve_first(two_moves(degree=3, intervals=4))
    fine = refine_mesh(coarse, solve, SplineSettings(tolerance=1e-3), NEVER)
    assert not fine.not_completed
    assert min(phase.intervals for phase in fine.program.phases) > 8
    assert fine.t_end == pytest.approx(bang_bang(0.5, 0.7), rel=1e-3)
    assert coarse.t_end > 1.01 * fine.t_end


def test_free_knots_move_in_every_phase():
    even = solve_first(two_moves(degree=3, intervals=3))
    moved = optimise_knots(even, solve, 0.03, RefinementOptions())
    assert moved.program.variables == even.program.variables
    assert moved.t_end < 0.99 * even.t_end
    assert moved.t_end == pytest.approx(bang_bang(0.5, 0.7), rel=1e-3)


def test_phases_are_solved_from_few_intervals():
    phases = [
        move(0.0, 0.5, degree=3, intervals=60),
        move(FREE, LENGTH, degree=3, intervals=14),
    ]
    program = Program(phases, [CurveLink(0, 1, (0,), ALONE)])
    coarse = solve_first(coarsest(program))
    assert [phase.intervals for phase in coarse.program.phases] == [15, 14]
    nested = solve_by_levels(program, coarse, solve)
    assert not nested.not_completed
    assert [phase.intervals for phase in nested.program.phases] == [60, 14]
    assert nested.t_end < coarse.t_end


def test_a_limit_of_several_phases_is_one_figure():
    program = two_moves()
    assert program.limits == (TORQUE,)
    report = solve_first(program).report
    multipliers = multipliers_of(program, report.x, report.multipliers)
    (entry,) = sensitivities_at(program, multipliers).limits
    assert entry.change(1.0) == pytest.approx(-0.5 * report.objective, rel=1e-3)
    ((limit, bound),) = figures_of(program)[entry.label, entry.side]
    relaxed = program.relax(limit, bound, 0.21 * FORCE)
    assert len(relaxed.limits) == 1
    faster = solve(relaxed, report.x).objective
    assert faster == pytest.approx(report.objective / 1.1, rel=1e-4)


def test_a_program_in_another_process_is_the_same():
    """Plans in several processes send programs to and fro."""
    program = two_moves()
    x = first_point(program)
    copy = pickle.loads(pickle.dumps(program))  # noqa: S301
    assert_array_equal(copy.rows(x), program.rows(x))
    assert_array_equal(copy.jacobian(x), program.jacobian(x))
    (limit,) = copy.limits
    assert_array_equal(copy.rows_of(limit), program.rows_of(TORQUE))
