import csv

import numpy as np
import pytest

from brachis import export
from brachis.errors import InputError
from support.scripts import output_of

DT = 0.004


@pytest.fixture(scope="module")
def table(line_trajectory, tmp_path_factory):
    path = tmp_path_factory.mktemp("csv") / "motion.csv"
    export.write(line_trajectory, path, dt=DT)
    return path


def numbers(path):
    return np.loadtxt(path, delimiter=",", skiprows=1)


def test_every_column_read_back_equals_the_trajectory_exactly(table, line_trajectory):
    content = table.read_bytes()
    assert b"\r" not in content
    assert content.endswith(b"\n")
    header, *_ = content.decode().splitlines()
    kinds = ("q", "qd", "qdd", "tau")
    names = [f"{kind}_{joint}" for kind in kinds for joint in ("j1", "j2", "j3")]
    assert header == ",".join(["t", *names])
    values = numbers(table)
    at = line_trajectory.at(values[:, 0])
    assert np.array_equal(values[:, 1:], np.hstack([at.q, at.qdot, at.qddot, at.tau]))


def test_rows_are_at_multiples_of_the_period_and_at_the_end_time_exactly(
    table, line_trajectory
):
    t = numbers(table)[:, 0]
    assert np.array_equal(t[:-1], np.arange(len(t) - 1) * DT)
    assert t[-1] == line_trajectory.t_end
    assert 0.0 < t[-1] - t[-2] <= DT * (1.0 + 1e-9)


def test_joint_names_with_commas_stay_one_column(
    line_trajectory, tmp_path, monkeypatch
):
    monkeypatch.setattr(type(line_trajectory), "joint_names", ("a,b", 'c"d', "e"))
    export.write(line_trajectory, tmp_path / "motion.csv", dt=0.5)
    with (tmp_path / "motion.csv").open(newline="", encoding="utf-8") as stream:
        rows = list(csv.reader(stream))
    assert rows[0][1:4] == ["q_a,b", 'q_c"d', "q_e"]
    assert {len(row) for row in rows} == {13}


@pytest.mark.parametrize("dt", [0.0, -0.1, float("nan"), 1e-9])
def test_an_unusable_period_leaves_the_old_file(line_trajectory, tmp_path, dt):
    path = tmp_path / "motion.csv"
    path.write_text("t,q_old")
    with pytest.raises(InputError, match="period"):
        export.write(line_trajectory, path, dt=dt)
    assert path.read_text() == "t,q_old"


TOO_LARGE = """
import resource, sys
from brachis import InputError, Trajectory
from brachis import export
trajectory = Trajectory.load(sys.argv[1])
resource.setrlimit(resource.RLIMIT_FSIZE, (20000, resource.RLIM_INFINITY))
try:
    export.write(trajectory, sys.argv[2], dt=0.004)
except InputError as error:
    print(error)
"""


def test_a_file_that_cannot_be_written_whole_leaves_the_old_one_and_nothing_else(
    line_trajectory, tmp_path
):
    path, saved = tmp_path / "motion.csv", tmp_path / "result.npz"
    path.write_text("t,q_old")
    line_trajectory.save(saved)
    printed = output_of("-c", TOO_LARGE, saved, path)
    assert printed == f"{path}: the file cannot be written; found File too large\n"
    assert path.read_text() == "t,q_old"
    assert sorted(tmp_path.iterdir()) == [path, saved]
