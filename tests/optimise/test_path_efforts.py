"""How closely joint paths are looked for, and how closely they are timed."""

from __future__ import annotations

import numpy as np
import pytest

import brachis
from brachis.optimise.phase_timing import PhaseTiming
from brachis.search.differential_ik import differential_ik_paths
from brachis.timing import phase_plane


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


def test_rows_that_are_kept_change_nothing(monkeypatch):
    """Friction is linearised again and again; velocity and acceleration are not."""
    task = brachis.load_task(brachis.examples.payload_friction_jerk)
    program, _ = brachis.transcribe(task)
    (own,) = program.phases
    joint_path = next(differential_ik_paths(own.joint_map))
    written = []
    write = phase_plane._Rows.of

    def count(limit, *rest):
        written.append(limit.kind)
        return write(limit, *rest)

    monkeypatch.setattr(phase_plane._Rows, "of", count)
    kept = PhaseTiming.through(own, joint_path, 400)
    with_kept = len(written)
    monkeypatch.setattr(phase_plane, "_EXACT", -1.0)
    anew = PhaseTiming.through(own, joint_path, 400)
    assert len(written) - with_kept > with_kept
    assert np.isfinite(anew.t_end)
    assert kept.t_end == pytest.approx(anew.t_end, rel=1e-9)
