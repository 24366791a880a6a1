"""Every public name has an example in its docstring, the examples run, and documented parameters exist."""

import ast
import dataclasses
import doctest
import importlib
import inspect
import re
from pathlib import Path

import pytest

import brachis
from brachis.robot import Robot
from brachis.task import task_with

ROOT = Path(__file__).parents[1]
SOURCE = Path(brachis.__file__).parent
COMMANDS = "apps/cli/"
"""A command documents its arguments and options in their help."""
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


def documented_parameters(docstring):
    """Names in the section `Parameters` of a docstring; None without one."""
    _, *sections = re.split(r"^(\w+)\n-{3,}$", docstring, flags=re.MULTILINE)
    texts = dict(zip(sections[::2], sections[1::2], strict=True))
    if "Parameters" not in texts:
        return None
    rows = re.findall(r"^(\S.*?)(?: :.*)?$", texts["Parameters"], re.MULTILINE)
    return [name.strip() for row in rows for name in row.split(",")]


def parameters_of(function):
    """Names of a function's parameters, as numpydoc writes them, without those that are not used."""
    given = function.args
    names = [each.arg for each in (*given.posonlyargs, *given.args, *given.kwonlyargs)]
    names += [f"*{each.arg}" for each in [given.vararg] if each]
    names += [f"**{each.arg}" for each in [given.kwarg] if each]
    return [name for name in names if name not in {"self", "cls"} and name[0] != "_"]


def parameters_of_class(node, file):
    """Parameters of a class's own `__init__`, or the fields of a dataclass."""
    for function in node.body:
        if getattr(function, "name", "") == "__init__":
            return parameters_of(function)
    module = file.relative_to(SOURCE.parent).with_suffix("").parts
    made = getattr(importlib.import_module(".".join(module)), node.name)
    return [entry.name for entry in dataclasses.fields(made) if entry.init]


def wrong_parameters(file, tree):
    """Places, with the documented names that are no parameters, and the parameters that are not documented."""
    for node in ast.walk(tree):
        if not isinstance(node, ast.FunctionDef | ast.ClassDef):
            continue
        documented = documented_parameters(ast.get_docstring(node) or "")
        if documented is None:
            continue
        is_class = isinstance(node, ast.ClassDef)
        real = parameters_of_class(node, file) if is_class else parameters_of(node)
        keywords = [name for name in real if name.startswith("**")]
        if keywords:  # what follows them are keys that they take
            documented = documented[: documented.index(keywords[0]) + 1]
        name = file.relative_to(SOURCE).as_posix()
        place = f"{name}:{node.lineno} {node.name}"
        for parameter in documented:
            if parameter not in real:
                yield f"{place} has no parameter {parameter!r}"
        for parameter in real:
            if parameter not in documented and not name.startswith(COMMANDS):
                yield f"{place} does not document {parameter!r}"


def test_documented_parameters_are_those_of_the_function():
    found = []
    for file in sorted(SOURCE.rglob("*.py")):
        found += wrong_parameters(file, ast.parse(file.read_text()))
    assert found == []


STALE = """
def f(a, *, b, **c):
    '''Do.

    Parameters
    ----------
    a, d : int
    **c
    e : int
    '''
"""


def test_a_stale_name_is_found():
    assert list(wrong_parameters(SOURCE / "f.py", ast.parse(STALE))) == [
        "f.py:2 f has no parameter 'd'",
        "f.py:2 f does not document 'b'",
    ]
