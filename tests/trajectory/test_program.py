"""The motion of a program: its parts in tables and summaries, its torques with payloads, its given speeds."""

import numpy as np
import pytest

import brachis
from brachis.robot import dynamics
from brachis.trajectory import PART_COLUMNS, change_robots, part_rows
from support.cycle import CYCLE, KINDS, NAMES


def test_rows_of_parts_share_the_time(cycle):
    parts = cycle.trajectory.parts
    rows = part_rows(parts)
    assert {len(row) for row in rows} == {len(PART_COLUMNS)}
    assert [row[0] for row in rows] == NAMES
    assert [row[1] for row in rows] == KINDS
    assert "0.1000 s" in rows[2][2]
    shares = [float(row[3].removesuffix(" %")) for row in rows]
    assert sum(shares) == pytest.approx(100.0, abs=0.3)


def test_summaries_name_parts_and_events_and_no_branch(cycle):
    shown = cycle.trajectory.summary()
    assert shown["parts"] == ", ".join(NAMES)
    on, off = cycle.trajectory.events
    assert shown["events"] == f"{on}, {off}"
    assert f"{on.time:.4f} s" in shown["events"]
    assert "branch" not in shown
    assert cycle.summary()["parts"] == shown["parts"]


def test_times_belong_to_the_later_motion_and_stand_still_in_waits(cycle):
    motion = cycle.trajectory
    first, second, third = (begin for begin, _ in motion.components)
    t = np.array([first, second, 0.5 * (motion.parts[2].begin + third), third])
    pieces = [(rows.tolist(), times) for _, rows, times in motion.split_times(t)]
    assert [rows for rows, _ in pieces] == [[0], [1, 2], [3]]
    assert pieces[1][1].tolist() == [0.0, motion.components[1][1].t_end]
    ((itself, rows, times),) = motion.components[0][1].split_times(t[:1])
    assert itself is motion.components[0][1]
    assert rows.tolist() == times.tolist() == [0]


def test_torques_are_those_with_the_payload_of_the_part(cycle):
    motion = cycle.trajectory
    last = motion.parts[-1]
    t = np.linspace(last.begin, last.end, 20)[1:-1]
    q = motion.position(t)
    qdot = motion.velocity(t)
    qddot = motion.acceleration(t)
    loaded = dynamics.torque(motion.robot.with_payload(3.0), q, qdot, qddot)
    np.testing.assert_allclose(motion.torque(t), loaded, atol=1e-9)
    np.testing.assert_allclose(motion.at(t).tau, loaded, atol=1e-9)
    empty = dynamics.torque(motion.robot, q, qdot, qddot)
    assert np.abs(empty - loaded).max() > 1.0
    first = motion.torque(t[0] - last.begin)
    assert first.shape == (2,)


def test_robots_are_changed_in_all_parts(cycle):
    changed = change_robots(
        cycle.trajectory, lambda robot: robot.with_limits(velocity=9.0)
    )
    robots = [changed.robot, *(part.robot for _, part in changed.components)]
    assert {robot.limits.velocity[0] for robot in robots} == {9.0}
    masses = [robot.settings.payload for robot in robots]
    assert [mass is None for mass in masses] == [True, True, True, False]


def test_speeds_that_are_given_in_a_part_are_those_of_its_phases():
    lines = [
        {"line": {"by": [0.1, 0.0]}, **speed} for speed in ({}, {"speed": 0.2}, {})
    ]
    path = {"path": lines, "path_start": [0.2, 0.0]}
    program = [{"move": "next"}, path, {"move": "home"}]
    result = brachis.plan({**CYCLE, "program": program})
    phases = result.trajectory.phases
    kinds = [phase.kind for phase in phases]
    assert kinds == ["move", "move", "given speed", "move", "move"]
    middle = 0.5 * (phases[2].begin + phases[2].end)
    (speed,) = result.trajectory.at(middle).tool_speed
    assert speed == pytest.approx(phases[2].speed)
    assert phases[2].speed == pytest.approx(0.2)


def test_programs_with_a_free_order_are_saved_with_the_order_that_was_chosen(tmp_path):
    paths = [
        {"path": [{"line": {"by": [0.05, 0.0]}}], "path_start": [x, 0.0], "name": name}
        for x, name in ((0.3, "far"), (0.15, "near"))
    ]
    result = brachis.plan({**CYCLE, "program": paths, "order": "free"})
    result.save(tmp_path / "cycle.npz")
    loaded = brachis.Trajectory.load(tmp_path / "cycle.npz")
    assert loaded.parts == result.trajectory.parts
    assert {part.name for part in loaded.parts} == {
        "to near",
        "near",
        "to far",
        "far",
        "to the end",
    }
    assert brachis.verify_trajectory(loaded).passed
