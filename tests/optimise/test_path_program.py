"""The NLP over the path: derivatives, and what it finds."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.sparse import coo_array

import brachis
from brachis.optimise import retiming
from brachis.optimise.path_program import PathProgram


@pytest.fixture(scope="module")
def programs():
    """Programs over the path, and their answers, of one plan with one redundant joint."""
    found = []
    find = PathProgram.timings

    def keep(self, x, places):
        found.append((self, x))
        return find(self, x, places)

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
    assert set(intervals) == {16, 32, 64, 128}
    for (program, x), count in zip(found, intervals, strict=True):
        timing = retiming.least_time(program.timings(x, 4000))
        nearly = 1e-2 if count == 16 else 2e-3
        assert timing == pytest.approx(program.objective(x), rel=nearly)
    # Splines may be slower by the tolerance.
    assert result.t_end == pytest.approx(timing, rel=1e-3)


def test_values_that_are_given_stay(programs):
    program, x = programs[0][-1]
    (phase,) = program.phases
    start = phase.phase.boundary.start[1].value
    assert phase.course(x, np.array([phase.ends[0]])).y[0, 1] == pytest.approx(start)
    assert x[0] == program.start[0]
