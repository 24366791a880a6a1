"""What a report says, and that it holds the motion itself."""

import dataclasses
import hashlib
import html
import re
import sys
from datetime import datetime
from pathlib import Path

import numpy as np
import pytest
import yaml
from numpy.testing import assert_allclose

import brachis
from brachis.apps.report import make_report, tables
from brachis.apps.report.figures import motion_figure
from brachis.apps.report.motion import reported_motion
from brachis.apps.report.page import _plotly
from brachis.errors import NotInstalledError
from brachis.limits import Role
from brachis.robot.from_task import robot_from_settings
from brachis.robot.plausibility import Issue
from brachis.task import task_with

from .conftest import data_of, floats

LARGEST = 3_500_000
CARRIED = yaml.safe_load("""
robot.payload: {mass: 0.5, com: [0.0, 0.0, 0.1]}
robot.mounting: {xyz: [0.0, 0.0, 1.0], rpy_deg: [0.0, 0.0, 30.0]}
""")


def test_the_verdict_the_time_and_what_limits_are_said_first(planar, planar_page):
    header = re.search(r"<header.*?</header>", planar_page.html, re.DOTALL)[0]
    assert 'class="verified"' in header
    assert "<h1>VERIFIED</h1>" in header
    assert f"{planar.t_end:.4f} s" in header
    assert re.search(
        r"Limits that are active longest: j\d torque \(\d+ % of the time\)", header
    )
    assert planar_page.verified


def test_a_branch_is_a_row_if_it_is_not_the_chart_s(planar):
    reported = reported_motion(planar)
    own = planar.trajectory.branch
    assert own
    for branch, named in ((own, own), ("chart", None), ("", None)):
        trajectory = dataclasses.replace(
            planar.trajectory, redundant_joints=(), branch=branch
        )
        motion = dataclasses.replace(reported, trajectory=trajectory)
        assert tables.figures_of_merit(motion).get("branch") == named


def test_it_is_said_where_every_limit_holds(planar, planar_page):
    for limit in planar.candidate.refined.program.limits:
        row = f"<tr><th>{limit.name}</th><td>{limit.guarantee.value}</td></tr>"
        assert (row in planar_page.html) == (limit.role is not Role.SAFEGUARD)
    assert "met at all instants" in planar_page.html


def test_style_and_program_have_nothing_that_the_template_would_fill_in():
    folder = Path(tables.__file__).parent
    for name in ("page.css", "page.js"):
        assert not re.search(r"{{|{%|{#", (folder / name).read_text())


def test_everything_is_in_the_file(planar_page):
    without_plotly = re.sub(
        r'<script type="text/plain" id="plotly">.*?</script>', "", planar_page.html
    )
    links = re.findall(r"""(?:src|href)\s*=\s*["']?([^"'\s>]{1,40})""", without_plotly)
    assert links
    assert all(link.startswith("data:image/png;base64,") for link in links)
    assert not re.search(r"url\(|@import", without_plotly)
    assert "default-src 'none'" in without_plotly
    assert planar_page.size < LARGEST
    assert len(without_plotly) < 700_000


def test_curves_are_the_motion(rail, rail_page):
    data = data_of(rail_page)["motion"]
    trajectory = rail.trajectory
    kinds = ("position", "velocity", "acceleration", "torque")
    functions = {kind: getattr(trajectory, kind) for kind in kinds}
    functions["force"] = trajectory.torque
    drawn = set()
    for trace in data["data"]:
        number = trace["yaxis"][1:]
        axis = data["layout"]["yaxis" if number == "1" else f"yaxis{number}"]
        kind, _, unit = axis["title"]["text"].partition(" (")
        name = trace["name"]
        is_limit = trace.get("meta") == "limit" or unit == "of the limit)"
        if is_limit or kind not in functions:
            continue
        assert ("rad" in unit or "Nm" in unit) == (name != "rail")
        t = np.clip(floats(trace["x"]).astype(float), 0.0, rail.t_end)
        expected = functions[kind](t)[:, trajectory.joint_names.index(name)]
        off = 2e-4 * max(1.0, np.abs(expected).max())
        assert_allclose(floats(trace["y"]), expected, atol=off)
        drawn.add((kind, name))
    assert {kind for kind, name in drawn if name == "joint_1"} == {*kinds}
    assert ("force", "rail") in drawn


def test_the_figure_has_limits_of_every_joint(weaker_page, weaker):
    traces = data_of(weaker_page)["motion"]["data"]
    levels = {
        (trace["name"], level)
        for trace in traces
        if trace.get("meta") == "limit"
        for level in floats(trace["y"]).tolist()
    }
    torques = weaker.robot.limits.torque_upper
    for name, torque in zip(weaker.joint_names, torques, strict=True):
        assert (name, float(np.float32(torque))) in levels


def test_the_timeline_shows_what_the_saturations_say(planar, planar_page):
    (heat,) = data_of(planar_page)["timeline"]["data"]
    entries = brachis.bottleneck.saturations(planar.trajectory)
    peaks = {str(entry.label): entry.peak for entry in entries if entry.peak > 0.5}
    assert heat["y"] == [*peaks][::-1]
    colours = floats(heat["z"]).max(axis=1)
    assert_allclose(colours, [*peaks.values()][::-1], atol=0.01)


def test_the_animation_is_the_motion(rail, rail_page, planar_page):
    scene = data_of(rail_page)["scene"]
    t, bones = floats(scene["t"]), floats(scene["bones"])
    assert t[0] == 0.0
    assert t[-1] == pytest.approx(rail.t_end)
    samples = rail.trajectory.at(np.clip(t.astype(float), 0.0, rail.t_end))
    assert_allclose(bones[:, -1], samples.tool_position, atol=1e-4)
    assert_allclose(floats(scene["speed"]), samples.tool_speed, atol=1e-2)
    slides = [joint["name"] for joint in scene["joints"] if joint["prismatic"]]
    assert slides == ["rail"]
    assert {len(joint["quantities"]) for joint in scene["joints"]} == {4}
    planes = [data_of(page)["scene"]["plane"] for page in (rail_page, planar_page)]
    assert planes == [None, [0, 1]]


def test_an_unverified_motion_says_which_check_fails(weaker_page):
    header = re.search(r"<header.*?</header>", weaker_page.html, re.DOTALL)[0]
    assert 'class="unverified"' in header
    assert "<h1>NOT VERIFIED: do not run</h1>" in header
    told = r"<b>torque ratio</b>: 1\.11\d* \((rail|joint_\d) at 0\.\d+ s\),\s+allowed 1\.0001"
    assert re.search(told, header)
    assert "Verification: FAILED" in weaker_page.html
    rows = re.findall(r'<tr class="(passed|failed)"><th>(.*?)</th>', weaker_page.html)
    assert rows[0] == ("failed", "torque ratio")
    assert {kind for kind, _ in rows[1:]} == {"passed"}
    assert 'class="beyond"' in weaker_page.html
    assert not weaker_page.verified
    assert "The cost of the limits is unknown" in weaker_page.html


def test_text_is_no_markup(weaker_page):
    assert "<script>weaker" not in weaker_page.html
    assert "&lt;script&gt;weaker" in weaker_page.html


def test_every_joint_is_told_with_its_posture_and_how_near_it_comes_to_its_limits(
    rail, rail_page
):
    page = rail_page.html
    rows = re.findall(
        r"<tr><th>([\w ]+?)( \*)?</th><td>(-?[\d.]+) (rad|m)</td><td>(-?[\d.]+) (?:rad|m)</td>",
        page,
    )
    assert [row[0] for row in rows] == list(rail.trajectory.joint_names)
    assert [row[0] for row in rows if row[1]] == ["rail"]
    starts, ends = ([float(row[i]) for row in rows] for i in (2, 4))
    assert_allclose(starts, rail.trajectory.position(0.0), atol=5e-5)
    assert_allclose(ends, rail.trajectory.position(rail.t_end), atol=5e-5)
    assert re.search(r"100\.0 % of\s+1500 N", page)


def test_a_saved_motion_is_verified_again_and_told_as_the_plan(
    planar, planar_page, tmp_path
):
    planar.save(tmp_path / "motion.npz")
    page = make_report(brachis.Trajectory.load(tmp_path / "motion.npz"))

    def verification(text):
        return re.search(r'<table class="checks">.*?</table>', text, re.DOTALL)[0]

    assert verification(page.html) == verification(planar_page.html)
    assert data_of(page)["scene"]["bones"] == data_of(planar_page)["scene"]["bones"]
    saves = re.findall(r"<li>[^<]* saves ", page.html)
    assert len(saves) >= 2, "the bottlenecks of a saved motion are found again"


def test_a_result_writes_its_report_with_remarks_and_what_was_left_undone(
    planar, tmp_path
):
    remark = Issue(
        "robot.limits.velocity", "looks like degrees", "120 rad/s", "1 to 60 rad/s"
    )
    result = dataclasses.replace(
        planar, warnings=(remark,), not_completed=("the knots",), interrupted=True
    )
    page = result.report(tmp_path / "motion.html")
    assert (tmp_path / "motion.html").read_text(encoding="utf-8") == page.html
    aside = re.search(r"<aside>.*?</aside>", page.html, re.DOTALL)[0]
    for words in ("looks like degrees (found 120 rad/s;", "the knots", "ended early"):
        assert words in aside
    assert len(repr(page)) < 80
    assert page._repr_html_().startswith("<iframe")


def pairs_of(page):
    """What the summary says."""
    rows = re.findall(r"<tr><th>(.*?)</th><td>(.*?)</td></tr>", page.html)
    return {name: html.unescape(value) for name, value in rows}


def test_the_summary_names_robot_path_and_payload(planar, planar_page):
    expected = {
        "robot": "scara3 (robot.urdf)",
        "path": "line (length 1, angle deg 90); the tool moves 1.000 m in all; prescribed: x, y",
        "payload": "none",
        "tool offset": "none",
        "mounting": "at the world's origin, upright",
    }
    pairs = pairs_of(planar_page)
    assert pairs | expected == pairs
    today = datetime.now().astimezone().strftime("%Y-")
    assert pairs["report of"].startswith(today)
    assert f"brachis {brachis.__version__}" in planar_page.html
    task = brachis.load_task(planar.task.to_dict(), changes=CARRIED)
    robot = robot_from_settings(task.robot)
    moved = dataclasses.replace(planar.trajectory, robot=robot, task=task)
    pairs = tables.identity(reported_motion(moved))
    assert pairs["payload"] == "0.5 kg at [0, 0, 0.1] m in the tool frame, a point mass"
    assert pairs["mounting"] == "at [0, 0, 1] m, roll, pitch, yaw [0, 0, 30] deg"


def test_hashes_are_those_of_the_urdf_and_of_the_task_in_the_page(planar, planar_page):
    pairs = pairs_of(planar_page)
    urdf = Path(planar.task.robot.urdf).read_bytes()
    text = re.search(r"<pre>(.*?)</pre>", planar_page.html, re.DOTALL)[1]
    task = html.unescape(text).encode()
    assert b"angle_deg: 90" in task
    for name, content in (("URDF", urdf), ("task as it stands below", task)):
        assert pairs[f"SHA-256 of the {name}"] == hashlib.sha256(content).hexdigest()


def test_no_path_of_this_machine_is_in_it(planar, planar_page):
    folder = Path(planar.task.robot.urdf).parent
    assert folder.is_absolute()
    assert str(folder) not in planar_page.html
    assert "urdf: robot.urdf" in planar_page.html
    robot = planar.task.robot.model_copy(update={"urdf": r"C:\cells\arm.urdf"})
    task = planar.task.model_copy(update={"robot": robot})
    assert "urdf: arm.urdf" in tables.task_text(task)


def test_paths_of_many_segments_are_told_in_short():
    points = [[0.01 * i, 0.02 * i] for i in range(1, 30)]
    first = brachis.Line(by=[0.1, 0.0]) + brachis.Spline(through=points)
    path = [*first, *[brachis.Line(by=[0.0, 0.1])] * 7]
    task = task_with(start=[0.0], task_space=["x", "y"], path=path)
    text = tables.describe_path(task)
    assert text.startswith("line (by [0.1, 0]), then spline (through 29 entries), then")
    assert text.endswith(", and 3 more")


def test_angles_may_be_in_degrees_and_lengths_stay(rail):
    reported = reported_motion(rail.trajectory, degrees=True)
    rows = {row["name"]: row for row in tables.joint_rows(reported)}
    q = rail.trajectory.q
    assert rows["rail"]["start"] == f"{q[0, 0]:.4f} m"
    assert rows["joint_1"]["start"] == f"{np.rad2deg(q[0, 1]):.4f} deg"
    units = {row["found"].partition(" ")[2] for row in tables.check_rows(reported)}
    assert not any("rad" in unit for unit in units - {"m, rad"})
    units = [row["value"].split()[1] for row in rows["joint_1"]["peaks"]]
    assert units == ["deg", "deg/s", "deg/s²", "Nm"]
    layout = motion_figure(reported)["layout"]
    axes = [axis for name, axis in layout.items() if name.startswith("yaxis")]
    titles = {axis["title"]["text"] for axis in axes}
    assert {"position (deg)", "position (m)", "velocity (deg/s)", "force (N)"} < titles


@pytest.mark.parametrize(
    "module, name", [("jinja2", "Jinja2"), ("plotly.offline", "Plotly")]
)
def test_the_error_names_the_package_to_install(module, name, planar, monkeypatch):
    _plotly.cache_clear()
    monkeypatch.setitem(sys.modules, module, None)
    with pytest.raises(
        NotInstalledError, match=rf"{name}, which is not installed.*whl\[report\]"
    ):
        make_report(planar)
