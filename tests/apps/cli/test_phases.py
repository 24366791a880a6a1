"""A plan of several phases prints them and has them in its JSON; one of a single phase says nothing of phases."""

import json

import pytest

from .conftest import quick_task


@pytest.fixture
def stopping():
    """A task that waits at a corner."""
    path = [{"line": {"by": [0.2, 0.0]}, "dwell": 0.3}, {"line": {"by": [0.0, 0.2]}}]
    return {**quick_task(), "path": path}


def test_a_plan_prints_its_phases_and_has_them_in_its_json(
    run, write, stopping, tmp_path
):
    outcome = run(f"plan {write(stopping)} --out {tmp_path / 'out'} --no-figures")
    table = outcome.out.split("phases")[1]
    (row,) = [line for line in table.splitlines() if " dwell " in line]
    assert "at rest" in row
    assert "0.3000 s" in row
    assert "1 move" in table
    data = json.loads((tmp_path / "out/result.json").read_text())
    phases = data["phases"]
    assert [phase["kind"] for phase in phases] == ["move", "dwell", "move"]
    assert phases[1]["s"] == [0.5, 0.5]
    assert phases[1]["end"] - phases[1]["begin"] == pytest.approx(0.3)
    assert phases[-1]["end"] == data["t_end"]


def test_a_plan_lists_no_single_phase(run, write):
    assert "phases" not in run(f"plan {write(quick_task())}").out


def test_the_bottleneck_report_has_the_phases(run, write, stopping):
    assert "phase 2 dwell, s = 0.5" in run(f"bottleneck {write(stopping)}").out
