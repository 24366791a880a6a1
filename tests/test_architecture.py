"""The rule that no stage imports one to its right, and that importing brachis stays quick."""

from __future__ import annotations

import ast
import subprocess
import sys
from pathlib import Path

import pytest

SOURCE = Path(__file__).parents[1] / "src/brachis"

# Data flows from left to right; a stage may import those before it.
ORDER = (
    "errors",
    "files",
    "arrays",
    "deadline",
    "interrupts",
    "task",
    "robot",
    "custom_limits",
    "compose",
    "plausibility",
    "path",
    "ik",
    "kinematics",
    "limits",
    "bspline",
    "nlp",
    "solvers",
    "refine",
    "mesh",
    "feasibility",
    "trajectory",
    "verify",
    "setting",
    "attempt",
    "extract",
    "search",
    "result",
    "planner",
    "bottleneck",
    "plots",
    "export",
    "cli",
)
VERIFY_MUST_NOT_REACH = {"ik", "kinematics", "limits", "bspline", "nlp", "solvers", "refine", "mesh"}
HEAVY = {"matplotlib", "viser", "yourdfpy", "unopy", "ipyopt"}


def stage_of(path: Path) -> str:
    relative = path.relative_to(SOURCE)
    return relative.parts[0] if len(relative.parts) > 1 else relative.stem


def imports_of(path: Path, *, top_level_only: bool = False) -> set[str]:
    """Dotted names of the modules that a file imports."""
    tree = ast.parse(path.read_text())
    typing_only = {
        id(inner)
        for node in ast.walk(tree)
        if isinstance(node, ast.If) and getattr(node.test, "id", "") == "TYPE_CHECKING"
        for inner in ast.walk(node)
    }
    names: set[str] = set()
    for node in tree.body if top_level_only else ast.walk(tree):
        if id(node) in typing_only:
            continue
        if isinstance(node, ast.Import):
            names |= {alias.name for alias in node.names}
        elif isinstance(node, ast.ImportFrom):
            names |= {f"{node.module}.{alias.name}" for alias in node.names} | {str(node.module)}
    return names


def stages_imported(path: Path) -> set[str]:
    parts = (name.split(".") for name in imports_of(path))
    return {part[1] for part in parts if part[0] == "brachis" and len(part) > 1}


FILES = sorted(SOURCE.rglob("*.py"))
STAGED = [path for path in FILES if stage_of(path) not in {"__init__", "__main__"}]


def test_every_module_belongs_to_a_stage():
    assert len(STAGED) > 50
    assert {stage_of(path) for path in STAGED} == set(ORDER)


@pytest.mark.parametrize("path", STAGED, ids=lambda path: str(path.relative_to(SOURCE)))
def test_no_stage_imports_one_to_its_right(path):
    own = stage_of(path)
    later = set(ORDER[ORDER.index(own) + 1 :])
    assert not stages_imported(path) & later


def test_verification_shares_no_code_with_the_optimiser():
    """Not even through the modules that it imports."""
    reached, waiting = set(), {"verify"}
    while waiting:
        stage = waiting.pop()
        reached.add(stage)
        files = [path for path in STAGED if stage_of(path) == stage]
        waiting |= set().union(*(stages_imported(path) for path in files)) & set(ORDER) - reached
    assert {"robot", "path", "trajectory"} <= reached
    assert not reached & VERIFY_MUST_NOT_REACH


@pytest.mark.parametrize("path", FILES, ids=lambda path: str(path.relative_to(SOURCE)))
def test_heavy_libraries_are_imported_where_used(path):
    assert not {name.split(".")[0] for name in imports_of(path, top_level_only=True)} & HEAVY


@pytest.mark.parametrize(
    "statement", ["import brachis", "import brachis.planner", "from brachis import plan, Robot, Trajectory, Task"]
)
def test_importing_loads_no_heavy_library(statement):
    code = f"{statement}\nimport sys\nprint(sorted({HEAVY!r} & set(sys.modules)))"
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert done.stdout.strip() == "[]"


def test_public_names_exist():
    import brachis  # noqa: PLC0415

    for name in brachis.__all__:
        assert getattr(brachis, name) is not None
    assert callable(brachis.plan)
    assert callable(brachis.verify_trajectory)
    with pytest.raises(AttributeError, match="no attribute 'nothing'"):
        _ = brachis.nothing


@pytest.mark.parametrize("path", FILES, ids=lambda path: str(path.relative_to(SOURCE)))
def test_modules_stay_small(path):
    assert len(path.read_text().splitlines()) <= 400
