"""Exported files name the parts and events of a program."""

import json

import jsonschema
import pytest
import yaml

from brachis import export
from support.cycle import NAMES


def test_json_has_parts_and_events(cycle, tmp_path):
    export.write(cycle, tmp_path / "cycle.json", dt=0.05)
    content = json.loads((tmp_path / "cycle.json").read_text())
    jsonschema.validate(content, export.samples_schema())
    motion = cycle.trajectory
    assert [part["name"] for part in content["parts"]] == NAMES
    assert content["parts"][1]["begin"] == motion.parts[1].begin
    assert content["events"] == [vars(event) for event in motion.events]
    content["parts"][0]["kind"] = "dance"
    with pytest.raises(jsonschema.ValidationError):
        jsonschema.validate(content, export.samples_schema())


def test_other_motions_have_no_such_entries(line_trajectory, tmp_path):
    export.write(line_trajectory, tmp_path / "line.json", dt=0.05)
    assert {"parts", "events"}.isdisjoint(
        json.loads((tmp_path / "line.json").read_text())
    )


def test_tables_have_comments_with_parts_and_events(cycle, tmp_path):
    export.write(cycle, tmp_path / "cycle.csv", dt=0.05)
    lines = (tmp_path / "cycle.csv").read_text().splitlines()
    comments = [line for line in lines if line.startswith("# brachis: ")]
    assert len(comments) == 6
    motion = cycle.trajectory
    bead = motion.parts[1]
    assert (
        comments[1]
        == f"# brachis: part bead (path): {bead.begin:.6f} to {bead.end:.6f} s"
    )
    assert comments[4] == f"# brachis: event process_on: {motion.events[0].time:.6f} s"
    assert lines[6].startswith("t,q_x_axis")
    export.write(cycle, tmp_path / "cycle.csv", dt=0.05)  # it may be replaced


def test_messages_keep_their_form(cycle, tmp_path):
    export.write(cycle, tmp_path / "cycle.yaml", dt=0.05)
    text = (tmp_path / "cycle.yaml").read_text()
    assert "# event process_off: " in text
    assert set(yaml.safe_load(text)) == {"header", "joint_names", "points"}


def test_parquet_has_them_as_metadata(cycle, tmp_path):
    parquet = pytest.importorskip("pyarrow.parquet")
    export.write(cycle, tmp_path / "cycle.parquet", dt=0.05)
    metadata = parquet.read_schema(tmp_path / "cycle.parquet").metadata[b"brachis"]
    assert [part["name"] for part in json.loads(metadata)["parts"]] == NAMES
