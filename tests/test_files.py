"""Reading files of bounded size, and temporary files that killed processes leave."""

import io
import os
import re
import signal
import socket
import subprocess
import sys
from pathlib import Path

import pytest

from brachis.apps.cli.folder import write_files, write_text
from brachis.common import files
from brachis.common.files import atomic_write, is_file, is_folder, read_file
from brachis.common.progress import ignore
from brachis.errors import InputError, ResultFileError
from brachis.trajectory import Trajectory

LARGE = 1_000_000_000_000


def test_a_file_is_read(tmp_path):
    (tmp_path / "file").write_bytes(b"a\r\nb")
    assert read_file(tmp_path / "file") == b"a\r\nb"


def test_a_file_of_the_kernel_that_has_nothing_to_say_yet_is_empty(
    tmp_path, monkeypatch
):
    """Such as /proc/kmsg: read without waiting it gives None, and not bytes."""

    class Silent(io.BytesIO):
        def read(self, *_):
            return None

    (tmp_path / "kmsg").touch()
    monkeypatch.setattr(files.os, "fdopen", lambda *_, **__: Silent())
    assert read_file(tmp_path / "kmsg") == b""
    with pytest.raises(ResultFileError, match="the file is not a brachis result"):
        Trajectory.load(tmp_path / "kmsg")


@pytest.fixture(params=["pipe", "folder", "socket", "zeros", "long", "name"])
def endless(request, tmp_path):
    """What must not be read, and what is said of it."""
    path = tmp_path / request.param
    match request.param:
        case "pipe":
            os.mkfifo(path)
            return path, "it is a pipe, not a file"
        case "folder":
            path.mkdir()
            return path, "it is a folder, not a file"
        case "socket":
            with socket.socket(socket.AF_UNIX) as server:
                server.bind(str(path)[:100])
            return path, "."  # some systems do not even open it
        case "zeros":
            return Path("/dev/zero"), "it is a device, not a file"
        case "name":
            return tmp_path / "a\0b", "not the name of a file"
    with path.open("wb") as stream:
        stream.truncate(LARGE)  # takes no room
    return path, r"it is longer than 16 MB"


@pytest.mark.parametrize(
    "name", ["circle", "circle/file", "file/file", "a" * 5000, "a\0b"]
)
def test_what_the_system_refuses_is_not_written(name, tmp_path):
    (tmp_path / "circle").symlink_to("circle")
    (tmp_path / "file").write_text("old")
    with (
        pytest.raises(InputError, match="cannot be written"),
        atomic_write(tmp_path / name),
    ):
        pytest.fail("nothing can be written there")
    assert (tmp_path / "circle").is_symlink()
    assert not is_file(tmp_path / name)
    assert not is_folder(tmp_path / name)


def test_what_would_not_end_is_an_error(endless):
    path, words = endless
    with pytest.raises(OSError) as caught:  # noqa: PT011  (its text is what is looked at)
        read_file(path)
    assert re.search(words, caught.value.strerror)


@pytest.mark.skipif(
    not Path("/proc/self/status").exists(), reason="only Linux has /proc"
)
def test_a_file_without_a_size_is_read_so_far_and_no_farther():
    assert read_file("/proc/self/status").startswith(b"Name")
    with pytest.raises(OSError, match="longer than"):
        read_file("/proc/self/status", largest=10)


def test_nothing_stays_open_after_a_refusal(tmp_path):
    before = os.dup(0)
    os.close(before)
    for _ in range(3):
        with pytest.raises(OSError, match="folder"):
            read_file(tmp_path, 100)
    after = os.dup(0)
    os.close(after)
    assert after == before


def dead_process():
    done = subprocess.Popen([sys.executable, "-c", ""])
    done.wait()
    return done.pid


def test_what_killed_processes_left_is_removed_and_nothing_else(tmp_path):
    host = files.temporary_in(tmp_path).name.split("-")[1]
    dead = dead_process()
    tail = "0123456789abcdef"
    ours = [
        f".brachis-{host}-{dead}-{tail}.part",
        f".brachis-{host}-{dead}-{tail[::-1]}.part",
    ]
    others = [
        f".brachis-{host}-{os.getpid()}-{tail}.part",  # of a process that runs
        f".brachis-00000000-{dead}-{tail}.part",  # of another host
        f".brachis-{host}-{dead}-{tail}.part.bak",
        f".{tail}.part",
        "download.part",
    ]
    (tmp_path / ours[0]).mkdir()
    for name in (f"{ours[0]}/result.npz", ours[1], *others):
        (tmp_path / name).write_bytes(b"half")
    with atomic_write(tmp_path / "file") as stream:
        stream.write(b"whole")
    assert {path.name for path in tmp_path.iterdir()} == {"file", *others}


WRITING = """
import sys, time
from pathlib import Path
from brachis.apps.cli.folder import write_files, write_text

def slow(path):
    write_text("half", path)
    print("writing", flush=True)
    time.sleep(600)

write_files(Path(sys.argv[1]), {"result.json": slow}, {}, listener=print)
"""


@pytest.mark.parametrize("number", [signal.SIGTERM, signal.SIGKILL])
def test_a_process_that_is_ended_while_it_writes(number, tmp_path):
    (tmp_path / "result.json").write_text("old")
    with subprocess.Popen(
        [sys.executable, "-c", WRITING, tmp_path], stdout=subprocess.PIPE, text=True
    ) as process:
        assert process.stdout.readline() == "writing\n"
        assert len(list(tmp_path.iterdir())) == 2
        process.send_signal(number)
    assert (
        process.returncode
        == {signal.SIGTERM: 128 + signal.SIGTERM, signal.SIGKILL: -signal.SIGKILL}[
            number
        ]
    )
    assert (tmp_path / "result.json").read_text() == "old"
    if number == signal.SIGKILL:  # nobody can clean up after that but the next one
        assert len(list(tmp_path.iterdir())) == 2
        results = {"result.json": lambda path: write_text("new", path)}
        write_files(tmp_path, results, {}, listener=ignore)
        assert (tmp_path / "result.json").read_text() == "new"
    assert [path.name for path in tmp_path.iterdir()] == ["result.json"]


FULL = """
import resource, sys
from pathlib import Path
from brachis.apps.cli.folder import write_files, write_text

def writer(size):
    return lambda path: write_text(size * "x", path)

out = Path(sys.argv[1])
resource.setrlimit(resource.RLIMIT_FSIZE, (1000, 1000))
figures = {"overview.png": writer(5000), "candidates.png": writer(50)}
written = write_files(out, {"result.json": writer(500)}, figures, listener=lambda text: None)
print(*written[0], *written[1], sep="\\n")
"""


def test_figures_that_are_too_large_for_the_disk_leave_the_result(tmp_path):
    for name in ("result.json", "overview.png", "candidates.png"):
        (tmp_path / name).write_text("old")
    done = subprocess.run(
        [sys.executable, "-c", FULL, tmp_path],
        capture_output=True,
        text=True,
        check=True,
    )
    result, small, large = (
        tmp_path / name for name in ("result.json", "candidates.png", "overview.png")
    )
    assert done.stdout.splitlines() == [
        str(result),
        str(small),
        f"{large}: the file cannot be written; found File too large",
    ]
    assert (result.read_text(), small.read_text()) == (500 * "x", 50 * "x")
    assert {path.name for path in tmp_path.iterdir()} == {
        "result.json",
        "candidates.png",
    }


def test_results_that_are_too_large_for_the_disk_leave_the_folder_as_it_was(tmp_path):
    for name in ("result.json", "overview.png"):
        (tmp_path / name).write_text("old")

    def full(path):
        raise InputError(
            "the file cannot be written",
            where=str(path),
            found="No space left on device",
        )

    with pytest.raises(
        InputError,
        match=r"result.json: the file cannot be written; found No space left",
    ):
        write_files(
            tmp_path,
            {"result.json": full},
            {"overview.png": lambda path: write_text("new", path)},
            listener=ignore,
        )
    assert {path.name: path.read_text() for path in tmp_path.iterdir()} == {
        "result.json": "old",
        "overview.png": "old",
    }


def test_ctrl_c_while_a_figure_is_drawn_says_what_is_written(tmp_path):
    def interrupt(_path):
        raise KeyboardInterrupt

    results = {"result.json": lambda path: write_text("{}", path)}
    steps = []
    with pytest.raises(KeyboardInterrupt, match=r"written before: .*result\.json"):
        write_files(
            tmp_path, results, {"overview.png": interrupt}, listener=steps.append
        )
    assert steps == ["drawing overview.png"]
    assert (tmp_path / "result.json").read_text() == "{}"
