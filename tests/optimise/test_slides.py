"""A slide of 2 kg over 1 m, from drives that hardly move it to those that take it to its speed within microseconds."""

from __future__ import annotations

import itertools
import math

import pytest

import brachis

MASS = 2.0
"""kg."""
WAY = 1.0
"""m."""
FORCES = (0.5, 5.0, 50.0, 500.0, 5000.0, 50000.0)
"""N."""
SAME = 2e-4
"""Part of the time by which a motion with a stronger drive may be slower: `tolerances.GAIN`."""


def slide(speed: float) -> str:
    """Return the URDF of a slide with a speed limit, m/s."""
    inertia = '<inertia ixx="1" iyy="1" izz="1" ixy="0" ixz="0" iyz="0"/>'
    return f"""<robot name="slide"><link name="base"/>
    <link name="cart"><inertial><mass value="{MASS}"/>{inertia}</inertial></link>
    <joint name="x" type="prismatic"><parent link="base"/><child link="cart"/><axis xyz="1 0 0"/>
    <limit lower="-5" upper="5" effort="1e9" velocity="{speed}"/></joint></robot>"""


def least_time(speed: float, force: float) -> float:
    """Time of the trapezoid, or of the triangle where the speed is not reached, s."""
    acceleration = force / MASS
    if speed**2 > WAY * acceleration:
        return 2.0 * math.sqrt(WAY / acceleration)
    return WAY / speed + speed / acceleration


@pytest.mark.parametrize("rest", ["velocity", "full"])
@pytest.mark.parametrize(
    ("speed", "degree"), [(0.02, 3), (0.5, 3), (0.5, 4), (0.5, 5), (10.0, 3)]
)
def test_slides_of_any_force_are_as_fast_as_their_trapezoid(
    speed, degree, rest, tmp_path
):
    urdf = tmp_path / "slide.urdf"
    urdf.write_text(slide(speed))
    times = []
    for force in FORCES:
        result = brachis.plan(
            urdf,
            tool_frame="cart",
            gravity=[0.0, 0.0, 0.0],
            limits={"torque": force},
            start=[0.0],
            task_space=["x"],
            path=[{"line": {"by": [WAY]}}],
            degree=degree,
            rest=rest,
        )
        assert result.verified
        assert result.t_end == pytest.approx(least_time(speed, force), rel=1e-3)
        times.append(result.t_end)
    for weaker, stronger in itertools.pairwise(times):
        assert stronger < weaker * (1.0 + SAME)
