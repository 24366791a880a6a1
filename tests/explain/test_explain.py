"""What a plan says of itself: no solve, one row a cause, process speeds and waits among them."""

from dataclasses import replace
from pathlib import Path

import pytest

import brachis

ROOT = Path(__file__).parents[2]
STEP = 0.01


@pytest.fixture(scope="module")
def seams():
    """Two seams at given speeds, with a wait of half a second at the corner."""
    return brachis.plan(ROOT / "examples/13_weld_seams.yaml")


def test_a_saved_plan_is_explained_without_a_solve(seams, tmp_path):
    seams.save(tmp_path / "result.npz")
    lines = []
    saved = brachis.bottleneck.report(tmp_path / "result.npz", listener=lines.append)
    assert saved.sensitivities == seams.bottleneck().sensitivities
    assert saved.sensitivities.reliable
    assert not [line for line in lines if "again" in line]


def faster(task, speed):
    """Return a task with one of its process speeds higher by `STEP`."""
    parts = tuple(
        part.model_copy(update={"speed": (1.0 + STEP) * part.speed})
        if part.speed == speed
        else part
        for part in task.tool_limits.process_speed
    )
    limits = task.tool_limits.model_copy(update={"process_speed": parts})
    return task.model_copy(update={"tool_limits": limits})


@pytest.mark.parametrize("speed", [0.1, 0.2])
def test_a_higher_process_speed_saves_what_its_row_says(seams, speed):
    entry = seams.sensitivities.of("tool", f"process speed of {speed} m/s")
    again = brachis.plan(faster(seams.task, speed), start_from=seams)
    assert entry.change(STEP) == pytest.approx(again.t_end - seams.t_end, rel=0.05)
    assert entry.change(STEP) < -1e-3


def test_waits_and_speeds_have_their_rows(seams):
    wait = seams.sensitivities.task[0]
    assert wait.saved == 0.5
    lines = str(seams.bottleneck()).splitlines()
    assert lines[0] == "without the dwell at s = 0.6025 saves 13 % (500 ms)"
    assert lines[1].startswith("a process speed of 0.22 m/s in place of 0.2 m/s saves")


def test_phases_and_motion_have_the_share_of_their_process_speed(seams):
    found = seams.bottleneck()
    given = [each for each in found.phases if each.phase.speed]
    assert [each.phase.speed for each in given] == [0.2, 0.1]
    for each in given:
        (label, share) = each.shares[0]
        assert str(label) == f"tool process speed of {each.phase.speed} m/s"
        assert share == pytest.approx(1.0)
    part = 100.0 * given[0].phase.duration / seams.t_end
    text = "the tool is held at its process speed of 0.2 m/s"
    assert f"{text} for {part:.1f} % of the time, once" in str(found)
    shares = {each["kind"]: each["share"] for each in found.to_dict()["saturations"]}
    assert shares["process speed of 0.2 m/s"] == pytest.approx(part / 100.0, rel=1e-3)


def test_a_cause_has_one_row(seams):
    entries = seams.sensitivities.limits
    rows = [(entry.label, entry.side) for entry in entries]
    assert len(set(rows)) == len(rows)
    assert not [entry for entry in entries if "next to" in entry.label.kind]


def test_a_check_leaves_process_speeds_out(seams):
    checked = brachis.bottleneck.check_sensitivities(
        seams.candidate.optimum, seams.sensitivities
    )
    kinds = {entry.sensitivity.label.kind for entry in checked.entries}
    assert kinds
    assert not [kind for kind in kinds if "process speed" in kind]


def test_a_broken_sensitivity_is_an_error(seams, tmp_path):
    broken = replace(seams.sensitivities, residual="much")
    replace(seams.trajectory, sensitivities=broken).save(tmp_path / "result.npz")
    with pytest.raises(brachis.errors.ResultFileError, match="broken") as caught:
        brachis.Trajectory.load(tmp_path / "result.npz")
    assert "residual" in str(caught.value)


def test_a_path_of_joints_is_explained_by_its_timings():
    result = brachis.plan(
        "scara3",
        task_space="joints",
        start=[0.5, -2.0, 2.0],
        path=[{"spline": {"through": [[0.7, -1.5, 1.8], [0.9, -1.2, 1.4]]}}],
    )
    assert result.sensitivities.limits[0].change(0.1) < -1e-3
