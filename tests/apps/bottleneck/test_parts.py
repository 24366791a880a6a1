"""What holds a program back: its limits by part, and their costs, also where parts have limits of their own."""

import numpy as np
import pytest

import brachis
from brachis.apps.bottleneck import limit_ratios, limits_by_phase, saturations
from brachis.apps.bottleneck.saturation import PhaseLimits
from brachis.errors import InputError
from brachis.limits import Label
from support.cycle import NAMES


def test_ratios_are_those_to_the_limits_of_each_part(cycle):
    motion = cycle.trajectory
    ratios = limit_ratios(motion)
    columns = {
        str(label): column
        for label, column in zip(ratios.labels, ratios.values.T, strict=True)
    }
    speed = motion.velocity(ratios.t)[:, 0]
    first, bead, _, last = motion.parts
    inside = ratios.t < first.end
    largest = np.where(inside, 0.5, 2.0)
    np.testing.assert_allclose(columns["x_axis velocity"], speed / largest, atol=1e-9)
    after = ratios.t >= last.begin
    torque = motion.torque(ratios.t[after])[:, 0]
    force = motion.robot.limits.both_ways("torque")[1, 0]
    np.testing.assert_allclose(
        columns["x_axis force"][after], torque / force, atol=1e-9
    )
    held = (ratios.t >= bead.begin) & (ratios.t < last.begin)
    tool = motion.at(ratios.t).tool_speed
    np.testing.assert_allclose(columns["tool speed"][held], tool[held] / 0.3, atol=1e-6)
    assert np.isnan(columns["tool speed"][~held]).all()
    assert np.nanmax(np.abs(ratios.values)) == pytest.approx(1.0, abs=2e-4)


def test_short_shares_are_not_zero(cycle):
    part = cycle.trajectory.parts[0]
    label = Label("x_axis", "velocity", "m/s")
    assert "less than 1 % of the time" in str(PhaseLimits(part, ((label, 0.004),)))


def test_each_part_has_its_active_limits(cycle):
    motion = cycle.trajectory
    parts = limits_by_phase(motion, saturations(motion))
    assert [limits.phase.name for limits in parts] == NAMES
    named = [str(limits.shares[0][0]) if limits.shares else "" for limits in parts]
    assert named[0] == "x_axis velocity"
    assert named[1] == "tool speed"
    assert named[2] == ""
    assert named[3].endswith("force")


def test_costs_name_the_limit_of_a_part_and_are_those_of_solving_again(cycle):
    found = cycle.bottleneck(check=True)
    text = str(found)
    assert "10 % more velocity of 0.5 m/s at x_axis (0.05 m/s) saves" in text
    assert "more speed at tool" in text
    assert "part bead (path), " in text
    assert "phase" not in text
    assert found.check.larger()
    assert found.check.worst_deviation() < 0.15
    data = found.to_dict()
    assert "phases" not in data
    assert [part["name"] for part in data["parts"]] == NAMES
    assert data["parts"][1]["limits"][0]["kind"] == "speed"


def test_a_saved_program_has_its_costs(cycle, tmp_path):
    cycle.save(tmp_path / "cycle.npz")
    saved = brachis.bottleneck.report(tmp_path / "cycle.npz")
    assert str(saved) == str(cycle.bottleneck())


def test_without_saved_costs_it_is_not_planned_again(cycle):
    report = brachis.bottleneck.report(cycle.trajectory)
    assert report.sensitivities is None
    assert "the cost of the limits is unknown" in str(report)
    for key in ("check", "reference"):
        with pytest.raises(InputError, match=f"{key}: the motion of a program"):
            brachis.bottleneck.report(cycle.trajectory, **{key: True})
    with pytest.raises(InputError, match="reference: the motion of a program"):
        cycle.bottleneck(reference=True)
