"""``brachis report``."""

import dataclasses

import brachis


def test_a_report_lies_beside_its_motion_and_keeps_to_its_own_files(
    run, error_of, planned, tmp_path
):
    result = planned.copied(tmp_path / "out") / "result.npz"
    page = result.with_suffix(".html")
    page.write_text(
        "<!doctype html>\n<!-- brachis report -->\nan older one", encoding="utf-8"
    )
    outcome = run(f"report {result} --title 'the first line'")
    assert str(page) in outcome.out
    assert "MB" in outcome.out
    assert "the first line" in page.read_text(encoding="utf-8")
    page.write_text("<!doctype html><p>somebody else's", encoding="utf-8")
    assert "of a different kind than the new one" in error_of(f"report {result}")
    assert page.read_text(encoding="utf-8") == "<!doctype html><p>somebody else's"


def test_an_unverified_motion_is_reported_with_its_exit_code(run, result, tmp_path):
    """On drives that are weaker than those that it was planned for."""
    trajectory = brachis.Trajectory.load(result)
    settings = trajectory.task.robot
    limits = dataclasses.replace(settings.limits, torque=9.0)
    robot = settings.model_copy(update={"limits": limits})
    task = trajectory.task.model_copy(update={"robot": robot})
    weak = dataclasses.replace(trajectory, task=task)
    weak.save(tmp_path / "motion.npz")
    assert (
        "did not pass"
        in run(
            f"report {tmp_path / 'motion.npz'} --out {tmp_path / 'bad.html'}", code=1
        ).err
    )
    assert "NOT VERIFIED" in (tmp_path / "bad.html").read_text(encoding="utf-8")
