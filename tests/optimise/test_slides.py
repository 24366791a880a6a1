"""A slide of 2 kg over 1 m, from drives that hardly move it to those that take it to its speed within microseconds."""

import itertools
import math

import pytest

from support.slides import X, plan_slides, slides

MASS = 2.0
"""kg."""
WAY = 1.0
"""m."""
FORCES = (0.5, 5.0, 50.0, 500.0, 5000.0, 50000.0)
"""N."""
SAME = 2e-4
"""Part of the time by which a motion with a stronger drive may be slower: `tolerances.GAIN`."""


def least_time(speed, force):
    """Time of the trapezoid, or of the triangle where the speed is not reached, s."""
    acceleration = force / MASS
    if speed**2 > WAY * acceleration:
        return 2.0 * math.sqrt(WAY / acceleration)
    return WAY / speed + speed / acceleration


@pytest.mark.parametrize("rest", ["velocity", "full"])
@pytest.mark.parametrize(
    "speed, degree", [(0.02, 3), (0.5, 3), (0.5, 4), (0.5, 5), (10.0, 3)]
)
def test_slides_of_any_force_are_as_fast_as_their_trapezoid(speed, degree, rest):
    times = []
    for force in FORCES:
        robot = slides([X], [force], MASS).with_limits(velocity=speed)
        spline = {"degree": degree, "rest": rest}
        result = plan_slides(robot, ["x"], [WAY], spline=spline)
        assert result.verified
        assert result.t_end == pytest.approx(least_time(speed, force), rel=1e-3)
        times.append(result.t_end)
    for weaker, stronger in itertools.pairwise(times):
        assert stronger < weaker * (1.0 + SAME)
