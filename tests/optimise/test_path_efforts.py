"""How closely joint paths are looked for, and how closely they are timed."""

import pytest

import brachis
from brachis.optimise.phase_timing import PhaseTiming
from brachis.search.differential_ik import differential_ik_paths


@pytest.fixture(scope="module")
def phase():
    """Of the planar arm's line, and a joint path along it."""
    program, _ = brachis.transcribe(
        brachis.examples.scara_line, redundant_joints=["j1"], intervals=20
    )
    (own,) = program.phases
    return own, next(differential_ik_paths(own.joint_map))


@pytest.mark.parametrize("places", [200, 800])
def test_a_rough_timing_is_right_within_a_hundredth(phase, places):
    fine = PhaseTiming.through(*phase)
    rough = PhaseTiming.through(*phase, places, is_rough=True)
    assert rough.t_end == pytest.approx(fine.t_end, rel=1e-2)
