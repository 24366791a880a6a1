"""``brachis sweep``, with plans that cost nothing."""

import pytest
import yaml

from brachis.apps.sweeps import run as sweeps_run
from brachis.apps.sweeps.plans import PlanOutcome

REASON = "out of reach"


@pytest.fixture
def sweep_file(tmp_path, write, task, monkeypatch):
    """A file of four plans, of which the fourth fails; end times are made up."""

    def pool(plans):
        for plan in plans:
            length = plan.task.path[0].line.length
            if length > 3.0:
                facts = {"status": "failed", "error": "PathError", "message": REASON}
            else:
                times = {"t_end_s": length / 2.0, "wall_time_s": 40.0}
                facts = {"status": "verified", **times}
            yield plan, PlanOutcome(facts)

    monkeypatch.setattr(sweeps_run, "pool_for", lambda *_settings: pool)
    content = {
        "sweep": 1,
        "task": str(write(task)),
        "grid": {"path.0.line.length": [1.0, 2.0, 3.0, 4.0]},
    }
    path = tmp_path / "lengths.yaml"
    path.write_text(yaml.safe_dump(content))
    return path


def test_a_sweep_shows_its_results(run, sweep_file, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    done = run(f"sweep {sweep_file} --verbose")
    lines = done.out.splitlines()
    rows = [" ".join(line.split()) for line in lines if line.startswith("│")]
    assert rows == [
        "│ plans │ 4 │",
        "│ verified │ 3 │",
        "│ unverified │ 0 │",
        "│ failed │ 1 │",
        "│ best │ plan: 0, path.0.line.length: 1, t_end_s: 0.5 │",
        "│ median │ plan: 1, path.0.line.length: 2, t_end_s: 1 │",
        "│ worst │ plan: 2, path.0.line.length: 3, t_end_s: 1.5 │",
        "│ wall_time_s │ 120 │",
    ]
    assert "1 failed with PathError, for example: out of reach" in lines
    for name in ("table.parquet", "table.csv", "sweep.png"):
        assert f"wrote lengths/{name}" in lines
    assert (tmp_path / "lengths/sweep.png").read_bytes().startswith(b"\x89PNG")
    assert " s: 0 of 4 plans\n" in done.err
    assert "4 of 4 plans, 1 failed; 0:00:00 left" in done.err


def test_a_sweep_as_json(run, sweep_file, tmp_path):
    outcome = run(f"sweep {sweep_file} --out {tmp_path / 'out'} --json")
    data = outcome.data
    assert (data["plans"], data["verified"], data["failed"]) == (4, 3, 1)
    assert data["best"] == {"plan": 0, "path.0.line.length": 1.0, "t_end_s": 0.5}
    assert data["failures"] == {"PathError": {"plans": 1, "message": "out of reach"}}
    assert len(data["files"]) == 3


def test_no_verified_plan_is_exit_code_1(run, sweep_file, tmp_path):
    content = yaml.safe_load(sweep_file.read_text())
    content["grid"]["path.0.line.length"] = [4.0, 5.0]
    sweep_file.write_text(yaml.safe_dump(content))
    assert (
        "2 failed with PathError"
        in run(f"sweep {sweep_file} --out {tmp_path / 'out'}", code=1).out
    )
    assert not (tmp_path / "out/sweep.png").exists()


def test_parts_of_a_sweep_give_one_table_by_merge(run, error_of, sweep_file, tmp_path):
    out = tmp_path / "out"
    assert "│ plans       │ 2 " in run(f"sweep {sweep_file} --part 1/2 --out {out}").out
    assert "found no result for 2 plans: 1, 3" in error_of(
        f"sweep {sweep_file} --merge --out {out}"
    )
    run(f"sweep {sweep_file} --part 2/2 --out {out}")
    assert not (out / "sweep.png").exists()
    run(f"sweep {sweep_file} --merge --out {out}")
    assert (out / "sweep.png").exists()
