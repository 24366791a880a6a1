"""Ctrl-C from the first import to the last file: exit code 130, no traceback, nothing half written.

The press comes at an event, not at a time: where a module begins to be imported, or where the planner says something.
There it is swallowed, too, as compiled libraries and finalisers do.
"""

import subprocess
import sys

import pytest

SCRIPT = """
import os, signal, sys
where, how = sys.argv.pop(1), sys.argv.pop(1)
signal.signal(signal.SIGINT, signal.default_int_handler)

def press():
    try:
        os.kill(os.getpid(), signal.SIGINT)
        if how == "twice":
            os.kill(os.getpid(), signal.SIGINT)
            print("the second press was not heard at once")
    except KeyboardInterrupt:
        if how != "swallowed":
            raise

class Finder:
    def find_spec(self, name, path=None, target=None):
        if name == where:
            sys.meta_path.remove(self)
            press()

sys.meta_path.insert(0, Finder())
from brachis.__main__ import main
main()
"""


def brachis(where, how, *arguments):
    command = [sys.executable, "-c", SCRIPT, where, how, *map(str, arguments)]
    return subprocess.run(command, capture_output=True, text=True, check=False)


@pytest.mark.parametrize(
    "where, how",
    [
        ("brachis.apps.cli.main", "swallowed"),
        ("rich.console", "raised"),
        ("numpy", "swallowed"),
        ("pinocchio", "raised"),
        ("lxml", "swallowed"),
        ("unopy", "swallowed"),
    ],
)
def test_a_press_before_the_plan(where, how, write, task, tmp_path):
    done = brachis(where, how, "plan", write(task), "--out", tmp_path / "out")
    assert (done.returncode, done.stdout) == (130, ""), done.stderr
    assert done.stderr == "brachis: interrupted\n"
    assert not (tmp_path / "out").exists() or not list((tmp_path / "out").iterdir())


def test_a_press_while_files_are_written(write, task, tmp_path):
    done = brachis(
        "matplotlib", "swallowed", "plan", write(task), "--out", tmp_path / "out"
    )
    assert done.returncode == 130, done.stderr
    assert done.stderr.endswith("\nbrachis: interrupted\n")


def test_a_press_is_told_in_json(write, task):
    done = brachis("numpy", "raised", "plan", write(task), "--json")
    assert done.returncode == 130
    assert '"exit_code": 130' in done.stdout


def test_a_second_press_ends_at_once(write, task):
    done = brachis("numpy", "twice", "plan", write(task))
    assert (done.returncode, done.stdout, done.stderr) == (
        130,
        "",
        "brachis: interrupted\n",
    )
