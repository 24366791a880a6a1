"""A program on a controller: samples and positions of all parts, and its events as instructions of the profile."""

import re
from dataclasses import replace

import numpy as np
import pytest

import brachis
from brachis.apps.controller.run import slow_down
from brachis.apps.export import write_for_controller
from brachis.errors import InputError
from brachis.trajectory import Event
from support.cycle import CYCLE
from support.effort import QUICK
from support.slides import X, slides


def test_the_run_is_checked_against_the_limits_of_each_part(cycle):
    run = brachis.verify_run(cycle, "kuka_rsi_4ms")
    assert run.passed
    checks = {check.name: check for check in run.checks}
    assert checks["velocity by differences"].value == pytest.approx(1.0, abs=1e-3)
    assert checks["velocity by differences"].subject == "x_axis, move 1"
    assert checks["tool speed by differences"].subject == "tool, bead"
    assert checks["torque ratio"].value == pytest.approx(1.0, abs=1e-3)


def test_a_run_beyond_the_limits_of_one_part_fails(cycle):
    motion = cycle.trajectory
    begin, first = motion.components[0]
    slower = replace(first, robot=first.robot.with_limits(velocity=0.4))
    changed = replace(motion, components=((begin, slower), *motion.components[1:]))
    run = brachis.verify_run(changed, "kuka_rsi_4ms")
    assert not run.passed
    (failure,) = run.failures
    assert "velocity by differences" in failure
    assert "move 1" in failure


def test_differences_go_on_where_parts_meet():
    """A part that begins between two samples, or in motion, does not begin from rest."""
    parts = [
        {"move": {"joints": [0.3]}, "fly": True, "limits": {"acceleration": 3.0}},
        {"move": {"joints": [0.7]}},
        {"move": {"joints": [0.1]}},
    ]
    slide = slides([X], [16.0], 2.0, gravity=[0, 0, 0])
    robot = {"limits": {"acceleration": 5.0}}
    result = brachis.plan(slide, program=parts, start=[0.0], robot=robot, **QUICK)
    run = brachis.verify_run(result, "kuka_rsi_4ms")
    assert run.passed
    checks = {check.name: check for check in run.checks}
    rate = checks["acceleration by differences"]
    assert rate.value == pytest.approx(1.0, abs=1e-3)


def test_a_run_is_on_the_path_of_each_part(cycle):
    """The whole motion has no path; each part is compared with its own."""
    motion = cycle.trajectory
    begin, bead = motion.components[1]
    path = [{"line": {"by": [0.1, 0.21]}}]
    other = brachis.task.task_with(bead.task, path=path)
    changed = list(motion.components)
    changed[1] = (begin, replace(bead, task=other))
    run = brachis.verify_run(replace(motion, components=tuple(changed)), "kuka_rsi_4ms")
    (failure,) = run.failures
    assert "path error" in failure
    assert "bead" in failure


def test_samples_around_a_change_of_the_payload_are_not_mixed():
    """The light part begins faster than the heavy part before it could move."""
    parts = [
        {"move": {"joints": [0.5]}},
        {"payload": None},
        {"move": {"joints": [0.0]}},
    ]
    slide = slides([X], [16.0], 2.0, gravity=[0, 0, 0])
    loaded = {"payload": {"mass": 5.0}, "limits": {"scale": {"torque": 0.9}}}
    result = brachis.plan(
        slide, program=parts, start=[0.0], robot=loaded, rest="velocity", **QUICK
    )
    checks = brachis.verify_run(result, "kuka_rsi_4ms").checks
    (torque,) = (check for check in checks if check.name == "torque ratio")
    assert torque.value == pytest.approx(0.9, rel=0.01)


def test_a_slower_program_is_slower_in_all_parts(cycle):
    slow = slow_down(cycle.trajectory, 2.0)
    for (begin, part), (before, fast) in zip(
        slow.components, cycle.trajectory.components, strict=True
    ):
        assert begin == 2.0 * before
        assert part.t_end == 2.0 * fast.t_end


def instructions(cycle, tmp_path, profile="kuka_rsi_4ms", **options):
    options["time_tolerance"] = 0.05  # whole percents of the largest speeds
    write_for_controller(cycle, tmp_path / "cycle.src", profile, **options)
    return (tmp_path / "cycle.src").read_text().splitlines()


def test_events_come_out_at_their_positions(cycle, tmp_path):
    lines = instructions(cycle, tmp_path)
    motion = cycle.trajectory
    for event, instruction in zip(motion.events, ("TRUE", "FALSE"), strict=True):
        (row,) = [
            i for i, line in enumerate(lines) if f"$OUT[1] = {instruction}" in line
        ]
        before = next(line for line in lines[row::-1] if line.startswith("PTP"))
        values = np.array(re.findall(r"A\d (-?[\d.]+)", before), dtype=float)
        np.testing.assert_allclose(values, 1e3 * motion.position(event.time), atol=1e-3)
    waits = [float(line.split()[-1]) for line in lines if line.startswith("WAIT SEC")]
    assert sum(waits) == pytest.approx(0.1, abs=1e-5)


def test_the_program_of_positions_follows_all_parts(cycle, tmp_path):
    path = tmp_path / "cycle.mod"
    report = write_for_controller(cycle, path, "abb_egm_4ms")
    assert report.passed
    assert 0.0 < report.place <= 1e-3
    assert 0.0 < report.time <= 0.01
    closer = write_for_controller(cycle, path, "abb_egm_4ms", tolerance=1e-4)
    assert closer.place <= 1e-4
    assert closer.positions > report.positions


def test_a_single_move_has_a_program_too(cycle, tmp_path):
    move = cycle.trajectory.components[0][1]
    report = write_for_controller(move, tmp_path / "move.src", "kuka_rsi_4ms")
    assert 0.0 < report.place <= 1e-3
    assert report.positions < 12


def test_events_of_any_name_need_an_instruction(cycle, tmp_path):
    motion = cycle.trajectory
    arc = replace(motion, events=(Event("arc_on", 0.2),))
    with pytest.raises(InputError) as caught:
        instructions(arc, tmp_path)
    assert "profile.events: the controller has no instruction" in str(caught.value)
    assert "found arc_on; allowed: process_on, process_off" in str(caught.value)
    own = tmp_path / "own.yaml"
    own.write_text('extends: kuka_rsi_4ms\nevents: {arc_on: "$OUT[7] = TRUE"}\n')
    assert any("$OUT[7] = TRUE" in line for line in instructions(arc, tmp_path, own))


def test_two_events_at_one_time_are_refused(cycle, tmp_path):
    twice = tuple(Event(f"process_{end}", 0.2) for end in ("on", "off"))
    both = replace(cycle.trajectory, events=twice)
    with pytest.raises(
        InputError, match="one instruction at a time; found process_off"
    ):
        instructions(both, tmp_path)


def test_events_of_a_part_replace_those_of_its_process_speed(tmp_path):
    parts = [dict(part) for part in CYCLE["program"]]
    parts[1]["path"] = [{"line": {"by": [0.1, 0.2]}, "speed": 0.2}]
    result = brachis.plan({**CYCLE, "program": parts})
    lines = instructions(result, tmp_path)
    switches = [line for line in lines if "$OUT[1]" in line]
    assert [line.split()[-1] for line in switches] == ["TRUE", "FALSE"]


def test_linear_moves_are_refused(cycle, tmp_path):
    with pytest.raises(
        InputError, match="found a program of several parts; allowed: joint"
    ):
        instructions(cycle, tmp_path, moves="linear")


def test_samples_name_events_in_comments(cycle, tmp_path):
    write_for_controller(cycle, tmp_path / "cycle.csv", "kuka_rsi_4ms")
    text = (tmp_path / "cycle.csv").read_text()
    assert "# brachis: event process_on: " in text


def test_a_program_is_planned_for_a_controller():
    result, run = brachis.plan_for_controller("kuka_rsi_4ms", CYCLE)
    assert run.passed
    assert [part.kind for part in result.trajectory.parts] == [
        "move",
        "path",
        "dwell",
        "move",
    ]
