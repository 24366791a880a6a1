"""``brachis export`` in its formats, and the schema of exported JSON."""

import json

import jsonschema
import pytest

import brachis


@pytest.fixture(scope="module")
def saved(tmp_path_factory):
    path = tmp_path_factory.mktemp("saved") / "result.npz"
    brachis.plan(
        brachis.examples.scara_line,
        redundant_joints=["j1"],
        effort="single",
        intervals=6,
    ).trajectory.save(path)
    return path


def test_the_suffix_says_the_format_unless_it_is_named(run, saved, tmp_path):
    assert run("export", saved, "--out", tmp_path / "motion.parquet").code == 0
    assert (tmp_path / "motion.parquet").read_bytes().startswith(b"PAR1")
    for _ in range(2):  # over the file of before, too
        outcome = run("export", saved, "--out", tmp_path / "motion.yaml", "--dt", 0.1)
        assert outcome.code == 0, outcome.err
    assert (
        run(
            "export",
            saved,
            "--out",
            tmp_path / "motion.txt",
            "--format",
            "ros2",
            "--dt",
            0.1,
        ).code
        == 0
    )
    assert (tmp_path / "motion.txt").read_bytes() == (
        tmp_path / "motion.yaml"
    ).read_bytes()
    outcome = run("export", saved, "--out", tmp_path / "motion.dat")
    assert outcome.code == 2
    assert (
        "the suffix of the file is not that of a known format; found suffix .dat; allowed: .csv, .parquet"
        in outcome.err
    )
    (tmp_path / "task.yaml").write_text("brachis: 1")
    outcome = run("export", saved, "--out", tmp_path / "task.yaml")
    assert (outcome.code, (tmp_path / "task.yaml").read_text()) == (2, "brachis: 1")


def test_some_joints(run, saved, tmp_path):
    assert (
        run(
            "export",
            saved,
            "--out",
            tmp_path / "motion.csv",
            "--dt",
            0.5,
            "--joints",
            "j3, j1",
        ).code
        == 0
    )
    first, header = (tmp_path / "motion.csv").read_text().splitlines()[:2]
    assert header.startswith("t,q_j3,q_j1,qd_j3")
    assert first.startswith("# brachis: joint j2 moves by ")
    outcome = run(
        "export",
        saved,
        "--out",
        tmp_path / "motion.csv",
        "--dt",
        0.5,
        "--joints",
        "j3, j1",
    )
    assert outcome.code == 0  # over a file of its own
    assert "brachis: warning: joint j2 moves by " in outcome.err
    outcome = run("export", saved, "--out", tmp_path / "motion.csv", "--joints", "j4")
    assert outcome.code == 2
    assert "there is no joint named 'j4'" in outcome.err
    outcome = run("export", saved, "--out", tmp_path / "motion.script")
    assert outcome.code == 2
    assert "servoj takes the angles of six joints" in outcome.err


def test_json_fulfils_the_schema_that_is_printed(run, saved, tmp_path):
    assert (
        run("export", saved, "--out", tmp_path / "motion.json", "--dt", 0.1).code == 0
    )
    schema = json.loads(run("schema", "--of", "trajectory").out)
    content = json.loads((tmp_path / "motion.json").read_text())
    jsonschema.validate(content, schema)
    assert content["$schema"] == schema["$id"]
    outcome = run("schema", "--of", "tasks")
    assert outcome.code == 2
    assert "Did you mean 'task'?" in outcome.err
