import os
import stat
from pathlib import Path

import numpy as np
import pytest

from brachis.common.files import atomic_write
from brachis.errors import InputError
from brachis.trajectory import Trajectory


def half_write(path, error):
    with atomic_write(path) as stream:
        stream.write(b"half")
        raise error


def test_writes_and_leaves_nothing_else(tmp_path):
    path = tmp_path / "new"
    with atomic_write(path) as stream:
        stream.write(b"content")
    assert path.read_bytes() == b"content"
    assert list(tmp_path.iterdir()) == [path]


def test_the_old_file_stays_until_the_block_has_ended(tmp_path):
    path = tmp_path / "file"
    path.write_bytes(b"old")
    with atomic_write(path) as stream:
        stream.write(b"new")
        stream.flush()
        assert path.read_bytes() == b"old"
    assert path.read_bytes() == b"new"


def test_whoever_reads_the_old_file_keeps_it(tmp_path):
    path = tmp_path / "file"
    path.write_bytes(b"old")
    with path.open("rb") as reader:
        with atomic_write(path) as stream:
            stream.write(b"new")
        assert reader.read() == b"old"


@pytest.mark.parametrize(
    "error",
    [ValueError("bug"), KeyboardInterrupt(), FileNotFoundError("of another file")],
)
def test_an_error_in_the_block_keeps_the_old_file_and_is_passed_on(tmp_path, error):
    path = tmp_path / "file"
    path.write_bytes(b"old")
    with pytest.raises(type(error)):
        half_write(path, error)
    assert path.read_bytes() == b"old"
    assert list(tmp_path.iterdir()) == [path]


def test_permissions_are_those_of_any_new_file(tmp_path):
    (tmp_path / "plain").write_bytes(b"")
    with atomic_write(tmp_path / "atomic") as stream:
        stream.write(b"content")
    assert stat.S_IMODE((tmp_path / "atomic").stat().st_mode) == stat.S_IMODE(
        (tmp_path / "plain").stat().st_mode
    )


def test_a_symbolic_link_is_followed(tmp_path):
    (tmp_path / "target").write_bytes(b"old")
    link = tmp_path / "link"
    link.symlink_to("target")
    with atomic_write(link) as stream:
        stream.write(b"new")
    assert link.is_symlink()
    assert (tmp_path / "target").read_bytes() == b"new"


def test_a_pipe_is_written_to_and_not_replaced(tmp_path):
    pipe = tmp_path / "pipe"
    os.mkfifo(pipe)
    reader = os.open(pipe, os.O_RDONLY | os.O_NONBLOCK)
    try:
        with atomic_write(pipe) as stream:
            stream.write(b"content")
        assert os.read(reader, 100) == b"content"
    finally:
        os.close(reader)
    assert stat.S_ISFIFO(pipe.stat().st_mode)


@pytest.mark.parametrize("name", ["nowhere/file", "."])
def test_what_cannot_be_written_is_named(tmp_path, name):
    path = tmp_path / name
    with (
        pytest.raises(InputError, match="cannot be written") as caught,
        atomic_write(path),
    ):
        pytest.fail("the block must not run")
    assert caught.value.where == str(path)
    assert caught.value.found


@pytest.mark.skipif(not Path("/dev/full").exists(), reason="only Linux has /dev/full")
def test_a_full_disk_is_named():
    with (
        pytest.raises(
            InputError,
            match="/dev/full: the file cannot be written; found No space left",
        ),
        atomic_write("/dev/full") as stream,
    ):
        stream.write(b"content")


def test_a_trajectory_is_saved_through_it(line_trajectory, tmp_path):
    path = tmp_path / "result.npz"
    line_trajectory.save(path)
    assert list(tmp_path.iterdir()) == [path]
    assert np.array_equal(Trajectory.load(path).q, line_trajectory.q)
    with pytest.raises(InputError, match=r"nowhere.*cannot be written"):
        line_trajectory.save(tmp_path / "nowhere" / "result.npz")
