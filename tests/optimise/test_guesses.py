"""Initial guesses are reachable at every collocation point and within the limits that time relieves."""

import numpy as np
import pytest

from brachis.optimise.guess import shortest_time, worst_time_scaling_ratio
from brachis.optimise.program import Program
from support.phases import CASES, phase_of
from support.starts import starting_points


@pytest.mark.parametrize("intervals", [5, 20])
@pytest.mark.parametrize("case", CASES)
def test_guesses_are_reachable_and_slow_enough(case, intervals):
    phase = phase_of(case, intervals=intervals, points_per_interval=3)
    guesses = list(starting_points(Program([phase])))
    shapes = {tuple(np.round(x[1:], 3)) for x in guesses}
    assert len(shapes) >= (3 if phase.joint_map.r else 1)
    for x in guesses:
        assert x.shape == (phase.variables,)
        state = phase.state(x)
        for kind in ("torque", "velocity", "acceleration"):
            (limit,) = (each for each in phase.limits if each.kind == kind)
            assert np.abs(limit.values(state)).max() <= 1.0
        part = phase.slices[0]
        assert np.all(np.diff(x[part]) >= 0.0)
        assert np.all((x[part] >= 0.0) & (x[part] <= 1.0))


# Half of an open range is infinite; a push away from its ends must not become so.
@pytest.mark.parametrize("j2", [None, [None, 2.9], [-3.0, None]], ids=str)
def test_open_ranges(j2):
    found = list(starting_points(Program([phase_of("r1", position={"j2": j2})])))
    assert len(found) >= 3
    assert np.isfinite(found).all()


def test_time_scaling_stops_at_the_limits():
    program = Program([phase_of("r1")])
    x = next(starting_points(program))
    fast = x.copy()
    fast[0] = 0.05
    assert worst_time_scaling_ratio(program, fast) > 2.0
    slow = shortest_time(program, fast)
    assert worst_time_scaling_ratio(program, slow) <= 1.0
    assert slow[0] > fast[0]
    # Not longer than about one step of the scaling beyond need.
    barely = slow.copy()
    barely[0] /= 1.5
    assert worst_time_scaling_ratio(program, barely) > 1.0
    np.testing.assert_array_equal(slow[1:], fast[1:])
    assert fast[0] == 0.05
