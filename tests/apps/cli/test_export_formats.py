"""``brachis export`` in its formats, and the schema of exported JSON."""

import json

import brachis


def test_the_suffix_says_the_format_unless_an_option_does(
    run, error_of, result, tmp_path
):
    for name, *options in (
        ("motion.parquet",),
        ("motion.yaml",),
        ("motion.yaml",),  # over the file of before, too
        ("motion.txt", "--format", "ros2"),
    ):
        out = tmp_path / name
        run("export", result, "--out", out, "--dt", 0.1, *options)
    assert (tmp_path / "motion.parquet").read_bytes().startswith(b"PAR1")
    texts = [(tmp_path / f"motion.{suffix}").read_bytes() for suffix in ("txt", "yaml")]
    assert texts[0] == texts[1]
    assert "found suffix .dat; allowed: .csv, .parquet" in error_of(
        f"export {result} --out {tmp_path / 'motion.dat'}"
    )


def test_some_joints(run, error_of, result, tmp_path):
    file = tmp_path / "motion.csv"
    for _ in range(2):  # over a file of its own, too
        assert (
            "brachis: warning: joint j2 moves by "
            in run(f"export {result} --out {file} --dt 0.5 --joints 'j3, j1'").err
        )
    remark, header = file.read_text().splitlines()[:2]
    assert header.startswith("t,q_j3,q_j1,qd_j3")
    assert remark.startswith("# brachis: joint j2 moves by ")
    assert "servoj needs the angles of six joints" in error_of(
        f"export {result} --out {tmp_path / 'motion.script'}"
    )


def test_schemas_of_tasks_and_of_trajectories(run, error_of):
    schema = run("schema --of trajectory").data
    assert schema == json.loads(json.dumps(brachis.export.samples_schema()))
    assert "Did you mean 'task'?" in error_of("schema --of tasks")
