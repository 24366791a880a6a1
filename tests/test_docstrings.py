"""Every public name has an example in its docstring, and the examples run."""

import doctest
import inspect
from pathlib import Path

import pytest

import brachis
from brachis.robot import Robot
from brachis.task import task_with

ROOT = Path(__file__).parents[1]
NAMES = [name for name in brachis.__all__ if name != "__version__"]
FURTHER = {
    "with_limits": Robot.with_limits,
    "with_payload": Robot.with_payload,
    "task_with": task_with,
}


def examples_of(subject):
    (found,) = doctest.DocTestFinder(recurse=False).find(
        subject, getattr(subject, "__name__", ""), globs={}
    )
    return found


@pytest.mark.parametrize("name", [*NAMES, *FURTHER])
def test_examples_run(name, monkeypatch, capsys):
    monkeypatch.chdir(ROOT)
    example = examples_of(FURTHER.get(name) or getattr(brachis, name))
    assert example.examples, "a name without an example"
    assert not any(doctest.SKIP in each.options for each in example.examples)
    outcome = doctest.DocTestRunner(optionflags=doctest.NORMALIZE_WHITESPACE).run(
        example
    )
    assert outcome.failed == 0, capsys.readouterr().out


def test_help_tells_what_there_is_for_what():
    """The first screen of ``help(brachis)`` names all that is public."""
    page = inspect.getdoc(brachis)
    assert len(page.splitlines()) <= 24
    assert [name for name in NAMES if name not in page] == []


def test_names_are_found_by_completion():
    assert set(dir(brachis)) == set(brachis.__all__)
    assert {"plots", "export", "ik", "errors", "robots", "examples"} <= set(
        dir(brachis)
    )
    assert "scara3" in dir(brachis.robots)
    assert "scara_line" in dir(brachis.examples)


@pytest.mark.parametrize("name", sorted(brachis._MODULES))
def test_public_modules_show_public_names_only(name):
    module = getattr(brachis, name)
    names = dir(module)
    assert names
    for shown in names:
        assert not shown.startswith("_")
        home = getattr(getattr(module, shown), "__module__", "brachis")
        assert home.startswith(("brachis", "pathlib")), f"{shown} is of {home}"
