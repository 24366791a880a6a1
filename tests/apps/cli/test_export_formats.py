"""``brachis export`` in its formats, and the schema of exported JSON."""

import json

import brachis


def test_the_suffix_says_the_format_unless_an_option_does(run, result, tmp_path):
    for name, *options in (
        ("motion.parquet",),
        ("motion.yaml",),
        ("motion.yaml",),  # over the file of before, too
        ("motion.txt", "--format", "ros2"),
    ):
        out = tmp_path / name
        outcome = run("export", result, "--out", out, "--dt", 0.1, *options)
        assert outcome.code == 0, outcome.err
    assert (tmp_path / "motion.parquet").read_bytes().startswith(b"PAR1")
    texts = [(tmp_path / f"motion.{suffix}").read_bytes() for suffix in ("txt", "yaml")]
    assert texts[0] == texts[1]
    outcome = run(f"export {result} --out {tmp_path / 'motion.dat'}")
    assert outcome.code == 2
    assert "found suffix .dat; allowed: .csv, .parquet" in outcome.err


def test_some_joints(run, result, tmp_path):
    file = tmp_path / "motion.csv"
    for _ in range(2):  # over a file of its own, too
        outcome = run(f"export {result} --out {file} --dt 0.5 --joints 'j3, j1'")
        assert outcome.code == 0
        assert "brachis: warning: joint j2 moves by " in outcome.err
    remark, header = file.read_text().splitlines()[:2]
    assert header.startswith("t,q_j3,q_j1,qd_j3")
    assert remark.startswith("# brachis: joint j2 moves by ")
    outcome = run(f"export {result} --out {tmp_path / 'motion.script'}")
    assert outcome.code == 2
    assert "servoj takes the angles of six joints" in outcome.err


def test_schemas_of_tasks_and_of_trajectories(run):
    schema = json.loads(run("schema --of trajectory").out)
    assert schema == json.loads(json.dumps(brachis.export.samples_schema()))
    outcome = run("schema --of tasks")
    assert outcome.code == 2
    assert "Did you mean 'task'?" in outcome.err
