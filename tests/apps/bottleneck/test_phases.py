"""What holds a motion of several phases back: each phase by itself, and the multipliers of all of them."""

import re
from dataclasses import replace

import pytest

import brachis
from brachis.apps.bottleneck import limit_ratios, limits_by_phase, saturations
from support.effort import QUICK
from support.gantry import gantry_motion


@pytest.fixture(scope="module")
def stopping():
    """A planned motion that waits at a corner."""
    path = [{"line": {"by": [0.2, 0.0]}, "dwell": 0.3}, {"line": {"by": [0.0, 0.2]}}]
    example = brachis.examples.scara_line
    result = brachis.plan(example, path=path, redundant_joints=["j1"], **QUICK)
    assert result.verified
    return result


def test_limits_of_phases_add_up_to_those_of_the_motion(stopping):
    trajectory = stopping.trajectory
    entries = saturations(trajectory)
    phases = limits_by_phase(trajectory, entries)
    assert [limits.phase.kind for limits in phases] == ["move", "dwell", "move"]
    assert phases[1].shares == ()
    for entry in entries:
        times = [
            dict(limits.shares).get(entry.label, 0.0) * limits.phase.duration
            for limits in phases
        ]
        expected = entry.share * trajectory.t_end
        assert sum(times) == pytest.approx(expected, abs=1e-3 * trajectory.t_end)
    assert sum(len(limits.shares) for limits in phases) > 1


def test_costs_are_those_of_all_phases(stopping):
    found = brachis.bottleneck.report(stopping, check=True)
    assert found.sensitivities.reliable
    assert found.check.larger()
    assert found.check.worst_deviation() < 0.02
    assert found.timing.gap > 0.0
    assert found.timing.least_time > 0.3
    assert "phase 2 dwell, s = 0.5, 0.3000 s" in str(found)
    assert found.to_dict()["phases"][1]["limits"] == []


def test_a_saved_motion_is_solved_again_by_phase(stopping):
    lines = []
    again = brachis.bottleneck.report(
        stopping.trajectory, reference=True, listener=lines.append
    )
    words = r"re-planning the motion, with itself as the first guess: about (\S+) s, no more than 60 s"
    assert int(re.match(words, lines[1])[1]) >= 1
    assert any("iteration 1," in line for line in lines)
    assert "planning again with discontinuous torque" in lines
    now = brachis.bottleneck.report(stopping)
    for entry in now.sensitivities.limits:
        other = again.sensitivities.of(entry.label.subject, entry.label.kind)
        same = pytest.approx(entry.derivative, rel=0.01, abs=1e-5)
        assert other.derivative == same
    assert 0.5 * now.t_end < again.reference.t_end < now.t_end


def test_a_motion_from_elsewhere_has_limits_by_phase():
    motion = gantry_motion()
    ratios = limit_ratios(motion)
    narrower = replace(ratios, values=ratios.values / 0.29)
    phases = limits_by_phase(motion, saturations(narrower))
    (label, share) = phases[0].shares[0]
    assert (label.subject, label.kind) == ("j2", "velocity")
    assert 0.0 < share < 0.5
    assert str(phases[1]) == "none"
