"""The NLP over the path: derivatives, and what it finds."""

from pathlib import Path

import numpy as np
import pytest
from scipy.sparse import coo_array

import brachis
from brachis.common.deadline import NEVER
from brachis.optimise import retiming
from brachis.optimise.backends import SolverOptions, solvers_for
from brachis.optimise.improve import SolverSession
from brachis.optimise.path_program import PathProgram
from support.starts import starting_points

ROOT = Path(__file__).parents[2]


@pytest.fixture(scope="module")
def programs():
    """Programs over the path, and their answers, of one plan with one redundant joint."""
    found = []
    find = PathProgram.timings

    def keep(self, x, places, **how):
        found.append((self, x))
        return find(self, x, places, **how)

    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(PathProgram, "timings", keep)
        result = brachis.plan(
            brachis.examples.scara_line,
            redundant_joints=["j1"],
            intervals="auto",
            rest="velocity",
            least_motion=False,
        )
    assert result.verified
    return found, result


def test_slopes_agree_with_differences(programs):
    program, x = programs[0][0]
    rng = np.random.default_rng(0)
    x = program.start * (1.0 + 1e-2 * rng.normal(size=len(x)))
    shape = (len(program.lower), len(x))
    places = (program.jacobian_rows, program.jacobian_columns)
    jacobian = coo_array((program.jacobian(x), places), shape=shape).toarray()
    gradient = program.gradient(x)
    step = 1e-6
    stations = len(x) - 19
    for number in (1, 40, stations - 2, stations, stations + 9, len(x) - 1):
        moved = np.zeros(len(x))
        moved[number] = step
        rows = (program.rows(x + moved) - program.rows(x - moved)) / (2.0 * step)
        np.testing.assert_allclose(jacobian[:, number], rows, rtol=1e-6, atol=1e-6)
        slope = program.objective(x + moved) - program.objective(x - moved)
        assert gradient[number] == pytest.approx(slope / (2.0 * step), abs=1e-7)


def test_answers_are_as_fast_as_their_timings(programs):
    found, result = programs
    intervals = [len(program.phases[0].breaks) - 1 for program, _ in found]
    # It ends with the level that gains less than the tolerance.
    assert {16, 32, 64} <= set(intervals) <= {16, 32, 64, 128, 256}
    for (program, x), count in zip(found, intervals, strict=True):
        timing = retiming.least_time(program.timings(x, 4000, is_rough=False))
        nearly = 1e-2 if count == 16 else 2e-3
        assert timing == pytest.approx(program.objective(x), rel=nearly)
    # Splines may be slower by the tolerance.
    assert result.t_end == pytest.approx(timing, rel=1e-3)


def improve(program):
    """Improve a joint path by numeric inverse kinematics, roughly."""
    (motion,) = program.motions(next(starting_points(program)))
    curves = motion.at(np.linspace(0.0, motion.t_end, 201))[0]
    (backend,) = solvers_for("uno")
    session = SolverSession(backend, SolverOptions(), NEVER)
    return retiming.improve_joint_paths(
        program, [curves], session, 1e-3, retiming.ROUGH
    )


def test_a_periodic_motion_ends_where_it_begins():
    program, _ = brachis.transcribe(ROOT / "examples/10_periodic_circle.yaml")
    found = improve(program)
    (curves,) = found.curves
    assert curves[0, 1] == pytest.approx(curves[-1, 1], abs=1e-3)
    assert found.reports[0].iterations > 1


def test_limits_that_the_phase_plane_does_not_know_are_left_out():
    task = brachis.load_task(brachis.examples.scara_line).to_dict()
    limits = {**task["robot"].get("limits", {}), "jerk": 20.0}
    slower = {**task, "robot": {**task["robot"], "limits": limits}}
    times = [
        improve(brachis.transcribe(each, redundant_joints=["j1"])[0]).t_end
        for each in (task, slower)
    ]
    assert times[1] == pytest.approx(times[0], rel=5e-3)
