"""``brachis place``: what it prints and writes."""

import json
import re

import pytest

import brachis
from support.movable import TASK


def test_a_faster_place_is_printed_and_written(run, write, tmp_path):
    out = tmp_path / "moved.yaml"
    command = f"place {write(TASK)} --range x=-0.2,0.2 --starts 1 --steps 1 --out {out}"
    text = run(*command.split()).out
    before, after = re.findall(r"end time (?:before|after)\W+(\S+) s", text)
    assert float(after) < float(before)
    assert f"wrote {out}" in text
    assert re.search(r"base\W+yaw\W+\S+ s/rad", text)
    assert brachis.load_task(out).frames["workpiece"].xyz[0] != 0.0
    again = run(*command.split(), code=2)
    assert "the file exists" in again.err


def test_gradients_alone(run, write):
    data = json.loads(run(f"place {write(TASK)} --gradients --json").out)
    by_figure = {
        (entry["subject"], entry["figure"]): entry["derivative"]
        for entry in data["gradients"]
    }
    assert by_figure["path", "x"] == pytest.approx(-by_figure["base", "x"], rel=1e-6)
    assert by_figure["payload", "mass"] > 0.0


def test_gradients_are_printed_with_the_end_time(run, write):
    text = run(f"place {write(TASK)} --gradients").out
    assert re.search(r"end time t_E: \d\.\d+ s", text)


def test_gradients_alone_refuse_a_file_for_another_task(run, write, tmp_path):
    file = tmp_path / "moved.yaml"
    for option in (f"--out {file}", "--range x=-0.2,0.2"):
        message = run(f"place {write(TASK)} --gradients {option}", code=2).err
        assert "cannot be used with --gradients" in message
    assert not file.exists()
