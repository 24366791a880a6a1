"""``brachis report``."""

import dataclasses

import brachis
from support.effort import QUICK

from .conftest import ROOT


def save_motion(folder, torque=None):
    """Save a motion of the example, on drives with other limits than it was planned for."""
    task = brachis.load_task(ROOT / "examples/01_scara_line.yaml").to_dict()
    quick = {**task, "spline": {**task["spline"], "intervals": 6}, "search": QUICK}
    trajectory = brachis.plan(quick).trajectory
    if torque is not None:
        settings = trajectory.task.robot
        limits = dataclasses.replace(settings.limits, torque=torque)
        robot = settings.model_copy(update={"limits": limits})
        trajectory = dataclasses.replace(
            trajectory, task=trajectory.task.model_copy(update={"robot": robot})
        )
    trajectory.save(folder / "motion.npz")
    return folder / "motion.npz"


def test_a_report_lies_beside_its_motion_and_keeps_to_its_own_files(run, tmp_path):
    result, page = save_motion(tmp_path), tmp_path / "motion.html"
    page.write_text(
        "<!doctype html>\n<!-- brachis report -->\nan older one", encoding="utf-8"
    )
    outcome = run(f"report {result} --title 'the first line'")
    assert outcome.code == 0, outcome.err
    assert str(page) in outcome.out
    assert "MB" in outcome.out
    assert "the first line" in page.read_text(encoding="utf-8")
    page.write_text("<!doctype html><p>somebody else's", encoding="utf-8")
    refused = run(f"report {result}")
    assert refused.code == 2
    assert "of another kind than the new one" in refused.err
    assert page.read_text(encoding="utf-8") == "<!doctype html><p>somebody else's"


def test_an_unverified_motion_is_reported_with_its_exit_code(run, tmp_path):
    outcome = run(
        "report", save_motion(tmp_path, torque=9.0), "--out", tmp_path / "bad.html"
    )
    assert outcome.code == 1
    assert "did not pass" in outcome.err
    assert "NOT VERIFIED" in (tmp_path / "bad.html").read_text(encoding="utf-8")
