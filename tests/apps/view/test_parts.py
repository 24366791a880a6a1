"""The viewer of a program: a list of parts and events to go to, and the paths of all parts."""

from types import SimpleNamespace

import numpy as np
import pytest

import brachis
from brachis.apps.view import Viewer
from brachis.apps.view.bodies import prescribed_path
from brachis.apps.view.tables import state_table
from support.cycle import CYCLE

pytest.importorskip("viser", reason="viser is not installed")


@pytest.fixture
def shown(cycle):
    with Viewer(cycle.trajectory, verified=True, port=0) as viewer:
        yield viewer


def choices_of(viewer):
    """The entries of the list of parts."""
    (choice,) = [
        handle
        for handle in viewer._gui._gui_input_handle_from_uuid.values()
        if getattr(handle, "label", "") == "go to"
    ]
    return choice


def test_parts_and_events_are_listed_with_their_times(shown, cycle):
    motion = cycle.trajectory
    parts = [f"{part.name} ({part.begin:.3f} s)" for part in motion.parts]
    events = [f"event {event}" for event in motion.events]
    assert list(choices_of(shown).options) == parts + events


@pytest.mark.parametrize("number", [1, 3, 4])
def test_a_choice_shows_its_instant_and_pauses(shown, cycle, number):
    motion = cycle.trajectory
    times = [part.begin for part in motion.parts]
    times += [event.time for event in motion.events]
    choice = choices_of(shown)
    listed = dict(zip(choice.options, times, strict=True))
    target = SimpleNamespace(value=choice.options[number])
    shown._go_to(listed, SimpleNamespace(target=target))
    assert shown.playback.time == times[number]
    assert not shown.playback.playing
    now = motion.at(np.array([times[number]]))
    assert shown._state.content == state_table(motion, now)


def test_bodies_appear_and_disappear_with_the_parts():
    bodies = [
        {"name": "lasting", "sphere": 0.02, "position": [3, 0, 0]},
        {"name": "early", "sphere": 0.02, "position": [3, 1, 0], "until": "bead"},
        {"name": "late", "sphere": 0.02, "position": [3, 2, 0], "since": "payload 1"},
    ]
    collisions = {"mode": "check", "capsules": "auto"}
    result = brachis.plan({**CYCLE, "scene": bodies, "collisions": collisions})
    motion = result.trajectory
    _, bead, dwell, _ = motion.parts
    with Viewer(motion, verified=True, port=0) as viewer:
        handles = [handle for _, handle in viewer._scene._passing]
        for t, shown in (
            (0.0, [True, False]),
            (bead.begin, [False, False]),
            (dwell.end - 1e-6, [False, False]),
            (dwell.end, [False, True]),
            (motion.t_end, [False, True]),
        ):
            viewer._scene.show(t)
            assert [handle.visible for handle in handles] == shown


def test_a_motion_without_parts_has_no_list(line_trajectory):
    with Viewer(line_trajectory, port=0) as viewer:
        labels = [
            getattr(handle, "label", "")
            for handle in viewer._gui._gui_input_handle_from_uuid.values()
        ]
    assert "speed" in labels
    assert "go to" not in labels


def test_paths_of_all_parts_are_drawn_where_the_tool_is(cycle):
    motion = cycle.trajectory
    samples = motion.at(np.linspace(0.0, motion.t_end, 200))
    path = prescribed_path(motion, samples)
    np.testing.assert_allclose(path, samples.tool_position, atol=1e-9)
    assert not np.array_equal(path, samples.tool_position)  # but not taken from it
