import dataclasses
import os
import shutil
import stat
from pathlib import Path

import numpy as np
import pytest

import brachis
from brachis import export
from brachis.apps.compose import Rail, on_rail
from brachis.apps.plots.style import figure_class, save_figure
from brachis.apps.report.page import Report
from brachis.common.files import atomic_write
from brachis.errors import InputError


def half_write(path, error):
    with atomic_write(path) as stream:
        stream.write(b"half")
        raise error


def test_the_old_file_stays_until_the_end_of_the_block(tmp_path):
    path = tmp_path / "file"
    path.write_bytes(b"old")
    with atomic_write(path) as stream:
        stream.write(b"new")
        stream.flush()
        assert path.read_bytes() == b"old"
    assert path.read_bytes() == b"new"


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
    modes = {(tmp_path / name).stat().st_mode for name in ("plain", "atomic")}
    assert len(modes) == 1


def test_a_symbolic_link_stays_a_link(tmp_path):
    (tmp_path / "target").write_bytes(b"old")
    link = tmp_path / "link"
    link.symlink_to("target")
    with atomic_write(link) as stream:
        stream.write(b"new")
    assert link.is_symlink()
    assert (tmp_path / "target").read_bytes() == b"new"


def test_a_pipe_stays_a_pipe(tmp_path):
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
def test_the_error_names_what_cannot_be_written_to(tmp_path, name):
    path = tmp_path / name
    with (
        pytest.raises(InputError, match="cannot be written") as caught,
        atomic_write(path),
    ):
        pytest.fail("the block must not run")
    assert caught.value.where == str(path)
    assert caught.value.found


@pytest.mark.skipif(not Path("/dev/full").exists(), reason="only Linux has /dev/full")
def test_the_error_names_a_full_disk():
    with (
        pytest.raises(
            InputError,
            match="/dev/full: the file cannot be written; found No space left",
        ),
        atomic_write("/dev/full") as stream,
    ):
        stream.write(b"content")


def foreign_files(folder):
    """Files of other programs, by name."""
    np.savez(folder / "result.npz", a=np.zeros(3))
    (folder / "motion.csv").write_text("x,y\n0,0\n")
    (folder / "report.html").write_text("<!doctype html>\n<p>mine</p>")
    (folder / "figure.png").write_text("no figure")
    shutil.copy(brachis.robots.path_of("scara3"), folder / "cell.urdf")
    return {path.name: path.read_bytes() for path in folder.iterdir()}


RAIL = Rail(axis=(0, 1, 0), range=(-1, 1), velocity=1, force=100, mass=5)


def write_kind(name, motion, folder):
    """Write a file of the kind that the suffix of its name says."""
    path = folder / name
    match path.suffix:
        case ".npz":
            motion.save(path)
        case ".html":
            page = "<!doctype html>\n<!-- brachis report -->\n"
            Report(page, verified=True).save(path)
        case ".png":
            save_figure(figure_class()(), path)
        case ".urdf":
            on_rail(brachis.robots.path_of("iiwa14"), RAIL, output=path)
        case _:
            export.write(motion, path, dt=0.1)


@pytest.mark.parametrize(
    "name", ["result.npz", "motion.csv", "report.html", "figure.png", "cell.urdf"]
)
def test_writers_replace_what_they_wrote_and_nothing_of_others(
    name, line_trajectory, tmp_path
):
    before = foreign_files(tmp_path)
    with pytest.raises(InputError, match="exists and is of a different kind"):
        write_kind(name, line_trajectory, tmp_path)
    assert (tmp_path / name).read_bytes() == before[name]
    (tmp_path / name).write_bytes(b"")
    write_kind(name, line_trajectory, tmp_path)
    written = (tmp_path / name).read_bytes()
    (tmp_path / name).write_bytes(written + b"older")
    write_kind(name, line_trajectory, tmp_path)
    assert not (tmp_path / name).read_bytes().endswith(b"older")


def test_a_composed_robot_has_one_mark_however_many_rails(tmp_path):
    arm = brachis.robots.path_of("iiwa14")
    on_rail(arm, RAIL, output=tmp_path / "one.urdf")
    second = dataclasses.replace(RAIL, name="x", root="w")
    text = on_rail(tmp_path / "one.urdf", second)
    assert text.count("<!-- brachis compose -->") == 1
