import math
import socket
import sys
import threading
from types import SimpleNamespace
from unittest.mock import ANY

import numpy as np
import pytest

import brachis
from brachis.apps.plots.panels import panels_of
from brachis.apps.view import Viewer
from brachis.apps.view.bodies import placements, prescribed_path
from brachis.apps.view.tables import candidates_table, state_table, summary
from brachis.robot import Robot
from support.effort import QUICK
from support.shown import PANDA

pytest.importorskip("viser", reason="viser is not installed")


@pytest.fixture
def shown(line_result):
    candidates = [candidate.to_dict() for candidate in line_result.candidates]
    with Viewer(line_result.trajectory, candidates, verified=True, port=0) as viewer:
        yield viewer


def poses(viewer):
    return np.array([[*frame.position, *frame.wxyz] for frame in viewer._scene._frames])


def test_the_robot_is_where_the_motion_has_it_at_the_chosen_instant(shown, line_result):
    motion = line_result.trajectory
    before = poses(shown)
    shown.playback.go_to(0.6 * motion.t_end)
    shown.show()
    placed = placements(motion.robot, motion.position(0.6 * motion.t_end)[None])
    expected = np.concatenate(placed, axis=2)[0]
    np.testing.assert_allclose(poses(shown), expected, atol=1e-6)
    assert np.abs(poses(shown) - before).max() > 0.1
    assert shown._slider.value == pytest.approx(0.6 * motion.t_end, abs=0.01)


def test_plots_and_table_follow_the_slider(shown, line_result):
    motion = line_result.trajectory
    shown.playback.go_to(0.25 * motion.t_end)
    shown.show()
    assert len(shown._lines) > 2
    for line in shown._lines:
        assert 'data-part="0.25000"' in line.content
    text = f"t = {0.25 * motion.t_end:.4f} s of {motion.t_end:.4f} s"
    assert text in shown._state.content


def test_what_holds_the_motion_back_is_shown_without_a_solve(line_result, monkeypatch):
    def refuse(*_given, **_keys):
        raise AssertionError("solved again")

    module = sys.modules["brachis.apps.bottleneck.report"]
    monkeypatch.setattr(module, "plan_again", refuse)
    unknown = "the cost of the limits is unknown"
    known = "more torque at j1"
    for motion, text in (
        (line_result.explained_trajectory, known),
        (line_result.trajectory, unknown),
    ):
        with Viewer(motion, port=0) as viewer:
            shown = [handle for handle in contents(viewer) if text in handle]
            assert len(shown) == 1
            assert "torque limit for" in shown[0]


def contents(viewer):
    """Return what the viewer's pages say, as HTML."""
    messages = viewer._server._websock_server._broadcast_buffer.message_from_id
    parts = [getattr(message, "props", None) for message in messages.values()]
    return [part.content for part in parts if hasattr(part, "content")]


def test_path_and_trace_are_one_curve_and_every_layer_can_be_hidden(shown):
    samples = shown._scene.samples
    path = prescribed_path(shown._trajectory, samples)
    np.testing.assert_allclose(path, samples.tool_position, atol=1e-8)
    assert len(shown._scene.layers) == 8
    for name in shown._scene.layers:
        assert shown._scene.layers[name]
        shown._scene.set_visible(name, visible=False)
        assert not any(handle.visible for handle in shown._scene.layers[name])


def test_the_motion_is_not_played_while_nobody_looks(shown):
    assert shown.playback.playing
    assert shown.playback.time == 0.0


def test_a_stopped_viewer_leaves_its_port_and_no_thread(line_result):
    with line_result.view(port=0, block=False) as viewer:
        port = int(viewer.url.rpartition(":")[2])
        assert viewer.url.startswith("http://127.0.0.1:")
        assert viewer.url in viewer._repr_html_()
        assert "brachis viewer" in {thread.name for thread in threading.enumerate()}
    assert "brachis viewer" not in {thread.name for thread in threading.enumerate()}
    with socket.socket() as trial:
        assert trial.connect_ex(("127.0.0.1", port)) != 0


def test_a_script_waits_and_a_notebook_does_not(line_result, monkeypatch):
    waited = []
    monkeypatch.setattr(Viewer, "wait", lambda self: waited.append(self.stop()))
    brachis.view(line_result.trajectory, port=0)
    assert len(waited) == 1
    monkeypatch.setattr(sys, "ps1", ">>> ", raising=False)
    brachis.view(line_result.trajectory, port=0).stop()
    assert len(waited) == 1


def test_robots_without_shapes_and_with_lost_meshes_are_shown_as_skeletons(
    bare_robot, motion_of
):
    robots = [bare_robot]
    if PANDA.exists():
        text = PANDA.read_text().replace("package://", "package://no")
        robots.append(
            Robot.from_urdf(
                "/nowhere/panda.urdf", urdf_text=text, tool_frame="panda_hand_tcp"
            )
        )
    for robot in robots:
        with Viewer(motion_of(robot), port=0) as viewer:
            layers = viewer._scene.layers
            assert all(handle.visible for handle in layers["skeleton"])
            assert not any(handle.visible for handle in layers["robot"])
            assert layers["ghost postures"]


def test_angles_may_be_in_degrees(bare_robot, motion_of):
    motion = motion_of(bare_robot)
    now = motion.at(np.array([0.5]))
    table = state_table(motion, now, degrees=True)
    assert f"{np.rad2deg(now.q[0, 1]):.3f} deg</td>" in table
    assert f"{np.rad2deg(now.qdot[0, 1]):.3f} deg/s</td>" in table
    assert f"{now.q[0, 0]:.3f} m</td>" in table
    with Viewer(motion, degrees=True, port=0) as viewer:
        viewer.show()
        assert " deg/s</td>" in viewer._state.content


def test_the_report_button_sends_the_page_to_whoever_asks(
    shown, line_result, monkeypatch
):
    sent, told = {}, []

    class Client:
        def send_file_download(self, name, content, *, save_immediately):
            sent[name] = (content.decode(), save_immediately)

        def add_notification(self, title, body):
            told.append((title, body))

    shown._send_report(SimpleNamespace(client=Client()))
    page, at_once = sent["report.html"]
    assert at_once
    assert "<h1>VERIFIED</h1>" in page
    assert f"{line_result.t_end:.4f} s" in page
    monkeypatch.setitem(sys.modules, "jinja2", None)
    shown._send_report(SimpleNamespace(client=Client()))
    assert told == [("The report cannot be made", ANY)]
    assert "Jinja2" in told[0][1]


def test_tables_have_units_and_escape_names(bare_robot, motion_of):
    motion = motion_of(bare_robot)
    now = motion.at(np.array([0.5]))
    table = state_table(motion, now)
    assert f" m, {now.tool_speed[0]:.3f} m/s" in table
    for unit in ("m/s", "rad/s", "N", "Nm"):
        assert f" {unit}</td>" in table
    known = {
        "redundant_joints": ["<b>"],
        "branch": "up",
        "origin": "lattice 1",
        "status": "verified",
    }
    unknown = known | {"estimate": None, "t_end": None}
    text = candidates_table([known | {"estimate": 1.5, "t_end": math.inf}, unknown])
    for words in ("&lt;b&gt;", "1.5000", "estimate [s]"):
        assert words in text
    assert "inf" not in text
    assert "result.json" in candidates_table([])
    assert "40 more" in candidates_table([known] * 100)


def test_the_panel_says_the_verdict_of_the_verification(line_result):
    assert ", verified" in summary(line_result.trajectory, (), verified=True)
    assert "NOT verified" in summary(line_result.trajectory, (), verified=False)
    told = summary(line_result.trajectory, ["not shown: a: no file <x>"], verified=None)
    assert "erified" not in told
    assert "no file &lt;x&gt;" in told


def test_a_line_joins_the_closest_bodies_and_a_panel_shows_their_distance():
    ball = brachis.Sphere(0.05, position=[0.9, 0.4, 0.0], name="ball")
    task = brachis.load_task(brachis.examples.scara_line, changes={"scene": [ball]})
    motion = brachis.plan(task, **QUICK, intervals=8, strict=False).trajectory
    samples = motion.at(np.linspace(0.0, motion.t_end, 21))
    (panel,) = panels_of(motion, samples, "clearance")
    (curve,) = panel.curves
    assert curve.lower == task.collisions.clearance
    with Viewer(motion, port=0) as viewer:
        for k in (0, 10, 20):
            viewer.playback.time = float(samples.t[k])
            viewer.show()
            line, label = viewer._scene.layers["closest pair"]
            apart = float(np.linalg.norm(line.points[0, 1] - line.points[0, 0]))
            assert apart == pytest.approx(curve.values[k], abs=1e-6)
            assert label.text.endswith(f"{1e3 * apart:.1f} mm")
