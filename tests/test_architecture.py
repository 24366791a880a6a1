"""The rules of the structure: what may import what, that importing brachis stays quick, and who names kinds of limits.

Each test collects all that breaks its rule.
"""

import ast
from functools import cache
from pathlib import Path

import pytest

import brachis
import brachis.limits
import brachis.verify.limits
from support.scripts import output_of

SOURCE = Path(__file__).parents[1] / "src/brachis"

# Data flows from left to right; a stage may import those before it, be it for types or by a string.
ORDER = (
    "errors",
    "common",
    "kernel",
    "task",
    "robot",
    "scene",
    "robots",
    "examples",
    "path",
    "trajectory",
    "verify",
    "ik",
    "kinematics",
    "limits",
    "timing",
    "problem",
    "optimise",
    "explain",
    "search",
    "apps.bottleneck",
    "apps.plots",
    "apps.controller",
    "apps.export",
    "apps.report",
    "apps.view",
    "result",
    "planner",
    "apps.controller_plan",
    "apps.place",
    "apps.recording",
    "apps.comparison",
    "apps.sweeps",
    "apps.starter",
    "apps.compose",
    "apps.cli",
)
VERIFY_MUST_NOT_REACH = {
    "ik",
    "kinematics",
    "limits",
    "timing",
    "problem",
    "optimise",
    "explain",
    "search",
}
MAY_NAME_KINDS = ("limits", "verify/limits", "task", "robot")
HEAVY = {
    "matplotlib",
    "viser",
    "yourdfpy",
    "unopy",
    "ipyopt",
    "pyarrow",
    "pandas",
    "mujoco",
}
MOST_LINES = 500


def module_of(path):
    parts = ("brachis", *path.relative_to(SOURCE).with_suffix("").parts)
    return ".".join(parts[:-1] if parts[-1] == "__init__" else parts)


FILES = {module_of(path): path for path in sorted(SOURCE.rglob("*.py"))}
STAGED = {
    module: path
    for module, path in FILES.items()
    if module not in {"brachis", "brachis.__main__", "brachis.apps"}
}


def stage_of(module):
    parts = module.split(".")
    return ".".join(parts[1:3]) if parts[1] == "apps" else parts[1]


@cache
def tree_of(module):
    return ast.parse(FILES[module].read_text())


def only_for_types(tree):
    """Nodes under ``if TYPE_CHECKING``."""
    tests = [
        node
        for node in ast.walk(tree)
        if isinstance(node, ast.If) and ast.unparse(node.test) == "TYPE_CHECKING"
    ]
    return {inner for node in tests for inner in ast.walk(node)}


@cache
def imports_of(module, *, top_level=False, types=False):
    """Dotted names of the modules that a module imports; of a package's names the package."""
    tree, names = tree_of(module), set()
    skipped = set() if types else only_for_types(tree)
    for node in tree.body if top_level else ast.walk(tree):
        if node in skipped:
            continue
        if isinstance(node, ast.Import):
            names |= {alias.name for alias in node.names}
        elif isinstance(node, ast.ImportFrom):
            assert node.level == 0
            assert node.module
            whole = {f"{node.module}.{alias.name}" for alias in node.names}
            names |= {name if name in FILES else node.module for name in whole}
    return frozenset(names)


def function_name(call):
    """Name of the function that is called, without the module that it comes from."""
    named = call.func
    if isinstance(named, ast.Attribute):
        return named.attr
    return named.id if isinstance(named, ast.Name) else ""


def modules_by_string(module):
    """Modules that a module imports by a string."""
    calls = [node for node in ast.walk(tree_of(module)) if isinstance(node, ast.Call)]
    importing = [call for call in calls if function_name(call) == "import_module"]
    inside = [node for call in importing for node in ast.walk(call)]
    words = {node.value for node in inside if isinstance(node, ast.Constant)}
    return frozenset(words & set(FILES))


@cache
def stages_of_imports(module, *, types=False):
    """Stages of what a module imports; with types, what it imports for types alone or by a string too."""
    names = imports_of(module, types=types) | (
        modules_by_string(module) if types else frozenset()
    )
    return frozenset(
        stage_of(name)
        for name in names
        if name.startswith("brachis.") and name in STAGED
    )


def test_every_module_belongs_to_a_stage():
    assert len(STAGED) > 50
    assert {stage_of(module) for module in STAGED} == set(ORDER)


def test_no_stage_imports_one_to_its_right():
    assert [
        f"{module} imports {stage}"
        for module in STAGED
        for stage in ORDER[ORDER.index(stage_of(module)) + 1 :]
        if stage in stages_of_imports(module, types=True)
    ] == []


def test_verification_shares_no_code_with_the_optimiser():
    """Not even through the modules that it imports."""
    reached, waiting = set(), {"verify"}
    while waiting:
        reached |= waiting
        importing = [module for module in STAGED if stage_of(module) in waiting]
        waiting = set().union(*map(stages_of_imports, importing)) - reached
    assert {"robot", "path", "trajectory"} <= reached
    assert not reached & VERIFY_MUST_NOT_REACH


def in_circles(graph):
    """Nodes that lie on a circle, or between two."""
    left = dict(graph)
    while left:
        ends = {node for node, others in left.items() if not others & set(left)}
        starts = set(left) - set().union(*left.values())
        if not ends | starts:
            break
        left = {
            node: others for node, others in left.items() if node not in ends | starts
        }
    return sorted(left)


def test_in_circles_finds_circles():
    assert in_circles({"a": {"b"}, "b": {"c"}, "c": set()}) == []
    assert in_circles({"a": {"b"}, "b": {"c"}, "c": {"b", "d"}, "d": set()}) == [
        "b",
        "c",
    ]


def test_no_package_has_an_import_circle_between_its_files():
    """Not for the sake of types either."""
    found = []
    for stage in ORDER:
        own = {module for module in STAGED if stage_of(module) == stage}
        found += in_circles(
            {module: imports_of(module, types=True) & own - {module} for module in own}
        )
    assert found == []


def test_every_kind_of_limit_is_checked_by_the_verification():
    checked = {kind.replace(" ", "_") for kind in brachis.verify.limits.LIMIT_CHECKS}
    assert len(brachis.limits.LIMIT_BUILDERS) >= 5
    assert set(brachis.limits.LIMIT_BUILDERS) <= checked


def compared_words(tree):
    """Lines and constants that are compared with something, or are among what something is looked for in."""
    for node in ast.walk(tree):
        if isinstance(node, ast.Compare):
            for side in (node.left, *node.comparators):
                listed = (
                    side.elts
                    if isinstance(side, ast.Tuple | ast.List | ast.Set)
                    else [side]
                )
                yield from (
                    (node.lineno, each.value)
                    for each in listed
                    if isinstance(each, ast.Constant)
                )
        elif isinstance(node, ast.MatchValue) and isinstance(node.value, ast.Constant):
            yield node.value.lineno, node.value.value


def test_nobody_asks_for_a_kind_of_limit():
    kinds = set(brachis.limits.LIMIT_BUILDERS)
    kinds |= {kind.replace("_", " ") for kind in kinds}
    example = ast.parse("limit.kind in ('jerk', 'torque')")
    assert (1, "torque") in compared_words(example)
    allowed = tuple(f"{folder}/" for folder in MAY_NAME_KINDS)
    names = {
        module: path.relative_to(SOURCE).as_posix() for module, path in FILES.items()
    }
    assert [
        f"{name}:{line}: {word!r}"
        for module, name in names.items()
        if not name.startswith(allowed)
        for line, word in compared_words(tree_of(module))
        if word in kinds
    ] == []


def test_no_module_imports_a_heavy_library_at_its_top():
    assert [
        f"{module} imports {name}"
        for module in FILES
        for name in imports_of(module, top_level=True)
        if name.split(".")[0] in HEAVY
    ] == []


def test_importing_loads_no_heavy_library():
    code = f"from brachis import plan, Robot, Trajectory, Task\nimport sys\nprint(sorted({HEAVY!r} & set(sys.modules)))"
    assert output_of("-c", code).strip() == "[]"


@pytest.mark.parametrize("example", ["scara_line", "tx90l_rail_line"])
def test_an_ordinary_plan_loads_no_scipy(example):
    """Its import takes longer than the plan."""
    code = (
        "import sys, brachis\n"
        f"brachis.plan(brachis.examples.{example}, effort='single', intervals=8, strict=False)\n"
        "print('scipy' in sys.modules, 'pinocchio' in sys.modules)"
    )
    assert output_of("-W", "ignore", "-c", code).split() == ["False", "True"]


def test_public_names_exist():
    for name in brachis.__all__:
        assert getattr(brachis, name) is not None
    assert callable(brachis.plan)
    assert callable(brachis.verify_trajectory)
    with pytest.raises(AttributeError, match="no attribute 'nothing'"):
        _ = brachis.nothing


def test_modules_stay_small():
    lines = {
        module: len(path.read_text().splitlines()) for module, path in FILES.items()
    }
    assert {
        module: count for module, count in lines.items() if count > MOST_LINES
    } == {}
